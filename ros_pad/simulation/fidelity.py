# SPDX-License-Identifier: Apache-2.0
"""Choose the fidelity level for a scene, and list the physics that the level leaves out.

The errors of the levels against the top one were measured on random scenes (``python -m studies
fidelity``) and are in ``config/fidelity.yaml``. They depend on a scene's grip margin (*reserve*):
capacity over demand of tangential force, on the ground where the capacity is least. Well above
one, feet stick and all levels agree; near one, feet slip on some levels and not on others.
"""

from __future__ import annotations

import bisect
import functools
import importlib.util
import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace

import yaml

from ros_pad import configuration
from ros_pad.configuration import choice
from ros_pad.contact import WATER
from ros_pad.contact import inflate
from ros_pad.contact import pressure_for
from ros_pad.contact import trapped_film
from ros_pad.contact.film import Film
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.resistance import THICK_FILM
from ros_pad.contact.squeeze import DIMPLE
from ros_pad.contact.squeeze import STIFF
from ros_pad.contact.squeeze import TRAPPED
from ros_pad.contact.squeeze import dome_dimple
from ros_pad.contact.squeeze import dry_share
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoEquilibrium
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.rail_leg import walk_many
from ros_pad.simulation.robot import SimulatedRobot
from ros_pad.simulation.scene import RAIL_LEG
from ros_pad.simulation.scene import LeggedBody
from ros_pad.simulation.scene import RailGait
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

FIDELITIES = ('auto', 'L0', 'L1', 'L2')
SOLE_MODULUS = 3.95e5
"""Reduced modulus of a sole whose foot names no material, Pa: Dragon Skin 10, four times 2 C1 of
``config/materials``, times 1.88."""

ATMOSPHERE = 101325.0  # Pa

_MARGIN = 1.2  # pressure margin with which a controller chooses the pressure of a dome by default


@dataclass(frozen=True)
class ChosenLevel:
    """A fidelity level for a scene, and the bound on its error.

    Attributes
    ----------
    level : str
        ``L0``, ``L1`` or ``L2``.
    bound : float
        Largest error of the distance that was measured on scenes with a similar grip margin, with
        an allowance. It is relative to the distance on the top level, or to half of the distance
        without slip if that is more. Infinite where the error has no bound, and for scenes outside
        the range of the measured ones.
    reserve : float
        Grip margin of the scene, see :func:`reserve`.
    note : str
        Bound and grip margin in words, and whether the scene requires a smaller error.
    """

    level: str
    bound: float
    reserve: float
    note: str


@dataclass(frozen=True)
class Omission:
    """A physical term that a trial leaves out.

    Attributes
    ----------
    term : str
        Name of the term.
    bound : float or None
        Bound on the relative effect of the term; None if no bound is known.
    reason : str
        To what the bound is relative, and its source.
    """

    term: str
    bound: float | None
    reason: str


@dataclass(frozen=True)
class ErrorTable:
    """Errors of the levels by grip margin, measured by ``python -m studies fidelity``.

    Attributes
    ----------
    reserves : tuple of float
        Lower ends of the classes of grip margin, rising from 0.
    bounds : dict of tuple
        For each level, the bound on its error in each class.
    ranges : dict of dict
        For each robot and each value of a scene (dotted name), lowest and highest value of the
        measured scenes.
    """

    reserves: tuple[float, ...]
    bounds: dict[str, tuple[float, ...]]
    ranges: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)

    @classmethod
    @functools.cache
    def load(cls) -> ErrorTable:
        """Read the table in ``config/fidelity.yaml``.

        Raises
        ------
        ConfigError
            When the file is missing or is not as ``python -m studies fidelity`` writes it.
        """
        path = configuration.shared_folder() / 'fidelity.yaml'
        try:
            values = configuration.read_yaml(path.read_text(encoding='utf-8'))
            reserves = tuple(float(value) for value in values['reserves'])
            bounds = {
                level: tuple(float(value) for value in values['bounds'][level])
                for level in FIDELITIES[1:]
            }
            ranges = {
                robot: {
                    name: (float(low), float(high))
                    for name, (low, high) in values['ranges'][robot].items()
                }
                for robot in values['ranges']
            }
            assert reserves[0] == 0.0 and list(reserves) == sorted(reserves)
            assert all(len(row) == len(reserves) for row in bounds.values())
        except (OSError, yaml.YAMLError, LookupError, TypeError, ValueError, AssertionError) as e:
            raise ConfigError(
                f'{path}: the errors of the fidelity levels cannot be read ({e!r}): write the file'
                ' again with python -m studies fidelity'
            ) from e
        return cls(reserves, bounds, ranges)

    def bound(self, level: str, reserve: float) -> float:
        """Return the bound on the error of a level for a grip margin from 0."""
        return self.bounds[level][bisect.bisect_right(self.reserves, reserve) - 1]

    def beyond(self, scene: Scene) -> str:
        """Return as text the values of a scene outside the measured ranges; empty if none are."""
        if self.ranges and scene.robot not in self.ranges:
            return f'robot = {scene.robot}, measured for {", ".join(self.ranges)}'
        found = [
            f'{name} = {value:g}, measured from {low:g} to {high:g}'
            for name, (low, high) in self.ranges.get(scene.robot, {}).items()
            if not low <= (value := operator.attrgetter(name)(scene)) <= high
        ]
        if self.ranges and isinstance(scene.gait, WalkingGait) and not _walks_as_usual(scene):
            found.append(f'phases or pushes of the gait, measured for those of {scene.robot}')
        return ', '.join(found)


def _walks_as_usual(scene: Scene) -> bool:
    """Return whether the gait has the phases and pushes of the robot's own."""
    assert isinstance(scene.body, LeggedBody) and isinstance(scene.gait, WalkingGait)
    usual, gait = scene.body.robot.gait, scene.gait
    if usual is None or usual.pushes != gait.pushes:
        return False
    apart = (
        a - b - (gait.middles[0] - usual.phases[0])
        for a, b in zip(gait.middles, usual.phases, strict=True)
    )
    return all(abs(math.remainder(each, 1.0)) < 1e-6 for each in apart)


def choose(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> ChosenLevel:
    """Return the level for a scene, and the bound on its error.

    ``auto`` takes the cheapest level whose bound is within ``scene.accuracy``, else the best
    available one; for a legged robot without MuJoCo that is L1.

    Parameters
    ----------
    scene : Scene
        Scene to be walked.
    fidelity : str
        ``auto`` or a level.
    policy : str or None
        Policy of the feet; None takes the scene's own.

    Raises
    ------
    InvalidInput
        When the level does not exist, or does not model the scene's robot.
    """
    known = _levels(scene, fidelity)
    own, table = reserve(scene, policy), ErrorTable.load()
    beyond = table.beyond(scene)
    bounds = {level: math.inf if beyond else table.bound(level, own) for level in known}
    missing = 'L2' in known and importlib.util.find_spec('mujoco') is None
    level = fidelity
    if fidelity == 'auto':
        available = known[:1] if missing else known
        enough = [each for each in available if bounds[each] <= scene.accuracy]
        level = (enough or available[-1:])[0]
    bound = bounds[level]
    if beyond:
        within = f'of unknown error ({beyond})'
    elif bound == math.inf:
        within = 'of unbounded error'
    else:
        within = f'within {100.0 * bound:.0f} % of the top level'
    note = f'grip capacity {own:.2g} times the demand: the distance on {level} is {within}'
    if bound > scene.accuracy:
        note += f', but the scene requires {100.0 * scene.accuracy:.0f} %'
        if missing and level == 'L1':
            note += '; pip install "ros_pad[mujoco]" adds L2'
    return ChosenLevel(level, bound, own, note)


def level(
    scene: Scene, fidelity: str = 'auto', policy: str | None = None, joints: bool = False
) -> str:
    """Return the name of the level that :func:`choose` returns, with the same errors.

    With ``joints`` it must be one with joints: ``auto`` takes L2, others are refused.
    """
    if joints:
        known = _levels(scene, fidelity)
        if fidelity not in ('auto', 'L2') or 'L2' not in known:
            given = f'scene {scene.name!r}' if 'L2' not in known else f'fidelity = {fidelity!r}'
            raise InvalidInput(
                f"sensing = 'joints' is not allowed with {given}: it needs fidelity L2, which"
                ' has joints'
            )
        return 'L2'
    if fidelity == 'auto':
        return choose(scene, fidelity, policy).level
    _levels(scene, fidelity)
    return fidelity


def _levels(scene: Scene, fidelity: str) -> tuple[str, ...]:
    """Return the levels that model a scene's robot.

    Raise `InvalidInput` if ``fidelity`` is neither ``auto`` nor one of them.
    """
    choice('fidelity', fidelity, FIDELITIES)
    known = ('L0',) if scene.robot == RAIL_LEG else ('L1', 'L2')  # the cheapest first
    if fidelity not in ('auto', *known):
        raise InvalidInput(
            f'fidelity = {fidelity!r} is not allowed: scene {scene.name!r} has {scene.robot},'
            f' which only {" and ".join(known)} model{"s" if len(known) == 1 else ""}'
        )
    return known


def build(scene: Scene, floor: Floor, period: float, fidelity: str = 'auto') -> SimulatedRobot:
    """Return the robot of a scene on a floor, with a step of ``period`` seconds.

    Raises
    ------
    InvalidInput
        As by :func:`choose`, and when the period is not finite and above 0.
    ConfigError
        For L2 when MuJoCo is missing, or the scene cannot be built as :class:`FullRobot`.
    """
    name = level(scene, fidelity)
    if name == 'L0':
        return RailLeg(scene, floor, period)
    if name == 'L1':
        return PlanarRobot(scene, floor, period)
    return FullRobot(scene, floor, period)


def reserve(scene: Scene, policy: str | None = None) -> float:
    """Return the grip margin: capacity over demand, on the ground with the least capacity.

    Parameters
    ----------
    scene : Scene
        Scene to be walked.
    policy : str or None
        ``flat``, ``dome``, or a policy that makes feet domes only on wet ground; None takes the
        scene's own.

    Returns
    -------
    float
        Grip margin, from 0. The capacity is that of a foot with its expected load in mid-stance,
        when its film has drained for half of the stance. The demand has three parts: the gait's
        peak acceleration of body and towed load, the drag of that load or of the wheels, and the
        slope. Feet and load may stand on different ground. In a scene with faults each foot may
        also have the morphology that the policy does not choose.
    """
    policy = scene.policy if policy is None else policy
    wets = {'dry': (False,), 'wet': (True,)}.get(scene.floor.kind, (False, True))
    grip = math.inf
    for wet in wets:
        dome = policy == 'dome' or (policy != 'flat' and wet)
        morphologies = (False, True) if scene.faults else (dome,)
        grip = min(grip, *(mid_stance_grip(scene, each, wet) for each in morphologies))
    body, gait, slope = scene.body, scene.gait, scene.floor.slope
    if isinstance(gait, RailGait) or not isinstance(body, LeggedBody):
        assert isinstance(gait, RailGait) and not isinstance(body, LeggedBody)
        peak = 0.5 * gait.stroke * (math.pi / gait.stance) ** 2
        demand = body.mass * (peak + GRAVITY * abs(math.sin(slope))) + body.rolling_drag
        return grip * body.load / demand
    tow = scene.tow
    weight = body.mass * GRAVITY * math.cos(slope)
    drag = max(tow.friction_wet if wet else tow.friction_dry for wet in wets)
    demand = (body.mass + tow.weight / GRAVITY) * (
        gait.peak_acceleration + GRAVITY * abs(math.sin(slope))
    ) + drag * tow.weight * math.cos(slope)
    return grip * weight / demand


def mid_stance_grip(scene: Scene, dome: bool, wet: bool) -> float:
    """Return the tangential resistance of a foot in mid-stance over its load."""
    stand = _Stand(scene, dome)
    films = stand.films(0.5 * _stance(scene)) if wet else (0.0, 0.0)
    return stand.resistance(*films) / scene.expected_load


class _Stand:
    """A foot of a scene under its expected load: how domes and flat sole share it."""

    def __init__(self, scene: Scene, dome: bool) -> None:
        self.foot, self.floor = scene.foot.on_rough(scene.floor.roughness), scene.floor
        self.pressure = _dome_pressure(scene) if dome else 0.0
        self.on_domes = self.foot.dome_load(scene.expected_load, self.pressure)
        self.on_sole = scene.expected_load - self.on_domes

    def films(self, time: float) -> tuple[float, float]:
        """Return the films under domes and sole after a time, s, by Stefan and Reynolds, m."""
        film = Film(self.foot, self.floor.viscosity)
        film.touch_down(self.floor.film_thickness)
        return film.drain(self.on_domes, self.on_sole, self.pressure, time)

    def resistance(self, dome_film: float, sole_film: float) -> float:
        return self.foot.resistance_of(
            self.on_domes, self.on_sole, self.pressure, dome_film, sole_film
        )

    @property
    def discs(self) -> tuple[int, float]:
        """Number and radius, m, of the discs that touch: the whole sole, or the domes."""
        if self.on_sole > 0.0:
            return 1, self.foot.sole_radius
        pads = self.foot.pads
        return pads, math.sqrt(self.on_domes / self.pressure / pads / math.pi)

    def dimples(self, time: float) -> Iterator[tuple[str, float, float, float]]:
        """Yield for domes and sole, if they carry load: name, and films after a time, s, in m.

        These are the rigid film, and with a soft surface the dimple in its middle and its mean.
        """
        foot, (dome_film, sole_film) = self.foot, self.films(time)
        if self.on_domes > 0.0:
            contact = math.sqrt(self.on_domes / self.pressure / foot.pads / math.pi)
            sphere = float(inflate(foot.pad, self.pressure).sphere_radius)
            middle = dome_dimple(contact, sphere, self.pressure, time, self.floor.viscosity)
            yield 'domes', dome_film, middle, 0.5 * middle
        if self.on_sole > 0.0:
            material = foot.pad.material
            modulus = 4.0 * material.shear_modulus if material else SOLE_MODULUS
            mean = trapped_film(foot.sole_radius, modulus, self.on_sole / foot.sole_area)
            mean = min(mean, self.floor.film_thickness)
            yield 'sole', sole_film, DIMPLE / TRAPPED * mean, mean


def _stance(scene: Scene) -> float:
    gait = scene.gait
    return gait.stance if isinstance(gait, RailGait) else gait.duty * gait.cycle


def _on_wet_ground(scene: Scene, policy: str | None) -> _Stand:
    return _Stand(scene, (scene.policy if policy is None else policy) != 'flat')


def omitted(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> list[Omission]:
    """Return what a trial of this scene leaves out on a level, with bounds on its effect.

    Parameters
    ----------
    scene, fidelity, policy
        As for :func:`choose`.

    Raises
    ------
    InvalidInput
        When the level does not exist, or does not model the scene's robot.
    """
    name = level(scene, fidelity, policy)
    terms = [] if scene.floor.kind == 'dry' else _omitted_of_liquid(scene, policy)
    if scene.foot.pad.material is not None:
        terms.append(
            Omission(
                'pads that balloon',
                None,
                f'above {pressure_end(scene.foot.pad)[0]:.6g} Pa the air under the pads keeps its'
                f' volume; the ceiling of the foot is {scene.foot.ceiling:g} Pa',
            )
        )
    if name == 'L0':
        terms.append(_friction_of_the_rail(scene, policy))
    terms.append(_omitted_joints(scene, policy) if name == 'L1' else _soft_pads(scene))
    if name == 'L2':
        terms.append(
            Omission('size of the sole', None, 'the foot is a point on an ankle that tilts freely')
        )
    return terms


def _omitted_of_liquid(scene: Scene, policy: str | None) -> list[Omission]:
    foot, terms = scene.foot, [_suction(scene, policy)]
    soft = _soft_film(scene, policy)
    if soft is not None:
        terms.append(soft)
    # A meniscus resists sliding at most by its hysteresis, γ w (cos θ_rec - cos θ_adv) <= 2 γ w,
    # with w = 2 r0 for each pad. Only domes have a meniscus.
    capillary = foot.pads * 2.0 * WATER.surface_tension * 2.0 * foot.pad.radius
    if not foot.capillary_force:
        terms.append(
            Omission(
                'capillary force of the pads',
                capillary / (foot.friction * scene.expected_load),
                'of the friction of a loaded foot: full hysteresis of the contact angle (180'
                ' to 0 degrees) on every pad',
            )
        )
    terms.append(
        Omission(
            'liquid dragged under a slipping foot',
            None,
            'the film is assumed to move with the foot; at 10 mm/s a plane wedge drags at most'
            f' {1e6 * dragged_film(scene, 0.01):.2g} um under a dome; a film of'
            f' {1e6 * foot.critical_film:.2g} um leaves 1/e of dry contact',
        )
    )
    if scene.floor.roughness:
        terms.append(
            Omission(
                'liquid held in the valleys of a rough floor',
                None,
                'roughness enters as one composite height of pad and floor',
            )
        )
    return terms


def _soft_film(scene: Scene, policy: str | None) -> Omission | None:
    """Return what Stefan and Reynolds leave out under a soft foot; None if that is nothing."""
    stand, time = _on_wet_ground(scene, policy), 0.5 * _stance(scene)
    foot, found = stand.foot, []
    for name, rigid, middle, mean in stand.dimples(time):
        if mean >= STIFF * rigid:
            dry = math.exp(-((rigid / foot.critical_film) ** foot.film_exponent))
            left = dry_share(middle, foot.critical_film, foot.film_exponent)
            found.append(
                f'; for a load at once, under the {name} the dimple is'
                f' {_brief(1e6 * middle)} um thick and leaves {100.0 * left:.1f} % of the contact'
                f' dry, the rigid film of {_brief(1e6 * rigid)} um {100.0 * dry:.1f} %'
            )
    if not found:
        return None
    least = stand.resistance(THICK_FILM, THICK_FILM)
    return Omission(
        'dimple of the film under a soft foot',
        1.0 - least / stand.resistance(*stand.films(time)),
        'of the friction on wet ground in mid-stance: no dry contact at all' + ''.join(found),
    )


def _brief(value: float) -> str:
    return f'{float(f"{value:.3g}"):g}'


def _suction(scene: Scene, policy: str | None) -> Omission:
    """Return the pull of the film at lift-off.

    A policy that adapts has flat feet on wet ground, too: until it has found out.
    """
    policy = scene.policy if policy is None else policy
    domes = {'flat': (False,), 'dome': (True,)}.get(policy, (False, True))
    terms = [_suction_under(_Stand(scene, dome), scene) for dome in domes]
    return max(terms, key=lambda term: term.bound or 0.0)


def _suction_under(stand: _Stand, scene: Scene) -> Omission:
    """Return the pull of the film under a foot at lift-off.

    Rigid discs that part at a speed V: F = 3 π η a⁴ V/(2 h³), at most the atmosphere on them. A
    swing begins with h = k t²/2, so F falls below that after (12 π η a⁴/(k² F))^(1/5).
    """
    gait, stance = scene.gait, _stance(scene)
    swing = gait.swing if isinstance(gait, RailGait) else gait.cycle - stance
    count, radius = stand.discs
    resistance = 1.5 * math.pi * scene.floor.viscosity * count * radius**4
    most = ATMOSPHERE * count * math.pi * radius**2
    rise = 2.0 * gait.lift * (math.pi / swing) ** 2
    until = (8.0 * resistance / (rise**2 * most)) ** 0.2
    films = stand.films(stance)
    film = films[1] if stand.on_sole > 0.0 else films[0]
    return Omission(
        'suction of the film at lift-off',
        1.25 * most * until / (scene.expected_load * stance),
        f'of the impulse of a load of {_brief(scene.expected_load)} N in its stance: at most'
        f' {_brief(most)} N, the atmosphere on the contact, for {_brief(1e3 * until)} ms; rigid'
        f' discs with a film of {_brief(1e6 * film)} um pull with'
        f' {_brief(1e-3 * resistance / film**3)} N a mm/s',
    )


def _omitted_joints(scene: Scene, policy: str | None) -> Omission:
    bound = choose(scene, 'L1', policy).bound
    return Omission(
        'joints, servos, scuffing at touch-down, swinging legs, pitch and roll',
        bound if bound < math.inf else None,
        'of the distance: L1 against L2 on random scenes with a similar grip margin; on dry flat'
        ' ground feet slip 3 to 4 mm a cycle on L2, 0.1 mm on L1',
    )


def _soft_pads(scene: Scene) -> Omission:
    gait, foot = scene.gait, scene.foot
    grip = max(mid_stance_grip(scene, False, False), mid_stance_grip(scene, True, False))
    steps, length = (1.0, gait.stroke) if isinstance(gait, RailGait) else (2.0, gait.stride)
    return Omission(
        'effect of soft pads on the motion of the body',
        steps * grip * scene.expected_load / foot.shear_stiffness / length,
        'of the distance: at each step the pads shear by the whole grip over their stiffness, and'
        ' nothing of this shear is recovered',
    )


def dragged_film(scene: Scene, speed: float) -> float:
    """Return the thickest film, m, that a plane wedge can drag under domes at a slip speed, m/s.

    The optimum slider of Reynolds' equation (Rayleigh 1918; Hamrock, Fundamentals of Fluid Film
    Lubrication, ch. 8) carries a mean pressure of 0.160 η U L / h².
    """
    pressure = _dome_pressure(scene)
    width = math.sqrt(scene.expected_load / pressure / scene.foot.pads / math.pi)
    return math.sqrt(0.160 * scene.floor.viscosity * speed * 2.0 * width / pressure)


def _friction_of_the_rail(scene: Scene, policy: str | None) -> Omission:
    """Return how much one per cent of friction changes the distance on the rail.

    The effect is large near the drag of the wheels, where the distance is ill-conditioned.
    """
    foot, policy = scene.foot, scene.policy if policy is None else policy
    scenes = [
        replace(
            scene,
            foot=replace(
                foot,
                friction=factor * foot.friction,
                shear_strength=factor * foot.shear_strength,
                boundary_friction=factor * foot.boundary_friction,
            ),
        )
        for factor in (0.995, 1.005)
    ]
    wet = scene.floor.kind != 'dry'
    domed = policy == 'dome' or (policy != 'flat' and wet)
    pressure = _dome_pressure(scene) if domed else 0.0
    gait = scene.gait
    assert isinstance(gait, RailGait)
    duration = scene.settle + 10.0 * gait.cycle
    floor = Floor.uniform(wet, scene.floor.film_thickness)
    walks = walk_many(scenes, [floor, floor], [pressure, pressure], 0.004, duration)
    less, more = walks.position
    return Omission(
        'friction off by one per cent',
        (more - less) / less if less > 0.0 else None,
        'of the distance, on a uniform floor: near the drag of the wheels a little more or less'
        ' friction moves the body much further, or not at all',
    )


def _dome_pressure(scene: Scene) -> float:
    """Return the pressure of a dome, Pa: the scene's, or what a controller would choose."""
    foot, load = scene.foot, scene.expected_load
    if scene.dome_pressure:
        return scene.dome_pressure
    try:
        wanted = pressure_for(foot.pad, load / foot.pads, foot.limit, margin=_MARGIN)
    except NoEquilibrium:
        wanted = foot.ceiling
    return min(foot.ceiling, float(wanted))
