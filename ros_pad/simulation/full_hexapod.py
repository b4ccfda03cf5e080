# SPDX-License-Identifier: Apache-2.0
"""L2: a hexapod with eighteen servos, in MuJoCo.

Body and legs are rigid, joints are driven by hobby servos with the torque and speed of real ones,
feet land, scuff and slip on their own. The friction of each foot is written before every step of
MuJoCo from the same film and the same law of resistance that the other rungs use.

Axes of the body: x fore, y left, z up. Each leg turns about the vertical at its hip (coxa), then
about two level axes (femur, tibia). All joint angles are zero at home, where the femur is level
and the tibia upright, and positive counter-clockwise seen from above (coxa), up (femur) and
outwards (tibia).

Needs the extra ``ros_pad[mujoco]``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import sub
from typing import Any

import numpy as np

from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation.gait import TripodGait
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.robot import check_pressures
from ros_pad.simulation.scene import HexapodBody
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

# Servos: HS-645MG at 6 V, the class that the CH3-R is built with.
STALL_TORQUE = 0.94  # N m
NO_LOAD_SPEED = 5.2  # rad/s: 60 degrees in 0.2 s
FULL_TORQUE_ERROR = 0.05  # rad from the set-point at which a servo gives all it has, assumed
ROTOR_INERTIA = 2e-3  # kg m² of the motor behind its gears, assumed

# Shares of the robot's mass in each link of one leg, assumed: the rest is the trunk. The coxa
# carries the servo of the femur; knee and hip servos are counted to femur and trunk.
COXA_SHARE, FEMUR_SHARE, TIBIA_SHARE = 0.02, 0.015, 0.015
ROLL_SHARE = 0.6  # inertia of the trunk about x and about y, of that about z, assumed

# Legs 1, 3, 4, 6 point 30 degrees off the fore-and-aft axis, 2 and 5 straight aside (CH3-R).
BEARINGS = tuple(math.radians(angle) for angle in (30.0, 90.0, 150.0, -150.0, -90.0, -30.0))
LINKS = ('coxa', 'femur', 'tibia')
TRAVEL = math.pi / 2.0  # rad either way from home

LIGHT = 0.05
"""N. A foot that carries less has the friction coefficient that it has with this load."""

SLIP_LOAD = 1.0
"""N. A foot that carries no more does not count as slipping."""

SLIP_SPEED = 1e-3
"""m/s. A contact that moves more slowly counts as sticking."""

CLEAR = 2e-3
"""m above the ground, at which a foot has left it and its film is whole again."""

TIPPED = 0.5
"""rad off the vertical of the floor, at which the walk ends with a verdict."""

_UPRIGHT = math.cos(TIPPED)

LOST = 0.3
"""rad between a joint and its set-point, at which the walk ends with a verdict."""

# The sole is a point: a ball so small that it does not roll noticeably under a tilting tibia.
_POINT = 1e-4  # m
_FAR = 1e6  # m: no walk, but numbers that overflow
_SHALLOW = 5e-3  # m above the ground, below which a foot's block no longer moves
_SHORTEST = 1e-4  # s: a towed load that needs shorter steps is refused


@dataclass(frozen=True)
class Settings:
    """How MuJoCo is asked to solve a step.

    Parameters
    ----------
    timestep : float
        Longest step, s, 1e-5 to 0.01; it is shortened to divide the robot's period, and for a
        towed load that swings on its line faster than that.
    integrator : str
        ``Euler``, ``implicit`` or ``implicitfast``.
    cone : str
        ``pyramidal`` or ``elliptic``.
    impratio : float
        How much harder friction is than the normal contact, 1 to 1e4. A foot at a share of its
        friction limit creeps at a speed that goes as 1/impratio whatever the step.
    noslip_iterations : int
        Of the solver that takes the creep off afterwards, 0 to 100; for elliptic cones only.

    Raises
    ------
    InvalidInput
        When a value is outside its range.
    """

    timestep: float = 2e-3
    integrator: str = 'implicitfast'
    cone: str = 'elliptic'
    impratio: float = 100.0
    noslip_iterations: int = 0

    def __post_init__(self) -> None:
        number('timestep', self.timestep, 's', 1e-5, 0.01)
        choice('integrator', self.integrator, ('Euler', 'implicit', 'implicitfast'))
        choice('cone', self.cone, ('pyramidal', 'elliptic'))
        number('impratio', self.impratio, '(ratio)', 1.0, 1e4)
        passes = self.noslip_iterations
        if isinstance(passes, bool) or not isinstance(passes, int) or not 0 <= passes <= 100:
            raise InvalidInput(
                f'noslip_iterations = {passes!r} is not allowed: a whole number from 0 to 100'
            )


RECOMMENDED = Settings()
"""Creep below 0.1 mm/s at 0.8 of the friction limit; longer steps give way before the limit."""

DEFAULTS = Settings(integrator='Euler', cone='pyramidal', impratio=1.0)
"""What MuJoCo does unless told."""


@dataclass(frozen=True)
class Leg:
    """Geometry of one leg.

    Attributes
    ----------
    hip_x, hip_y : float
        Axis of the coxa in the body, fore and left, m.
    bearing : float
        Direction in which the leg points at home, rad from fore to left.
    coxa, femur, tibia : float
        Lengths of the links, m.
    """

    hip_x: float
    hip_y: float
    bearing: float
    coxa: float
    femur: float
    tibia: float

    @classmethod
    def standing_at(cls, home: tuple[float, float], bearing: float, body: HexapodBody) -> Leg:
        """Return the leg whose foot is at ``home`` when its femur is level, its tibia upright."""
        out = body.coxa + body.femur
        return cls(
            home[0] - out * math.cos(bearing),
            home[1] - out * math.sin(bearing),
            bearing,
            body.coxa,
            body.femur,
            body.tibia,
        )

    def foot(self, coxa: float, femur: float, tibia: float) -> Vector:
        """Return where the foot is, fore, left and above the hip, m, for joint angles, rad."""
        out = self.coxa + self.femur * math.cos(femur) + self.tibia * math.sin(femur + tibia)
        up = self.femur * math.sin(femur) - self.tibia * math.cos(femur + tibia)
        direction = self.bearing + coxa
        x = self.hip_x + out * math.cos(direction)
        return x, self.hip_y + out * math.sin(direction), up

    def angles(self, x: float, y: float, z: float) -> Vector:
        """Return the joint angles, rad, that put the foot there: the inverse of :meth:`foot`.

        Of the two ways to bend the knee it is the one with the tibia outside.

        Raises
        ------
        InvalidInput
            When the leg is too short, or the point too close, for the foot to get there.
        """
        x -= self.hip_x
        y -= self.hip_y
        coxa = math.remainder(math.atan2(y, x) - self.bearing, math.tau)
        out = math.hypot(x, y) - self.coxa
        femur, tibia = self.femur, self.tibia
        bend = (out * out + z * z - femur * femur - tibia * tibia) / (2.0 * femur * tibia)
        if not -1.0 <= bend <= 1.0:
            raise InvalidInput(
                f'foot {math.hypot(out, z):.4g} m from the knee axis at the hip is out of reach:'
                f' {abs(femur - tibia):.4g} to {femur + tibia:.4g} m is needed'
            )
        # In the axes of the femur the foot is at (femur + tibia sin t, -tibia cos t).
        side = tibia * math.sqrt(1.0 - bend * bend)
        lift = math.atan2(z, out) + math.atan2(side, femur + tibia * bend)
        return coxa, math.remainder(lift, math.tau), math.asin(bend)


class FootPath:
    """Where the gait wants the feet in the body: back under it in stance, forward in swing.

    Parameters
    ----------
    gait : TripodGait
        Its clock starts at zero; the feet are placed as if it had been running before.
    homes : sequence of (float, float)
        Where feet 1 to 6 stand in the body, fore and left, m.

    Attributes
    ----------
    feet : list of tuple
        Fore, left, and above the ground, m; legs 1 to 6.
    swings : tuple of bool
        Which of them swing.
    """

    def __init__(self, gait: TripodGait, homes: Sequence[tuple[float, float]]) -> None:
        self._gait = gait
        self._homes = homes
        self._reach = gait.reach()
        self._time = 0.0
        self._offsets: list[tuple[float, float]] = []
        for leg in range(1, 7):
            phase = gait.phase(leg, 0.0)
            if phase < gait.duty:
                ahead = self._reach + gait.body_advance(-phase * gait.cycle)
            else:
                ahead = (2.0 * gait.swing(phase)[0] - 1.0) * self._reach
            self._offsets.append((ahead, 0.0))
        self._lifted = list(self._offsets)
        self.swings = tuple(gait.phase(leg, 0.0) >= gait.duty for leg in range(1, 7))
        self.feet: list[Vector] = []
        self.move(0.0, 0.0)

    def move(self, time: float, turn: float) -> None:
        """Go on to a time of the gait, s, while the body is to turn by an angle, rad."""
        gait = self._gait
        advance = gait.body_advance(time) - gait.body_advance(self._time)
        self._time = time
        feet, swinging = [], []
        for index, (home_x, home_y) in enumerate(self._homes):
            phase = gait.phase(index + 1, time)
            x, y = self._offsets[index]
            height = 0.0
            swings = phase >= gait.duty
            if swings:
                if not self.swings[index]:
                    self._lifted[index] = (x, y)
                progress, height = gait.swing(phase)
                from_x, from_y = self._lifted[index]
                x, y = from_x + progress * (self._reach - from_x), from_y * (1.0 - progress)
            else:
                # Walking ahead and turning: the foot goes back and round the other way.
                x, y = x - advance + turn * (home_y + y), y - turn * (home_x + x)
            swinging.append(swings)
            self._offsets[index] = (x, y)
            feet.append((home_x + x, home_y + y, height))
        self.feet, self.swings = feet, tuple(swinging)


class FullHexapod:
    """Six feet on eighteen servos in a tripod gait on a floor with wet patches, towing a load.

    Parameters
    ----------
    scene : Scene
        One with a hexapod.
    floor : Floor
        The ground.
    period : float
        Step, s: the servos get a set-point, and the feet are read, once in each.
    settings : Settings
        How MuJoCo solves its own, shorter steps.

    Attributes
    ----------
    joint_names : tuple of str
        ``leg_1_coxa``, ``leg_1_femur``, ``leg_1_tibia``, ``leg_2_coxa`` and so on.
    model, data : mujoco.MjModel, mujoco.MjData
        The simulation itself, for a viewer or to push the robot.

    Raises
    ------
    ConfigError
        When the legs cannot do what the scene wants of them, when the towed load is too light for
        so stiff a line, or when MuJoCo is missing.
    InvalidInput
        When the period is not above zero.

    Notes
    -----
    The pads' shear is quasi-static: a marker is where the contact is, less force/stiffness, but
    the body does not feel that its feet are soft. A foot's position and force are those of the
    beginning of the last MuJoCo step, one ``timestep`` before the body's position.
    """

    def __init__(
        self,
        scene: Scene,
        floor: Floor,
        period: float,
        settings: Settings = RECOMMENDED,
    ) -> None:
        try:
            import mujoco
        except ImportError as error:
            raise ConfigError(
                f'fidelity L2 needs MuJoCo ({error}): pip install "ros_pad[mujoco]"'
            ) from error
        assert isinstance(scene.body, HexapodBody) and isinstance(scene.gait, TripodGait)
        number('period', period, 's', above=True)
        self.legs: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
        self.joint_names = tuple(f'leg_{leg}_{link}' for leg in self.legs for link in LINKS)
        self.period = period
        self.time = 0.0
        self.feet = [FootState() for _ in self.legs]
        self.dissipation = 0.0
        self.verdict: str | None = None
        self._heading_gain = scene.heading_gain
        self._settle = scene.settle
        self._foot = foot = scene.foot.on_rough(scene.floor.roughness)
        self._lever = 2.0 / 3.0 * foot.sole_radius
        self._floor = floor
        self._tow = scene.tow
        self._steps = 0
        longest = min(settings.timestep, _line_step(scene))
        self._substeps = max(1, math.ceil(period / longest - 1e-9))
        self._dt = period / self._substeps
        self._geometry = _legs(scene)
        self._path = FootPath(scene.gait, scene.body.homes)
        self._films = [Film(foot, scene.floor.viscosity) for _ in self.legs]
        self._cleared = [True] * 6  # the ground, in the swing that is on or was last
        self._loads = [0.0] * 6
        self._pushes = [(0.0, 0.0)] * 6
        self._moments = [0.0] * 6
        self._ratios = [0.0] * 6
        self._mujoco: Any = mujoco
        text = mjcf(scene, self._geometry, floor.heights is not None, settings, self._dt)
        self.model: Any = mujoco.MjModel.from_xml_string(text)
        self.data: Any = mujoco.MjData(self.model)
        # MuJoCo makes a new array each time it is asked for one: these are kept.
        first = self.model.geom('foot_1').id
        self._index = {first + index: index for index in range(6)}
        self._state = self.data.qpos[:25]
        self._ctrl = self.data.ctrl
        self._places = self.data.geom_xpos[first : first + 6]
        self._axes = self.data.geom_xmat[first : first + 6, :6]  # of the feet, along x and y
        # Scalars go through a memoryview faster than through an array.
        self._frictions: list[Any] = [
            memoryview(self.model.pair(f'foot_{leg}').friction) for leg in self.legs
        ]
        if scene.tow.weight:
            self._sled_place = self.data.geom('sled').xpos[:2]
            self._sled_friction = self.model.pair('sled').friction
        self._wrench = np.zeros(6)
        self._targets = [
            angle
            for leg, (x, y, _) in zip(self._geometry, self._path.feet, strict=True)
            for angle in leg.angles(x, y, -leg.tibia)
        ]
        self._place(scene.body.tibia)

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""
        x, y, _, a, b, c, d = self._state[:7].tolist()
        return x, y, math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))

    @property
    def joint_positions(self) -> tuple[float, ...]:
        """Angles of the eighteen joints, rad, in the order of ``joint_names``."""
        return tuple(self._state[7:].tolist())

    def _place(self, height: float) -> None:
        """Put the robot on its planned feet, with nothing moving, and the load behind it."""
        data = self.data
        data.qpos[7:25] = data.ctrl[:] = self._targets
        feet = self._path.feet
        grounds = [self._floor.height(x, y) for x, y, _ in feet]
        if self._floor.heights is not None:
            data.mocap_pos[:, 2] = grounds
        data.qpos[2] = height + max(grounds)
        if self._tow.weight:
            data.qpos[25] = -self._tow.distance
        for film, state, (x, y, _) in zip(self._films, self.feet, feet, strict=True):
            film.touch_down(self._floor.depth(x, y))
            state.wet = self._floor.wet(x, y)
        self._mujoco.mj_kinematics(self.model, data)
        self._last = self._places.tolist()
        self._last_axes = self._axes.tolist()
        self._report([0.0] * 6)

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg.

        Where MuJoCo loses the solution the robot's feet stay as they were last.

        Raises
        ------
        InvalidInput
            When there are not six finite pressures.
        """
        check_pressures(pressures, 6)
        self._steps += 1
        self.time = self._steps * self.period
        model, data, state = self.model, self.data, self._state
        mj_step = self._mujoco.mj_step
        if not abs(state.item(0)) < _FAR:
            return
        self._aim()
        for _ in range(self._substeps):
            self._set_friction(pressures)
            mj_step(model, data)
            # The solver couples all joints: one that is lost takes the body with it.
            if not abs(state.item(0)) < _FAR:
                self._end('MuJoCo has lost the solution')
                return
            self._read_contacts()
        self._report(pressures)
        self._judge()

    def _aim(self) -> None:
        """Give the servos their set-points; they keep the last where a foot is out of reach."""
        # The gait has its own clock, which starts when the robot has settled.
        heading = self.body[2]
        path, swung = self._path, self._path.swings
        path.move(max(0.0, self.time - self._settle), -self._heading_gain * heading * self.period)
        for index, (before, now) in enumerate(zip(swung, path.swings, strict=True)):
            if now and not before:
                self._cleared[index] = False
            elif before and not now and not self._cleared[index]:
                self._end(f'leg {index + 1} does not clear the ground in its swing')
        targets: list[float] = []
        try:
            for leg, (x, y, height) in zip(self._geometry, self._path.feet, strict=True):
                targets += leg.angles(x, y, height - leg.tibia)
        except InvalidInput as error:
            self._end(f'leg {len(targets) // 3 + 1}: {error}')
            return
        self._targets = targets
        self._ctrl[:] = targets

    def _set_friction(self, pressures: Sequence[float]) -> None:
        """Write what each standing foot resists in the next step, from its load in the last."""
        for index, load in enumerate(self._loads):
            if load > LIGHT:
                self._write_friction(index, load, pressures[index], self._dt)
        tow = self._tow
        if tow.weight:
            x, y = self._sled_place.tolist()
            self._sled_friction[:2] = (
                tow.friction_wet if self._floor.wet(x, y) else tow.friction_dry
            )

    def _write_friction(self, index: int, load: float, pressure: float, drained: float) -> None:
        """Write what a foot resists with a load, N, after its film has drained for a time, s."""
        foot = self._foot
        dome_load = foot.dome_load(load, pressure) if pressure > 0.0 else 0.0
        sole_load = load - dome_load
        if self.feet[index].wet:
            film = self._films[index]
            film.drain(dome_load, sole_load, pressure, drained)
            grip = foot.resistance_of(
                dome_load, sole_load, pressure, film.under_domes, film.under_sole
            )
        else:
            grip = foot.resistance_of(dome_load, sole_load, pressure, 0.0, 0.0)
        self._ratios[index] = ratio = grip / load
        row = self._frictions[index]
        # A round sole that presses evenly resists twisting with 2/3 of its radius as lever.
        row[0] = row[1] = ratio
        row[2] = self._lever * ratio

    def _read_contacts(self) -> None:
        """Note the ground's force and moment on each foot in the step that is over."""
        model, data, wrench = self.model, self.data, self._wrench
        contact_force = self._mujoco.mj_contactForce
        loads, pushes, moments = [0.0] * 6, [(0.0, 0.0)] * 6, [0.0] * 6
        for contact, (_, geom) in enumerate(data.contact.geom.tolist()):
            index = self._index.get(geom)
            if index is not None:
                contact_force(model, data, contact, wrench)
                # The axes of a contact with level ground are z, y, -x.
                normal, left, back, moment, _, _ = wrench.tolist()
                loads[index], pushes[index] = normal, (-back, left)
                moments[index] = moment
        self._loads, self._pushes, self._moments = loads, pushes, moments

    def _report(self, pressures: Sequence[float]) -> None:
        dt, foot, floor = self.period, self._foot, self._floor
        softness = 1.0 / foot.shear_stiffness
        places, last = self._places.tolist(), self._last
        axes, last_axes = self._axes.tolist(), self._last_axes
        self._last, self._last_axes = places, axes
        for index, state in enumerate(self.feet):
            x, y, z = places[index]
            load, (push_x, push_y) = self._loads[index], self._pushes[index]
            state.position = (x - push_x * softness, y - push_y * softness, z - _POINT)
            state.force = (push_x, push_y, load)
            state.moment = self._moments[index]
            state.standing = load > 0.0
            state.grip = self._ratios[index] * load
            state.slip_speed = 0.0
            state.wet = floor.wet(x, y)
            if load <= LIGHT:
                self._approach(index, x, y, z - _POINT, pressures[index])
            elif load > SLIP_LOAD:
                step_x, step_y = x - last[index][0], y - last[index][1]
                way = math.hypot(step_x, step_y)
                if way > SLIP_SPEED * dt:
                    state.slip_speed = way / dt
                    state.slip_path += way
                turn = _turn(last_axes[index], axes[index])
                # As on the planar robot: sliding and turning share a foot's grip.
                if math.hypot(way, self._lever * turn) > SLIP_SPEED * dt:
                    self.dissipation -= push_x * step_x + push_y * step_y + state.moment * turn
            pressure = pressures[index]
            if pressure > 0.0 and foot.dome_load(load, pressure) < load:
                state.overload_time += dt

    def _approach(self, index: int, x: float, y: float, z: float, pressure: float) -> None:
        """Prepare the ground below a foot that carries nothing yet."""
        ground, clear = 0.0, CLEAR
        if self._floor.heights is not None:
            clear = _SHALLOW
            block = self.data.mocap_pos[index]
            ground = float(block[2])
            if z > ground + _SHALLOW:
                block[2] = self._floor.height(x, y)
        if z > ground + CLEAR:
            self._films[index].touch_down(self._floor.depth(x, y))
        if z > ground + clear:
            self._cleared[index] = True
        self._write_friction(index, LIGHT, pressure, 0.0)

    def _judge(self) -> None:
        """Note why the walk is no longer valid, the first time that it is not."""
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
    """Return how far a body has turned about the vertical, rad, small; both have its x and y rows.

    The vertical part of the turn's axis times its sine.
    """
    a, b, c, d, e, f = before
    u, v, w, x, y, z = now
    return 0.5 * (x * a + y * b + z * c - u * d - v * e - w * f)


def _line_step(scene: Scene) -> float:
    """Return the longest step, s, at which the line of a scene's towed load is sure to be stable.

    MuJoCo takes springs explicitly: an undamped one grows from 2/ω on, ω that of load and trunk.
    """
    tow = scene.tow
    if not tow.weight:
        return math.inf
    assert isinstance(scene.body, HexapodBody)
    trunk = scene.body.mass * (1.0 - 6.0 * (COXA_SHARE + FEMUR_SHARE + TIBIA_SHARE))
    longest = 1.0 / math.sqrt(tow.stiffness * (GRAVITY / tow.weight + 1.0 / trunk))
    if longest < _SHORTEST:
        raise ConfigError(
            f'scene {scene.name!r}: tow.weight = {tow.weight:g} N on a line of tow.stiffness ='
            f' {tow.stiffness:g} N/m needs steps of {longest:.2g} s, and {_SHORTEST:g} s is the'
            ' shortest: take a heavier load, none (weight 0), or a softer line'
        )
    return longest


def _legs(scene: Scene) -> list[Leg]:
    """Return the legs of a scene's robot once they are known to reach where the gait goes."""
    assert isinstance(scene.body, HexapodBody) and isinstance(scene.gait, TripodGait)
    body, gait = scene.body, scene.gait
    legs = []
    for number_, (home, bearing) in enumerate(zip(body.homes, BEARINGS, strict=True), 1):
        leg = Leg.standing_at(home, bearing, body)
        name = f'scene {scene.name!r}: leg {number_} at home ({home[0]:g}, {home[1]:g}) m'
        if leg.hip_y * home[1] <= 0.0:
            raise ConfigError(
                f'{name} needs its hip {leg.hip_y:+.4g} m to the left, beyond the middle: with'
                f' coxa = {body.coxa:g} m and femur = {body.femur:g} m the foot must be more than'
                f' {abs(home[1] - leg.hip_y):.4g} m to the side'
            )
        for step in range(-8, 9):
            height = gait.lift * math.cos(step * math.pi / 16.0) ** 2
            for up in (0.0, height):
                ahead = home[0] + gait.reach() * step / 8.0
                try:
                    angles = leg.angles(ahead, home[1], up - body.tibia)
                except InvalidInput as error:
                    raise ConfigError(f'{name}: {error}') from error
                if max(map(abs, angles)) > TRAVEL:
                    raise ConfigError(
                        f'{name}: {ahead - home[0]:+.4g} m ahead of it and {up:g} m up, a joint'
                        f' must turn {max(map(abs, angles)):.2f} rad; {TRAVEL:.2f} is allowed'
                    )
        legs.append(leg)
    return legs


def mjcf(scene: Scene, legs: Sequence[Leg], uneven: bool, settings: Settings, dt: float) -> str:
    """Return the robot, its load and the ground of each foot, in MuJoCo's XML.

    Links are rods with the shares of the mass above; what is left makes the trunk, placed and
    spread so that the whole has the scene's height of the centre of mass and inertia.

    Raises
    ------
    ConfigError
        When the legs alone have more inertia than the scene's body.
    """
    body, tow, slope = scene.body, scene.tow, scene.floor.slope
    assert isinstance(body, HexapodBody)
    tibia = body.tibia
    masses = [share * body.mass for share in (COXA_SHARE, FEMUR_SHARE, TIBIA_SHARE)]
    trunk = body.mass - 6.0 * sum(masses)
    sunk = (body.mass * body.height - 6.0 * tibia * (sum(masses) - masses[2] / 3.0)) / trunk
    yaw = body.inertia
    for leg, home in zip(legs, body.homes, strict=True):
        # Coxa and femur lie in one line at home, the tibia stands below its end.
        for mass, out, length in (
            (masses[0], 0.5 * leg.coxa, leg.coxa),
            (masses[1], leg.coxa + 0.5 * leg.femur, leg.femur),
        ):
            x = leg.hip_x + out * math.cos(leg.bearing)
            y = leg.hip_y + out * math.sin(leg.bearing)
            yaw -= mass * (x * x + y * y + length * length / 12.0)
        yaw -= masses[2] * (home[0] ** 2 + home[1] ** 2)
    if yaw <= 0.0:
        raise ConfigError(
            f'scene {scene.name!r}: body.inertia = {body.inertia:g} kg m2 is not allowed with'
            f' body.mass = {body.mass:g} kg: the legs have {6.0 * sum(masses) / body.mass:.0%} of'
            f' it, and alone make {body.inertia - yaw:.3g} kg m2'
        )
    roll = ROLL_SHARE * yaw

    def link(name: str, at: str, axis: str, mass: float, middle: str, inertia: str) -> str:
        return (
            f'<body name="{name}" {at}><joint name="{name}" axis="{axis}"/>'
            f'<inertial mass="{mass!r}" pos="{middle}" diaginertia="{inertia}"/>'
        )

    def rod(mass: float, length: float, along: int) -> str:
        # MuJoCo needs some inertia about the rod's own axis, too.
        across = mass * length * length / 12.0
        return ' '.join(repr(0.02 * across if axis == along else across) for axis in range(3))

    blocks, trees, pairs, servos = [], [], [], []
    for number_, leg in enumerate(legs, 1):
        name = f'leg_{number_}_'
        block = f'<geom name="block_{number_}" type="plane" size="0 0 1"/>'
        # Bodies cost time, also those that do not move.
        blocks.append(f'<body mocap="true">{block}</body>' if uneven else block)
        trees.append(
            link(name + 'coxa',
                 f'pos="{leg.hip_x!r} {leg.hip_y!r} 0" euler="0 0 {leg.bearing!r}"', '0 0 1',
                 masses[0], f'{leg.coxa / 2.0!r} 0 0', rod(masses[0], leg.coxa, 0))
            + link(name + 'femur', f'pos="{leg.coxa!r} 0 0"', '0 -1 0', masses[1],
                   f'{leg.femur / 2.0!r} 0 0', rod(masses[1], leg.femur, 0))
            + link(name + 'tibia', f'pos="{leg.femur!r} 0 0"', '0 -1 0', masses[2],
                   f'0 0 {-leg.tibia / 3.0!r}', rod(masses[2], leg.tibia, 2))
            + f'<geom name="foot_{number_}" size="{_POINT}" pos="0 0 {_POINT - leg.tibia!r}"/>'
            '</body></body></body>'
        )  # fmt: skip
        pairs.append(
            f'<pair name="foot_{number_}" geom1="block_{number_}" geom2="foot_{number_}"'
            ' condim="4"/>'
        )
        servos += [f'<position joint="{name}{joint}"/>' for joint in LINKS]
    load = line = ''
    if tow.weight:
        blocks.append('<geom name="ground" type="plane" size="0 0 1"/>')
        load = (
            f'<body name="sled" pos="0 0 {_POINT}">'
            '<joint type="slide" axis="1 0 0" armature="0" damping="0"/>'
            '<joint type="slide" axis="0 1 0" armature="0" damping="0"/>'
            '<joint type="slide" axis="0 0 1" armature="0" damping="0"/>'
            f'<inertial mass="{tow.weight / GRAVITY!r}" pos="0 0 0" diaginertia="1 1 1"/>'
            f'<geom name="sled" size="{_POINT}"/>'
            f'<site name="sled" pos="0 0 {tow.height - _POINT!r}"/></body>'
        )
        line = (
            f'<tendon><spatial name="line" stiffness="{tow.stiffness!r}"'
            f' springlength="0 {tow.distance!r}">'
            '<site site="hook"/><site site="sled"/></spatial></tendon>'
        )
        pairs.append('<pair name="sled" geom1="ground" geom2="sled" condim="3"/>')
    return f"""
<mujoco>
  <compiler angle="radian" inertiafromgeom="false" balanceinertia="false"/>
  <option timestep="{dt!r}" integrator="{settings.integrator}" cone="{settings.cone}"
          impratio="{settings.impratio!r}" tolerance="1e-6" jacobian="sparse"
          noslip_iterations="{settings.noslip_iterations}"
          gravity="{-GRAVITY * math.sin(slope)!r} 0 {-GRAVITY * math.cos(slope)!r}">
    <flag autoreset="disable"/>
  </option>
  <default>
    <geom contype="0" conaffinity="0"/>
    <joint damping="{STALL_TORQUE / NO_LOAD_SPEED!r}" armature="{ROTOR_INERTIA!r}"/>
    <position kp="{STALL_TORQUE / FULL_TORQUE_ERROR!r}"
              forcerange="{-STALL_TORQUE!r} {STALL_TORQUE!r}"/>
  </default>
  <worldbody>
    {''.join(blocks)}
    <body name="trunk">
      <freejoint/>
      <inertial mass="{trunk!r}" pos="0 0 {sunk - tibia!r}"
                diaginertia="{roll!r} {roll!r} {yaw!r}"/>
      <site name="hook" pos="0 0 {tow.height - tibia!r}"/>
      {''.join(trees)}
    </body>
    {load}
  </worldbody>
  <contact>{''.join(pairs)}</contact>
  {line}
  <actuator>{''.join(servos)}</actuator>
</mujoco>
"""
