# SPDX-License-Identifier: Apache-2.0
"""The ladder of walking: every rung of the simulation, timed and compared with the top one.

The hexapod walks open loop, its pads at the pressure that a controller would begin with, on the
floors of the shipped scenes. Errors are those of L2 with steps of 0.25 ms, whose own uncertainty
is the row with half of them; without MuJoCo they are those of L1 with steps of 0.25 ms, which says
nothing of what L1 leaves out. The rail leg is compared with an event-driven integration of its
equations of motion, phase by phase, to 1e-11.

Times are those of the steps: neither of making the robot nor of reading its feet, which L2 sees to
in every step, L1 only when asked.

Only the elastic law of :mod:`ros_pad.simulation.friction` is here: the hexapod does not walk with
the others, which :mod:`ros_pad.ladders.stability` compares.
"""

from __future__ import annotations

import importlib.util
import math
import statistics
import time
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.integrate import solve_ivp

from ros_pad.contact.film import Film
from ros_pad.control.morphology import DOME
from ros_pad.control.morphology import FLAT
from ros_pad.control.morphology import MorphologyController
from ros_pad.control.morphology import policy_named
from ros_pad.errors import PadError
from ros_pad.ladders.ladder import Progress
from ros_pad.simulation.full_hexapod import DEFAULTS
from ros_pad.simulation.full_hexapod import RECOMMENDED
from ros_pad.simulation.full_hexapod import FullHexapod
from ros_pad.simulation.full_hexapod import Settings
from ros_pad.simulation.planar_hexapod import PlanarHexapod
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.rail_leg import walk_many
from ros_pad.simulation.scene import RailBody
from ros_pad.simulation.scene import RailGait
from ros_pad.simulation.scene import Scene
from ros_pad.trials.report import BLACK
from ros_pad.trials.report import BLUE
from ros_pad.trials.report import GREEN
from ros_pad.trials.report import PALE
from ros_pad.trials.report import STYLE as PAGE_STYLE
from ros_pad.trials.report import VERMILION

HEXAPOD, RAIL = 'hexapod', 'rail leg'
CYCLES = {HEXAPOD: 6, RAIL: 10}
SETTLE = 0.2  # s that the hexapod stands first
SAMPLE = 4e-3  # s between set-points of L2's servos
TOP_STEP = 2.5e-4  # s
FAILED = 0.1  # relative error of distance or slip from which a walk has failed
LEAST = 0.01  # of the stride: relative errors of shorter ways are taken relative to this
_LEGS = 200  # rail legs that are walked at once


@dataclass(frozen=True)
class Walk:
    """A scene to walk in, with its pads at one pressure.

    Attributes
    ----------
    name : str
    scene : Scene
    pressure : float
        Gauge, Pa, of all pads.
    seed : int
        Of the floor.
    """

    name: str
    scene: Scene
    pressure: float
    seed: int = 0


@dataclass(frozen=True)
class Walked:
    """How a walk went.

    Attributes
    ----------
    distance, slip : float
        Way of the body ahead, and slip path of a foot (their mean), m a cycle.
    lateral, yaw : float
        Drift to the left, m a cycle, and of the heading, rad a cycle.
    verdict : str or None
        Why the walk is not valid.
    steps : int
        Steps that were made.
    seconds : float
        Time that they took.
    """

    distance: float
    slip: float
    lateral: float
    yaw: float
    verdict: str | None
    steps: int
    seconds: float


@dataclass(frozen=True)
class Walker:
    """A way to simulate a walk.

    Attributes
    ----------
    family, name : str
        Walkers of one family differ in their step alone.
    step : float or None
        s; None where the method chooses its own.
    walk : callable
    ours : bool
    """

    family: str
    name: str
    step: float | None
    walk: Callable[[Walk], Walked]
    ours: bool = True


@dataclass(frozen=True)
class WalkRung:
    """What a walker achieved.

    Attributes
    ----------
    robot, method, family : str
    step_s : float or None
    ms_per_second : float
        Median time of a simulated second, ms.
    us_per_step : float
        Median time of a step (of MuJoCo's own, on L2), us.
    versus : float
        Time of a simulated second over that of the baseline, median over walks of the ratio.
    baseline, top : str
        What times and errors are compared with.
    errors, worst : dict of float
        Median and largest error of ``distance`` and ``slip`` (relative), ``lateral`` (m a cycle)
        and ``yaw`` (rad a cycle), of walks without a verdict; NaN where there are none.
    failures : int
        Walks whose distance is off by more than 10 %, or that have no answer.
    slip_failures : int
        The same for the slip path.
    refused : int
        Those that have no answer, and say so.
    cases : int
    walks : list of dict
        Each walk, what it was, and what its relative error of the distance is.
    ours : bool
    """

    robot: str
    method: str
    family: str
    step_s: float | None
    ms_per_second: float
    us_per_step: float
    versus: float
    baseline: str
    top: str
    errors: dict[str, float]
    worst: dict[str, float]
    failures: int
    slip_failures: int
    refused: int
    cases: int
    walks: list[dict[str, Any]]
    ours: bool


RELATIVE = ('distance', 'slip')
MEASURES = {HEXAPOD: (*RELATIVE, 'lateral', 'yaw'), RAIL: RELATIVE}


def measure(progress: Progress | None = None) -> list[WalkRung]:
    """Walk every scene on every rung; ``progress`` from 0 to 1."""
    tell = progress or (lambda _: None)
    walkers, top, baseline = hexapod_walkers()
    hexapod = climb(
        HEXAPOD, hexapod_walks(), walkers, top, baseline, lambda done: tell(0.85 * done)
    )
    rail = climb(
        RAIL, rail_walks(), rail_walkers(), EVENTS, LEG, lambda done: tell(0.85 + 0.15 * done)
    )
    return hexapod + rail


def climb(
    robot: str,
    walks: Sequence[Walk],
    walkers: Sequence[Walker],
    top: str,
    baseline: str,
    progress: Progress,
) -> list[WalkRung]:
    """Measure each walker; ``top`` and ``baseline`` are names of walkers.

    Walkers take turns on each walk, so that whatever else the machine does hits all of them.
    """
    went: dict[str, list[Walked]] = {walker.name: [] for walker in walkers}
    for number, walk in enumerate(walks):
        for turn, walker in enumerate(walkers):
            went[walker.name].append(_attempt(walker, walk))
            progress((number + (turn + 1) / len(walkers)) / len(walks))
    return [_rung(robot, walker, walks, went, top, baseline) for walker in walkers]


def _attempt(walker: Walker, walk: Walk) -> Walked:
    try:
        return walker.walk(walk)
    except (ArithmeticError, PadError) as error:
        return Walked(*(math.nan,) * 4, f'{type(error).__name__}: {error}', 1, math.nan)


def _rung(
    robot: str,
    walker: Walker,
    walks: Sequence[Walk],
    went: dict[str, list[Walked]],
    top: str,
    baseline: str,
) -> WalkRung:
    here, truth = went[walker.name], went[top]
    durations = [walk.scene.duration for walk in walks]
    least_ways = [LEAST * walk.scene.stride for walk in walks]
    valid = [not each.verdict and math.isfinite(each.distance) for each in here]
    off = {
        measure: np.array(
            [
                abs(getattr(each, measure) - getattr(true, measure))
                / (max(abs(getattr(true, measure)), least) if measure in RELATIVE else 1.0)
                if good
                else math.nan
                for each, true, good, least in zip(here, truth, valid, least_ways, strict=True)
            ]
        )
        for measure in MEASURES[robot]
    }
    found = {measure: errors[np.isfinite(errors)] for measure, errors in off.items()}
    return WalkRung(
        robot=robot,
        method=walker.name,
        family=walker.family,
        step_s=walker.step,
        ms_per_second=1e3
        * _median(each.seconds / duration for each, duration in zip(here, durations, strict=True)),
        us_per_step=1e6 * _median(each.seconds / each.steps for each in here),
        versus=_median(
            each.seconds / base.seconds for each, base in zip(here, went[baseline], strict=True)
        ),
        baseline=baseline,
        top=top,
        errors={name: _median(errors) for name, errors in found.items()},
        worst={name: max(errors, default=math.nan) for name, errors in found.items()},
        # What is no number is no error below the limit either.
        failures=int((~(off['distance'] <= FAILED)).sum()),
        slip_failures=int((~(off['slip'] <= FAILED)).sum()),
        refused=valid.count(False),
        cases=len(walks),
        walks=[
            {'walk': walk.name}
            | asdict(each)
            | {'distance_error': each.distance / true.distance - 1.0}
            for walk, each, true in zip(walks, here, truth, strict=True)
        ],
        ours=walker.ours,
    )


def _median(values: Any) -> float:
    finite = [float(value) for value in values if math.isfinite(value)]
    return statistics.median(finite) if finite else math.nan


# --- hexapod -------------------------------------------------------------------------------------


def hexapod_walks() -> list[Walk]:
    """Return the walks: where feet stick, where they slip, and with a heavy load in tow."""
    heavy = Scene.load('hexapod_patches')
    heavy = replace(heavy, floor=replace(heavy.floor, kind='dry'))
    shipped = {
        'dry, flat': ('smooth_dry_flat', FLAT, 0),
        'rough dry, flat': ('rough_dry_flat', FLAT, 0),
        'wet, dome': ('smooth_wet_dome', DOME, 0),
        'rough wet, dome': ('rough_wet_dome', DOME, 0),
        'wet, flat': ('smooth_wet_flat', FLAT, 0),
        'wet, flat, other floor': ('smooth_wet_flat', FLAT, 1),
        'rough wet, flat': ('rough_wet_flat', FLAT, 0),
        'patches, 9 N in tow, dome': ('patches', DOME, 0),
        'patches, 9 N in tow, flat': ('patches', FLAT, 0),
    }
    walks = [
        _hexapod_walk(name, Scene.load(f'hexapod_{scene}'), shape, seed)
        for name, (scene, shape, seed) in shipped.items()
    ]
    return [*walks, _hexapod_walk('dry, 9 N in tow, dome', heavy, DOME, 0)]


def _hexapod_walk(name: str, scene: Scene, shape: str, seed: int) -> Walk:
    controller = MorphologyController(
        scene.foot,
        scene.legs,
        policy_named(shape),
        scene.expected_load,
        start=shape,
        fixed_pressure=scene.dome_pressure,
    )
    scene = replace(scene, settle=SETTLE, cycles=CYCLES[HEXAPOD])
    return Walk(name, scene, controller.setpoint(1), seed)


def hexapod_walkers() -> tuple[list[Walker], str, str]:
    """Return those that can be had here, the top one, and the baseline of times."""
    walkers = []
    forms = {'L1': (False, False, False), 'L1, soles turn': (False, True, False)}
    if importlib.util.find_spec('numba'):
        forms['L1, compiled'] = (True, False, False)
        forms['L1, compiled, walk'] = (True, False, True)
    for family, (compiled, turning, at_once) in forms.items():
        for step in (1e-3, 4e-3, 1e-2):
            walkers.append(_planar(family, step, compiled, turning, at_once))
    if not importlib.util.find_spec('mujoco'):
        top = _planar('L1', TOP_STEP, False, False, False)
        return [*walkers, top], top.name, _named('L1', SAMPLE)
    steps = (5e-4, 1e-3, 2e-3, 4e-3)
    walkers += [_full('L2', replace(RECOMMENDED, timestep=step)) for step in steps]
    stiff = replace(RECOMMENDED, impratio=10.0, noslip_iterations=5)
    walkers += [_full(STIFF, replace(stiff, timestep=step)) for step in steps[1:]]
    walkers += [
        _full('MuJoCo defaults', replace(DEFAULTS, timestep=step), ours=False)
        for step in (5e-4, 2e-3)
    ]
    walkers += [
        _full(TOP, replace(RECOMMENDED, timestep=step)) for step in (TOP_STEP, TOP_STEP / 2.0)
    ]
    return walkers, _named(TOP, TOP_STEP), _named('L2', RECOMMENDED.timestep)


TOP, STIFF = 'L2, top', 'L2, noslip'


def _named(family: str, step: float) -> str:
    return f'{family}, {1e3 * step:g} ms'


def _planar(family: str, step: float, compiled: bool, turning: bool, at_once: bool) -> Walker:
    def walk(case: Walk) -> Walked:
        floor = case.scene.floor.build(case.seed)
        robot = PlanarHexapod(case.scene, floor, step, compiled, turning)
        pressures, count = [case.pressure] * 6, round(case.scene.duration / step)
        start = time.perf_counter()
        if at_once:
            count = robot.walk(pressures, count)
        else:
            for _ in range(count):
                robot.step(pressures)
        return _walked(robot, case.scene, count, time.perf_counter() - start)

    return Walker(family, _named(family, step), step, walk)


def _full(family: str, settings: Settings, ours: bool = True) -> Walker:
    def walk(case: Walk) -> Walked:
        robot = FullHexapod(case.scene, case.scene.floor.build(case.seed), SAMPLE, settings)
        pressures, count = [case.pressure] * 6, round(case.scene.duration / SAMPLE)
        start = time.perf_counter()
        for _ in range(count):
            robot.step(pressures)
        taken = time.perf_counter() - start
        return _walked(robot, case.scene, count * round(SAMPLE / settings.timestep), taken)

    return Walker(family, _named(family, settings.timestep), settings.timestep, walk, ours)


def _walked(robot: Any, scene: Scene, steps: int, seconds: float) -> Walked:
    x, y, heading = robot.body
    slip = sum(foot.slip_path for foot in robot.feet) / len(robot.feet)
    count = scene.cycles
    return Walked(
        x / count, slip / count, y / count, heading / count, robot.verdict, steps, seconds
    )


# --- rail leg ------------------------------------------------------------------------------------

LEG = 'RailLeg, 4 ms'
EVENTS = 'solve_ivp, events, 1e-11'
_SMOOTH = 1e-3  # m/s below which the naive friction is viscous


def rail_walks() -> list[Walk]:
    """Return the thesis' walks on a rail, and one just above the threshold of walking."""
    scenes = {
        name: Scene.load(f'leg_{name.replace(" ", "_")}')
        for name in ('dry flat', 'wet flat', 'wet dome 60', 'wet dome 75')
    }
    body = scenes['dry flat'].body
    assert isinstance(body, RailBody)
    slippery = replace(
        scenes['dry flat'].foot, friction=1.06 * body.rolling_drag / body.load, shear_strength=0.0
    )
    scenes['threshold'] = replace(scenes['dry flat'], foot=slippery)
    return [
        Walk(name, replace(scene, settle=0.0, cycles=CYCLES[RAIL]), scene.dome_pressure or 0.0)
        for name, scene in scenes.items()
    ]


def rail_walkers() -> list[Walker]:
    """Return all ways to walk on the rail."""
    walkers = [_rail(step) for step in (1e-4, 1e-3, 4e-3)]
    walkers += [_rail_batch(step) for step in (1e-3, 4e-3)]
    for family, method, tolerance in (
        (EVENTS, 'DOP853', 1e-11),
        ('solve_ivp, events, 1e-6', 'RK45', 1e-6),
        ('solve_ivp, events, 1e-3', 'RK45', 1e-3),
    ):
        walkers.append(Walker(family, family, None, _by_events(method, tolerance), ours=False))
    for family, method in (
        ('solve_ivp, smoothed, LSODA', 'LSODA'),
        ('solve_ivp, smoothed, RK45', 'RK45'),
    ):
        walkers.append(Walker(family, family, None, _by_smoothing(method), ours=False))
    return walkers


def _rail(step: float) -> Walker:
    def walk(case: Walk) -> Walked:
        leg = RailLeg(case.scene, case.scene.floor.build(case.seed), step)
        pressures, count = [case.pressure], round(case.scene.duration / step)
        start = time.perf_counter()
        for _ in range(count):
            leg.step(pressures)
        return _walked(leg, case.scene, count, time.perf_counter() - start)

    return Walker('RailLeg', _named('RailLeg', step), step, walk)


def _rail_batch(step: float) -> Walker:
    family = f'walk_many, {_LEGS} legs'

    def walk(case: Walk) -> Walked:
        scene, count = case.scene, round(case.scene.duration / step)
        every = [scene] * _LEGS, [scene.floor.build(case.seed)] * _LEGS, [case.pressure] * _LEGS
        start = time.perf_counter()
        legs = walk_many(*every, step, scene.duration)
        taken = (time.perf_counter() - start) / _LEGS
        way, slip = legs.position[0] / scene.cycles, legs.slip_path[0] / scene.cycles
        return Walked(float(way), float(slip), 0.0, 0.0, None, count, taken)

    return Walker(family, _named(family, step), step, walk)


def cap_in_stance(case: Walk) -> Callable[[float], float]:
    """Return what a foot holds, N, by the time since its touch-down, s, at constant pressure."""
    scene = case.scene
    assert isinstance(scene.body, RailBody)
    foot = scene.foot.on_rough(scene.floor.roughness)
    domes = foot.dome_load(scene.body.load, case.pressure)
    sole = scene.body.load - domes
    if scene.floor.kind == 'dry':
        dry = foot.resistance_of(domes, sole, case.pressure, 0.0, 0.0)
        return lambda _: dry
    # 1/h² grows evenly.
    film = Film(foot, scene.floor.viscosity)
    film.touch_down(scene.floor.film_thickness)
    fresh = scene.floor.film_thickness**-2
    film.drain(domes, sole, case.pressure, 1.0)
    dome_rate, sole_rate = film.under_domes**-2 - fresh, film.under_sole**-2 - fresh

    def cap(since: float) -> float:
        films = (fresh + dome_rate * since) ** -0.5, (fresh + sole_rate * since) ** -0.5
        return foot.resistance_of(domes, sole, case.pressure, *films)

    return cap


def _by_events(method: str, tolerance: float) -> Callable[[Walk], Walked]:
    def walk(case: Walk) -> Walked:
        scene = case.scene
        start = time.perf_counter()
        way, slip, steps = walk_by_events(case, method, tolerance)
        taken = time.perf_counter() - start
        return Walked(way / scene.cycles, slip / scene.cycles, 0.0, 0.0, None, steps, taken)

    return walk


def walk_by_events(case: Walk, method: str, tolerance: float) -> tuple[float, float, int]:
    """Walk from phase to phase: the foot lags, holds, is ahead of the body, or both rest.

    Returns
    -------
    tuple
        Way of the body and slip path of the foot, m, and steps of the integrator.
    """
    body, gait = case.scene.body, case.scene.gait
    assert isinstance(body, RailBody) and isinstance(gait, RailGait)
    mass, drag, cap = body.mass, body.rolling_drag, cap_in_stance(case)
    rate = math.pi / gait.stance
    peak = 0.5 * rate * gait.stroke  # m/s

    def back(since: float) -> float:
        return peak * math.sin(rate * since)

    def needed(since: float) -> float:
        return mass * peak * rate * math.cos(rate * since) + drag

    # What holds while the phase lasts, of time and speed of the body; its push on the body.
    lasts: dict[str, Callable[[float, float], float]] = {
        'slower': lambda t, v: back(t) - v,
        'stops': lambda t, v: v,
        'faster': lambda t, v: v - back(t),
        'holds': lambda t, v: cap(t) - abs(needed(t)),
        'rests': lambda t, v: drag - cap(t),
    }
    ends = {'slower': ('slower', 'stops'), 'faster': ('faster',), 'holds': ('holds',),
            'rests': ('rests',)}  # fmt: skip
    pushes: dict[str, Callable[[float], float]] = {
        'slower': lambda t: cap(t) - drag,
        'faster': lambda t: -cap(t) - drag,
        'holds': lambda t: needed(t) - drag,
        'rests': lambda t: 0.0,
    }

    def run(phase: str, since: float, speed: float) -> tuple[str | None, float, float, float, int]:
        """Return what ended the phase, when, way and speed by then, and steps."""
        events = []
        for name in ends[phase]:

            def event(t: float, state: Any, name: str = name) -> float:
                return lasts[name](t, float(state[1]))

            event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
            events.append(event)
        found = solve_ivp(
            lambda t, state: (state[1], pushes[phase](t) / mass),
            (since, gait.stance),
            (0.0, speed),
            method=method,
            events=events,
            rtol=max(tolerance, 3e-14),
            atol=1e-3 * tolerance,
        )
        over = [name for name, hits in zip(ends[phase], found.t_events, strict=True) if len(hits)]
        way, speed = found.y[:, -1].tolist()
        return over[0] if over else None, float(found.t[-1]), way, speed, len(found.t) - 1

    way = slip = speed = 0.0
    steps = 0
    for _ in range(case.scene.cycles):
        since = 0.0
        phase = 'faster'
        if speed == 0.0:
            phase = (
                'holds' if cap(0.0) >= needed(0.0) else 'slower' if cap(0.0) > drag else 'rests'
            )
        while since < gait.stance:
            begun = since
            over, since, gained, speed, count = run(phase, since, speed)
            steps += count
            foot = 0.5 * gait.stroke * (math.cos(rate * begun) - math.cos(rate * since))
            way += gained
            slip += 0.0 if phase == 'holds' else abs(gained - foot)
            if over == 'holds':
                phase = 'slower' if needed(since) > 0.0 else 'faster'
            elif over == 'stops':
                phase, speed = 'rests', 0.0
            elif over == 'rests':
                phase = 'slower'
            elif over:
                # They meet, and stay together if the foot can hold that.
                speed = back(since)
                held = abs(needed(since)) <= cap(since)
                other = 'faster' if over == 'slower' else 'slower'
                phase = 'holds' if held else other
        coasting = min(gait.swing, mass * speed / drag) if drag else gait.swing
        way += speed * coasting - 0.5 * drag / mass * coasting**2
        speed = speed - drag / mass * coasting if coasting == gait.swing else 0.0
    return way, slip, steps


def _by_smoothing(method: str) -> Callable[[Walk], Walked]:
    """Walk as one writes it first: one call, default tolerances, friction c tanh(slip/v)."""

    def walk(case: Walk) -> Walked:
        scene, body, gait = case.scene, case.scene.body, case.scene.gait
        assert isinstance(body, RailBody) and isinstance(gait, RailGait)
        cap, peak = cap_in_stance(case), 0.5 * math.pi * gait.stroke / gait.stance

        def motion(t: float, state: Any) -> tuple[float, float, float]:
            speed, since = float(state[1]), t % gait.cycle
            force, slip = -body.rolling_drag * math.tanh(speed / _SMOOTH), 0.0
            if since < gait.stance:
                slip = speed - peak * math.sin(math.pi * since / gait.stance)
                force -= cap(since) * math.tanh(slip / _SMOOTH)
            return speed, force / body.mass, abs(slip)

        start = time.perf_counter()
        found = solve_ivp(motion, (0.0, scene.duration), (0.0, 0.0, 0.0), method=method)
        taken = time.perf_counter() - start
        way, _, slip = (found.y[:, -1] / scene.cycles).tolist()
        verdict = None if found.success else str(found.message)
        return Walked(way, slip, 0.0, 0.0, verdict, len(found.t) - 1, taken)

    return walk


# --- what is shown -------------------------------------------------------------------------------

# Those shown walk by walk.
SHOWN = tuple(
    _named(family, step)
    for family, step in (
        ('L1', 4e-3),
        ('L1, soles turn', 4e-3),
        ('L2', 2e-3),
        (STIFF, 2e-3),
        ('MuJoCo defaults', 2e-3),
    )
)
_UNITS = {
    'distance': ('distance, %', 1e2),
    'slip': ('slip path, %', 1e2),
    'lateral': ('aside, mm/cycle', 1e3),
    'yaw': ('yaw, mrad/cycle', 1e3),
}


def table(rungs: Sequence[WalkRung]) -> str:
    """Return the rungs as text: a block for each robot, and the distances walk by walk."""
    lines: list[str] = []
    for robot in dict.fromkeys(rung.robot for rung in rungs):
        part = [rung for rung in rungs if rung.robot == robot]
        lines += [*_block(robot, part), '']
        if robot == HEXAPOD:
            lines += [*_walk_by_walk(part), '']
            if any(rung.family == STIFF for rung in part):
                lines.append(f'{STIFF}: impratio 10 and noslip_iterations 5, not impratio 100')
            lines += [f'left out: {why}' for why in _missing(part)]
            lines.append('')
    return '\n'.join(lines)


def _block(robot: str, part: Sequence[WalkRung]) -> list[str]:
    first, width = part[0], max(len(rung.method) for rung in part)
    heads = ''.join(f'{_UNITS[name][0]:>18}' for name in first.errors)
    lines = [
        f'{robot} ({first.cases} walks of {CYCLES[robot]} cycles; median and worst errors against'
        f' {first.top}; times against {first.baseline})',
        f'  {"method":{width}}      ms/s  us/step    ratio{heads}  distance fails  slip fails'
        '  refused',
    ]
    for rung in part:
        errors = ''.join(
            f'{scale * rung.errors[name]:9.2g}{scale * rung.worst[name]:9.2g}'
            for name, (_, scale) in _UNITS.items()
            if name in rung.errors
        )
        ratio = f'1/{1 / rung.versus:.0f}' if rung.versus < 0.1 else f'{rung.versus:.2g}'
        lines.append(
            f'  {rung.method:{width}}  {rung.ms_per_second:8.3g} {rung.us_per_step:8.3g}'
            f' {ratio:>8}{errors}  {rung.failures:14d}  {rung.slip_failures:10d}'
            f'  {rung.refused:7d}'
        )
    return lines


def _walk_by_walk(part: Sequence[WalkRung]) -> list[str]:
    named = {rung.method: rung for rung in part}
    top, shown = named[part[0].top], [named[name] for name in SHOWN if name in named]
    width = max(len(walk['walk']) for walk in top.walks)
    heads = ''.join(f'  {rung.method}' for rung in shown)
    lines = [
        f'{top.method}, a cycle, and by how much others are off in distance, %',
        f'  {"walk":{width}}  distance, mm  slip, mm  aside, mm  yaw, mrad{heads}',
    ]
    for row, true in enumerate(top.walks):
        off = ''
        for rung in shown:
            walk = rung.walks[row]
            said = 'verdict' if walk['verdict'] else f'{1e2 * walk["distance_error"]:+.1f}'
            off += f'  {said:>{len(rung.method)}}'
        lines.append(
            f'  {true["walk"]:{width}}  {1e3 * true["distance"]:12.1f}  {1e3 * true["slip"]:8.1f}'
            f'  {1e3 * true["lateral"]:+9.2f}  {1e3 * true["yaw"]:+9.2f}{off}'
        )
    return lines


def _missing(part: Sequence[WalkRung]) -> list[str]:
    families = {rung.family for rung in part}
    why = [
        'friction other than elastic, with which the hexapod does not walk: pad chart stability'
    ]
    if 'L1, compiled' not in families:
        why.append('L1, compiled: pip install "ros_pad[fast]"')
    if 'L2' not in families:
        why.append('L2, and with it what L1 is worth: pip install "ros_pad[mujoco]"')
    return why


def figures(rungs: Sequence[WalkRung], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture by its name."""
    return {'walk': draw(rungs)}


SKY, ORANGE, PURPLE = '#56B4E9', '#E69F00', '#CC79A7'
STYLE: dict[Any, Any] = PAGE_STYLE | {'font.size': 9.0, 'axes.titlesize': 9.5}
_LOOKS: dict[str, dict[str, Any]] = {
    'L1': {'color': BLUE, 'marker': 'o'},
    'L1, compiled': {'color': BLUE, 'marker': 's'},
    'L1, compiled, walk': {'color': SKY, 'marker': 'v'},
    'L1, soles turn': {'color': PURPLE, 'marker': 'o'},
    'L2': {'color': GREEN, 'marker': 'D'},
    STIFF: {'color': ORANGE, 'marker': 'P'},
    'MuJoCo defaults': {'color': VERMILION, 'marker': 'X'},
    'RailLeg': {'color': GREEN, 'marker': 'o'},
    f'walk_many, {_LEGS} legs': {'color': GREEN, 'marker': 's'},
    'solve_ivp, events, 1e-6': {'color': BLUE, 'marker': 'D'},
    'solve_ivp, events, 1e-3': {'color': BLUE, 'marker': 'D'},
    'solve_ivp, smoothed, LSODA': {'color': VERMILION, 'marker': 'X'},
    'solve_ivp, smoothed, RK45': {'color': VERMILION, 'marker': 'P'},
}
# Where steps are written beside their marks, points.
_STEP_PLACES = {
    'L1': (6, 4),
    'L1, compiled, walk': (0, 7),
    'L2': (-9, -3),
    STIFF: (9, -4),
    'MuJoCo defaults': (9, 3),
}
_LEGEND = {STIFF: 'L2, impratio 10 and noslip 5'}
_PANELS = {
    'distance': ('distance', 'error, %'),
    'slip': ('slip path of a foot', 'error, %'),
    'lateral': ('drift aside', 'error, mm a cycle'),
    'yaw': ('heading', 'error, mrad a cycle'),
}


def draw(rungs: Sequence[WalkRung]) -> Figure:
    """Return the picture: time against each error, distances walk by walk, and the rail leg."""
    hexapod = [rung for rung in rungs if rung.robot == HEXAPOD]
    rail = [rung for rung in rungs if rung.robot == RAIL]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.5, 8.0))
        figure.set_layout_engine('constrained', w_pad=0.08, h_pad=0.08)
        panels = figure.subplots(2, 3).ravel()
        places = zip('abce', (0, 1, 2, 4), _PANELS, strict=True)
        for letter, place, name in places:
            _climb(panels[place], hexapod, name, f'{letter}  hexapod: {_PANELS[name][0]}')
        _strips(panels[3], hexapod, 'd  hexapod: distance, walk by walk')
        _climb(panels[5], rail, 'distance', 'f  rail leg: distance')
        _write_names(panels[5], rail)
        families = {rung.family for rung in hexapod}
        handles = [
            Line2D([], [], ls='', ms=6, label=_LEGEND.get(family, family), **look)
            for family, look in _LOOKS.items()
            if family in families
        ]
        handles.append(
            Line2D([], [], color=PALE, ls='--', lw=0.9, label='top rung against half its step')
        )
        figure.legend(
            handles=handles,
            loc='outside lower center',
            ncol=4,
            title='Mark: median of the walks; whisker: the worst; number: step, ms.'
            ' In f, events and smoothed friction are those of solve_ivp.',
        )
    return figure


def _climb(panel: Axes, part: Sequence[WalkRung], name: str, title: str) -> None:
    """Draw time against the error called ``name``: mark the median, whisker the worst walk."""
    scale = _UNITS[name][1]
    panel.set(xscale='log', yscale='log', title=title, ylabel=_PANELS[name][1])
    panel.set_xlabel('time for a simulated second, ms')
    for family, look in _LOOKS.items():
        mine = [rung for rung in part if rung.family == family]
        x = [rung.ms_per_second for rung in mine]
        y = [scale * rung.errors[name] for rung in mine]
        panel.plot(x, y, ls='-', lw=1.0, ms=6, zorder=3, **look)
        for rung, at, error in zip(mine, x, y, strict=True):
            # Compiled walks are those of plain Python.
            if 'compiled' not in family:
                ends = [error, scale * rung.worst[name]]
                panel.plot([at, at], ends, '-_', color=look['color'], lw=1.0, ms=5, alpha=0.5)
            if name == 'distance' and rung.step_s is not None:
                panel.annotate(
                    f'{1e3 * rung.step_s:g}',
                    (at, error),
                    xytext=_STEP_PLACES.get(family, (0, -12)),
                    textcoords='offset points',
                    ha='center',
                    fontsize=7,
                    color=look['color'],
                )
    for rung in part:
        if rung.family == TOP and rung.method != rung.top:
            own = scale * rung.errors[name]
            panel.axhline(own, color=PALE, ls='--', lw=0.9, zorder=1)
            # Nothing below means anything.
            panel.set_ylim(bottom=0.6 * own)
    panel.xaxis.set_major_formatter('{x:g}')
    panel.yaxis.set_major_formatter('{x:g}')
    panel.grid(color=PALE, alpha=0.25, lw=0.5)


def _write_names(panel: Axes, part: Sequence[WalkRung]) -> None:
    """Write beside the marks of the rail leg whose they are."""
    # The first of a family has the shortest step.
    first = {rung.family: rung for rung in reversed(part) if rung.family in _LOOKS}
    for family, rung in first.items():
        panel.annotate(
            family.removesuffix(f', {_LEGS} legs').removeprefix('solve_ivp, '),
            (rung.ms_per_second, 1e2 * rung.errors['distance']),
            xytext=(-34, -24) if 'walk_many' in family else (8, -3),
            textcoords='offset points',
            fontsize=8,
            color=_LOOKS[family]['color'],
        )
    panel.set_xlim(right=8.0 * max(rung.ms_per_second for rung in part))


def _strips(panel: Axes, part: Sequence[WalkRung], title: str) -> None:
    """Draw by how much each walk's distance is off, a row for each walk."""
    names = [walk['walk'] for walk in part[0].walks]
    shown = [rung for rung in part if rung.method in SHOWN]
    for rung, shift in zip(shown, np.linspace(-0.28, 0.28, len(shown)), strict=True):
        off = [1e2 * walk['distance_error'] for walk in rung.walks]
        look = _LOOKS[rung.family]
        panel.plot(off, shift + np.arange(len(names)), ls='', ms=5, **look)
    panel.axvline(0.0, color=BLACK, lw=0.8, zorder=1)
    for limit in (-1e2 * FAILED, 1e2 * FAILED):
        panel.axvline(limit, color=PALE, lw=0.9, ls=':', zorder=1)
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set(title=title, xlabel='distance off by, %')
    panel.grid(axis='y', color=PALE, alpha=0.25, lw=0.5)
