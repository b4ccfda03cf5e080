# SPDX-License-Identifier: Apache-2.0
"""Let feet land more slowly, where that could pay: dry contact under wet domes, and distance.

Walks variants of ``hexapod_patches`` and ``quadruped_patches`` with full dynamics (L2): slippery
films, viscous liquid, heavier loads. A foot is lowered over the last 3 mm at a given speed, while
it stays over one place of the ground; the rest of its swing is faster, so the cycle stays. The
first of the speeds is about the usual one: it shows what staying over one place does. Of the
slower ones, each robot takes that with which it goes farthest on tuning floors (seeds from 0) to
other floors. Writes landing.json and .png.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple
from unittest.mock import patch

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.contact import laws
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.simulation import Scene, balance, balance_step
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.soles import LIGHT, Sole
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.closed_loop.policies import Changes, interval, ratio
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PURPLE, STYLE, VERMILION
from studies.samples import bootstrap

HEIGHT = 3e-3
"""Height over which a foot is lowered, m: feet touch before the end of their swing, because the
legs give way."""

SPEEDS = {'hexapod_patches': (0.15, 0.08, 0.04), 'quadruped_patches': (0.2, 0.08, 0.04)}
"""Speeds at which they are lowered, m/s; the first is about that of the usual landing."""

POLICIES = ('dome', 'adaptive')
FIRST_SEED = 20_000

GROUNDS: dict[str, dict[str, Changes]] = {
    'hexapod_patches': {
        'as shipped': {},
        'critical film of 0.25 µm': {'foot': {'critical_film': 0.25e-6}},
        'critical film of 0.1 µm': {'foot': {'critical_film': 0.1e-6}},
        '12 N towed': {'tow': {'weight': 12.0}},
        '5 mPa s, sled slides badly': {
            'floor': {'viscosity': 5e-3}, 'tow': {'friction_wet': 0.3},
        },
    },
    'quadruped_patches': {
        'as shipped': {},
        'critical film of 0.25 µm': {'foot': {'critical_film': 0.25e-6}},
        '90 N towed': {'tow': {'weight': 90.0}},
    },
}  # fmt: skip
"""Changes to floor, towed load and foot of each scene."""


class Job(NamedTuple):
    """One walk; ``speed`` is that of the landing, m/s, None for the usual one."""

    scene: str
    ground: str
    policy: str
    speed: float | None
    seed: int
    cycles: int


class Walk(NamedTuple):
    """What a walk gave.

    Attributes
    ----------
    distance, slip : float
        Advance of the body, and path of slip of a foot, a cycle, m.
    dry, load : float
        Sums over samples of the load on domes on wet ground: of its dry share, and of all, N.
    landing : float or None
        Median vertical speed of feet that touch down, m/s.
    verdict : str or None
        Why it ended early.
    """

    distance: float
    slip: float
    dry: float
    load: float
    landing: float | None
    verdict: str | None


# --- slower landing ------------------------------------------------------------------------------


@dataclass(frozen=True)
class LoweringGait(WalkingGait):
    """A gait whose feet are lowered at the end of their swing, at a speed in m/s."""

    speed: float = math.inf

    def swing(self, phase: float) -> tuple[float, float]:
        """Return progress and height of a swing: up and ahead, then down over one place."""
        since, whole = (phase - self.duty) * self.cycle, (1.0 - self.duty) * self.cycle
        left, slow = whole - since, HEIGHT / self.speed
        fast = whole - slow
        share = min(1.0, since / fast)
        height = self.lift * math.sin(math.pi * share) ** 2
        if left <= slow:
            height = self.speed * left
        elif share > 0.5:  # the cubic that begins at rest and ends at the speed of the landing
            part = 2.0 * share - 1.0
            down, steep = part * part * (3.0 - 2.0 * part), part * part * (1.0 - part)
            height = self.lift + (HEIGHT - self.lift) * down + 0.5 * fast * self.speed * steep
        # In the body, a foot over one place moves backwards as fast as the body advances.
        touch = (1.0 + self.middles[0] - 0.5 * self.duty) * self.cycle
        behind = self.body_advance(touch) - self.body_advance(touch - min(left, slow))
        ahead = 1.0 + 0.5 * behind / self.reach()
        return ahead * (0.5 - 0.5 * math.cos(math.pi * share)), height


def lowering(speed: float, usual: Callable[..., None]) -> Callable[..., None]:
    """Return the aim of a swinging foot of a robot with balance, lowered at a speed, m/s."""

    def aim(plan: Any, leg: int, goal: Any, feet: Any, state: Any) -> None:
        usual(plan, leg, goal, feet, state)
        whole = (1.0 - plan.duty) * plan.cycle
        since = (feet[balance_step.PHASE][leg] - plan.duty) * plan.cycle
        left, fast, ground = whole - since, whole - HEIGHT / speed, goal[balance_step.GROUND]
        if since < 0.0:
            return
        start, top = feet[balance_step.FROM_Z][leg], balance_step.TOP
        way = plan.lift + max(ground - start, 0.0)
        share, part, sign = since / fast, top, 1.0
        if share >= top:
            way += start - ground - HEIGHT
            start, share, part, sign = ground + HEIGHT, 1.0 - share, 1.0 - top, -1.0
        there, rate, pull = balance_step.blend(share / part, part * fast)
        motion = start + there * way, sign * rate * way, pull * way
        if since > fast:
            motion = ground + speed * left, -speed, 0.0
        for row, value in zip(
            (balance_step.AIM_Z, balance_step.RATE_Z, balance_step.PULL_Z), motion, strict=True
        ):
            feet[row][leg] = value

    return aim


def ground(scene: str, name: str, cycles: int, speed: float | None = None) -> Scene:
    """Return the scene of a ground; a robot with servos has its landing in the gait."""
    made = replace(Scene.load(scene), cycles=cycles)
    for part, changes in GROUNDS[scene][name].items():
        made = replace(made, **{part: replace(getattr(made, part), **changes)})
    body, gait = made.legged
    if speed is None or not body.robot.servo:
        return made
    values = {each.name: getattr(gait, each.name) for each in fields(gait)}
    return replace(made, gait=LoweringGait(**values, speed=speed))


# --- walks ---------------------------------------------------------------------------------------


class Feet:
    """What happens under the feet of a walk, sample by sample."""

    def __init__(self, loop: ClosedLoop) -> None:
        self._robot: Any = loop.robot  # at L2
        self._period = 1e-9 * loop.period_ns
        self.dry = self.load = 0.0
        self.landings: list[float] = []
        self._heights: list[list[float]] = [[] for _ in loop.robot.feet]  # since the lift-off

    def look(self) -> None:
        """Look at all feet after a sample."""
        for sole, heights in zip(self._robot.feet, self._heights, strict=True):
            load = sole.force[2]
            if load <= LIGHT:
                heights.append(sole.position[2])
                continue
            if len(heights) > 1 and sole.cleared:
                self.landings.append((heights[-2] - heights[-1]) / self._period)
            heights.clear()
            if sole.wet and sole.pressure > DOME_PRESSURE:
                self._weigh(sole, load)

    def _weigh(self, sole: Sole, load: float) -> None:
        foot, film = self._robot.soles.foot, sole.film
        if film._state[laws.FRESH] > 0.0 and film._state[laws.AREA] > 0.0:
            on_domes = foot.dome_load(load, sole.pressure)
            sphere = laws.between(foot.spheres, sole.pressure / foot.limit_cell)
            self.load += on_domes
            self.dry += on_domes * laws.dry_share(film, film._state, sphere)


def walk(job: Job) -> Walk:
    """Walk once."""
    scene = ground(job.scene, job.ground, job.cycles, job.speed)
    loop = ClosedLoop(scene, job.policy, job.seed, 'L2')
    robot: Any = loop.robot
    aim = balance_step.aim
    if job.speed and not scene.legged[0].robot.servo:
        robot._drive._step = balance._plain  # compiled code would keep the usual aim
        aim = lowering(job.speed, aim)
    feet = Feet(loop)
    # A foot must not move ahead while it is lowered.
    whole = (1.0 - scene.legged[1].duty) * scene.gait.cycle
    ahead = min(balance_step.AHEAD, 1.0 - HEIGHT / (job.speed or math.inf) / whole)
    with patch.multiple(balance_step, aim=aim, AHEAD=ahead):
        for _ in loop.walk():
            if robot.time > scene.settle:
                feet.look()
    slips = statistics.fmean(sole.slip_path for sole in robot.feet)
    landing = statistics.median(feet.landings) if feet.landings else None
    count = scene.cycles
    return Walk(robot.body[0] / count, slips / count, feet.dry, feet.load, landing, robot.verdict)


def row(
    walks: Sequence[Walk], usual: Sequence[Walk], as_fast: Sequence[Walk], seeds: Sequence[int]
) -> dict[str, Any]:
    """Return what the walks of one landing gave, and the ratio of distances to other landings."""
    distances, landings = [each.distance for each in walks], [each.landing for each in walks]
    known = [each for each in landings if each is not None]
    wet = [(each.dry, each.load) for each in walks if each.load > 0.0]
    low, high = bootstrap(wet, 10_000) if wet else (math.nan, math.nan)
    share = sum(dry for dry, _ in wet) / sum(load for _, load in wet) if wet else math.nan
    made = {
        'landing_mm_s': 1e3 * statistics.median(known) if known else math.nan,
        'dry_share': share,
        'dry_low': low,
        'dry_high': high,
        'slip_mm': 1e3 * statistics.fmean(each.slip for each in walks),
        'mm_a_cycle': 1e3 * statistics.fmean(distances),
    }
    kept = {name: None if math.isnan(value) else round(value, 3) for name, value in made.items()}
    return {
        **kept,
        'each_mm': [round(1e3 * each, 2) for each in distances],
        'to usual': ratio(distances, [each.distance for each in usual]),
        'to as fast': ratio(distances, [each.distance for each in as_fast]),
        'seeds': [*seeds],
        'verdicts': sorted({each.verdict for each in walks if each.verdict}),
    }


Rows = dict[str, dict[str, Any]]


def _part(
    scene: str, speeds: Sequence[float], first: int, floors: int, cycles: int, processes: int
) -> Rows:
    """Return rows by ground, policy and landing; each ground has floors of its own from a seed."""
    landings = (None, *speeds)
    seeds = {
        name: range(first + 100 * place, first + 100 * place + floors) if first else range(floors)
        for place, name in enumerate(GROUNDS[scene])
    }
    jobs = [
        Job(scene, name, policy, speed, seed, cycles)
        for name in GROUNDS[scene]
        for policy in POLICIES
        for speed in landings
        for seed in seeds[name]
    ]
    title = f'{scene}, {"other" if first else "tuning"} floors'
    found = command.in_processes(walk, [(job,) for job in jobs], processes, title)
    walks: dict[tuple[Any, ...], list[Walk]] = {}
    for job, each in zip(jobs, found, strict=True):
        walks.setdefault((job.ground, job.policy, job.speed), []).append(each)
        walks.setdefault(('all', job.policy, job.speed), []).append(each)
    rows: Rows = {}
    for (name, policy, speed), own in walks.items():
        usual, as_fast = (walks[name, policy, each] for each in landings[:2])
        made = row(own, usual, as_fast, seeds.get(name, ()))
        rows.setdefault(name, {}).setdefault(policy, {})[label(speed)] = made
    return rows


def label(speed: float | None) -> str:
    """Return the name of a landing."""
    return 'usual' if speed is None else f'{1e3 * speed:g} mm/s'


def chosen(rows: Rows, speeds: Sequence[float]) -> float:
    """Return the speed with which a robot went farthest, both policies together."""

    def far(speed: float) -> float:
        return sum(float(rows['all'][each][label(speed)]['mm_a_cycle']) for each in POLICIES)

    return max(speeds, key=far)


def measure(floors: int, tuning: int, cycles: int, processes: int) -> dict[str, Any]:
    """Walk everything and return the document that is saved."""
    started = time.perf_counter()
    robots: dict[str, Any] = {}
    for place, scene in enumerate(GROUNDS):
        as_fast, *slower = SPEEDS[scene]
        tried = _part(scene, (as_fast, *slower), 0, tuning, cycles, processes)
        best, first = chosen(tried, slower), FIRST_SEED + 1000 * place
        other = _part(scene, (as_fast, best), first, floors, cycles, processes)
        robots[scene] = {'tuning': tried, 'chosen': label(best), 'held out': other}
    return {
        'height_mm': 1e3 * HEIGHT,
        'cycles': cycles,
        'changes': GROUNDS,
        'robots': robots,
        'wall_s': round(time.perf_counter() - started, 1),
    }


# --- table and picture ---------------------------------------------------------------------------


def _rows(document: Mapping[str, Any]) -> list[tuple[tuple[str, ...], Mapping[str, Any]]]:
    """Return every row of a document with its robot, part, ground, policy and landing."""
    return [
        ((scene, part, name, policy, landing), each)
        for scene, robot in document['robots'].items()
        for part in ('tuning', 'held out')
        for name, policies in robot[part].items()
        for policy, landings in policies.items()
        for landing, each in landings.items()
    ]


def table(document: Mapping[str, Any]) -> str:
    """Return all rows as text."""
    heads = ('robot', 'floors', 'ground', 'policy', 'landing')
    return command.listed([
        {
            **dict(zip(heads, names, strict=True)),
            'mm/s': each['landing_mm_s'],
            'dry': each['dry_share'],
            'slip, mm': each['slip_mm'],
            'mm a cycle': each['mm_a_cycle'],
            'to usual': interval(each['to usual']),
            'to as fast': interval(each['to as fast']),
            'ended early': len(each['verdicts']),
        }
        for names, each in _rows(document)
    ])  # fmt: skip


_NAMES = list(dict.fromkeys(name for grounds in GROUNDS.values() for name in grounds))
COLOURS = dict(zip(_NAMES, (BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION), strict=True))


def _ends(each: Mapping[str, Any], of_ratio: bool) -> tuple[float, ...] | None:
    """Return a value and the ends of its interval."""
    if of_ratio:
        return tuple(each['to usual'][name] for name in ('of_means', 'low', 'high'))
    if each['dry_share'] is None:
        return None
    return each['dry_share'], each['dry_low'], each['dry_high']


def _column(panels: Sequence[Axes], robot: Mapping[str, Any], scene: str) -> None:
    """Draw one robot: landings beside each other, and the grounds in each."""
    speeds, names, ticks = SPEEDS[scene], [*GROUNDS[scene]], []
    groups = [('tuning', label(speed)) for speed in (None, *speeds)]
    groups += [('held out', each) for each in ('usual', label(speeds[0]), robot['chosen'])]
    for place, (part, landing) in enumerate(groups):
        rows = robot[part]
        touch = rows['all']['dome'][landing]['landing_mm_s']
        ticks.append(f'{landing.removesuffix(" mm/s")}\n({touch:.0f})')
        for panel, policy, of_ratio in zip(
            panels, (POLICIES[0], *POLICIES), (False, True, True), strict=True
        ):
            for index, name in enumerate(names):
                ends = _ends(rows[name][policy][landing], of_ratio)
                if ends and not (of_ratio and landing == 'usual'):
                    at = place + 0.13 * (index - 0.5 * (len(names) - 1))
                    face = 'white' if part == 'tuning' else COLOURS[name]
                    panel.plot([at, at], ends[1:], color=COLOURS[name], lw=1.2)
                    panel.plot(at, ends[0], 'o', color=COLOURS[name], mfc=face, ms=4)
    for panel in panels:
        panel.axvline(len(speeds) + 0.5, color='0.8', lw=0.8, zorder=0)
        panel.set_xticks(range(len(groups)), ticks)
        panel.set_xlim(-0.5, len(groups) - 0.5)
    for panel in panels[1:]:
        panel.axhline(1.0, color='0.6', lw=0.8, zorder=0)
    panels[0].set_title(f'{scene}, tuning floors')
    panels[0].set_title('held out', loc='right')
    panels[-1].set_xlabel('speed of lowering, mm/s (of touch-down)')


def draw(document: Mapping[str, Any]) -> Figure:
    """Draw dry share and ratio of distances by landing and ground."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 7.5), layout='constrained')
        panels = figure.subplots(3, 2, sharex='col', width_ratios=(1.3, 1.0))
        for column, (scene, robot) in enumerate(document['robots'].items()):
            _column(panels[:, column], robot, scene)
        for panel, text in zip(
            panels[:, 0],
            ('dry share under wet domes', *(f'{each}: distance, to usual' for each in POLICIES)),
            strict=True,
        ):
            panel.set_ylabel(text)
        handles = [
            Line2D([], [], color=colour, marker='o', ms=4, label=name)
            for name, colour in COLOURS.items()
        ]
        figure.legend(handles=handles, loc='outside lower center', ncols=3)
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, save, and print the table."""
    parser = command.parser('landing', __doc__)
    command.add_count(parser, '--floors', 8, 'other floors of each ground')
    command.add_count(parser, '--tuning', 4, 'tuning floors')
    command.add_count(parser, '--cycles', 12, 'gait cycles of a walk')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    document = measure(options.floors, options.tuning, options.cycles, options.processes)
    document = command.write(options.out, 'landing', document, {'landing': draw(document)})
    command.show(options, document, table(document))
    return 0
