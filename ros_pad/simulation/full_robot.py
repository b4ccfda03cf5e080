# SPDX-License-Identifier: Apache-2.0
"""L2: a legged robot in MuJoCo.

Body and legs are rigid. Position servos drive the joints along the gait, or torques keep a gait
with balance; both within what real motors can do.
Landing, scuffing and slip of the feet follow from contact. Before every step of MuJoCo the
friction of each foot is set from the same film and the same law of resistance as on the other
fidelity levels.

:mod:`ros_pad.simulation.mujoco_model` makes the model. This level needs the extra
``ros_pad[mujoco]``.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.configuration import number
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots.rotation import Array
from ros_pad.signals import children_spared
from ros_pad.simulation.balance import Balance
from ros_pad.simulation.mujoco_model import (
    LONGEST,
    RECOMMENDED,
    SolverSettings,
    landing_step,
    mjcf,
    tow_step,
)
from ros_pad.simulation.robot import (
    FootState,
    Proprioception,
    Vector,
    check_reach,
    check_strength,
    check_tow,
)
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.servos import Servos
from ros_pad.simulation.soles import Sled, Soles
from ros_pad.simulation.terrain import Floor

TIPPED = 0.5
"""Angle between trunk and normal of the floor, rad, at which the walk ends with a verdict."""

_FAR = 1e6  # m: if the body is farther away than this, the solution has diverged


def _import_mujoco() -> Any:
    """Import MuJoCo, without OpenGL unless ``MUJOCO_GL`` asks for it: that takes as long again."""
    given = os.environ.get('MUJOCO_GL')
    os.environ['MUJOCO_GL'] = given or 'disable'
    try:
        with children_spared():  # mujoco may import glfw, which starts a Python of its own
            import mujoco
    except ImportError as error:
        raise ConfigError(
            f'fidelity L2 needs MuJoCo ({error}): pip install "ros_pad[mujoco]"'
        ) from error
    finally:
        if not given:
            del os.environ['MUJOCO_GL']
    return mujoco


class FullRobot:
    """A robot of three to eight legs on a floor with wet patches, towing a load.

    Parameters
    ----------
    scene : Scene
        A scene with a legged robot.
    floor : Floor
        The ground.
    period : float
        Length of a step, s, above 0: in each step the servos receive one set-point and the feet
        are read once.
    settings : SolverSettings
        Settings of MuJoCo for its own, shorter steps.

    Attributes
    ----------
    joint_names : tuple of str
        Leg by leg from the body to the foot, as in the robot's file.
    model, data : mujoco.MjModel, mujoco.MjData
        The simulation, for a viewer or to push the robot.

    Raises
    ------
    ConfigError
        When its legs cannot walk the scene's gait or have more inertia than the scene's body; when
        its motors are too weak to stand, its samples too slow, or the towed load beyond its grip,
        if its joints take torques; when the load is too light for so stiff a line; or when MuJoCo
        is missing.
    InvalidInput
        When the period is not finite and above 0.

    Notes
    -----
    The pads' shear is quasi-static: a marker is at the contact less force/stiffness, but the body
    moves as on rigid feet. A foot's position and force are those at the beginning of the last
    MuJoCo step; the body's position is that at its end.
    """

    def __init__(
        self,
        scene: Scene,
        floor: Floor,
        period: float,
        settings: SolverSettings = RECOMMENDED,
    ) -> None:
        mujoco = _import_mujoco()
        body, _ = scene.legged
        robot = body.robot
        number('period', period, 's', above=True)
        if not robot.servo:
            check_strength(scene)
            check_tow(scene)
        solver = check_reach(scene)
        self.legs = scene.legs
        self.joint_names = robot.joint_names
        self.period = period
        self.time = 0.0
        self.verdict: str | None = None
        longest = min(settings.timestep or LONGEST, tow_step(scene))
        text = mjcf(scene, floor.heights is not None, settings)
        self.model: Any = mujoco.MjModel.from_xml_string(text)
        if settings.timestep is None:
            longest = min(longest, landing_step(scene, self.model))
        self._substeps = max(1, math.ceil(period / longest - 1e-9))
        self.model.opt.timestep = dt = period / self._substeps
        self.data: Any = mujoco.MjData(self.model)
        # Views are kept, because it would take time to make them in every step.
        self._state = self.data.qpos[: 7 + len(self.joint_names)]
        self._where: Any = memoryview(self._state)  # faster for single numbers
        self._mujoco = mujoco
        self._drive: Servos | Balance
        if robot.servo:
            self._drive = Servos(scene, solver, period, self.data.ctrl)
        else:
            self._drive = Balance(scene, period, mujoco, self.model, self.data)
        self.soles = Soles(scene, floor, period, dt, self.model, self.data)
        self._sled = Sled(scene.tow, floor, self.model, self.data) if scene.tow.weight else None
        self._senses = _Senses(mujoco, self.model, self.data, scene, period)
        self._place(-body.ground)

    @property
    def feet(self) -> list[FootState]:
        """State of each foot, updated on access; the objects stay the same."""
        return list(self.soles.feet)

    @property
    def contacts(self) -> Array:
        """Force, N, yaw moment, N m, and position, m, of each foot, (feet, 7)."""
        return self.soles.contacts

    @property
    def dissipation(self) -> float:
        """Work lost in feet that slip or turn, J."""
        return self.soles.dissipation

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""
        x, y, _, a, b, c, d = self._state[:7].tolist()
        return x, y, math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))

    @property
    def joint_positions(self) -> tuple[float, ...]:
        """Angles of the joints, rad, in the order of ``joint_names``."""
        return tuple(self._state[7:].tolist())

    def proprioception(self) -> Proprioception:
        """Return what gyro, accelerometer, joints and force sensors of the feet measure."""
        return self._senses.read(self.contacts[:, :3])

    def _place(self, height: float) -> None:
        """Place the robot at rest on its planned feet, and the load behind it."""
        data = self.data
        self._state[7:] = self._drive.targets
        data.qpos[2] = height + self.soles.place(self._drive.places)
        if self._sled:
            data.qpos[len(self._state)] = -self._sled.distance
        self._mujoco.mj_fwdPosition(self.model, data)
        self._mujoco.mj_fwdVelocity(self.model, data)
        self.soles.update()

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg.

        Once MuJoCo's solution has diverged, the state of the feet no longer changes.

        Raises
        ------
        InvalidInput
            When there is not one finite pressure for each leg.
        """
        soles, sled, where = self.soles, self._sled, self._where
        soles.fill(pressures)
        self.time = (round(self.time / self.period) + 1) * self.period
        if not abs(where[0]) < _FAR:
            return
        self._aim()
        self._senses.note()
        mj_step, model, data = self._mujoco.mj_step, self.model, self.data
        for _ in range(self._substeps):
            soles.rub()
            if sled:
                sled.rub()
            mj_step(model, data)
            # Checking the body is enough: the solver couples all joints, so if one diverges the
            # body diverges too.
            if not abs(where[0]) < _FAR:
                self._end('the solution of MuJoCo has diverged')
                return
        soles.update()
        self._judge()

    def _aim(self) -> None:
        """Set the set-points of all joints; where a foot is out of reach, they stay unchanged."""
        drive, swung = self._drive, self._drive.swings
        try:
            drive.act(self.time, self.body[2])
        except InvalidInput as error:
            self._end(str(error))
        if drive.swings != swung:
            for index in self.soles.swing(swung, drive.swings):
                self._end(f'leg {index + 1} does not clear the ground in its swing')

    def _judge(self) -> None:
        """Set the verdict when the body tips over or a joint is far from its set-point."""
        state = self._state.tolist()
        upright = 1.0 - 2.0 * (state[4] * state[4] + state[5] * state[5])
        if upright < math.cos(TIPPED):
            self._end(f'tip-over: the body leans {math.acos(max(-1.0, upright)):.2f} rad')
        elif lost := self._drive.lost(state[7:]):
            self._end(lost)

    def _end(self, why: str) -> None:
        if self.verdict is None:
            self.verdict = f'{why}, at {self.time:.3f} s'


class _Senses:
    """What gyro, accelerometer, joints and force sensors of the feet of a robot measure.

    The accelerometer shows the change of velocity over the step: MuJoCo's own sensor is of an
    explicit step, and the motion that of an implicit one; a shorter time would alias with the
    set-points of the servos. Joints are those of rigid feet: pads that shear do not move them.
    """

    def __init__(self, mujoco: Any, model: Any, data: Any, scene: Scene, period: float) -> None:
        robot, first = scene.legged[0].robot, model.geom('foot_1').id
        self._to_matrix = mujoco.mju_quat2Mat
        self._imu = robot.imu
        self._data = data
        self._gravity = model.opt.gravity
        self._period = period
        self._moving = slice(6, 6 + len(robot.joint_names))
        self._turns = data.geom_xmat[first : first + len(scene.legs)].reshape(-1, 3, 3)
        self._now = data.qpos, data.qvel
        self._before = data.qpos.copy(), data.qvel.copy()  # a step ago

    def note(self) -> None:
        """Note places and speeds at the beginning of a step."""
        for before, now in zip(self._before, self._now, strict=True):
            np.copyto(before, now)

    def read(self, forces: Array) -> Proprioception:
        """Return what they measure at forces on the feet, N, (feet, 3)."""
        data, to_imu, moving = self._data, self._imu[:3, :3], self._moving
        turn, after = self._motion(*self._now)
        pull = (after - self._motion(*self._before)[1]) / self._period - self._gravity
        # The damping of the joints is the back-EMF of their motors.
        efforts = data.qfrc_actuator[moving] + data.qfrc_passive[moving]
        return Proprioception(
            data.qvel[3:6] @ to_imu,
            pull @ turn @ to_imu,
            data.qpos[moving.start + 1 : moving.stop + 1].copy(),
            data.qvel[moving].copy(),
            efforts,
            np.array([turn.T @ force for turn, force in zip(self._turns, forces, strict=True)]),
        )

    def _motion(self, places: Array, speeds: Array) -> tuple[Array, Array]:
        """Return the rotation from the body to the world, and the IMU's velocity there, m/s."""
        turn = np.empty(9)
        self._to_matrix(turn, places[3:7])
        matrix = turn.reshape(3, 3)
        around = np.cross(speeds[3:6], self._imu[:3, 3])
        return matrix, np.asarray(speeds[:3] + matrix @ around)
