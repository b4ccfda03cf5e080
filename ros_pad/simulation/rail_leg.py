# SPDX-License-Identifier: Apache-2.0
"""L0: the thesis' walking mechanism (5.2), one foot that pushes a body on wheels along a rail.

One degree of freedom. The foot's force is at most its cap c, the wheels resist with a drag F, and
each step solves M (v - v0)/dt + c sgn(v - u) + F sgn(v) + M g sin(slope) = 0 for the speed v of
the body exactly, u being the speed at which the foot goes back under it. The springs' load and the
wheels' drag are what they are, on a slope as on the level. :class:`RailLeg` is one leg that can be
steered; :func:`walk_many` walks many legs at once at fixed pressures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.robot import check_pressures
from ros_pad.simulation.scene import RailBody
from ros_pad.simulation.scene import RailGait
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor


class RailLeg:
    """A body on a rail with one foot.

    Parameters
    ----------
    scene : Scene
        One with a rail leg.
    floor : Floor
        The ground.
    period : float
        Step, s, > 0.

    Raises
    ------
    InvalidInput
        When the period is not above zero.
    """

    def __init__(self, scene: Scene, floor: Floor, period: float) -> None:
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
        self._x = self._speed = 0.0
        self._offset = scene.gait.stroke / 2.0
        self._stands = True
        self._film.touch_down(floor.depth(self._offset, 0.0))

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body."""
        return self._x, 0.0, 0.0

    def _plan(self, time: float) -> tuple[bool, float, float]:
        """Whether the foot stands, where it is ahead of the body, and how high, m."""
        gait = self._gait
        since = max(0.0, time - self._start) % gait.cycle
        if since < gait.stance:
            return True, 0.5 * gait.stroke * math.cos(math.pi * since / gait.stance), 0.0
        share = (since - gait.stance) / gait.swing
        height = gait.lift * math.sin(math.pi * share) ** 2
        return False, -0.5 * gait.stroke * math.cos(math.pi * share), height

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with the pad's gauge pressure, Pa, in a sequence of one.

        Raises
        ------
        InvalidInput
            When there is not one finite pressure.
        """
        check_pressures(pressures, 1)
        dt, state, foot = self.period, self.feet[0], self._foot
        self._steps += 1
        self.time = self._steps * dt
        stands, offset, height = self._plan(self.time)
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
                self._film.drain(domes, load - domes, pressure, dt)
                films = self._film.under_domes, self._film.under_sole
            cap = foot.resistance_of(domes, load - domes, pressure, *films)
        force = self._push(cap, back, dt)
        self._x += self._speed * dt
        slip = self._speed - back if stands else 0.0
        # What stands on the floor is the contact; the marker is above soft pads, which shear.
        state.position = (self._x + offset - force / foot.shear_stiffness, 0.0, height)
        state.force = (force, 0.0, self._body.load if stands else 0.0)
        state.standing = stands
        state.grip = cap
        state.slip_speed = abs(slip)
        state.slip_path += abs(slip) * dt
        self.dissipation += cap * abs(slip) * dt
        if overloaded:
            state.overload_time += dt

    def _push(self, cap: float, back: float, dt: float) -> float:
        """Solve the step for the speed of the body; return the floor's force on the foot.

        The speed minimises ½ (v - v1)² + (dt/M) (c |v - u| + F |v|), v1 = v0 - g dt sin(slope)
        being what it would be without foot and wheels; the minimiser of a parabola
        and two kinks is the median of the kinks and of the three smooth branches.
        """
        mass, drag = self._body.mass, self._body.rolling_drag
        free = self._speed - self._downhill * dt
        foot, wheels = dt / mass * cap, dt / mass * drag
        low, high = (foot, wheels) if back < 0.0 else (wheels, foot)
        branches = (free + foot + wheels, free - low + high, free - foot - wheels)
        speed = self._speed = sorted((back, 0.0, *branches))[2]
        if speed == 0.0:
            # The wheels hold too, so only a slipping foot has a force that is known.
            return math.copysign(cap, back) if back else 0.0
        return mass * (speed - free) / dt + math.copysign(drag, speed)


@dataclass(frozen=True)
class RailWalks:
    """Where many legs have come.

    Attributes
    ----------
    position, slip_path : ndarray (n,)
        Of the body, and how far the foot slid, m.
    dissipation : ndarray (n,)
        Work lost in the slipping foot, J.
    arrival : ndarray (n,)
        Time at the end of the step in which the body came to its goal, s after it had settled;
        NaN where it did not.
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

    The same steps as :meth:`RailLeg.step`, made by NumPy for all legs together. At fixed pressure
    the load of the domes and the rate at which a film drains do not change in a stance.

    Parameters
    ----------
    scenes : sequence of Scene
        n scenes with a rail leg.
    floors : sequence of Floor
        n floors.
    pressures : sequence of float
        n gauge pressures, Pa, from 0 to the foot's ceiling.
    period, duration : float
        Step and length of the walk, s, > 0, the same for all.

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
    rows = []
    for scene, pressure in zip(scenes, pressures, strict=True):
        if scene.robot != 'rail_leg':
            raise InvalidInput(f'scene {scene.name!r} has a {scene.robot}: a rail_leg is needed')
        number('pressure', pressure, 'Pa', high=scene.foot.ceiling)
        rows.append(_row(scene, pressure))
    (
        mass, drag, goal, stroke, stance, swing, settle, downhill,
        dome_dry, dome_wet, dome_drain, sole_dry, sole_wet, sole_drain, critical, exponent,
        capillary,
    ) = np.array(rows).reshape(-1, 17).T  # fmt: skip
    # A depth of zero is dry ground: no film at all, 1/h² is infinite.
    depths = [floor.film_thickness for floor in floors]
    puddle = np.array([depth**-2.0 if depth else math.inf for depth in depths])
    kinds = [
        (floor, np.array([index for index, each in enumerate(floors) if each is floor]))
        for floor in {id(floor): floor for floor in floors}.values()
    ]

    def wet_at(x: np.ndarray) -> np.ndarray:
        wet = np.zeros(len(x), dtype=bool)
        for floor, where in kinds:
            wet[where] = floor.wet_along(x[where], np.zeros(len(where)))
        return wet

    def resistance(dry: np.ndarray, floating: np.ndarray, film: np.ndarray) -> np.ndarray:
        touching = np.exp(-((film**-0.5 / critical) ** exponent))
        return touching * dry + (1.0 - touching) * floating

    x, speed, offset = np.zeros((3, len(rows)))
    offset += 0.5 * stroke
    stood = np.ones(len(rows), dtype=bool)
    fresh = np.where(wet_at(offset), puddle, math.inf)
    drained, slipped, lost = np.zeros((3, len(rows)))
    arrival = np.full(len(rows), math.nan)
    foot_share, wheels = period / mass, period / mass * drag
    for step in range(1, round(duration / period) + 1):
        since = np.maximum(0.0, step * period - settle) % (stance + swing)
        stands = since < stance
        angle = np.pi * np.where(stands, since / stance, 1.0 + (since - stance) / swing)
        planned = 0.5 * stroke * np.cos(angle)
        back = (offset - planned) / period
        offset = planned
        wet = wet_at(x + offset)
        landed = stands & ~stood
        fresh[landed] = np.where(wet[landed], puddle[landed], math.inf)
        drained[landed] = 0.0
        drained[stands & wet] += period
        stood = stands
        cap = np.where(
            wet,
            resistance(dome_dry, dome_wet, fresh + dome_drain * drained)
            + resistance(sole_dry, sole_wet, fresh + sole_drain * drained)
            + np.where(fresh < math.inf, capillary, 0.0),
            dome_dry + sole_dry,
        )
        cap[~stands] = 0.0
        free, foot = speed - downhill * period, foot_share * cap
        turned = np.where(back < 0.0, wheels - foot, foot - wheels)
        branches = np.stack([
            back, np.zeros(len(rows)), free + foot + wheels, free + turned, free - foot - wheels
        ])  # fmt: skip
        speed = np.sort(branches, axis=0)[2]
        x = x + speed * period
        slip = np.where(stands, np.abs(speed - back) * period, 0.0)
        slipped += slip
        lost += cap * slip
        arrival[np.isnan(arrival) & (x >= goal)] = step * period
    return RailWalks(x, slipped, lost, arrival - settle)


def _row(scene: Scene, pressure: float) -> tuple[float, ...]:
    """Return the numbers that a walk of one leg at a fixed pressure needs."""
    body, gait = scene.body, scene.gait
    assert isinstance(body, RailBody) and isinstance(gait, RailGait)
    foot, viscosity = scene.foot.on_rough(scene.floor.roughness), scene.floor.viscosity
    domes = foot.dome_load(body.load, pressure)
    sole = body.load - domes
    both_dry = foot.resistance_of(domes, sole, pressure, 0.0, 0.0)
    dome_dry = foot.resistance_of(domes, 0.0, pressure, 0.0, 0.0)
    # Domes: p acts on A/n each, A = N/p; sole: N on all of it (Stefan-Reynolds, see Film).
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
