# SPDX-License-Identifier: Apache-2.0
"""Which rung of the simulation ladder a scene is run on, and what that leaves out.

How far the rungs are from the top one was measured on random scenes (``bench/fidelity.py``) and is
kept in ``config/fidelity.yaml``. What decides is a scene's *reserve*: the grip of its feet on the
ground where they hold least, over what the walk asks of them. Well above one, feet stick and all
rungs agree; near one they slip on some rungs and not on others.
"""

from __future__ import annotations

import bisect
import functools
import importlib.util
import math
import operator
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace

import yaml

from ros_pad import configuration
from ros_pad.contact import WATER
from ros_pad.contact import pressure_for
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoEquilibrium
from ros_pad.simulation.full_hexapod import FullHexapod
from ros_pad.simulation.planar_hexapod import PlanarHexapod
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.rail_leg import walk_many
from ros_pad.simulation.robot import Robot
from ros_pad.simulation.scene import HexapodBody
from ros_pad.simulation.scene import RailGait
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

FIDELITIES = ('auto', 'L0', 'L1', 'L2')
_RUNGS = {'rail_leg': ('L0',), 'hexapod': ('L1', 'L2')}  # the cheapest first
_MARGIN = 1.2  # of the pads' force limit over the load: a dome that a controller would choose


@dataclass(frozen=True)
class Choice:
    """A rung for a scene, and what it promises.

    Attributes
    ----------
    rung : str
        ``L0``, ``L1`` or ``L2``.
    bound : float
        Largest error of the distance that was measured on scenes with such a reserve, with a
        margin: relative to the way on the top rung, or to half of the full way where that is
        less. Infinite where the rung cannot be trusted, and for scenes unlike those measured.
    reserve : float
        See :func:`reserve`.
    note : str
        The same in words, and whether the scene asks for more.
    """

    rung: str
    bound: float
    reserve: float
    note: str


@dataclass(frozen=True)
class Omission:
    """A physical term that a trial leaves out.

    Attributes
    ----------
    term : str
        What it is.
    bound : float or None
        How large its effect can be, relative; None where nobody knows.
    reason : str
        Relative to what, and where the bound comes from.
    """

    term: str
    bound: float | None
    reason: str


@dataclass(frozen=True)
class Ladder:
    """Errors of the rungs by reserve, as ``bench/fidelity.py`` measured them.

    Attributes
    ----------
    reserves : tuple of float
        Lower ends of the classes of reserve, rising from 0.
    bounds : dict of tuple
        For each rung its bound in each class.
    ranges : dict of dict
        For each robot, by dotted name, the ends between which the measured scenes were drawn.
    """

    reserves: tuple[float, ...]
    bounds: dict[str, tuple[float, ...]]
    ranges: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)

    @classmethod
    @functools.cache
    def load(cls) -> Ladder:
        """Read ``config/fidelity.yaml``.

        Raises
        ------
        ConfigError
            When the file is missing or has not the shape that the bench gives it.
        """
        path = configuration.shared_folder() / 'fidelity.yaml'
        try:
            values = yaml.safe_load(path.read_text(encoding='utf-8'))
            reserves = tuple(float(value) for value in values['reserves'])
            bounds = {
                rung: tuple(float(value) for value in values['bounds'][rung])
                for rung in FIDELITIES[1:]
            }
            ranges = {
                robot: {
                    name: (float(low), float(high))
                    for name, (low, high) in values['ranges'][robot].items()
                }
                for robot in _RUNGS
            }
            assert reserves[0] == 0.0 and list(reserves) == sorted(reserves)
            assert all(len(row) == len(reserves) for row in bounds.values())
        except (OSError, yaml.YAMLError, LookupError, TypeError, ValueError, AssertionError) as e:
            raise ConfigError(f'{path}: no table of rungs ({e!r}): run bench/fidelity.py') from e
        return cls(reserves, bounds, ranges)

    def bound(self, rung: str, reserve: float) -> float:
        """Return what a rung promises for a reserve."""
        return self.bounds[rung][bisect.bisect_right(self.reserves, reserve) - 1]

    def beyond(self, scene: Scene) -> str:
        """Return what of a scene is outside of what was measured; empty if nothing is."""
        return ', '.join(
            f'{name} = {value:g}, measured from {low:g} to {high:g}'
            for name, (low, high) in self.ranges.get(scene.robot, {}).items()
            if not low <= (value := operator.attrgetter(name)(scene)) <= high
        )


def choose(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> Choice:
    """Return the rung for a scene, and what it promises.

    ``auto`` takes the cheapest rung whose bound is within ``scene.accuracy``, else the best one
    that there is; without MuJoCo that is L1.

    Parameters
    ----------
    scene : Scene
        What to walk on, with what.
    fidelity : str
        ``auto`` or a rung.
    policy : str or None
        Which shapes the feet take; None takes the scene's own policy.

    Raises
    ------
    InvalidInput
        When the rung does not exist, or does not know the scene's robot.
    """
    known = _rungs(scene, fidelity)
    own, ladder = reserve(scene, policy), Ladder.load()
    beyond = ladder.beyond(scene)
    bounds = {rung: math.inf if beyond else ladder.bound(rung, own) for rung in known}
    missing = 'L2' in known and importlib.util.find_spec('mujoco') is None
    if fidelity != 'auto':
        rung = fidelity
    else:
        there = known[:1] if missing else known
        enough = [each for each in there if bounds[each] <= scene.accuracy]
        rung = (enough or there[-1:])[0]
    known_bound = bounds[rung] < math.inf
    within = (
        f'within {100.0 * bounds[rung]:.0f} % of the top rung'
        if known_bound
        else 'not to be trusted'
    )
    if beyond:
        within = f'of unknown error ({beyond})'
    note = f'feet hold {own:.2g} times what the walk asks; then the distance on {rung} is {within}'
    if bounds[rung] > scene.accuracy:
        note += f', and the scene asks for {100.0 * scene.accuracy:.0f} %'
        if missing and rung == 'L1':
            note += '; pip install "ros_pad[mujoco]" brings L2'
    return Choice(rung, bounds[rung], own, note)


def rung(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> str:
    """Return the rung of :func:`choose`."""
    if fidelity == 'auto':
        return choose(scene, fidelity, policy).rung
    _rungs(scene, fidelity)
    return fidelity


def _rungs(scene: Scene, fidelity: str) -> tuple[str, ...]:
    """Return the rungs that know a scene's robot; InvalidInput if the one asked for does not."""
    if fidelity not in FIDELITIES:
        raise InvalidInput(f'fidelity = {fidelity!r}: one of {", ".join(FIDELITIES)} is needed')
    known = _RUNGS[scene.robot]
    if fidelity not in ('auto', *known):
        raise InvalidInput(
            f'fidelity = {fidelity!r}: scene {scene.name!r} has a {scene.robot},'
            f' which {" and ".join(known)} model{"s" if len(known) == 1 else ""}'
        )
    return known


def build(scene: Scene, floor: Floor, period: float, fidelity: str = 'auto') -> Robot:
    """Return the robot of a scene on a floor, with a step of ``period`` seconds.

    Raises
    ------
    InvalidInput
        As :func:`choose`.
    ConfigError
        For L2 without MuJoCo, or with legs that cannot do what the scene wants of them.
    """
    name = rung(scene, fidelity)
    if name == 'L0':
        return RailLeg(scene, floor, period)
    if name == 'L1':
        return PlanarHexapod(scene, floor, period)
    return FullHexapod(scene, floor, period)


def reserve(scene: Scene, policy: str | None = None) -> float:
    """Return the grip of the feet over what the walk asks of them, where that is least.

    Parameters
    ----------
    scene : Scene
        What to walk on, with what.
    policy : str or None
        ``flat``, ``dome``, or one that makes feet domes on wet ground alone; None takes the
        scene's own.

    Returns
    -------
    float
        From 0. Grip is that of a foot with its expected load in mid-stance, when its film has
        drained for half of it. Asked for are the gait's peak acceleration of body and load, the
        drag of the load or of the wheels, and the slope. Feet and load may stand on different
        ground. With faults on its schedule a foot may have the other shape as well.
    """
    policy = scene.policy if policy is None else policy
    wets = {'dry': (False,), 'wet': (True,)}.get(scene.floor.kind, (False, True))
    grip = math.inf
    for wet in wets:
        dome = policy == 'dome' or (policy != 'flat' and wet)
        shapes = (False, True) if scene.faults else (dome,)
        grip = min(grip, *(_grip(scene, shape, wet) for shape in shapes))
    body, gait, slope = scene.body, scene.gait, scene.floor.slope
    if isinstance(gait, RailGait) or not isinstance(body, HexapodBody):
        assert isinstance(gait, RailGait) and not isinstance(body, HexapodBody)
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


def _grip(scene: Scene, dome: bool, wet: bool) -> float:
    """Return the resistance of a foot in mid-stance over its load."""
    foot, load = scene.foot.on_rough(scene.floor.roughness), scene.expected_load
    pressure = _dome_pressure(scene) if dome else 0.0
    on_domes = foot.dome_load(load, pressure)
    thickness = 0.0, 0.0
    if wet:
        gait = scene.gait
        stance = gait.stance if isinstance(gait, RailGait) else gait.duty * gait.cycle
        film = Film(foot, scene.floor.viscosity)
        film.touch_down(scene.floor.film_thickness)
        film.drain(on_domes, load - on_domes, pressure, 0.5 * stance)
        thickness = film.under_domes, film.under_sole
    return foot.resistance_of(on_domes, load - on_domes, pressure, *thickness) / load


def omitted(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> list[Omission]:
    """Return what a trial of this scene leaves out on a rung, with bounds on its effect.

    Parameters
    ----------
    scene, fidelity, policy
        As for :func:`choose`.

    Raises
    ------
    InvalidInput
        When the rung does not exist, or does not know the scene's robot.
    """
    foot, load, gait = scene.foot, scene.expected_load, scene.gait
    name, terms = rung(scene, fidelity, policy), []
    if scene.floor.kind != 'dry':
        # A meniscus resists sliding by hysteresis at most: γ w (cos θ_rec - cos θ_adv) <= 2 γ w,
        # with w = 2 r0 a pad; only domes have one.
        capillary = foot.pads * 2.0 * WATER.surface_tension * 2.0 * foot.pad.radius
        if not foot.capillary_force:
            terms.append(
                Omission(
                    'capillary force of the pads',
                    capillary / (foot.friction * load),
                    'of the friction of a loaded foot: full hysteresis of the contact angle (180'
                    ' to 0 degrees) on every pad',
                )
            )
        terms.append(
            Omission(
                'liquid dragged under a slipping foot',
                None,
                'the film is taken to travel with the foot; at 10 mm/s a plane wedge drags at most'
                f' {1e6 * _dragged_film(scene, 0.01):.2g} um under a dome, where'
                f' {1e6 * foot.critical_film:.2g} um leave 1/e of dry contact',
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
    if name == 'L0':
        terms.append(_doubt_of_the_rail(scene, policy))
    if name == 'L1':
        bound = choose(scene, name, policy).bound
        terms.append(
            Omission(
                'joints, servos, scuffing at touch-down, swinging legs, pitch and roll',
                bound if bound < math.inf else None,
                'of the distance: L1 against L2 on random scenes with such a reserve; on dry flat'
                ' ground feet slip 3 to 4 mm a cycle on L2, 0.1 mm here',
            )
        )
    else:
        grip = max(_grip(scene, False, False), _grip(scene, True, False))
        steps, length = (1.0, gait.stroke) if isinstance(gait, RailGait) else (2.0, gait.stride)
        terms.append(
            Omission(
                'what soft pads do to the motion of the body',
                steps * grip * load / foot.shear_stiffness / length,
                'of the distance: at each step the feet give way by their whole grip over the'
                ' shear stiffness of their pads, and get nothing back',
            )
        )
    if name == 'L2':
        terms.append(
            Omission('size of the sole', None, 'the foot is a point on an ankle that tilts freely')
        )
    return terms


def _dragged_film(scene: Scene, speed: float) -> float:
    """Return the thickest film, m, that a plane wedge can drag under sliding domes.

    The optimum slider of Reynolds' equation (Rayleigh 1918; Hamrock, Fundamentals of Fluid Film
    Lubrication, ch. 8) carries a mean pressure of 0.160 η U L / h².
    """
    pressure = _dome_pressure(scene)
    width = math.sqrt(scene.expected_load / pressure / scene.foot.pads / math.pi)
    return math.sqrt(0.160 * scene.floor.viscosity * speed * 2.0 * width / pressure)


def _doubt_of_the_rail(scene: Scene, policy: str | None) -> Omission:
    """Return what one per cent of friction is worth on the rail, which is ill-conditioned."""
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
