# SPDX-License-Identifier: Apache-2.0
"""Measure how well force and angular rate detect slip on labelled contacts of other robots.

The files are those of https://github.com/mrsp/lcd, folder ``data`` (MIT;
https://ieeexplore.ieee.org/document/9981354): 13 columns at 100 Hz without a header: force x, y,
z (N), moment x, y, z (N m), acceleration x, y, z without gravity (m/s²), angular rate x, y, z
(rad/s) of one foot, and a label: 0 stable contact, 1 no contact, 2 slip. A file's name up to its
first underscore is the robot; two robots or more are needed. Writes labelled_contacts.png and
.json.
"""

from __future__ import annotations

import functools
import json
import math
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.errors import InvalidInput
from ros_pad.estimation.track import LOAD_GATE
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, STYLE, VERMILION
from studies.samples import auc, runs

SOURCE = 'https://github.com/mrsp/lcd (folder data)'
STABLE, NONE, SLIP = 0, 1, 2
PERIOD = 0.01
"""Sampling period of the set, s."""

GATE = LOAD_GATE
"""Share of the expected load above which a foot is in stance, as for FootEstimator."""

LABEL_RATE = 0.08
"""Angular rate above which most samples are labelled slip, rad/s; found in the data."""

FALSE_PER_MINUTE = 1.0
"""Allowed number of false alarms per minute of quiet samples (``Recording.quiet``)."""

SHORTEST, CLEAR = 0.03, 0.05
"""Shortest slip that counts as an event, and shortest gap that splits one, s; and distance in
time from any labelled slip, s: alarms nearer than this are not false."""

SAME = 0.02
"""Relative difference up to which two coefficients of friction count as equal."""

FEWEST = 10
"""Smallest number of slips for which a share is given."""

FEATURES = ('T/N', 'rate')
"""What may show slip, by sample: T/N, and the angular rate."""


# --- recordings ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)  # compared and hashed by identity
class Recording:
    """One foot of one robot, by sample.

    Attributes
    ----------
    name : str
        Name of the file without its ending.
    force, rate : ndarray, shape (n, 3)
        N and rad/s.
    label : ndarray of int, shape (n,)
        ``STABLE``, ``NONE`` or ``SLIP``.
    """

    name: str
    force: np.ndarray
    rate: np.ndarray
    label: np.ndarray

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return self.name.split('_')[0]

    @property
    def load(self) -> np.ndarray:
        """Normal force, N."""
        return self.force[:, 2]

    @functools.cached_property
    def expected_load(self) -> float:
        """Median of all normal forces above zero, N; needs no label."""
        return float(np.median(self.load[self.load > 0.0]))

    @functools.cached_property
    def standing(self) -> np.ndarray:
        """Whether each sample is in stance."""
        return self.load > GATE * self.expected_load

    @functools.cached_property
    def stances(self) -> list[tuple[int, int]]:
        """Index of the first sample of each stance, and of the first sample after the stance."""
        return runs(self.standing)

    @functools.cached_property
    def slipping(self) -> np.ndarray:
        """Whether each sample is in stance and labelled slip."""
        return self.standing & (self.label == SLIP)

    @functools.cached_property
    def sticking(self) -> np.ndarray:
        """Whether each sample is in stance and labelled stable."""
        return self.standing & (self.label == STABLE)

    def per_load(self, value: np.ndarray) -> np.ndarray:
        """Return a value over the normal force; zero without load."""
        loaded = self.load > 0.0
        return np.where(loaded, value / np.where(loaded, self.load, 1.0), 0.0)

    @functools.cached_property
    def ratio(self) -> np.ndarray:
        """T/N; zero without load."""
        return self.per_load(np.hypot(self.force[:, 0], self.force[:, 1]))

    @functools.cached_property
    def floors(self) -> list[float]:
        """Coefficients of friction of the floors: values of T/N that are frequent in slips.

        In simulated Coulomb friction, T/N of a sliding foot is constant to four digits. A value
        that at least 1 % of the slip samples share is taken as the friction of a floor.
        """
        values, counts = np.unique(self.ratio[self.slipping].round(4), return_counts=True)
        found: list[float] = []
        for index in np.argsort(-counts, kind='stable'):
            value = float(values[index])
            apart = all(abs(value - other) > SAME * other for other in found)
            if counts[index] >= 0.01 * self.slipping.sum() and apart:
                found.append(value)
        return found

    @functools.cached_property
    def quiet(self) -> np.ndarray:
        """Whether each sample is stable, in stance, and :data:`CLEAR` away from labelled slips."""
        reach = round(CLEAR / PERIOD)
        near = np.convolve(self.label == SLIP, np.ones(2 * reach + 1), 'same') > 0.5
        return self.sticking & ~near

    @property
    def quiet_minutes(self) -> float:
        """Total time of the quiet samples, minutes."""
        return float(self.quiet.sum()) * PERIOD / 60.0

    @functools.cached_property
    def events(self) -> list[tuple[int, int]]:
        """Start and end (exclusive) of labelled slips in stance of at least :data:`SHORTEST`."""
        shortest = round(SHORTEST / PERIOD)
        joined = runs(self.slipping, join=shortest - 1)
        return [(start, stop) for start, stop in joined if stop - start >= shortest]

    @functools.cached_property
    def speed(self) -> np.ndarray:
        """Magnitude of the angular rate, rad/s."""
        return np.linalg.norm(self.rate, axis=1)


def read(path: pathlib.Path) -> Recording:
    """Return the recording of a file.

    Raises
    ------
    InvalidInput
        When the file is missing, has anything but 13 columns of finite numbers, has labels other
        than 0, 1 and 2, or has no stable contact or no slip in stance.
    """
    if not path.is_file():
        raise InvalidInput(f'{path}: no such file; fetch it from {SOURCE}')
    try:
        table = np.genfromtxt(path, delimiter=',', ndmin=2)
    except ValueError as error:
        raise InvalidInput(f'{path}: {error}; 13 columns of numbers are needed') from error
    if table.shape[1] != 13:
        raise InvalidInput(f'{path} has shape {table.shape}: 13 columns are needed')
    if not np.isfinite(table).all() or not np.isin(table[:, 12], (STABLE, NONE, SLIP)).all():
        raise InvalidInput(
            f'{path}: 13 columns of finite numbers are needed, the last one (labels'
            f' {np.unique(table[:, 12])}) 0, 1 or 2'
        )
    found = Recording(path.stem, table[:, :3], table[:, 9:12], table[:, 12].astype(int))
    if not (np.any(found.load > 0.0) and found.slipping.any() and found.sticking.any()):
        raise InvalidInput(
            f'{path} has no stable contact or no slip in stance (force z above {GATE:g} of the'
            ' expected load): at least one sample of each is needed'
        )
    return found


# --- features ------------------------------------------------------------------------------------


def features(recording: Recording) -> dict[str, np.ndarray]:
    """Return each feature by sample; a larger value makes slip more likely."""
    return dict(zip(FEATURES, (recording.ratio, recording.speed), strict=True))


# --- ranking -------------------------------------------------------------------------------------


def ranking(score: np.ndarray, recording: Recording, resamples: int = 200) -> dict[str, Any]:
    """Return how well a score separates slip from stick in stance.

    ``interval`` is the 95 % interval of the AUC, from stances drawn with replacement, because
    samples of one stance depend on each other. ``within_stance`` is the AUC over pairs of samples
    of one stance, NaN without such pairs: they are hardly ever from two floors.
    """
    slip = [score[a:b][recording.slipping[a:b]] for a, b in recording.stances]
    stick = [score[a:b][recording.sticking[a:b]] for a, b in recording.stances]

    def joined(chosen: np.ndarray) -> float:
        return auc(*(np.concatenate([each[index] for index in chosen]) for each in (slip, stick)))

    draw = np.random.default_rng(0)
    drawn = [joined(draw.integers(len(slip), size=len(slip))) for _ in range(resamples)]
    pairs = [(auc(a, b), len(a) * len(b)) for a, b in zip(slip, stick, strict=True) if a.size]
    aucs, counts = np.array([pair for pair in pairs if pair[1]]).reshape(-1, 2).T
    return {
        'auc': auc(score[recording.slipping], score[recording.sticking]),
        'interval': tuple(np.nanquantile(drawn, [0.025, 0.975]).tolist()),
        'within_stance': (float(np.average(aucs, weights=counts)) if len(aucs) else math.nan),
    }


# --- tables --------------------------------------------------------------------------------------


def measure(recordings: Sequence[Recording]) -> dict[str, Any]:
    """Return the document with all tables, by recording."""
    scores = {each.name: features(each) for each in command.each(recordings, 'features', 'file')}
    found = {}
    for each in command.each(recordings, 'tables', 'file'):
        own = scores[each.name]
        others = [other for other in recordings if other.robot != each.robot]
        alarms: dict[str, Any] = {}
        for name in FEATURES:
            for word, teachers in (('own', [each]), ('other', others)):
                taught = [scores[other.name][name] for other in teachers]
                threshold = operating_threshold(taught, teachers)
                alarms.setdefault(name, {})[word] = alarm_figures(own[name], threshold, each)
        found[each.name] = {
            'labels': labels(each),
            'ranking': {name: ranking(own[name], each) for name in FEATURES},
            'alarm': alarms,
        }
    return {
        'source': SOURCE, 'gate': GATE, 'false_per_minute': FALSE_PER_MINUTE, 'recordings': found,
    }  # fmt: skip


def labels(recording: Recording) -> dict[str, Any]:
    """Return how many labels there are, and the friction of the floors."""
    return {
        'samples': len(recording.label),
        'stances': len(recording.stances),
        'slips': int(recording.slipping.sum()),
        'expected_load_N': recording.expected_load,
        'floors': recording.floors,
    }


# --- alarms --------------------------------------------------------------------------------------


def false_alarms(score: np.ndarray, threshold: float, recording: Recording) -> int:
    """Return the number of alarms in quiet samples."""
    return len(runs((score > threshold) & recording.quiet))


def operating_threshold(scores: Sequence[np.ndarray], recordings: Sequence[Recording]) -> float:
    """Return the lowest threshold at which false alarms stay within :data:`FALSE_PER_MINUTE`.

    Candidates are 120 quantiles of the score in quiet samples; all higher ones must do so, too.
    """
    minutes = sum(each.quiet_minutes for each in recordings)
    pairs = list(zip(scores, recordings, strict=True))
    pooled = np.concatenate([score[each.quiet] for score, each in pairs])
    chosen = float(pooled.max())
    for threshold in np.quantile(pooled, 1.0 - np.geomspace(1.0 / len(pooled), 1.0, 120)):
        false = sum(false_alarms(score, threshold, each) for score, each in pairs)
        if false > FALSE_PER_MINUTE * minutes:
            break
        chosen = float(threshold)
    return chosen


def alarm_figures(score: np.ndarray, threshold: float, recording: Recording) -> dict[str, Any]:
    """Return misses, median delay and false alarms of a threshold.

    The share of misses is None for fewer than :data:`FEWEST` slips.
    """
    slips = recording.events
    above = [np.flatnonzero(score[start:stop] > threshold) for start, stop in slips]
    delays = [float(each[0]) * PERIOD for each in above if len(each)]
    return {
        'threshold': threshold,
        'events': len(slips),
        'missed': 1.0 - len(delays) / len(slips) if len(slips) >= FEWEST else None,
        'delay_s': float(np.median(delays)) if delays else None,
        'false_per_minute': false_alarms(score, threshold, recording) / recording.quiet_minutes,
    }


# --- table and picture ---------------------------------------------------------------------------


def table(document: dict[str, Any]) -> str:
    """Return labels, ranking and alarms as text."""
    found = document['recordings']
    lines = [command.listed([{'file': name, **row['labels']} for name, row in found.items()])]
    for part in ('ranking', 'alarm'):
        rows = [
            {'file': name, part: score, **row}
            for name, parts in found.items()
            for score, row in parts[part].items()
        ]
        lines.append(command.listed(rows))
    return '\n\n'.join(lines)


COLOURS = (SKY, BLUE, GREEN, ORANGE, VERMILION, PURPLE, BLACK)


def draw(recordings: Sequence[Recording], document: dict[str, Any]) -> Figure:
    """Return the picture: ranking, T/N and angular rate."""
    rows = document['recordings']
    colours = dict(zip(rows, COLOURS, strict=False))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 4.0), layout='constrained')
        a, b, c = figure.subplots(1, 3)
        _draw_ranking(a, rows, colours)
        _draw_ratio(b, max(recordings, key=lambda each: len(each.floors)))
        _draw_rate(c, recordings, colours)
    return figure


def _draw_ranking(panel: Axes, rows: dict[str, Any], colours: dict[str, str]) -> None:
    for number, (name, row) in enumerate(rows.items()):
        places = np.arange(len(FEATURES)) + 0.15 * (number - 0.5 * (len(rows) - 1))
        found = [row['ranking'][each] for each in FEATURES]
        ends = np.array([each['interval'] for each in found]).T
        panel.hlines(places, *ends, color=colours[name], lw=1.4)
        values = [each['auc'] for each in found]
        label = name.replace('_', ' ')
        panel.plot(values, places, 'o', ms=4.0, color=colours[name], label=label)
    panel.axvline(0.5, color=BLACK, lw=0.9, ls='--')
    panel.set_yticks(range(len(FEATURES)), FEATURES)
    panel.set(
        ylim=(len(FEATURES) - 0.5, -0.5),
        xlim=(0.1, 1.02),
        xlabel='AUC of labelled slip, in stance',
        title='a  slip ranked above stable contact',
    )
    panel.legend(fontsize=7.5, loc='lower left')


def _draw_ratio(panel: Axes, recording: Recording) -> None:
    bins = np.linspace(0.0, 0.6, 61).tolist()
    for label, mask, colour in (
        ('stable', recording.sticking, BLUE), ('slip', recording.slipping, VERMILION)
    ):  # fmt: skip
        weights = np.full(mask.sum(), 100.0 / mask.sum())
        panel.hist(recording.ratio[mask], bins, weights=weights, label=label, color=colour,
                   histtype='step', lw=1.6)  # fmt: skip
    panel.plot(recording.floors, np.zeros(len(recording.floors)), '^', color=BLACK, ms=5.0,
               clip_on=False, label='friction of its floors', zorder=5)  # fmt: skip
    panel.set(
        xlim=(0.0, 0.6), xlabel='T/N', ylabel='% of samples in stance, each 0.01',
        title=f'b  {recording.name.replace("_", " ")}: T/N of both',
    )  # fmt: skip
    panel.legend(fontsize=8)


def _draw_rate(panel: Axes, recordings: Sequence[Recording], colours: dict[str, str]) -> None:
    for recording in recordings:
        for mask, look in ((recording.sticking, '-'), (recording.slipping, '--')):
            values = np.sort(recording.speed[mask])
            share = np.arange(1, len(values) + 1) / len(values)
            panel.plot(values, 100.0 * share, look, color=colours[recording.name], lw=1.3)
    panel.axvline(LABEL_RATE, color=BLACK, lw=0.9, ls=':')
    panel.set(
        xscale='log', xlim=(1e-4, 2.0), ylim=(0.0, 101.0),
        xlabel='angular rate of the foot in stance (rad/s); dotted: 0.08',
        ylabel='% of samples below', title='c  angular rate: stable (solid), slip (dashed)',
    )  # fmt: skip


def main(words: Sequence[str]) -> int:
    """Measure, print and draw."""
    parser = command.parser('labelled_contacts', __doc__)
    parser.add_argument(
        'files', type=pathlib.Path, nargs='+', metavar='FILE.csv', help='two robots at least'
    )
    command.add_out(parser)
    options = parser.parse_args(words)
    recordings = [read(path) for path in options.files]
    if len({each.robot for each in recordings}) < 2:
        raise InvalidInput(
            f'all files are of one robot, {recordings[0].robot} (the name up to the underscore):'
            f' files of two robots or more are needed; fetch them from {SOURCE}'
        )
    # More than five digits would not be significant.
    document = json.loads(
        json.dumps(measure(recordings)), parse_float=lambda text: float(f'{float(text):.5g}')
    )
    pictures = {'labelled_contacts': draw(recordings, document)}
    kept = command.write(options.out, 'labelled_contacts', document, pictures)
    command.show(options, kept, table(document))
    return 0
