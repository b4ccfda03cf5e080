# SPDX-License-Identifier: Apache-2.0
"""L0: walking mechanism of the thesis (5.2), one foot that pushes a body on wheels along a rail.

The body has one degree of freedom. The foot's force is at most its cap c, the wheels resist with a
drag F, and each step solves M (v - v0)/dt + c sgn(v - u) + F sgn(v) + M g sin(slope) = 0 for the
speed v of the body exactly, with u the speed at which the foot moves back under the body. The
springs' load and the wheels' drag do not depend on the slope.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ros_pad.configuration import instance, number
from ros_pad.contact import laws
from ros_pad.contact.film import Film, landed
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.records import Array
from ros_pad.simulation.robot import FootState, Vector, check_pressures
from ros_pad.simulation.scene import RailBody, Scene
from ros_pad.simulation.terrain import Floor


class RailLeg:
    """A body on a rail with one foot.

    Parameters
    ----------
    scene : Scene
        A scene with a rail leg.
    floor : Floor
        The ground.
    period : float
        Length of a step, s, above 0.

    Attributes
    ----------
    speed : float
        Speed of the body, m/s.

    Raises
    ------
    InvalidInput
        When the period is not finite and above 0, or the scene has another robot.
    """

    legs: tuple[int, ...] = (1,)
    joint_names: tuple[str, ...] = ()
    joint_positions: tuple[float, ...] = ()
    verdict: str | None = None

    def __init__(self, scene: Scene, floor: Floor, period: float) -> None:
        instance('scene', scene, Scene)
        instance('floor', floor, Floor)
        self._rail = scene.on_rail
        number('period', period, 's', above=True)
        self.period = period
        self.time = 0.0
        self.feet = [FootState()]
        self.dissipation = 0.0
        self._scene = scene
        self._floor = floor
        self._foot = scene.foot.on_rough(scene.floor.roughness)
        self.film = Film(self._foot, scene.floor.viscosity)
        self._x = self.speed = 0.0
        self.feet[0].standing = True
        self.film.touch_down(floor.depth(self.plan(0.0)[1], 0.0))

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body."""
        return self._x, 0.0, 0.0

    def plan(self, time: float) -> tuple[bool, float, float]:
        """Return where the gait has the foot.

        Parameters
        ----------
        time : float
            Time, s.

        Returns
        -------
        tuple
            Whether the foot stands, its distance ahead of the body, m, and its height, m.
        """
        _, gait = self._rail
        since = max(0.0, time - self._scene.settle) % gait.cycle
        if since < gait.stance:
            return True, 0.5 * gait.stroke * math.cos(math.pi * since / gait.stance), 0.0
        share = (since - gait.stance) / gait.swing
        height = gait.lift * math.sin(math.pi * share) ** 2
        return False, -0.5 * gait.stroke * math.cos(math.pi * share), height

    @property
    def contacts(self) -> Array:
        """Force, N, yaw moment, N m, and position, m, of each foot, (feet, 7)."""
        return np.array([(*foot.force, foot.moment, *foot.position) for foot in self.feet])

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period``.

        Parameters
        ----------
        pressures : sequence of float
            Gauge pressure of the pads, in a sequence of one, Pa, from 0.

        Raises
        ------
        InvalidInput
            When the sequence is not one finite pressure.
        """
        check_pressures(pressures, 1)
        dt, state, foot, (body, gait) = self.period, self.feet[0], self._foot, self._rail
        before = self.plan(self.time)[1]
        self.time = (round(self.time / dt) + 1) * dt
        stands, offset, height = self.plan(self.time)
        back = (before - offset) / dt
        if stands and not state.standing:
            self.film.touch_down(self._floor.depth(self._x + offset, 0.0))
        state.standing = stands
        cap = 0.0
        if stands:
            load, pressure = body.load, pressures[0]
            state.wet = self._floor.wet(self._x + offset, 0.0)
            on_domes, films = foot.dome_load(load, pressure), (0.0, 0.0)
            if state.wet:
                since = max(0.0, self.time - self._scene.settle) % gait.cycle
                share = landed(max(since, dt), 0.5 * gait.stance)
                films = self.film.drain(
                    share * on_domes, share * (load - on_domes), pressure, dt, state.slip_speed
                )
            cap = laws.resistance(foot, on_domes, load - on_domes, pressure, *films)
            if pressure > 0.0 and foot.dome_load(load, pressure) < load:
                state.overload_time += dt
        free = self.speed - GRAVITY * math.sin(self._scene.floor.slope) * dt
        self.speed, force = push(free, back, cap, body, dt)
        self._x += self.speed * dt
        slip = self.speed - back if stands else 0.0
        # The marker is above the pads: their shear moves it away from the contact on the floor.
        state.position = (self._x + offset - force / foot.shear_stiffness, 0.0, height)
        state.force = (force, 0.0, body.load if stands else 0.0)
        state.grip = cap
        state.slip_speed = abs(slip)
        state.slip_path += abs(slip) * dt
        self.dissipation += cap * abs(slip) * dt


def push(free: float, back: float, cap: float, body: RailBody, dt: float) -> tuple[float, float]:
    """Return the speed of the body after a step, m/s, and the floor's force on the foot, N.

    The speed minimises ½ (v - v1)² + (dt/M) (c |v - u| + F |v|), a parabola and two kinks. The
    minimiser is the median of the two kinks and of the minimisers of the three smooth branches.

    Parameters
    ----------
    free : float
        Speed without foot and wheels, v1 = v0 - g dt sin(slope), m/s.
    back : float
        Speed at which the foot moves back under the body, u, m/s.
    cap : float
        Largest force of the foot, c, N.
    body : RailBody
        Body of mass M, whose wheels have the drag F.
    dt : float
        Length of the step, s.
    """
    mass, drag = body.mass, body.rolling_drag
    foot, wheels = dt / mass * cap, dt / mass * drag
    low, high = (foot, wheels) if back < 0.0 else (wheels, foot)
    branches = (free + foot + wheels, free - low + high, free - foot - wheels)
    speed = sorted((back, 0.0, *branches))[2]
    if speed == 0.0:
        # At rest the foot and the wheels share the force: that of the foot is determined only
        # while the foot slips.
        return speed, math.copysign(cap, back) if back else 0.0
    return speed, mass * (speed - free) / dt + math.copysign(drag, speed)
