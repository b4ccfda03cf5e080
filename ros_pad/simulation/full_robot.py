# SPDX-License-Identifier: Apache-2.0
"""L2: a legged robot with servos in its joints, in MuJoCo.

Body and legs are rigid. Servos with the torque and speed of real ones drive the joints.
Landing, scuffing and slip of the feet follow from contact. Before every step of MuJoCo the
friction of each foot is set from the same film and the same law of resistance as on the other
fidelity levels.

:mod:`ros_pad.simulation.mujoco_model` makes the model. This level needs the extra
``ros_pad[mujoco]``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import sub
from typing import Any

import numpy as np

from ros_pad.configuration import number
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.robots.rotation import Array
from ros_pad.signals import children_spared
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.mujoco_model import POINT
from ros_pad.simulation.mujoco_model import RECOMMENDED
from ros_pad.simulation.mujoco_model import SolverSettings
from ros_pad.simulation.mujoco_model import mjcf
from ros_pad.simulation.mujoco_model import tow_step
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.robot import Proprioception
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.robot import check_pressures
from ros_pad.simulation.robot import check_reach
from ros_pad.simulation.scene import LeggedBody
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

LIGHT = 0.05
"""Load, N, below which the friction coefficient no longer changes with the load."""

SLIP_LOAD = 1.0
"""Load, N, up to which a foot does not count as slipping."""

SLIP_SPEED = 1e-3
"""Speed, m/s, below which a contact counts as sticking."""

CLEAR = 2e-3
"""Height above the ground, m, above which a foot has left it; the film below the foot then has its
initial thickness.
"""

TIPPED = 0.5
"""Angle between trunk and normal of the floor, rad, at which the walk ends with a verdict."""

_UPRIGHT = math.cos(TIPPED)

LOST = 0.3
"""Angle between a joint and its set-point, rad, at which the walk ends with a verdict."""

_FAR = 1e6  # m: if the body is farther away than this, the solution has diverged
_SHALLOW = 5e-3  # m above the ground: below it the block under a foot no longer moves


class FootPath:
    """Positions of the feet in the body that the gait prescribes.

    Parameters
    ----------
    gait : WalkingGait
        Gait, whose clock starts at zero; the feet are placed as if the gait had run before.
    homes : sequence of (float, float, float)
        Home positions of the feet in the body, fore, left and up, m.

    Attributes
    ----------
    feet : list of tuple
        Positions of the feet in the body: fore, left and up, m.
    swings : list of bool
        For each of these feet, whether it is in swing.
    """

    def __init__(self, gait: WalkingGait, homes: Sequence[Vector]) -> None:
        self._gait = gait
        self._homes = homes
        self._reach = gait.reach()
        self._advance = gait.body_advance(0.0)
        self._offsets: list[tuple[float, float]] = []
        for leg in range(len(homes)):
            phase = gait.phase(leg, 0.0)
            if phase < gait.duty:
                ahead = self._reach + gait.body_advance(-phase * gait.cycle)
            else:
                ahead = (2.0 * gait.swing(phase)[0] - 1.0) * self._reach
            self._offsets.append((ahead, 0.0))
        self._lifted = list(self._offsets)
        self.swings = [gait.phase(leg, 0.0) >= gait.duty for leg in range(len(homes))]
        self.feet: list[Vector] = []
        self.move(0.0, 0.0)

    def move(self, time: float, turn: float) -> None:
        """Move the feet to a time of the gait, s, to turn the body by an angle, rad, meanwhile."""
        gait = self._gait
        before, self._advance = self._advance, gait.body_advance(time)
        advance = self._advance - before
        # Legs of one group have one phase: only that of the first of them is computed.
        strokes: dict[float, tuple[float, float] | None] = {}
        for index, middle in enumerate(gait.middles):
            if middle not in strokes:
                phase = gait.phase(index, time)
                strokes[middle] = gait.swing(phase) if phase >= gait.duty else None
        offsets, feet, swings = [], [], []
        places = zip(self._homes, self._offsets, gait.middles, strict=True)
        for index, ((home_x, home_y, home_z), (x, y), middle) in enumerate(places):
            stroke = strokes[middle]
            swings.append(stroke is not None)
            if stroke is None:
                # The foot moves in the body against the motion of the body.
                height = 0.0
                x, y = x - advance + turn * (home_y + y), y - turn * (home_x + x)
            else:
                if not self.swings[index]:
                    self._lifted[index] = (x, y)
                progress, height = stroke
                from_x, from_y = self._lifted[index]
                x, y = from_x + progress * (self._reach - from_x), from_y * (1.0 - progress)
            offsets.append((x, y))
            feet.append((home_x + x, home_y + y, home_z + height))
        self._offsets, self.feet, self.swings = offsets, feet, swings


def _import_mujoco() -> Any:
    try:
        with children_spared():  # mujoco imports glfw, which starts a Python of its own
            import mujoco
    except ImportError as error:
        raise ConfigError(
            f'fidelity L2 needs MuJoCo ({error}): pip install "ros_pad[mujoco]"'
        ) from error
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
        When the robot has no servos, when its legs cannot walk the scene's gait or have more
        inertia than the scene's body, when the towed load is too light for so stiff a line, or
        when MuJoCo is missing.
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
        assert isinstance(scene.body, LeggedBody) and isinstance(scene.gait, WalkingGait)
        number('period', period, 's', above=True)
        if scene.body.robot.servo is None:
            raise ConfigError(
                f'{scene.source}: fidelity L2 needs servos: the file of {scene.robot} has no'
                ' key servo; add it, or walk with --fidelity L1'
            )
        self._solver = check_reach(scene)
        self.legs = scene.legs
        self.joint_names = scene.body.robot.joint_names
        count, self._joints = len(self.legs), slice(7, 7 + len(self.joint_names))
        self.period = period
        self.time = 0.0
        self.feet = [FootState() for _ in self.legs]
        self.dissipation = 0.0
        self.verdict: str | None = None
        self._robot, self._servo = scene.body.robot, scene.body.robot.servo
        self._weight = scene.body.mass * GRAVITY
        self._heading_gain = scene.heading_gain
        self._settle = scene.settle
        self._foot = foot = scene.foot.on_rough(scene.floor.roughness)
        self._lever = foot.turning_radius
        self._floor = floor
        self._tow = scene.tow
        self._steps = 0
        longest = min(settings.timestep, tow_step(scene))
        self._substeps = max(1, math.ceil(period / longest - 1e-9))
        self._dt = period / self._substeps
        low = scene.body.ground
        self._path = FootPath(scene.gait, [(x, y, low) for x, y in scene.body.homes])
        self._films = [Film(foot, scene.floor.viscosity) for _ in self.legs]
        self._cleared = [
            True
        ] * count  # whether a foot left the ground in its present or last swing
        self._loads = [0.0] * count
        self._lefts = [0.0] * count
        self._backs = [0.0] * count
        self._moments = [0.0] * count
        self._ratios = [0.0] * count
        self._pressures = [0.0] * count
        self._limits = [0.0] * count  # force limits of the domes at these pressures, N
        self._ahead: list[tuple[float, bool, bool] | None] = [None] * count  # see `_approach`
        self._mujoco = mujoco
        text = mjcf(scene, floor.heights is not None, settings, self._dt)
        self.model: Any = mujoco.MjModel.from_xml_string(text)
        self.data: Any = mujoco.MjData(self.model)
        self._keep_views()
        self._targets = self._solver.angles([(x, y, low) for x, y, _ in self._path.feet])
        self._place(-low)

    def _keep_views(self) -> None:
        """Keep views of MuJoCo's arrays, because it would take time to make them in every step."""
        first = self.model.geom('foot_1').id
        feet = slice(first, first + len(self.legs))
        self._state = self.data.qpos[: self._joints.stop]
        self._ctrl = self.data.ctrl
        self._places = self.data.geom_xpos[feet]
        self._axes = self.data.geom_xmat[feet, :6]  # x and y rows of their rotation
        # Scalars go through a memoryview faster than through an array.
        self._pose: Any = memoryview(self._state)
        self._frictions: list[Any] = [
            memoryview(self.model.pair(f'foot_{leg}').friction) for leg in self.legs
        ]
        if self._tow.weight:
            self._sled_place: Any = memoryview(self.data.geom('sled').xpos)
            self._sled_friction: Any = memoryview(self.model.pair('sled').friction)
        self._contacts = self.data.sensordata  # force and moment of each foot's contact
        self._turns = self.data.geom_xmat[feet].reshape(-1, 3, 3)
        self._before = self.data.qpos.copy(), self.data.qvel.copy()  # a step ago

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
        """Return what gyro, accelerometer, joints and force sensors of the feet measure.

        The accelerometer shows the change of velocity over the step: MuJoCo's own sensor is of an
        explicit step, and the motion that of an implicit one; a shorter time would alias with the
        set-points of the servos. Joints are those of rigid feet: pads that shear do not move them.
        """
        data, to_imu = self.data, self._robot.imu[:3, :3]
        turn, after = self._imu_motion(data.qpos, data.qvel)
        pull = (after - self._imu_motion(*self._before)[1]) / self.period - self.model.opt.gravity
        forces = [
            tuple((turn_of_foot.T @ state.force).tolist())
            for turn_of_foot, state in zip(self._turns, self.feet, strict=True)
        ]
        moving = slice(6, 6 + len(self.joint_names))
        # The damping of the joints is the back-EMF of their motors.
        efforts = data.qfrc_actuator[moving] + data.qfrc_passive[moving]
        return Proprioception(
            tuple((data.qvel[3:6] @ to_imu).tolist()),
            tuple((pull @ turn @ to_imu).tolist()),
            self._state[7:].tolist(),
            data.qvel[moving].tolist(),
            efforts.tolist(),
            forces,
        )

    def _imu_motion(self, places: Array, speeds: Array) -> tuple[Array, Array]:
        """Return the rotation from the body to the world, and the IMU's velocity there, m/s."""
        turn = np.empty(9)
        self._mujoco.mju_quat2Mat(turn, places[3:7])
        matrix = turn.reshape(3, 3)
        around = np.cross(speeds[3:6], self._robot.imu[:3, 3])
        return matrix, np.asarray(speeds[:3] + matrix @ around)

    def _place(self, height: float) -> None:
        """Place the robot at rest on its planned feet, and the load behind it."""
        data = self.data
        data.qpos[self._joints] = data.ctrl[:] = self._targets
        feet = self._path.feet
        grounds = [self._floor.height(x, y) for x, y, _ in feet]
        if self._floor.heights is not None:
            data.mocap_pos[:, 2] = grounds
        data.qpos[2] = height + max(grounds)
        if self._tow.weight:
            data.qpos[self._joints.stop] = -self._tow.distance
        for film, state, (x, y, _) in zip(self._films, self.feet, feet, strict=True):
            film.touch_down(self._floor.depth(x, y))
            state.wet = self._floor.wet(x, y)
        self._mujoco.mj_kinematics(self.model, data)
        self._last = self._places.tolist()
        self._last_axes = self._axes.tolist()
        self.update_feet([0.0] * len(self.legs))

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg.

        Once MuJoCo's solution has diverged, the state of the feet no longer changes.

        Raises
        ------
        InvalidInput
            When there is not one finite pressure for each leg.
        """
        self._fill(pressures)
        self._steps += 1
        self.time = self._steps * self.period
        model, data, pose = self.model, self.data, self._pose
        mj_step = self._mujoco.mj_step
        if not abs(pose[0]) < _FAR:
            return
        self._aim()
        self._before[0][:], self._before[1][:] = data.qpos, data.qvel
        for _ in range(self._substeps):
            self._set_friction()
            mj_step(model, data)
            # Checking the body is enough: the solver couples all joints, so if one diverges the
            # body diverges too.
            if not abs(pose[0]) < _FAR:
                self._end('the solution of MuJoCo has diverged')
                return
            self.read_contacts()
        self.update_feet(pressures)
        self._judge()

    def _fill(self, pressures: Sequence[float]) -> None:
        """Set the gauge pressures of the pads, Pa."""
        if pressures != self._pressures:  # they change more rarely than the robot steps
            check_pressures(pressures, len(self.legs))
            self._pressures = list(pressures)
            self._limits = [self._foot.dome_load(math.inf, each) for each in pressures]

    def _aim(self) -> None:
        """Set the set-points of all servos; where a foot is out of reach, they stay unchanged."""
        # The clock of the gait starts when the robot has settled.
        heading = self.body[2]
        path, swung = self._path, self._path.swings
        path.move(max(0.0, self.time - self._settle), -self._heading_gain * heading * self.period)
        for index in range(len(swung)) if path.swings != swung else ():
            if not swung[index] and path.swings[index]:
                self._cleared[index] = False
            elif swung[index] and not path.swings[index] and not self._cleared[index]:
                self._end(f'leg {index + 1} does not clear the ground in its swing')
        try:
            targets = self._solver.angles(self._path.feet)
        except InvalidInput as error:
            self._end(str(error))
            return
        before, self._targets = self._targets, targets
        self._ctrl[:] = self._led(targets, before) if self._servo.feedforward else targets

    def _led(self, targets: Sequence[float], before: Sequence[float]) -> Array:
        """Return set-points that lead by what carries the robot and overcomes the damping."""
        servo, stands = self._servo, [not swings for swings in self._path.swings]
        aim = np.array(targets)
        share = np.array(stands) * self._weight / max(sum(stands), 1)
        torque = -share[:, None] * self._robot.foot_jacobians(aim)[:, 2]
        speed = (aim - before) / self.period
        return np.asarray(aim + (torque.ravel() + servo.damping * speed) / servo.stiffness)

    def _set_friction(self) -> None:
        """Set the friction of each standing foot for the next step, from its load in the last one.

        Set the friction of the towed load, too.
        """
        for index, load in enumerate(self._loads):
            if load > LIGHT:
                self._ahead[index] = None
                self._write_friction(index, load, self._dt)
        tow = self._tow
        if tow.weight:
            row, (x, y, _) = self._sled_friction, self._sled_place
            row[0] = row[1] = tow.friction_wet if self._floor.wet(x, y) else tow.friction_dry

    def _write_friction(self, index: int, load: float, drained: float) -> None:
        """Set the friction of a foot with a load, N, whose film has drained for a time, s."""
        foot, pressure, limit = self._foot, self._pressures[index], self._limits[index]
        dome_load = load if load < limit else limit
        sole_load = load - dome_load
        films = (0.0, 0.0)
        if self.feet[index].wet:
            films = self._films[index].drain(dome_load, sole_load, pressure, drained)
        grip = foot.resistance_of(dome_load, sole_load, pressure, *films)
        self._ratios[index] = ratio = grip / load
        row = self._frictions[index]
        # The yaw moment of an evenly pressed round sole has a lever arm of 2/3 of its radius.
        row[0] = row[1] = ratio
        row[2] = self._lever * ratio

    def read_contacts(self) -> None:
        """Read the ground's force and yaw moment on each foot in the last step of MuJoCo."""
        values = self._contacts.tolist()
        # The axes of a contact with level ground are z, y, -x.
        self._loads, self._lefts, self._backs = values[::6], values[1::6], values[2::6]
        self._moments = values[3::6]

    def update_feet(self, pressures: Sequence[float]) -> None:
        """Set the states of the feet, and the work lost in slip, from the contacts read last."""
        self._fill(pressures)
        dt, wet, softness = self.period, self._floor.wet, 1.0 / self._foot.shear_stiffness
        places, last = self._places.tolist(), self._last
        axes, last_axes = self._axes.tolist(), self._last_axes
        self._last, self._last_axes = places, axes
        feet = zip(
            range(len(places)), self.feet, places, self._loads, self._backs, self._lefts,
            self._moments, self._ratios, self._pressures, self._limits, strict=True,
        )  # fmt: skip
        for index, state, (x, y, z), load, back, push_y, moment, ratio, pressure, limit in feet:
            push_x = 0.0 - back  # not -0.0 in the air
            state.position = (x - push_x * softness, y - push_y * softness, z - POINT)
            state.force = (push_x, push_y, load)
            state.moment = moment
            state.standing = load > 0.0
            state.grip = ratio * load
            state.slip_speed = 0.0
            state.wet = wet(x, y)
            if load <= LIGHT:
                self._approach(index, x, y, z - POINT)
            elif load > SLIP_LOAD:
                step_x, step_y = x - last[index][0], y - last[index][1]
                distance = math.hypot(step_x, step_y)
                if distance > SLIP_SPEED * dt:
                    state.slip_speed = distance / dt
                    state.slip_path += distance
                turn = _turn(last_axes[index], axes[index])
                # As on L1, sliding and turning share a foot's grip.
                if math.hypot(distance, self._lever * turn) > SLIP_SPEED * dt:
                    self.dissipation -= push_x * step_x + push_y * step_y + moment * turn
            if pressure > 0.0 and limit < load:
                state.overload_time += dt

    def _approach(self, index: int, x: float, y: float, z: float) -> None:
        """Prepare film, block and friction below a foot without load."""
        ground, clear = 0.0, CLEAR
        if self._floor.heights is not None:
            clear = _SHALLOW
            block = self.data.mocap_pos[index]
            ground = float(block[2])
            if z > ground + _SHALLOW:
                block[2] = self._floor.height(x, y)
        if z > ground + clear:
            self._cleared[index] = True
        left = z > ground + CLEAR
        ahead = (self._pressures[index], self.feet[index].wet, left)
        if ahead != self._ahead[index]:  # else film and friction are as they were set last
            self._ahead[index] = ahead
            if left:
                self._films[index].touch_down(self._floor.depth(x, y))
            self._write_friction(index, LIGHT, 0.0)

    def _judge(self) -> None:
        """Set the verdict when the body tips over or a joint is far from its set-point."""
        state = self._state.tolist()
        upright = 1.0 - 2.0 * (state[4] * state[4] + state[5] * state[5])
        if upright < _UPRIGHT:
            self._end(f'tip-over: the body leans {math.acos(max(-1.0, upright)):.2f} rad')
        else:
            worst = max(map(abs, map(sub, self._targets, state[7:])))
            if worst > LOST:
                lost = [abs(a - b) == worst for a, b in zip(self._targets, state[7:], strict=True)]
                name = self.joint_names[lost.index(True)]
                self._end(f'servo {name} is {worst:.2f} rad off its set-point')

    def _end(self, why: str) -> None:
        if self.verdict is None:
            self.verdict = f'{why}, at {self.time:.3f} s'


def _turn(before: Sequence[float], now: Sequence[float]) -> float:
    """Return a body's small turn about the vertical, rad, from the x and y rows of its rotation.

    The rows are those of the rotation matrix.
    """
    a, b, c, d, e, f = before
    u, v, w, x, y, z = now
    return 0.5 * (x * a + y * b + z * c - u * d - v * e - w * f)
