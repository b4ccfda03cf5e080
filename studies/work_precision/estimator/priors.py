# SPDX-License-Identifier: Apache-2.0
"""Score the estimates of friction where the foot file is wrong.

Robots with full dynamics (L2) walk on floors whose friction differs from that of the foot file by
a factor, and from place to place by a spread that is correlated over 0.3 m. Their readings are
given to the filter as shipped, to one that learns nothing, and to three without any measurement:
the prior, the prior with the true ground (wet or dry), and one that knows the factors as well.

The score is the continuous ranked probability score (CRPS, in units of friction; smaller is
better): unlike the logarithm of a density it is finite for a truth outside of all that was
expected, and it does not depend on the cells of a grid. Beside it are the share of time, and of
stances, in which the truth is within the 95 % interval (calibration), the width of the interval
(sharpness), and the share of time below the 5 % quantile, on which the friction margin rests.

"Drawn from the prior": each walk has its own floor, with factors and spread drawn from what the
estimator expects before a walk, so that an interval of 95 % holds in 95 % of walks if it is right.
Under domes the ground is unobservable, so calibration is due for dry and wet together ("all").
The other floors have factors of 1/1.4 to 2; of them "late" is from two minutes on. The interval
beside a figure is that of 95 % by bootstrap over walks, or the range if there are fewer than
eight. Settings were chosen on walks of seeds 1 and 1000 to 1035, as `studies priors` makes
them; these begin with seeds 70 and 300, which no setting has seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy import ndimage

from ros_pad.estimation import FootEstimator
from ros_pad.estimation.friction import GroundFilter, GroundModel
from ros_pad.estimation.scales import SCALE_SD, SPREADS, Scale
from ros_pad.estimation.tuning import Tuning
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.soles import Sole
from ros_pad.simulation.terrain import CELL, LENGTH, WIDTH
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PURPLE, STYLE
from studies.samples import bootstrap
from studies.work_precision.estimator.walks import SETTLED, Recording, record

NAME = 'priors'
FIRST_SEED, FIRST_DRAW = 70, 300
DURATION, DRAWN_DURATION = 150, 40  # s
DRAWN = 'drawn from the prior'
FEW = 8  # walks, below which an interval is a range
LATE = 120.0  # s
EARLY = 30.0  # s
SPREAD_LENGTH = 0.3  # m over which friction changes from place to place
CLASSES = ('dry', 'wet', 'dome, dry', 'dome, wet', 'all')
LEVELS = (np.arange(50) + 0.5) / 50.0
SHARES = np.concatenate([[0.025, 0.05, 0.975], LEVELS])
LEARNS, FIXED, PRIOR, LABEL, KNOWN = (
    'learning', 'not learning', 'prior', 'prior, true ground', 'prior, true ground and scale',
)  # fmt: skip
FILTERS = (LEARNS, FIXED, PRIOR, LABEL, KNOWN)


@dataclass(frozen=True)
class Condition:
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
    walks : int
        How many times as many walks as of other conditions.
    """

    name: str
    dry: float = 1.0
    wet: float = 1.0
    dome: float = 1.0
    spread: float = 0.1
    scene: str = 'hexapod_patches'
    policies: tuple[str, ...] = ('flat', 'dome')
    walks: int = 1


CONDITIONS = (
    *(Condition(f'right, spread {spread:g}', spread=spread) for spread in (0.0, 0.1, 0.2)),
    Condition('right, adaptive', policies=('adaptive',)),
    Condition('right, quadruped', scene='quadruped_patches'),
    Condition('dry 1/1.4, quadruped', dry=1 / 1.4, walks=4, scene='quadruped_patches'),
    Condition('dry 1/1.4, adaptive', dry=1 / 1.4, walks=4, policies=('adaptive',)),
    Condition('dry 1/1.4', dry=1 / 1.4, walks=4, policies=('flat',)),
    Condition('dry 2', dry=2.0, policies=('flat',)),
)


def drawn(seed: int) -> tuple[Condition, str]:
    """Return a floor and a policy, drawn from what the estimator expects before a walk."""
    generator = np.random.default_rng([seed, 9])
    dry, wet, dome = np.exp(SCALE_SD * generator.normal(size=3)).tolist()
    scene = 'quadruped_patches' if seed % 4 == 3 else 'hexapod_patches'
    spread = float(generator.choice(SPREADS))
    floor = Condition(DRAWN, dry, wet, dome, spread, scene=scene)
    return floor, ('flat', 'dome', 'adaptive')[seed % 3]


def on_ground(condition: Condition, seed: int) -> Callable[[ClosedLoop], None]:
    """Return a function that changes the friction of the simulated feet of a loop, on L2."""
    shape = round(WIDTH / CELL), round(LENGTH / CELL)
    noise = np.random.default_rng([seed, 77]).normal(size=shape)
    noise = ndimage.gaussian_filter(noise, 0.5 * SPREAD_LENGTH / CELL, mode='wrap')
    places = np.exp(condition.spread / noise.std() * noise)

    def prepare(loop: ClosedLoop) -> None:
        robot: Any = loop.robot
        soles, press = robot.soles, robot.soles.press

        def changed(sole: Sole, load: float, drained: float) -> None:
            press(sole, load, drained)
            flat = condition.wet if sole.wet else condition.dry
            domed = soles.foot.dome_load(load, sole.pressure) / load
            x, y, _ = soles._places[soles._soles.index(sole)]
            place = places[int((y + 4.0) // CELL) % shape[0], int((x + 1.0) // CELL) % shape[1]]
            factor = float(place) * (domed * condition.dome + (1.0 - domed) * flat)
            sole.ratio *= factor
            for axis in range(3):
                sole.friction[axis] *= factor

        soles.press = changed

    return prepare


def walked(condition: Condition, policy: str, seed: int, duration: int) -> Recording:
    """Walk for a duration, s, and return the readings."""
    scene = Scene.load(condition.scene)
    scene = replace(scene, cycles=math.ceil(duration / scene.gait.cycle))
    return record(scene, policy, seed, 'L2', on_ground(condition, seed))


@dataclass
class Sample:
    """One update of the filter of a standing foot, and the score of its posterior."""

    time: float
    stance: int
    ground: int
    wrong: float
    covered: bool
    below: bool
    width: float
    crps: float


def updates(walk: Recording, learns: bool) -> Iterator[tuple[float, int, int, int, float, Any]]:
    """Yield time, leg, stance, class, true friction and estimator at each update under load."""
    foot, load, tuning = walk.settings
    legs = range(walk.load.shape[1])
    tuning = replace(tuning, learn_friction=learns)
    model = GroundModel.of(foot, load, tuning)
    estimators = [FootEstimator(foot, load, tuning, model) for _ in legs]
    rows, stood, stances = walk.rows, [False] * len(legs), [0] * len(legs)
    for sample, time in enumerate(walk.stamps.tolist()):
        for leg in legs:
            row, true = rows[leg][sample], float(walk.load[sample, leg])
            now = estimators[leg].update(time, row[:3], row[3:6], row[6])
            stances[leg] += now.standing and not stood[leg]
            stood[leg] = now.standing
            if now.fresh and now.standing and time > SETTLED and true > 1e-6:
                domed = walk.foot.dome_load(walk.expected_load, row[6]) > 0.5 * walk.expected_load
                ground = 2 * domed + int(walk.wet[sample, leg])
                friction = float(walk.grip[sample, leg]) / true
                yield time, leg, stances[leg], ground, friction, estimators[leg]


def measure(
    condition: Condition, policy: str, seed: int, duration: int
) -> dict[str, list[Sample]]:
    """Walk for a duration, s, and return the samples of each filter."""
    walk = walked(condition, policy, seed, duration)
    found: dict[str, list[Sample]] = {name: [] for name in FILTERS}
    blind = _without_measurement(walk, condition)
    for name in (LEARNS, FIXED):
        for time, leg, stance, ground, friction, estimator in updates(walk, name == LEARNS):
            filters = {name: estimator.ground}
            if name == LEARNS:
                filters |= {other: kinds[ground] for other, kinds in blind.items()}
            for key, each in filters.items():
                each.scales = estimator.ground.scales
                found[key].append(_sample(each, time, 1000 * stance + leg, ground, friction))
    return found


def _sample(ground_filter: Any, time: float, stance: int, ground: int, friction: float) -> Sample:
    low, least, high, *middle = ground_filter.quantile(SHARES)
    away = friction - np.array(middle)
    return Sample(
        time, stance, ground, abs(ground_filter.wet_probability - ground % 2),
        low <= friction <= high, friction < least, high - low,
        2.0 * float(np.mean(np.where(away > 0.0, LEVELS * away, (LEVELS - 1.0) * away))),
    )  # fmt: skip


def _without_measurement(walk: Recording, condition: Condition) -> dict[str, list[GroundFilter]]:
    """Return, for each filter without measurement, its posterior in each class."""
    foot, load, tuning = walk.settings
    sure = {
        'flat_dry': Scale(condition.dry, 0.01),
        'flat_wet': Scale(condition.wet, 0.01),
        'dome': Scale(condition.dome, 0.01),
    }
    found: dict[str, list[GroundFilter]] = {}
    for name, scales in ((PRIOR, tuning.scales), (LABEL, tuning.scales), (KNOWN, sure)):
        shared = GroundModel.of(foot, load, replace(tuning, scales=scales)).shared
        found[name] = []
        for ground in range(4):
            wet = Tuning.wet_prior if name == PRIOR else (1e-9, 1.0 - 1e-9)[ground % 2]
            found[name].append(GroundFilter(GroundModel(shared, wet_prior=wet)))
            found[name][-1].touch_down(0.0, ground >= 2)
            found[name][-1].fade(math.inf)  # films have drained
    return found


# --- tables --------------------------------------------------------------------------------------


Row = dict[str, Any]
"""Scores of a filter under a condition, of a class of friction, early or late."""


def _columns(samples: Sequence[Sample]) -> dict[str, np.ndarray]:
    """Return the samples of a walk as arrays."""
    rows = np.array([astuple(each) for each in samples], dtype=float)
    return dict(zip(Sample.__dataclass_fields__, rows.T, strict=True)) if samples else {}


def _chosen(
    table: dict[str, np.ndarray], ground: int, start: float, end: float
) -> dict[str, np.ndarray]:
    """Return the samples of a class between two times, s."""
    if not table:
        return {}
    mine = (table['ground'] == ground) | (CLASSES[ground] == 'all')
    use = mine & (table['time'] >= start) & (table['time'] < end)
    return {name: values[use] for name, values in table.items()} if use.any() else {}


def rows_of(condition: Condition, walks: Sequence[dict[str, list[Sample]]]) -> list[Row]:
    """Return the rows of the walks under a condition."""
    rows = []
    for name in FILTERS:
        columns = [_columns(walk[name]) for walk in walks]
        phases = [('early', 0.0, EARLY), ('late', LATE, math.inf)]
        for phase, start, end in [('whole', 0.0, math.inf)] if condition.name == DRAWN else phases:
            for ground, ground_name in enumerate(CLASSES):
                parts = [part for each in columns if (part := _chosen(each, ground, start, end))]
                if parts:
                    rows.append(_row(condition.name, name, phase, ground_name, parts))
    return rows


def _row(
    condition: str, name: str, phase: str, ground: str, parts: Sequence[dict[str, np.ndarray]]
) -> Row:
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    stances, labels = [], []
    for part in parts:
        _, stance = np.unique(part['stance'], return_inverse=True)
        stances.append(np.bincount(stance, part['covered']) / np.bincount(stance))
        last = np.flatnonzero(np.diff(stance, append=-1))
        labels.append(part['wrong'][last] > 0.5)
    by_stance = np.concatenate(stances)
    right = joined['wrong'] < 0.5
    measured = name in (LEARNS, FIXED) and ground in ('dry', 'wet')

    def mean(key: str) -> float:
        return round(float(joined[key].mean()), 4)

    def ends(key: str) -> list[float]:
        sums = np.array([(part[key].sum(), len(part[key])) for part in parts])
        means = sums[:, 0] / sums[:, 1]
        few = len(parts) < FEW
        low, high = (means.min(), means.max()) if few else bootstrap(sums.tolist(), 2000)
        return [round(float(low), 3), round(float(high), 3)]

    return {
        'condition': condition, 'filter': name, 'phase': phase, 'ground': ground,
        'walks': len(parts), 'samples': len(joined['time']), 'stances': len(by_stance),
        'coverage': mean('covered'), 'coverages': ends('covered'),
        'stance_coverage': round(float(by_stance.mean()), 4),
        'right_coverage': round(float(joined['covered'][right].mean()), 4)
        if measured and right.any() else None,
        'below': mean('below'), 'belows': ends('below'), 'width': mean('width'),
        'crps': mean('crps'),
        'wrong_labels': round(float(np.concatenate(labels).mean()), 4) if measured else None,
    }  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    """Return all but the first half minute as text."""
    return command.listed([row for row in rows if row['phase'] != 'early'])


_LOOKS = dict(
    zip(FILTERS, zip((GREEN, BLUE, BLACK, ORANGE, PURPLE), 'osxv^', strict=True), strict=True)
)
# Name of the axis, key of the interval, nominal value, target.
_PANELS = {
    'coverage': ('time in the 95 % interval, share', 'coverages', 0.95, (0.9, 0.98)),
    'below': ('time below the 5 % quantile, share', 'belows', 0.05, (0.03, 0.08)),
    'crps': ('CRPS, units of friction', '', None, None),
}


def draw(document: dict[str, Any]) -> Figure:
    """Return the picture of a document: scores of each filter by floor, on all ground together."""
    rows = [row for row in document['rows'] if row['phase'] != 'early' and row['ground'] == 'all']
    names = list(dict.fromkeys(row['condition'] for row in rows))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 0.4 * len(names) + 1.4), layout='constrained')
        panels = figure.subplots(1, len(_PANELS), sharey=True)
        for panel, (key, (label, ends, nominal, target)) in zip(
            panels, _PANELS.items(), strict=True
        ):
            if target:
                panel.axvspan(*target, color='0.9', lw=0, zorder=0, label='target')
                panel.axvline(nominal, color='0.6', lw=0.8, zorder=0, label='nominal')
            for row in rows:
                colour, marker = _LOOKS[row['filter']]
                place = names.index(row['condition']) + 0.15 * (FILTERS.index(row['filter']) - 2)
                if ends and row['walks'] > 1:
                    panel.plot(row[ends], [place, place], color=colour, lw=0.9)
                panel.plot(row[key], place, marker, color=colour, ms=4.0, clip_on=False)
            for place in range(len(names) - 1):
                panel.axhline(place + 0.5, color='0.9', lw=0.5, zorder=0)
            panel.set_xlabel(label)
            panel.tick_params(axis='y', length=0)
        walks = {row['condition']: row['walks'] for row in rows}
        panels[0].set_yticks(range(len(names)), [f'{name} ({walks[name]})' for name in names])
        panels[0].set_ylim(max(1, len(names)) - 0.5, -0.5)
        title = f'Dry, wet and domes together (walks). Bars: 95 % by walk; range below {FEW} walks'
        figure.suptitle(title, fontsize=9.5)
        panels[-1].set_xlim(left=0.0)
        handles = [
            Line2D([], [], color=colour, marker=marker, ms=4.0, lw=0.9, label=name)
            for name, (colour, marker) in _LOOKS.items()
        ]
        handles += panels[0].get_legend_handles_labels()[0]
        figure.legend(handles=handles, loc='outside lower center', ncols=4)
    return figure


def main(words: Sequence[str]) -> int:
    """Walk, print and save."""
    parser = command.parser(NAME, __doc__)
    command.add_count(
        parser,
        '--walks',
        2,
        'number of walks of a condition and policy, four times as many'
        ' where dry friction is 1/1.4',
    )
    command.add_count(parser, '--draws', 48, 'number of floors drawn from the prior')
    command.add_count(parser, '--duration', DURATION, 'duration of a walk, s; of drawn ones 40 s')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    draws = range(FIRST_DRAW, FIRST_DRAW + options.draws)
    cases = [(*drawn(seed), seed, min(DRAWN_DURATION, options.duration)) for seed in draws]
    cases += [
        (each, policy, seed, options.duration)
        for each in CONDITIONS for policy in each.policies
        for seed in range(FIRST_SEED, FIRST_SEED + options.walks * each.walks)
    ]  # fmt: skip
    parts = command.in_processes(measure, cases, options.processes, NAME)
    rows: list[Row] = []
    for name in dict.fromkeys(case[0].name for case in cases):
        mine = [(case, part) for case, part in zip(cases, parts, strict=True)
                if case[0].name == name]  # fmt: skip
        rows += rows_of(mine[0][0][0], [part for _, part in mine])
    document = {
        'duration_s': options.duration,
        'seeds': sorted({case[2] for case in cases if case[0].name != DRAWN}),
        'seeds_drawn': list(draws),
        'rows': rows,
    }
    written = command.write(options.out, NAME, document, {NAME: draw(document)})
    command.show(options, written, table(rows))
    return 0
