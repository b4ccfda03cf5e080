# SPDX-License-Identifier: Apache-2.0
"""Gait with balance of a robot in MuJoCo whose joints take torques."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.records import Array
from ros_pad.simulation import balance_step, compiled
from ros_pad.simulation.balance_step import GOAL, ROWS, Plan, State
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.scene import Scene


def plan(scene: Scene, period: float) -> Plan:
    """Return what stays during the walks of a scene."""
    body, gait = scene.legged
    homes = np.array(body.homes)
    return Plan(
        legs=len(homes),
        joints=body.robot.home.shape[1],
        period=period,
        cycle=gait.cycle,
        duty=gait.duty,
        lift=gait.lift,
        middles=np.array(gait.middles),
        homes=(homes - homes.mean(0)).ravel(),
        speeds=np.array([joint.speed for leg in body.robot.chains.legs for joint in leg]),
        height=-body.ground,
        mass=body.mass,
        pendulum=math.sqrt(GRAVITY / body.height),
    )


class Balance:
    """Torques of all joints, so that the robot walks its gait and does not fall.

    Parameters
    ----------
    scene : Scene
        Scene with a legged robot.
    period : float
        Time for which torques stay, s.
    model, data : mujoco.MjModel, mujoco.MjData
        The simulation; its state is the robot's own estimate.

    Attributes
    ----------
    targets : array (joints,)
        Joint positions in which it stands, rad.
    places : list of tuple
        Places of the feet then, fore, left and up in the body, m.
    swings : list of bool
        Whether each leg swings.
    """

    def __init__(self, scene: Scene, period: float, mujoco: Any, model: Any, data: Any) -> None:
        body, self._gait = scene.legged
        self._settle = scene.settle
        self.targets = body.robot.home.ravel()
        self.places = [(x, y, body.ground) for x, y in body.homes]
        self._plan = plan(scene, period)
        legs, count = self._plan.legs, self._plan.legs * self._plan.joints
        self._goal = np.zeros(GOAL)
        self._goal[balance_step.FRICTION] = balance_step.USUAL_GRIP
        self._goal[balance_step.CENTRE_X : balance_step.CENTRE_Y + 1] = np.mean(body.homes, 0)
        self._feet = np.zeros((ROWS, legs))
        self._feet[balance_step.STANDS] = 1.0
        self._feet[balance_step.GRIP] = balance_step.USUAL_GRIP
        self._inertia = np.zeros((model.nv, model.nv))
        self._mujoco, self._model, self._data = mujoco, model, data
        first = model.geom('foot_1').id
        # MuJoCo's joints are the free one of the base, then those of the legs.
        self._state = State(
            data.qpos[:3],
            data.qvel[: 6 + count],
            data.xmat[model.body('trunk').id],
            self._inertia[: 6 + count, : 6 + count],
            data.qfrc_bias[: 6 + count],
            data.geom_xpos[first : first + legs],
            data.xanchor[1 : 1 + count],
            data.xaxis[1 : 1 + count],
            data.sensordata.reshape(-1, 6),
            data.ctrl,
        )
        self._step = _plain
        if compiled.worth_loading(balance_step, scene.duration / period):
            given = self._plan, self._goal, self._feet, self._state
            self._step = compiled.step(balance_step, *given)
        self.swings = [False] * legs

    def lost(self, joints: Sequence[float]) -> str:
        """Return an empty text: joints that take torques have no set-point."""
        return ''

    def act(self, time: float, heading: float) -> None:
        """Set the torques for the period that ends at a time, s; the heading is held at 0."""
        goal, walked = self._goal, time - self._settle
        goal[balance_step.TIME] = walked
        if walked >= 0.0:
            speed, gain = motion(self._gait, walked)
            goal[balance_step.X] += speed * self._plan.period
            goal[balance_step.SPEED_X], goal[balance_step.GAIN_X] = speed, gain
        self._mujoco.mj_fullM(self._model, self._data, self._inertia)
        self._step(self._plan, goal, self._feet, self._state)
        phases, stands = self._feet[balance_step.PHASE], self._feet[balance_step.STANDS]
        self.swings = ((phases >= self._plan.duty) & (stands < 0.5)).tolist()


def motion(gait: WalkingGait, time: float) -> tuple[float, float]:
    """Return intended speed, m/s, and acceleration, m/s², of the body at a time of its gait, s."""
    time = max(time, 1e-3)  # before zero feet are placed as if the gait had run
    before, now, after = (gait.body_advance(time + each) for each in (-1e-3, 0.0, 1e-3))
    return (after - before) / 2e-3, (after - 2.0 * now + before) / 1e-6


def _plain(plan: Plan, goal: Array, feet: Array, state: State) -> bool:
    """Step in plain Python, which is faster on lists."""
    goals, table, lists = goal.tolist(), feet.tolist(), State(*(each.tolist() for each in state))
    done = balance_step.step(plan, goals, table, lists)
    goal[:], feet[:], state.torques[:] = goals, table, lists.torques
    return done
