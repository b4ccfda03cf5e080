# SPDX-License-Identifier: Apache-2.0
"""L0: walking mechanism of the thesis (5.2), one foot that pushes a body on wheels along a rail.

The body has one degree of freedom. The foot's force is at most its cap c, the wheels resist with a
drag F, and each step solves M (v - v0)/dt + c sgn(v - u) + F sgn(v) + M g sin(slope) = 0 for the
speed v of the body exactly, with u the speed at which the foot moves back under the body. The
springs' load and the wheels' drag do not depend on the slope. :class:`RailLeg` is one leg whose
pressure can change in each step; :func:`walk_many` walks many legs at once at fixed pressures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.configuration import instance, number
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import InvalidInput
from ros_pad.records import Array
from ros_pad.simulation.robot import FootState, Vector, check_pressures, contacts_of
from ros_pad.simulation.scene import RAIL_LEG, RailBody, RailGait, Scene
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

    def __init__(self, scene: Scene, floor: Floor, period: float) -> None:
        instance('scene', scene, Scene)
        instance('scene.body', scene.body, RailBody)
        instance('floor', floor, Floor)
        assert isinstance(scene.body, RailBody) and isinstance(scene.gait, RailGait)
        number('period', period, 's', above=True)
        self.legs: tuple[int, ...] = (1,)
        self.period = period
        self.time = 0.0
        self.feet = [FootState()]
        self.dissipation = 0.0
        self.verdict: str | None = None
        self.joint_names: tuple[str, ...] = ()
        self.joint_positions: tuple[float, ...] = ()
        self._body = scene.body
        self._gait = scene.gait
        self._foot = scene.foot.on_rough(scene.floor.roughness)
        self._floor = floor
        self._film = Film(self._foot, scene.floor.viscosity)
        self._downhill = GRAVITY * math.sin(scene.floor.slope)
        self._start = scene.settle
        self._steps = 0
        self._x = self.speed = 0.0
        self._offset = scene.gait.stroke / 2.0
        self._stands = True
        self._film.touch_down(floor.depth(self._offset, 0.0))

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
        gait = self._gait
        since = max(0.0, time - self._start) % gait.cycle
        if since < gait.stance:
            return True, 0.5 * gait.stroke * math.cos(math.pi * since / gait.stance), 0.0
        share = (since - gait.stance) / gait.swing
        height = gait.lift * math.sin(math.pi * share) ** 2
        return False, -0.5 * gait.stroke * math.cos(math.pi * share), height

    @property
    def contacts(self) -> Array:
        """Force, N, yaw moment, N m, and position, m, of each foot, (feet, 7)."""
        return contacts_of(self.feet)

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
        dt, state, foot = self.period, self.feet[0], self._foot
        self._steps += 1
        self.time = self._steps * dt
        stands, offset, height = self.plan(self.time)
        back = (self._offset - offset) / dt
        if stands and not self._stands:
            self._film.touch_down(self._floor.depth(self._x + offset, 0.0))
        self._stands, self._offset = stands, offset
        cap = 0.0
        overloaded = False
        if stands:
            load, pressure = self._body.load, pressures[0]
            domes = foot.dome_load(load, pressure)
            overloaded = pressure > 0.0 and domes < load
            state.wet = self._floor.wet(self._x + offset, 0.0)
            films = (0.0, 0.0)
            if state.wet:
                films = self._film.drain(domes, load - domes, pressure, dt)
            cap = foot.resistance_of(domes, load - domes, pressure, *films)
        free = self.speed - self._downhill * dt
        self.speed, force = push(free, back, cap, self._body, dt)
        self._x += self.speed * dt
        slip = self.speed - back if stands else 0.0
        # The marker is above the pads: their shear moves it away from the contact on the floor.
        state.position = (self._x + offset - force / foot.shear_stiffness, 0.0, height)
        state.force = (force, 0.0, self._body.load if stands else 0.0)
        state.standing = stands
        state.grip = cap
        state.slip_speed = abs(slip)
        state.slip_path += abs(slip) * dt
        self.dissipation += cap * abs(slip) * dt
        if overloaded:
            state.overload_time += dt


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


@dataclass(frozen=True)
class RailWalks:
    """Walks of many legs.

    Attributes
    ----------
    position, slip_path : ndarray (n,)
        Position of the body, and distance that the foot slipped, m.
    dissipation : ndarray (n,)
        Work lost in the slipping foot, J.
    arrival : ndarray (n,)
        Time at the end of the step in which the body reached its goal, s after the robot had
        settled; NaN where the body did not reach the goal.
    """

    position: np.ndarray
    slip_path: np.ndarray
    dissipation: np.ndarray
    arrival: np.ndarray


def walk_many(
    scenes: Sequence[Scene],
    floors: Sequence[Floor],
    pressures: Sequence[float],
    period: float,
    duration: float,
) -> RailWalks:
    """Walk many rail legs at once, each with its own scene, floor and fixed pressure.

    The steps are those of :meth:`RailLeg.step`, computed by NumPy for all legs together. This is
    possible because at fixed pressure the load of the domes and the drainage rate of a film are
    constant in a stance.

    Parameters
    ----------
    scenes : sequence of Scene
        n scenes with a rail leg.
    floors : sequence of Floor
        n floors.
    pressures : sequence of float
        n gauge pressures, Pa, from 0 to the foot's ceiling.
    period, duration : float
        Length of a step and of the walk, s, above 0, the same for all.

    Raises
    ------
    InvalidInput
        When lengths differ, a scene has no rail leg, or a number is out of its range.
    """
    number('period', period, 's', above=True)
    number('duration', duration, 's', above=True)
    if not len(scenes) == len(floors) == len(pressures):
        raise InvalidInput(
            f'{len(scenes)} scenes, {len(floors)} floors and {len(pressures)} pressures:'
            ' one of each is needed for each leg'
        )
    legs = _constants(scenes, floors, pressures)
    wet_at = _wetness(floors)
    count = len(scenes)
    x, speed, offset = np.zeros((3, count))
    offset += 0.5 * legs.stroke
    stood = np.ones(count, dtype=bool)
    fresh = np.where(wet_at(offset), legs.puddle, math.inf)
    drained, slipped, lost = np.zeros((3, count))
    arrival = np.full(count, math.nan)
    for step in range(1, round(duration / period) + 1):
        stands, planned = _plan(legs, step * period)
        back = (offset - planned) / period
        offset = planned
        wet = wet_at(x + offset)
        landed = stands & ~stood
        fresh[landed] = np.where(wet[landed], legs.puddle[landed], math.inf)
        drained[landed] = 0.0
        drained[stands & wet] += period
        stood = stands
        cap = _caps(legs, wet, fresh, drained)
        cap[~stands] = 0.0
        speed = _push_many(legs, speed, back, cap, period)
        x = x + speed * period
        slip = np.where(stands, np.abs(speed - back) * period, 0.0)
        slipped += slip
        lost += cap * slip
        arrival[np.isnan(arrival) & (x >= legs.goal)] = step * period
    return RailWalks(x, slipped, lost, arrival - legs.settle)


class _Legs(NamedTuple):
    """Constants of many legs at fixed pressures, arrays (n,) in SI units."""

    mass: np.ndarray
    drag: np.ndarray
    goal: np.ndarray
    stroke: np.ndarray
    stance: np.ndarray
    swing: np.ndarray
    settle: np.ndarray
    downhill: np.ndarray  # acceleration along -x, m/s²
    dome_dry: np.ndarray  # resistance of the domes in dry contact, N
    dome_floating: np.ndarray  # resistance of the domes on a film that carries them, N
    dome_drain: np.ndarray  # growth rate of 1/h² of the film under the domes, 1/(m² s)
    sole_dry: np.ndarray  # this and the next two: the same for the flat part of the sole
    sole_floating: np.ndarray
    sole_drain: np.ndarray
    critical_film: np.ndarray
    film_exponent: np.ndarray
    capillary: np.ndarray
    puddle: np.ndarray  # 1/h² of standing liquid, 1/m²


def _constants(
    scenes: Sequence[Scene], floors: Sequence[Floor], pressures: Sequence[float]
) -> _Legs:
    rows = []
    for scene, pressure in zip(scenes, pressures, strict=True):
        if scene.robot != RAIL_LEG:
            raise InvalidInput(f'scene {scene.name!r} has {scene.robot}: {RAIL_LEG} is needed')
        number('pressure', pressure, 'Pa', high=scene.foot.ceiling)
        rows.append(_row(scene, pressure))
    # With a depth of zero wet ground is dry: 1/h² is infinite.
    depths = [floor.film_thickness for floor in floors]
    puddle = np.array([depth**-2.0 if depth else math.inf for depth in depths])
    return _Legs._make([*np.array(rows).reshape(-1, len(_Legs._fields) - 1).T, puddle])


def _wetness(floors: Sequence[Floor]) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function of positions x, m, one on each floor, that returns which are wet."""
    kinds = [
        (floor, np.array([index for index, each in enumerate(floors) if each is floor]))
        for floor in {id(floor): floor for floor in floors}.values()
    ]

    def wet_at(x: np.ndarray) -> np.ndarray:
        wet = np.zeros(len(x), dtype=bool)
        for floor, where in kinds:
            wet[where] = floor.wet_along(x[where], np.zeros(len(where)))
        return wet

    return wet_at


def _plan(legs: _Legs, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which feet stand at a time, s, and their distances ahead of the body, m."""
    since = np.maximum(0.0, time - legs.settle) % (legs.stance + legs.swing)
    stands = since < legs.stance
    angle = np.pi * np.where(stands, since / legs.stance, 1.0 + (since - legs.stance) / legs.swing)
    return stands, 0.5 * legs.stroke * np.cos(angle)


def _caps(legs: _Legs, wet: np.ndarray, fresh: np.ndarray, drained: np.ndarray) -> np.ndarray:
    """Return the largest force of each foot, N, if it stands; ``drained`` is in s."""

    def resistance(dry: np.ndarray, floating: np.ndarray, film: np.ndarray) -> np.ndarray:
        touching = np.exp(-((film**-0.5 / legs.critical_film) ** legs.film_exponent))
        return touching * dry + (1.0 - touching) * floating

    return np.where(
        wet,
        resistance(legs.dome_dry, legs.dome_floating, fresh + legs.dome_drain * drained)
        + resistance(legs.sole_dry, legs.sole_floating, fresh + legs.sole_drain * drained)
        + np.where(fresh < math.inf, legs.capillary, 0.0),
        legs.dome_dry + legs.sole_dry,
    )


def _push_many(
    legs: _Legs, speed: np.ndarray, back: np.ndarray, cap: np.ndarray, dt: float
) -> np.ndarray:
    """Return the speeds of the bodies after a step, m/s, as :func:`push` does for one body."""
    free = speed - legs.downhill * dt
    foot, wheels = dt / legs.mass * cap, dt / legs.mass * legs.drag
    turned = np.where(back < 0.0, wheels - foot, foot - wheels)
    branches = np.stack([
        back, np.zeros(len(speed)), free + foot + wheels, free + turned, free - foot - wheels
    ])  # fmt: skip
    return np.sort(branches, axis=0)[2]


def _row(scene: Scene, pressure: float) -> tuple[float, ...]:
    """Return the constants of one leg at a fixed pressure, in the order of :class:`_Legs`."""
    body, gait = scene.body, scene.gait
    assert isinstance(body, RailBody) and isinstance(gait, RailGait)
    foot, viscosity = scene.foot.on_rough(scene.floor.roughness), scene.floor.viscosity
    domes = foot.dome_load(body.load, pressure)
    sole = body.load - domes
    both_dry = foot.resistance_of(domes, sole, pressure, 0.0, 0.0)
    dome_dry = foot.resistance_of(domes, 0.0, pressure, 0.0, 0.0)
    # The films drain by Stefan-Reynolds, see Film: under each of n domes the pressure p acts on
    # an area of N/(n p), under the flat sole the load acts on its whole area.
    return (
        body.mass, body.rolling_drag, body.goal, gait.stroke, gait.stance, gait.swing,
        scene.settle, GRAVITY * math.sin(scene.floor.slope),
        dome_dry, foot.boundary_friction * domes,
        4.0 * math.pi * foot.pads * pressure**2 / (3.0 * viscosity * domes) if domes else 0.0,
        both_dry - dome_dry, foot.boundary_friction * sole,
        4.0 * sole / (3.0 * viscosity * foot.sole_radius**2 * foot.sole_area),
        foot.critical_film, foot.film_exponent,
        foot.pads * foot.capillary_force if domes else 0.0,
    )  # fmt: skip
