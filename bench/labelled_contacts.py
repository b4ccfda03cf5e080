# SPDX-License-Identifier: Apache-2.0
"""What force, moment and foot IMU say of slip on labelled contacts of other people's robots.

Run ``python bench/labelled_contacts.py FILE.csv FILE.csv ... [--json]``. The files are those of
https://github.com/mrsp/lcd, folder ``data`` (MIT; https://ieeexplore.ieee.org/document/9981354):
13 columns at 100 Hz without a header: force x, y, z (N), moment x, y, z (N m), acceleration x, y,
z without gravity (m/s²), angular rate x, y, z (rad/s) of one foot, and a label: 0 stable contact,
1 no contact, 2 slip. What a file's name says before its first underscore is the robot; two robots
are needed. Tables go to the screen, a figure and its numbers (labelled_contacts.png and .json) to
docs/charts. ``bench/turning_feet.py`` asks our own robot about the angular rate.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import pathlib
import sys
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import optimize
from scipy import special
from scipy import stats
from tqdm import tqdm

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import Tuning
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.friction import FrictionPrior
from ros_pad.estimation.friction import GroundFilter
from ros_pad.trials.report import STYLE
from ros_pad.trials.report import rendered
from ros_pad.trials.report import save

CHARTS = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'charts'
SOURCE = 'https://github.com/mrsp/lcd (folder data)'
STABLE, NONE, SLIP = 0, 1, 2
PERIOD = 0.01
"""Between samples, s."""

GATE = Tuning().load_gate
"""Share of the expected load above which a foot stands, as for FootEstimator."""

LABEL_RATE = 0.08
"""Angular rate at which labels turn from stable to slip, rad/s: read off the data."""

EDGE_TIME = 0.1
"""What counts as just landed, or about to lift off, s."""

FALSE_PER_MINUTE = 1.0
"""Alarms a minute of stick that are put up with."""

SHORTEST = 0.03
"""Slips shorter than this are no events, and gaps shorter than this do not part them, s."""

CLEAR = 0.05
"""From any labelled slip, s: nearer alarms are not false."""

SAME = 0.02
"""Relative difference up to which two coefficients of friction are one."""

FEWEST = 10
"""Slips, without which no share of them is told."""

POINT = 1e-4
"""Moment about the vertical, over the load, below which a foot stands on a point, m."""

RESAMPLES = 200
PRIOR = FrictionPrior.of(Foot.load('large37'), 6.8)
LEAST = 1e-6
"""Below every reading: logarithms and ratios exist also where a sensor reads nothing."""

RATIO, TWIST = 'T/N', 'T/N with M_z'
LIGHT, EDGE, MARGIN = 'lightly loaded', 'centre of pressure at edge', 'margin from T/N alone'
RATE, YAW, ROLL = 'rate', 'rate about vertical', 'rate about horizontal'
QUIETLY, LARGELY = 'rate / quiet rate', 'rate / largest rate'
RIM, CUSUM = 'rim speed', 'CUSUM of rim speed'
SHAKE = 'acceleration'
BOTH, CHANNELS, SHARES = 'T/N and rate', '12 channels', '12 channels / largest'
AXES = tuple(f'{kind} {axis}' for kind in ('force', 'moment', SHAKE, 'rate') for axis in 'xyz')
FITTED = {BOTH: (RATIO, RATE), CHANNELS: AXES, SHARES: tuple(f'{name} / largest' for name in AXES)}
"""What is put together by a logistic fit."""

RANKED = (RATIO, TWIST, MARGIN, LIGHT, EDGE, ROLL, YAW, RATE, CUSUM, SHAKE, BOTH, CHANNELS)
ALARMED = (RATIO, YAW, RATE, QUIETLY, LARGELY, RIM, CUSUM, SHAKE, BOTH, CHANNELS, SHARES)
CALIBRATED = (RATIO, TWIST, YAW, RATE, QUIETLY, LARGELY, RIM, SHAKE, BOTH, CHANNELS, SHARES)
FORCELESS = (ROLL, YAW, RATE, CUSUM, SHAKE)
"""What is not made from the force, which shows slip by itself where the floor is one."""


# --- recordings ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)  # compared and hashed by identity
class Recording:
    """One foot of one robot, by sample.

    Attributes
    ----------
    name : str
        Of the file.
    force, moment, acceleration, rate : ndarray, shape (n, 3)
        N, N m, m/s², rad/s.
    label : ndarray of int, shape (n,)
        ``STABLE``, ``NONE`` or ``SLIP``.
    """

    name: str
    force: np.ndarray
    moment: np.ndarray
    acceleration: np.ndarray
    rate: np.ndarray
    label: np.ndarray

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return self.name.split('_')[0]

    @functools.cached_property
    def load(self) -> np.ndarray:
        """Normal force, N."""
        return self.force[:, 2]

    @functools.cached_property
    def expected_load(self) -> float:
        """Median normal force where there is any, N; needs no label."""
        return float(np.median(self.load[self.load > 0.0]))

    @functools.cached_property
    def standing(self) -> np.ndarray:
        """Whether each sample is of a stance."""
        return self.load > GATE * self.expected_load

    @functools.cached_property
    def stances(self) -> list[tuple[int, int]]:
        """First sample of each stance, and the one after its last."""
        return runs(self.standing)

    @functools.cached_property
    def stance(self) -> np.ndarray:
        """Number of the stance that each sample belongs to, -1 in the air."""
        number = np.full(len(self.label), -1)
        for index, (start, stop) in enumerate(self.stances):
            number[start:stop] = index
        return number

    @functools.cached_property
    def slipping(self) -> np.ndarray:
        """Samples in stance that are labelled slip."""
        return self.standing & (self.label == SLIP)

    @functools.cached_property
    def sticking(self) -> np.ndarray:
        """Samples in stance that are labelled stable."""
        return self.standing & (self.label == STABLE)

    @functools.cached_property
    def ratio(self) -> np.ndarray:
        """T/N; zero without load."""
        tangential = np.hypot(self.force[:, 0], self.force[:, 1])
        return self.per_load(tangential)

    @functools.cached_property
    def floors(self) -> list[float]:
        """Coefficients of friction: the ratios that labelled slips show again and again.

        Simulated Coulomb friction gives a sliding foot the same T/N to four digits; a value that
        at least 1 % of the slips share is a floor.
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
    def at_friction(self) -> np.ndarray:
        """Samples in stance whose T/N is the friction of one of the floors."""
        near = [np.abs(self.ratio - floor) < SAME * floor for floor in self.floors]
        return self.standing & np.any(near, axis=0)

    def per_load(self, value: np.ndarray) -> np.ndarray:
        """Return a value over the normal force; zero without load."""
        loaded = self.load > 0.0
        return np.where(loaded, value / np.where(loaded, self.load, 1.0), 0.0)

    @functools.cached_property
    def centre(self) -> np.ndarray:
        """Centre of pressure, shape (n, 2), m, if forces are measured at the sole's level."""
        return np.column_stack(
            [self.per_load(-self.moment[:, 1]), self.per_load(self.moment[:, 0])]
        )

    @functools.cached_property
    def torsion(self) -> np.ndarray:
        """Moment about the vertical through the centre of pressure, over the load, m."""
        x, y = self.centre.T
        return self.per_load(self.moment[:, 2] - x * self.force[:, 1] + y * self.force[:, 0])

    @functools.cached_property
    def reach(self) -> np.ndarray:
        """Box that holds 98 % of the centres of pressure of each axis, shape (2, 2), m."""
        return np.quantile(self.centre[self.load > 0.5 * self.expected_load], [0.01, 0.99], axis=0)

    @functools.cached_property
    def sole_radius(self) -> float:
        """Radius of the disc with the area of that box, m: the file does not tell the sole."""
        return math.sqrt(float(np.prod(self.reach[1] - self.reach[0])) / math.pi)

    @functools.cached_property
    def quiet(self) -> np.ndarray:
        """Stable samples in stance that are clear of any labelled slip."""
        reach = round(CLEAR / PERIOD)
        near = np.convolve(self.label == SLIP, np.ones(2 * reach + 1), 'same') > 0.5
        return self.sticking & ~near

    @property
    def quiet_minutes(self) -> float:
        """Their time, minutes."""
        return float(self.quiet.sum()) * PERIOD / 60.0

    @functools.cached_property
    def events(self) -> list[tuple[int, int]]:
        """Labelled slips in stance that last, as start and end (exclusive)."""
        shortest = round(SHORTEST / PERIOD)
        joined = runs(self.slipping, join=shortest - 1)
        return [(start, stop) for start, stop in joined if stop - start >= shortest]

    @functools.cached_property
    def speed(self) -> np.ndarray:
        """Angular rate whatever the axis, rad/s."""
        return np.linalg.norm(self.rate, axis=1)

    @functools.cached_property
    def quiet_rate(self) -> float:
        """Median angular rate above half of the expected load, rad/s; needs no label."""
        return float(np.median(self.speed[self.load > 0.5 * self.expected_load]))


def read(path: pathlib.Path) -> Recording:
    """Return the recording of a file.

    Raises
    ------
    InvalidInput
        When the file is missing, or holds anything but 13 finite columns with labels 0, 1 and 2,
        or no stable contact or no slip in stance to tell apart.
    """
    if not path.is_file():
        raise InvalidInput(f'{path}: no such file; fetch it from {SOURCE}')
    try:
        table = np.loadtxt(path, delimiter=',', ndmin=2)
    except ValueError as error:
        raise InvalidInput(f'{path}: {error}; 13 columns of numbers are needed') from error
    if table.shape[1] != 13 or not np.isfinite(table).all():
        raise InvalidInput(f'{path}: {table.shape[1]} columns: 13 of finite numbers are needed')
    if not np.isin(table[:, 12], (STABLE, NONE, SLIP)).all():
        raise InvalidInput(f'{path}: labels {np.unique(table[:, 12])}: must be 0, 1 or 2')
    found = Recording(path.stem, *np.split(table[:, :12], 4, axis=1), table[:, 12].astype(int))
    if not (np.any(found.load > 0.0) and found.slipping.any() and found.sticking.any()):
        raise InvalidInput(f'{path}: no stable contact, or no slip, under load: nothing to rank')
    return found


def runs(mask: np.ndarray, join: int = 0) -> list[tuple[int, int]]:
    """Return where a mask is true: start and end (exclusive), gaps of up to ``join`` closed."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    found: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if found and start - found[-1][1] <= join:
            found[-1] = (found[-1][0], stop)
        else:
            found.append((start, stop))
    return found


# --- what is read off a foot ---------------------------------------------------------------------


def features(recording: Recording) -> dict[str, np.ndarray]:
    """Return each single feature by sample: larger is more like slip; rates as logarithms."""
    low, high = recording.reach
    off_centre = np.abs(recording.centre - 0.5 * (low + high)) / (0.5 * (high - low))
    rim = 2.0 / 3.0 * recording.sole_radius * recording.speed

    def logarithm(value: np.ndarray) -> np.ndarray:
        return np.log10(np.maximum(value, LEAST))

    channels = np.column_stack(
        [recording.force, recording.moment, recording.acceleration, recording.rate]
    )
    magnitudes = dict(zip(AXES, np.abs(channels).T, strict=True))
    largest = {
        f'{name} / largest': value / max(value.max(), LEAST) for name, value in magnitudes.items()
    }
    return (
        magnitudes
        | largest
        | {
            RATIO: recording.ratio,
            # The ellipsoidal limit surface with the torsional limit 2/3 R μ N of a disc.
            TWIST: np.hypot(recording.ratio, 1.5 * recording.torsion / recording.sole_radius),
            LIGHT: -recording.load / recording.expected_load,
            EDGE: off_centre.max(axis=1),
            MARGIN: -margin(recording),
            RATE: logarithm(recording.speed),
            YAW: logarithm(np.abs(recording.rate[:, 2])),
            ROLL: logarithm(np.hypot(recording.rate[:, 0], recording.rate[:, 1])),
            QUIETLY: logarithm(recording.speed / max(recording.quiet_rate, LEAST)),
            LARGELY: logarithm(recording.speed / max(recording.speed.max(), LEAST)),
            RIM: logarithm(rim),
            CUSUM: cusum(recording, rim),
            SHAKE: logarithm(np.linalg.norm(recording.acceleration, axis=1)),
        }
    )


def cusum(recording: Recording, rim: np.ndarray) -> np.ndarray:
    """Return the statistic of ros_pad's slip alarm, fed with the speed of the rim, m/s.

    Its noise is that of the quiet foot, and nothing is fitted to the robot: the speed worth an
    alarm is SlipAlarm's own.
    """
    noise = 2.0 / 3.0 * recording.sole_radius * recording.quiet_rate
    noise = math.hypot(noise, Tuning().speed_noise)
    alarm = SlipAlarm(noise, Tuning().smoothing)
    statistic = np.zeros(len(rim))
    for start, stop in recording.stances:
        alarm.reset()
        for index in range(start, stop):
            alarm.update(float(rim[index]), PERIOD)
            statistic[index] = alarm.statistic
    return statistic


def margin(recording: Recording) -> np.ndarray:
    """Return the 5 % quantile of friction less T/N that GroundFilter gives without a position.

    Nobody knows the slip speed here: it is told zero, give or take 1 m/s. Each stance is new
    ground, and T/N that does not change is no news, as for FootEstimator.
    """
    ground = GroundFilter(PRIOR)
    noise = Tuning().ratio_noise
    window = round(Tuning().filter_period / PERIOD)
    quantile = np.zeros(len(recording.label))
    for start, stop in recording.stances:
        ground.touch_down(math.inf, dome=False)
        told = math.inf
        for first in range(start, stop, window):
            last = min(first + window, stop)
            ratio = float(recording.ratio[first:last].mean())
            weight = -math.expm1(-0.5 * ((ratio - told) / noise) ** 2)
            told = ratio if math.isinf(told) else told + weight * (ratio - told)
            ground.update(ratio, noise, 0.0, 1.0, (last - first) * PERIOD, weight)
            quantile[first:last] = ground.quantile(0.05)
    return quantile - recording.ratio


# --- ranking -------------------------------------------------------------------------------------


def auc(slip: np.ndarray, stick: np.ndarray) -> float:
    """Return the probability that a slip scores above a stick, ties half; NaN without either."""
    if not (len(slip) and len(stick)):
        return math.nan
    ranks = stats.rankdata(np.concatenate([slip, stick]))
    wins = ranks[: len(slip)].sum() - 0.5 * len(slip) * (len(slip) + 1)
    return float(wins / (len(slip) * len(stick)))


def auc_interval(
    score: np.ndarray, recording: Recording, seed: int = 0, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """Return the 95 % interval of the AUC, from stances drawn with replacement.

    Samples of one stance are no independent evidence; stances nearly are.
    """
    draw = np.random.default_rng(seed)
    slip = [score[a:b][recording.slipping[a:b]] for a, b in recording.stances]
    stick = [score[a:b][recording.sticking[a:b]] for a, b in recording.stances]
    found = []
    for _ in range(resamples):
        chosen = draw.integers(len(slip), size=len(slip))
        found.append(
            auc(
                np.concatenate([slip[index] for index in chosen]),
                np.concatenate([stick[index] for index in chosen]),
            )
        )
    low, high = np.nanquantile(found, [0.025, 0.975])
    return float(low), float(high)


def auc_within(score: np.ndarray, recording: Recording) -> float:
    """Return the AUC over pairs of one stance only: floors are then hardly mixed."""
    wins = pairs = 0.0
    for start, stop in recording.stances:
        slip = score[start:stop][recording.slipping[start:stop]]
        stick = score[start:stop][recording.sticking[start:stop]]
        if len(slip) and len(stick):
            wins += auc(slip, stick) * len(slip) * len(stick)
            pairs += len(slip) * len(stick)
    return wins / pairs if pairs else math.nan


# --- probability ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Logistic:
    """A logistic fit: probability 1/(1 + exp(-(intercept + slope · x))).

    Attributes
    ----------
    intercept : float
        Log odds at zero.
    slope : ndarray, shape (k,)
        Log odds per unit of each feature.
    """

    intercept: float
    slope: np.ndarray

    def log_odds(self, x: np.ndarray) -> np.ndarray:
        """Log odds of rows of features, shape (n, k)."""
        return self.intercept + x @ self.slope


def fit(x: np.ndarray, slip: np.ndarray, ridge: float = 1e-4) -> Logistic:
    """Return the logistic fit to rows of features, shape (n, k), and whether each slips.

    A small penalty on the slope of standardised features gives one fit also where a threshold
    parts all samples.
    """
    centre, spread = x.mean(axis=0), x.std(axis=0)
    rows = np.column_stack([np.ones(len(x)), (x - centre) / np.where(spread > 0.0, spread, 1.0)])
    penalty = np.r_[0.0, np.full(x.shape[1], ridge)]

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        odds = rows @ weights
        value = np.mean(np.logaddexp(0.0, odds) - slip * odds) + 0.5 * penalty @ weights**2
        return value, rows.T @ (special.expit(odds) - slip) / len(x) + penalty * weights

    weights = optimize.minimize(loss, np.zeros(rows.shape[1]), jac=True, method='BFGS').x
    slope = weights[1:] / np.where(spread > 0.0, spread, 1.0)
    return Logistic(float(weights[0] - slope @ centre), slope)


def brier(probability: np.ndarray, slip: np.ndarray) -> float:
    """Return the mean squared error of a probability."""
    return float(np.mean((probability - slip) ** 2))


def reliability(
    probability: np.ndarray, slip: np.ndarray, bins: int = 10, least: int = 20
) -> list[tuple[float, float, int]]:
    """Return mean probability, share of slip and number of samples of each filled bin."""
    place = np.minimum((probability * bins).astype(int), bins - 1)
    found = []
    for index in range(bins):
        inside = place == index
        if inside.sum() >= least:
            found.append(
                (
                    float(probability[inside].mean()),
                    float(slip[inside].mean()),
                    int(inside.sum()),
                )
            )
    return found


class Study:
    """Recordings with their features, and fits of them, own and of other robots."""

    def __init__(self, recordings: Sequence[Recording]) -> None:
        self.recordings = list(recordings)
        self.features = {
            each.name: features(each)
            for each in tqdm(self.recordings, 'features', file=sys.stderr)
        }

    def others(self, recording: Recording) -> list[Recording]:
        """Return the recordings of other robots."""
        return [each for each in self.recordings if each.robot != recording.robot]

    def columns(self, recording: Recording, name: str) -> np.ndarray:
        """Return the features behind a name, shape (n, k)."""
        return np.column_stack(
            [self.features[recording.name][each] for each in FITTED.get(name, (name,))]
        )

    def fitted(self, name: str, parts: Sequence[tuple[Recording, slice]]) -> Logistic:
        """Return the fit to the samples in stance of parts of recordings."""
        x, slip = [], []
        for recording, part in parts:
            use = recording.standing[part] & (recording.label[part] != NONE)
            x.append(self.columns(recording, name)[part][use])
            slip.append(recording.slipping[part][use])
        return fit(np.concatenate(x), np.concatenate(slip))

    @functools.cache  # noqa: B019 - one study a run
    def log_odds(self, recording: Recording, name: str, own: bool) -> np.ndarray:
        """Return the log odds of slip by sample, each half fitted on the other, or on others."""
        x = self.columns(recording, name)
        if not own:
            whole = [(each, slice(None)) for each in self.others(recording)]
            return self.fitted(name, whole).log_odds(x)
        half = self._middle(recording)
        return np.concatenate(
            [
                self.fitted(name, [(recording, slice(half, None))]).log_odds(x[:half]),
                self.fitted(name, [(recording, slice(half))]).log_odds(x[half:]),
            ]
        )

    @staticmethod
    def _middle(recording: Recording) -> int:
        """Return the end of a stance that parts the labelled slips of a recording in halves."""
        slips = np.flatnonzero(recording.slipping)
        return recording.stances[recording.stance[slips[len(slips) // 2]]][1]

    def score(self, recording: Recording, name: str, own: bool) -> np.ndarray:
        """Return what an alarm compares with its threshold, by sample."""
        if name in FITTED:
            return self.log_odds(recording, name, own)
        return self.features[recording.name][name]

    # --- tables -------------------------------------------------------------------------------

    def labels(self, recording: Recording) -> dict[str, Any]:
        """Return what the labels of a recording hold."""
        slip, stick = recording.slipping, recording.sticking
        after, before = _distance_to_edges(recording)
        at_edge = np.minimum(after, before) * PERIOD < EDGE_TIME
        horizontal = np.hypot(recording.rate[:, 0], recording.rate[:, 1])
        all_slips = recording.label == SLIP
        ratio, rate = recording.ratio, recording.speed
        ends = [stop - 1 for _, stop in recording.stances]
        quantile = (margin(recording) + ratio)[ends]
        return {
            'samples': len(recording.label),
            'stances': len(recording.stances),
            'slips': int(slip.sum()),
            'expected_load_N': recording.expected_load,
            'sole_radius_m': recording.sole_radius,
            'quiet_rate_rad_s': recording.quiet_rate,
            'slip_without_force': float(np.mean(recording.load[all_slips] <= 0.0)),
            'slip_below_gate': float(np.mean(~recording.standing[all_slips])),
            'floors': recording.floors,
            'slip_at_friction': float(np.mean(recording.at_friction[slip])),
            'stick_at_friction': float(np.mean(recording.at_friction[stick])),
            'slip_above_label_rate': float(np.mean(rate[slip] > LABEL_RATE)),
            'stick_above_label_rate': float(np.mean(rate[stick] > LABEL_RATE)),
            'slip_rate_least_rad_s': float(rate[slip].min()),
            'stick_rate_median_rad_s': float(np.median(rate[stick])),
            'slip_at_edge': float(np.mean(at_edge[slip])),
            'stick_at_edge': float(np.mean(at_edge[stick])),
            'slip_rolls': float(np.mean((horizontal > np.abs(recording.rate[:, 2]))[slip])),
            'slip_on_a_point': float(np.mean(np.abs(recording.torsion[slip]) < POINT)),
            'stick_on_a_point': float(np.mean(np.abs(recording.torsion[stick]) < POINT)),
            'slip_ratio_median': float(np.median(ratio[slip])),
            'stick_ratio_median': float(np.median(ratio[stick])),
            'friction_below_quantile': (
                float(np.mean(quantile > recording.floors[0]))
                if len(recording.floors) == 1
                else None
            ),
            'quantile_median': float(np.median(quantile)),
        }

    def ranking(self, recording: Recording, name: str) -> dict[str, Any]:
        """Return how a score ranks slip against stick."""
        score = self.score(recording, name, own=True)
        everywhere = recording.label == SLIP, recording.label == STABLE
        at_friction = None
        if name in FORCELESS and len(recording.floors) == 1:
            below = recording.standing & (recording.ratio < 0.9 * recording.floors[0])
            at_friction = auc(score[recording.at_friction], score[below])
        return {
            'at_friction': at_friction,
            'auc': auc(score[recording.slipping], score[recording.sticking]),
            'interval': auc_interval(score, recording),
            'within_stance': auc_within(score, recording),
            'whatever_load': auc(*(score[mask] for mask in everywhere)),
        }

    def alarm(self, recording: Recording, name: str) -> dict[str, Any]:
        """Return what an alarm hears, with a threshold of its own and one of other robots."""
        found = {}
        for word, own in (('own', True), ('other', False)):
            teachers = [recording] if own else self.others(recording)
            scores = [self.score(each, name, own=True) for each in teachers]
            threshold = operating_threshold(scores, teachers)
            found[word] = heard(self.score(recording, name, own), threshold, recording)
        return found

    def calibration(self, recording: Recording, name: str) -> dict[str, Any]:
        """Return how good the probability of slip is, own and from other robots."""
        use = recording.slipping | recording.sticking
        slip = recording.slipping[use]
        found: dict[str, Any] = {}
        for word, own in (('own', True), ('other', False)):
            odds = self.log_odds(recording, name, own)[use]
            probability = special.expit(odds)
            found[word] = {
                'auc': auc(odds[slip], odds[~slip]),
                'brier': brier(probability, slip),
                'accuracy': float(np.mean((probability > 0.5) == slip)),
                'mean': float(probability.mean()),
                'reliability': reliability(probability, slip),
            }
        share = float(slip.mean())
        return found | {'share': share, 'brier_of_share': share * (1.0 - share)}

    def run(self) -> dict[str, Any]:
        """Return all tables."""
        document: dict[str, Any] = {
            'source': SOURCE, 'gate': GATE, 'false_per_minute': FALSE_PER_MINUTE,
            'label_rate_rad_s': LABEL_RATE, 'recordings': {},
        }  # fmt: skip
        steps = tqdm(self.recordings, 'tables', file=sys.stderr)
        for each in steps:
            document['recordings'][each.name] = {
                'labels': self.labels(each),
                'ranking': {name: self.ranking(each, name) for name in RANKED},
                'alarm': {name: self.alarm(each, name) for name in ALARMED},
                'calibration': {name: self.calibration(each, name) for name in CALIBRATED},
            }
        return document


def _distance_to_edges(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return samples since touch-down and until lift-off; infinite in the air."""
    after = np.full(len(recording.label), math.inf)
    before = after.copy()
    for start, stop in recording.stances:
        after[start:stop] = np.arange(stop - start)
        before[start:stop] = np.arange(stop - start)[::-1]
    return after, before


# --- alarms --------------------------------------------------------------------------------------


def false_alarms(score: np.ndarray, threshold: float, recording: Recording) -> int:
    """Return how often an alarm goes off on a quiet foot."""
    return len(runs((score > threshold) & recording.quiet))


def operating_threshold(scores: Sequence[np.ndarray], recordings: Sequence[Recording]) -> float:
    """Return the lowest threshold whose false alarms, and those of all above, are few enough."""
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


def heard(score: np.ndarray, threshold: float, recording: Recording) -> dict[str, Any]:
    """Return misses, median delay and false alarms of a threshold."""
    slips = recording.events
    above = [np.flatnonzero(score[start:stop] > threshold) for start, stop in slips]
    delays = [float(each[0]) * PERIOD for each in above if len(each)]
    return {
        'threshold': threshold,
        'events': len(slips),
        'missed': 1.0 - len(delays) / len(slips) if len(slips) >= FEWEST else None,
        'delay_s': float(np.median(delays)) if delays else None,
        'false_per_minute': (false_alarms(score, threshold, recording) / recording.quiet_minutes),
    }


# --- what is shown -------------------------------------------------------------------------------


def table(document: dict[str, Any]) -> str:
    """Return the tables as text."""
    rows = document['recordings']
    wide = max(28, *map(len, rows)) + 2
    lines = []

    def section(title: str, part: str, names: Iterable[str], cell: Callable[[Any], str]) -> None:
        lines.extend(['', title, ' ' * 28 + ''.join(f'{each:>{wide}}' for each in rows)])
        for name in names:
            cells = (cell(row[part][name]) for row in rows.values())
            lines.append(f'{name:28}' + ''.join(f'{each:>{wide}}' for each in cells))

    first = next(iter(rows.values()))
    section('what the labels hold', 'labels', first['labels'], _cell)
    section(
        'AUC of slip over stick in stance, its 95 % interval, and over pairs of one stance',
        'ranking',
        RANKED,
        lambda each: '{} {}-{} {}'.format(
            *(f'{x:.3f}' for x in (each['auc'], *each['interval'], each['within_stance']))
        ),
    )
    section(
        'AUC whatever the load; of T/N at the friction of the floor, over T/N below',
        'ranking',
        RANKED,
        lambda each: f'{_cell(each["whatever_load"])} {_cell(each["at_friction"])}',
    )
    section(
        f'slips missed %, delay ms at {FALSE_PER_MINUTE:g} false alarm a minute;'
        ' missed %, false a minute with the threshold of the other robot',
        'alarm',
        ALARMED,
        lambda each: '{} {}; {} {}'.format(
            _scaled(each['own']['missed'], 1e2),
            _scaled(each['own']['delay_s'], 1e3),
            _scaled(each['other']['missed'], 1e2),
            _scaled(each['other']['false_per_minute'], 1.0),
        ),
    )
    section(
        'probability: Brier, accuracy, fitted to the other half; fitted to the other robot',
        'calibration',
        CALIBRATED,
        lambda each: '{:.3f} {:.3f}; {:.3f} {:.3f}'.format(
            *(each[word][key] for word in ('own', 'other') for key in ('brier', 'accuracy'))
        ),
    )
    section(
        'the same when the share of slip alone is known',
        'calibration',
        CALIBRATED[:1],
        lambda each: f'{each["brier_of_share"]:.3f} {1.0 - each["share"]:.3f}',
    )
    return '\n'.join(lines[1:])


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return ' '.join(map(_cell, value))
    return '-' if value is None else f'{value:d}' if isinstance(value, int) else f'{value:.3g}'


def _scaled(value: float | None, factor: float) -> str:
    return '-' if value is None else f'{factor * value:.0f}'


COLOURS = ('#56B4E9', '#0072B2', '#009E73', '#E69F00', '#D55E00', '#CC79A7', '#222222')


def draw(study: Study, document: dict[str, Any]) -> Figure:
    """Return the picture."""
    rows = document['recordings']
    colours = dict(zip(rows, COLOURS, strict=False))
    mixed = max(study.recordings, key=lambda each: len(each.floors))
    with matplotlib.rc_context(STYLE | {'font.size': 9.0, 'axes.titlesize': 9.5}):
        figure = Figure(figsize=(11.0, 8.0), layout='constrained')
        a, b, c, d = figure.subplots(2, 2).ravel()
        _draw_ranking(a, rows, colours)
        _draw_ratio(b, mixed)
        _draw_rate(c, study.recordings, colours)
        _draw_reliability(d, rows, colours)
    return figure


def _draw_ranking(panel: Axes, rows: dict[str, Any], colours: dict[str, str]) -> None:
    for number, (name, row) in enumerate(rows.items()):
        shift = 0.15 * (number - 0.5 * (len(rows) - 1))
        places = np.arange(len(RANKED)) + shift
        found = [row['ranking'][each] for each in RANKED]
        ends = np.array([each['interval'] for each in found]).T
        panel.hlines(places, *ends, color=colours[name], lw=1.4)
        panel.plot(
            [each['auc'] for each in found], places, 'o', ms=4.0, color=colours[name],
            label=name.replace('_', ' '),
        )  # fmt: skip
    panel.axvline(0.5, color='#222222', lw=0.9, ls='--')
    panel.set_yticks(range(len(RANKED)), RANKED)
    panel.set(
        ylim=(len(RANKED) - 0.5, -0.5), xlim=(0.1, 1.02), xlabel='AUC of labelled slip, in stance',
        title='a  slip ranked above stable contact',
    )  # fmt: skip
    panel.legend(fontsize=7.5, loc='lower left')


def _draw_ratio(panel: Axes, recording: Recording) -> None:
    bins = np.linspace(0.0, 0.6, 61)
    looks = (
        {'color': '#0072B2', 'alpha': 0.45},
        {'color': '#D55E00', 'histtype': 'step', 'lw': 1.6},
    )
    masks = {'stable': recording.sticking, 'slip': recording.slipping}
    for (label, mask), look in zip(masks.items(), looks, strict=True):
        weights = np.full(mask.sum(), 100.0 / mask.sum())
        panel.hist(recording.ratio[mask], bins, weights=weights, label=label, **look)
    top = panel.get_ylim()[1]
    panel.plot(recording.floors, np.full(len(recording.floors), -0.02 * top), '^', color='#222222',
               ms=5.0, ls='', clip_on=False, label='friction of its floors', zorder=5)  # fmt: skip
    panel.set(
        xlim=(0.0, 0.6), ylim=(0.0, top), xlabel='T/N', ylabel='% of samples in stance, each 0.01',
        title=f'b  {recording.name.replace("_", " ")}: T/N of both',
    )  # fmt: skip
    panel.legend(fontsize=8)


def _draw_rate(panel: Axes, recordings: Sequence[Recording], colours: dict[str, str]) -> None:
    for recording in recordings:
        for mask, look in ((recording.sticking, '-'), (recording.slipping, '--')):
            values = np.sort(recording.speed[mask])
            share = np.arange(1, len(values) + 1) / len(values)
            panel.plot(values, 100.0 * share, look, color=colours[recording.name], lw=1.3)
    panel.axvline(LABEL_RATE, color='#222222', lw=0.9, ls=':')
    panel.text(0.92 * LABEL_RATE, 70.0, '0.08 rad/s', fontsize=8, ha='right')
    panel.plot([], [], '-', color='#777777', label='stable')
    panel.plot([], [], '--', color='#777777', label='slip')
    panel.set(
        xscale='log', xlim=(1e-4, 2.0), ylim=(0.0, 101.0),
        xlabel='angular rate of the foot in stance (rad/s)', ylabel='% of samples below',
        title='c  angular rate, and where most labels turn',
    )  # fmt: skip
    panel.legend(fontsize=8, loc='upper left')


def _draw_reliability(panel: Axes, rows: dict[str, Any], colours: dict[str, str]) -> None:
    panel.plot([0.0, 1.0], [0.0, 1.0], color='#222222', lw=0.9, ls='--')
    for name, row in rows.items():
        for word, look in (('own', {'ls': '-'}), ('other', {'ls': ':', 'mfc': 'white'})):
            points = np.array(row['calibration'][RATE][word]['reliability'])
            panel.plot(points[:, 0], points[:, 1], marker='o', ms=4.0, lw=1.3, clip_on=False,
                       color=colours[name], **look)  # fmt: skip
    panel.plot([], [], 'o-', color='#777777', ms=4.0, label='fitted to its other half')
    panel.plot([], [], 'o:', color='#777777', ms=4.0, mfc='white',
               label='fitted to the other robot')  # fmt: skip
    panel.set(
        xlim=(0.0, 1.0), ylim=(0.0, 1.0), xlabel='probability of slip from the angular rate',
        ylabel='share labelled slip', title='d  what becomes of a probability',
    )  # fmt: skip
    panel.legend(fontsize=8, loc='upper left', bbox_to_anchor=(0.16, 0.97))


def main() -> int:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        'files', type=pathlib.Path, nargs='+', metavar='FILE.csv', help='of two robots'
    )
    parser.add_argument('--json', action='store_true', help='print the numbers as JSON instead')
    parser.add_argument('--out', type=pathlib.Path, default=CHARTS, help='folder (%(default)s)')
    options = parser.parse_args()
    try:
        recordings = [read(path) for path in options.files]
        if len({each.robot for each in recordings}) < 2:
            raise InvalidInput(f'files of two robots are needed; fetch them from {SOURCE}')
    except InvalidInput as error:
        print(error, file=sys.stderr)
        return 2
    study = Study(recordings)
    document = study.run()
    # Five digits: the rest says nothing.
    text = json.dumps(document)
    document = json.loads(text, parse_float=lambda number: float(f'{float(number):.5g}'))
    text = json.dumps(document, indent=1)
    options.out.mkdir(parents=True, exist_ok=True)
    save(options.out / 'labelled_contacts.json', (text + '\n').encode())
    save(options.out / 'labelled_contacts.png', rendered(draw(study, document), 'png', dpi=150))
    print(text if options.json else table(document))
    return 0


if __name__ == '__main__':
    sys.exit(main())
