# SPDX-License-Identifier: Apache-2.0
"""Whether friction and wet ground are as probable as the filter says, also with a wrong foot file.

Robots with full dynamics (L2) walk on floors whose friction is that of the foot file, or 1.4 times
more or less, and differs from place to place by 10 %, correlated over 0.3 m. On floors drawn from
the prior factors and spread are random, as the estimator expects them before a walk. Their
readings are given to the filter as shipped, to one that learns nothing about the floor, and to
the prior, which measures nothing.

Scores are those of the last estimate of each stance under load. If a filter is right, the 5 %
quantile is above the true friction in a share of 0.05 of them, the probability of less friction
than the true one (PIT) is as often in one tenth as in another, and as many stances are wet as
P(wet) says. The CRPS, in units of friction, scores everything; smaller is better. Intervals are
those of 95 % by bootstrap over walks.

Settings were chosen on walks of seeds 1, 70 to 78, 300 to 347 and 1000 to 1116. Under domes the
ground is unobservable, and feet are flat where P(wet) is low, so that what a foot expects of the
ground before it lands is no share of wet stances by shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy import ndimage

from ros_pad.contact.resistance import Foot
from ros_pad.estimation import FootEstimator
from ros_pad.estimation.friction import GroundFilter, GroundModel
from ros_pad.estimation.scales import SCALE_SD, SPREADS
from ros_pad.estimation.tuning import Tuning
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.soles import Sole
from ros_pad.simulation.terrain import CELL, LENGTH, WIDTH
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, STYLE
from studies.samples import bootstrap
from studies.work_precision.estimator.walks import LOADED, SETTLED, Recording, record

NAME = 'priors'
FIRST_SEED, FIRST_DRAW = 2001, 2101
DURATION = 40  # s
ALL, DRAWN = 'all of these', 'drawn from the prior'
SPREAD_LENGTH = 0.3  # m over which friction changes from place to place
WRONG = 1.4
LEVELS = (np.arange(50) + 0.5) / 50.0
BINS = (0.1, 0.5, 0.9)  # of P(wet)
LEARNS, FIXED, PRIOR = 'as shipped', 'learns nothing', 'prior'
FILTERS = (LEARNS, FIXED, PRIOR)
SCENES = ('hexapod_patches', 'quadruped_patches')


@dataclass(frozen=True)
class Floor:
    """True friction over that of the foot file.

    Attributes
    ----------
    name : str
    dry, wet, dome : float
        Factors on the friction of flat feet on dry and on wet ground, and of domes.
    spread : float
        Standard deviation of the logarithm of friction from place to place.
    scene : str
    policies : tuple of str
    """

    name: str
    dry: float = 1.0
    wet: float = 1.0
    dome: float = 1.0
    spread: float = 0.1
    scene: str = SCENES[0]
    policies: tuple[str, ...] = ('flat',)


def floors() -> list[Floor]:
    """Return the floors with given factors, for each robot."""
    found, both = [], ('flat', 'adaptive')
    for scene in SCENES:
        found.append(Floor('right', scene=scene, policies=both))
        for name, factor in (('more', WRONG), ('less', 1.0 / WRONG)):
            found += [
                Floor(f'dry {name}', dry=factor, scene=scene),
                Floor(f'wet {name}', wet=factor, scene=scene),
                Floor(f'all {name}', factor, factor, factor, scene=scene, policies=both),
            ]
    return found


def drawn(seed: int) -> tuple[Floor, str]:
    """Return a floor and a policy, drawn from what the estimator expects before a walk."""
    generator = np.random.default_rng([seed, 9])
    dry, wet, dome = np.exp(SCALE_SD * generator.normal(size=3)).tolist()
    scene = 'quadruped_patches' if seed % 4 == 3 else 'hexapod_patches'
    spread = float(generator.choice(SPREADS))
    return Floor(DRAWN, dry, wet, dome, spread, scene), ('flat', 'dome', 'adaptive')[seed % 3]


def on_ground(floor: Floor, seed: int) -> Callable[[ClosedLoop], None]:
    """Return a function that changes the friction of the simulated feet of a loop, on L2."""
    shape = round(WIDTH / CELL), round(LENGTH / CELL)
    noise = np.random.default_rng([seed, 77]).normal(size=shape)
    noise = ndimage.gaussian_filter(noise, 0.5 * SPREAD_LENGTH / CELL, mode='wrap')
    places = np.exp(floor.spread / noise.std() * noise)

    def prepare(loop: ClosedLoop) -> None:
        robot: Any = loop.robot
        soles, press = robot.soles, robot.soles.press

        def changed(sole: Sole, load: float, drained: float) -> None:
            press(sole, load, drained)
            flat = floor.wet if sole.wet else floor.dry
            domed = soles.foot.dome_load(load, sole.pressure) / load
            x, y, _ = soles._places[soles._soles.index(sole)]
            place = places[int((y + 4.0) // CELL) % shape[0], int((x + 1.0) // CELL) % shape[1]]
            factor = float(place) * (domed * floor.dome + (1.0 - domed) * flat)
            sole.ratio *= factor
            for axis in range(3):
                sole.friction[axis] *= factor

        soles.press = changed

    return prepare


def walked(floor: Floor, policy: str, seed: int, duration: int = DURATION) -> Recording:
    """Walk for a duration, s, and return the readings."""
    scene = Scene.load(floor.scene)
    scene = replace(scene, cycles=math.ceil(duration / scene.gait.cycle))
    return record(scene, policy, seed, 'L2', on_ground(floor, seed))


class End(NamedTuple):
    """The last estimate of a stance, and its scores.

    Attributes
    ----------
    wet : bool
        Whether the ground was wet.
    wet_probability : float
    above : bool
        Whether the 5 % quantile is above the true friction.
    less : float
        Probability of less friction than the true one.
    crps : float
    """

    wet: bool
    wet_probability: float
    above: bool
    less: float
    crps: float


def scored(posterior: Any, wet: bool, friction: float) -> End:
    """Return the scores of a posterior where the ground and friction are known."""
    least, *middle = posterior.quantile([0.05, *LEVELS])
    away = friction - np.array(middle)
    loss = np.where(away > 0.0, LEVELS * away, (LEVELS - 1.0) * away)
    above, less = bool(friction < least), float((away > 0.0).mean())
    return End(wet, posterior.wet_probability, above, less, 2.0 * float(loss.mean()))


def ends(walk: Recording, learns: bool) -> Iterator[tuple[End, End]]:
    """Yield the last estimate of each stance, and that of the prior."""
    foot, load, tuning = walk.settings
    tuning = replace(tuning, learn_friction=learns)
    model = GroundModel.of(foot, load, tuning)
    legs = range(walk.load.shape[1])
    estimators = [FootEstimator(foot, load, tuning, model) for _ in legs]
    last: list[tuple[End, End] | None] = [None for _ in legs]
    blind = {shape: _blind(foot, load, tuning, shape) for shape in (False, True)}
    for sample, time in enumerate(walk.stamps.tolist()):
        for leg, estimator in enumerate(estimators):
            row, true = walk.rows[leg][sample], float(walk.load[sample, leg])
            now, end = estimator.update(time, row[:3], row[3:6], row[6]), last[leg]
            if now.standing and now.fresh and true > LOADED * load:
                truth = bool(walk.wet[sample, leg]), float(walk.grip[sample, leg]) / true
                domed = foot.dome_load(load, row[6]) > 0.5 * load
                last[leg] = scored(estimator.ground, *truth), scored(blind[domed], *truth)
            elif end and not now.standing:
                last[leg] = None
                if time > SETTLED:
                    yield end


def _blind(foot: Foot, load: float, tuning: Tuning, domed: bool) -> GroundFilter:
    """Return what is expected of a foot before any measurement."""
    found = GroundFilter(GroundModel.of(foot, load, tuning))
    found.touch_down(0.0, domed)
    return found


def measure(floor: Floor, policy: str, seed: int) -> dict[str, list[End]]:
    """Walk, and return the ends of stances with each filter."""
    walk = walked(floor, policy, seed)
    shipped, prior = zip(*ends(walk, True), strict=True)
    fixed = [end for end, _ in ends(walk, False)]
    return dict(zip(FILTERS, (list(shipped), fixed, list(prior)), strict=True))


Row = dict[str, Any]
"""Scores of a filter on a floor."""


def row_of(names: Row, walks: Sequence[Sequence[End]]) -> Row:
    """Return the scores of walks."""
    wet, probable, above, less, crps = np.array([end for walk in walks for end in walk]).T
    pairs = [(sum(end.above for end in walk), len(walk)) for walk in walks]
    bins = np.digitize(probable, BINS)
    return names | {
        'walks': len(walks),
        'stances': len(wet),
        'above': round(float(above.mean()), 3),
        'interval': [round(end, 3) for end in bootstrap(pairs, 2000)],
        'crps': round(float(crps.mean()), 4),
        'right': round(float(((probable > 0.5) == (wet > 0.5)).mean()), 3),
        'pit': np.histogram(less, 10, (0.0, 1.0))[0].tolist(),
        'wet': [
            [int(mine.sum()), *np.round((probable[mine].mean(), wet[mine].mean()), 3).tolist()]
            for mine in (bins == number for number in range(len(BINS) + 1))
            if mine.any()
        ],
    }


Case = tuple[Floor, str, int]


def rows_of(cases: Sequence[Case], found: Sequence[dict[str, list[End]]]) -> list[Row]:
    """Return the rows of each floor and policy, of all floors drawn and of all others."""
    rows = []
    for name in FILTERS:
        parts: dict[tuple[str, ...], list[list[End]]] = {}
        for (floor, policy, _), each in zip(cases, found, strict=True):
            drawn_one = floor.name == DRAWN
            parts.setdefault((DRAWN if drawn_one else ALL, '', ''), []).append(each[name])
            if not drawn_one:
                robot = floor.scene.split('_')[0]
                parts.setdefault((floor.name, robot, policy), []).append(each[name])
        for (floor_name, robot, policy), walks in parts.items():
            names = {'filter': name, 'floor': floor_name, 'robot': robot, 'policy': policy}
            rows.append(row_of(names, walks))
    return rows


LOOKS = dict(zip(FILTERS, ((GREEN, 'o'), (BLUE, 's'), (BLACK, 'x')), strict=True))


def draw(rows: Sequence[Row]) -> Figure:
    """Return the picture: quantile and score of each floor, P(wet) and PIT of all of them."""
    labels = list(dict.fromkeys(_label(row) for row in rows))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 0.25 * len(labels) + 1.2), layout='constrained')
        share, score, wet, pit = figure.subplots(1, 4, width_ratios=(1.3, 1.0, 1.0, 1.0))
        share.axvspan(0.03, 0.08, color='0.9', lw=0, label='asked')
        for row in rows:
            colour, marker = LOOKS[row['filter']]
            place = labels.index(_label(row)) + 0.2 * (FILTERS.index(row['filter']) - 1)
            share.plot(row['interval'], [place, place], color=colour, lw=0.9)
            for axes, key in ((share, 'above'), (score, 'crps')):
                axes.plot(row[key], place, marker, color=colour, ms=3.5, clip_on=False)
            if row['floor'] in (ALL, DRAWN) and row['filter'] == LEARNS:
                line = '-' if row['floor'] == ALL else '--'
                _, said, true = np.array(row['wet']).T
                wet.plot(said, true, line + 'o', color=colour, ms=3.5)
                shares = np.array(row['pit']) / row['stances']
                pit.stairs(
                    shares, np.linspace(0.0, 1.0, 11), color=colour, ls=line, label=row['floor']
                )
        wet.plot([0.0, 1.0], [0.0, 1.0], color='0.6', lw=0.8)
        pit.axhline(0.1, color='0.6', lw=0.8)
        share.set(xlabel='5 % quantile is above friction,\nshare of stances', xlim=(0.0, None))
        score.set(xlabel='CRPS,\nunits of friction', xlim=(0.0, None), yticks=[])
        wet.set(xlabel='P(wet)\n', ylabel='wet, share of stances')
        pit.set(
            xlabel='probability of less friction\nthan the true one',
            ylabel='share of stances',
            ylim=(0.0, 0.3),
        )
        share.set_yticks(range(len(labels)), labels)
        for axes in (share, score):
            axes.set_ylim(len(labels) - 0.5, -0.5)
        pit.legend(fontsize=8, loc='upper left')
        handles = [
            Line2D([], [], color=colour, marker=marker, ms=4.0, lw=0.9, label=name)
            for name, (colour, marker) in LOOKS.items()
        ]
        figure.legend(handles=handles, loc='outside lower center', ncols=3)
    return figure


def _label(row: Row) -> str:
    return ', '.join(word for word in (row['robot'], row['policy'], row['floor']) if word)


def table(rows: Sequence[Row]) -> str:
    """Return the rows as text."""
    return command.listed(rows)


def main(words: Sequence[str]) -> int:
    """Walk, print and save."""
    parser = command.parser(NAME, __doc__)
    command.add_count(parser, '--walks', 4, 'walks on each floor, with each policy')
    command.add_count(parser, '--draws', 48, 'floors drawn from the prior')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    draws, seeds = (
        range(first, first + count)
        for first, count in ((FIRST_DRAW, options.draws), (FIRST_SEED, options.walks))
    )
    cases: list[Case] = [
        (floor, policy, seed)
        for floor in floors() for policy in floor.policies for seed in seeds
    ]  # fmt: skip
    cases += [(*drawn(seed), seed) for seed in draws]
    rows = rows_of(cases, command.in_processes(measure, cases, options.processes, NAME))
    document = {'seeds': list(seeds), 'seeds_drawn': list(draws), 'rows': rows}
    written = command.write(options.out, NAME, document, {NAME: draw(rows)})
    command.show(options, written, table(rows))
    return 0
