# SPDX-License-Identifier: Apache-2.0
"""Measure how well force, moment and foot IMU detect slip on labelled contacts of other robots.

The files are those of https://github.com/mrsp/lcd, folder ``data`` (MIT;
https://ieeexplore.ieee.org/document/9981354): 13 columns at 100 Hz without a header: force x, y,
z (N), moment x, y, z (N m), acceleration x, y, z without gravity (m/s²), angular rate x, y, z
(rad/s) of one foot, and a label: 0 stable contact, 1 no contact, 2 slip. A file's name up to its
first underscore is the robot; two robots or more are needed. Writes labelled_contacts.png and
.json. The study turning_feet does the same for the angular rate of the simulated hexapod.
"""

from __future__ import annotations

import functools
import json
import math
import pathlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import optimize, special

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import Tuning
from ros_pad.estimation.alarm import SLOW_SLIP, SlipAlarm
from ros_pad.estimation.friction import Evidence, GroundFilter, GroundModel
from ros_pad.estimation.scales import FrictionPrior, FrictionScales
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, STYLE, VERMILION
from studies.samples import auc, runs

SOURCE = 'https://github.com/mrsp/lcd (folder data)'
STABLE, NONE, SLIP = 0, 1, 2
PERIOD = 0.01
"""Sampling period of the set, s."""

GATE = Tuning().load_gate
"""Share of the expected load above which a foot is in stance, as for FootEstimator."""

LABEL_RATE = 0.08
"""Angular rate above which most samples are labelled slip, rad/s; found in the data."""

EDGE_TIME = 0.1
"""Time after touch-down, and before lift-off, that is counted separately, s."""

FALSE_PER_MINUTE = 1.0
"""Allowed number of false alarms per minute of quiet samples (``Recording.quiet``)."""

SHORTEST = 0.03
"""Shortest slip that counts as an event, and shortest gap that splits one, s."""

CLEAR = 0.05
"""Distance in time from any labelled slip, s: alarms nearer than this are not false."""

SAME = 0.02
"""Relative difference up to which two coefficients of friction count as equal."""

FEWEST = 10
"""Smallest number of slips for which a share is given."""

POINT = 1e-4
"""Yaw moment over load below which a foot counts as standing on a point, m."""

RESAMPLES = 200
PRIOR = FrictionPrior.of(Foot.load('large37'), 6.8)
LEAST = 1e-6
"""Least value in logarithms and denominators, so that a reading of zero gives a finite value."""

RATIO, TWIST = 'T/N', 'T/N with M_z'
LIGHT, EDGE, MARGIN = 'lightly loaded', 'centre of pressure at edge', 'margin from T/N alone'
RATE, YAW, ROLL = 'rate', 'rate about vertical', 'rate about horizontal'
QUIETLY, LARGELY = 'rate / quiet rate', 'rate / largest rate'
RIM, CUSUM = 'rim speed', 'CUSUM of rim speed'
SHAKE = 'acceleration'
BOTH, CHANNELS, SHARES = 'T/N and rate', '12 channels', '12 channels / largest'
AXES = tuple(f'{kind} {axis}' for kind in ('force', 'moment', SHAKE, 'rate') for axis in 'xyz')
FITTED = {BOTH: (RATIO, RATE), CHANNELS: AXES, SHARES: tuple(f'{name} / largest' for name in AXES)}
"""Features that a logistic fit combines."""

RANKED = (RATIO, TWIST, MARGIN, LIGHT, EDGE, ROLL, YAW, RATE, CUSUM, SHAKE, BOTH, CHANNELS)
ALARMED = (RATIO, YAW, RATE, QUIETLY, LARGELY, RIM, CUSUM, SHAKE, BOTH, CHANNELS, SHARES)
CALIBRATED = (RATIO, TWIST, YAW, RATE, QUIETLY, LARGELY, RIM, SHAKE, BOTH, CHANNELS, SHARES)
FORCELESS = (ROLL, YAW, RATE, CUSUM, SHAKE)
"""Features without force. Only these are compared between samples with T/N at the friction of the
floor and samples below, because features with force contain this difference."""


# --- recordings ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)  # compared and hashed by identity
class Recording:
    """One foot of one robot, by sample.

    Attributes
    ----------
    name : str
        Name of the file without its ending.
    force, moment, acceleration, rate : ndarray, shape (n, 3)
        N, N m, m/s², rad/s.
    label : ndarray of int, shape (n,)
        ``STABLE``, ``NONE`` or ``SLIP``.
    period : float
        Sampling period, s.
    """

    name: str
    force: np.ndarray
    moment: np.ndarray
    acceleration: np.ndarray
    rate: np.ndarray
    label: np.ndarray
    period: float = PERIOD

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
    def stance(self) -> np.ndarray:
        """Number of the stance that each sample belongs to, -1 in the air."""
        number = np.full(len(self.label), -1)
        for index, (start, stop) in enumerate(self.stances):
            number[start:stop] = index
        return number

    @functools.cached_property
    def slipping(self) -> np.ndarray:
        """Whether each sample is in stance and labelled slip."""
        return self.standing & (self.label == SLIP)

    @functools.cached_property
    def sticking(self) -> np.ndarray:
        """Whether each sample is in stance and labelled stable."""
        return self.standing & (self.label == STABLE)

    @functools.cached_property
    def ratio(self) -> np.ndarray:
        """T/N; zero without load."""
        tangential = np.hypot(self.force[:, 0], self.force[:, 1])
        return self.per_load(tangential)

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
    def at_friction(self) -> np.ndarray:
        """Whether each sample is in stance, with T/N equal to the friction of a floor."""
        near = [np.abs(self.ratio - floor) < SAME * floor for floor in self.floors]
        return self.standing & np.any(near, axis=0)

    def per_load(self, value: np.ndarray) -> np.ndarray:
        """Return a value over the normal force; zero without load."""
        loaded = self.load > 0.0
        return np.where(loaded, value / np.where(loaded, self.load, 1.0), 0.0)

    @functools.cached_property
    def centre(self) -> np.ndarray:
        """Centre of pressure, shape (n, 2), m, assuming that forces are measured at sole level."""
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
        """1 % and 99 % quantiles (rows) of x and y (columns) of the centre of pressure, m.

        Only samples above half of the expected load count.
        """
        return np.quantile(self.centre[self.load > 0.5 * self.expected_load], [0.01, 0.99], axis=0)

    @functools.cached_property
    def sole_radius(self) -> float:
        """Radius of a disc with the area of the rectangle :attr:`reach`, m.

        It stands for the radius of the sole, which the files do not contain.
        """
        return math.sqrt(float(np.prod(self.reach[1] - self.reach[0])) / math.pi)

    @functools.cached_property
    def quiet(self) -> np.ndarray:
        """Whether each sample is stable, in stance, and :data:`CLEAR` away from labelled slips."""
        reach = round(CLEAR / self.period)
        near = np.convolve(self.label == SLIP, np.ones(2 * reach + 1), 'same') > 0.5
        return self.sticking & ~near

    @property
    def quiet_minutes(self) -> float:
        """Total time of the quiet samples, minutes."""
        return float(self.quiet.sum()) * self.period / 60.0

    @functools.cached_property
    def events(self) -> list[tuple[int, int]]:
        """Start and end (exclusive) of labelled slips in stance of at least :data:`SHORTEST`."""
        shortest = round(SHORTEST / self.period)
        joined = runs(self.slipping, join=shortest - 1)
        return [(start, stop) for start, stop in joined if stop - start >= shortest]

    @functools.cached_property
    def speed(self) -> np.ndarray:
        """Magnitude of the angular rate, rad/s."""
        return np.linalg.norm(self.rate, axis=1)

    @functools.cached_property
    def quiet_rate(self) -> float:
        """Median angular rate at more than half of the expected load, rad/s; needs no label."""
        return float(np.median(self.speed[self.load > 0.5 * self.expected_load]))


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
        table = np.loadtxt(path, delimiter=',', ndmin=2)
    except ValueError as error:
        raise InvalidInput(f'{path}: {error}; 13 columns of numbers are needed') from error
    if table.shape[1] != 13 or not np.isfinite(table).all():
        raise InvalidInput(
            f'{path} has {table.shape[1]} columns and {np.sum(~np.isfinite(table))} values that'
            ' are not finite: 13 columns of finite numbers are needed'
        )
    if not np.isin(table[:, 12], (STABLE, NONE, SLIP)).all():
        raise InvalidInput(
            f'{path}: labels {np.unique(table[:, 12])} in column 13 are not allowed: each must be'
            ' 0, 1 or 2'
        )
    force, moment, acceleration, rate = np.split(table[:, :12], 4, axis=1)
    found = Recording(path.stem, force, moment, acceleration, rate, table[:, 12].astype(int))
    if not (np.any(found.load > 0.0) and found.slipping.any() and found.sticking.any()):
        raise InvalidInput(
            f'{path} has no stable contact or no slip in stance (force z above {GATE:g} of the'
            ' expected load): at least one sample of each is needed'
        )
    return found


# --- features ------------------------------------------------------------------------------------


def features(recording: Recording) -> dict[str, np.ndarray]:
    """Return each feature by sample; a larger value makes slip more likely.

    The features of one channel (:data:`AXES`) are magnitudes. Other rates, and the acceleration
    and the rim speed, are decimal logarithms.
    """
    low, high = recording.reach
    off_centre = np.abs(recording.centre - 0.5 * (low + high)) / (0.5 * (high - low))
    lever = 2.0 / 3.0 * recording.sole_radius
    rim = lever * recording.speed

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
            CUSUM: cusum(recording, rim, lever * recording.quiet_rate),
            SHAKE: logarithm(np.linalg.norm(recording.acceleration, axis=1)),
        }
    )


def cusum(recording: Recording, speed: np.ndarray, quiet: float) -> np.ndarray:
    """Return the statistic of ros_pad's slip alarm for a speed, m/s.

    The noise is the speed of the quiet foot, m/s, with the default noise of Tuning. Nothing else
    is fitted to the robot: the alarm tests for its default slip speed.
    """
    noise = math.hypot(quiet, Tuning().speed_noise)
    alarm = SlipAlarm(Tuning().smoothing, (SLOW_SLIP,))
    statistic = np.zeros(len(speed))
    for start, stop in recording.stances:
        alarm.reset()
        for index in range(start, stop):
            alarm.update(float(speed[index]), noise, recording.period)
            (statistic[index],) = alarm.statistics
    return statistic


def margin(recording: Recording) -> np.ndarray:
    """Return the friction margin that GroundFilter estimates without the position of the foot.

    The slip speed is not measured: the filter gets zero with a standard deviation of 1 m/s. Each
    stance is on new ground, and T/N that does not change has no weight, as in FootEstimator.
    """
    ground = GroundFilter(GroundModel(FrictionScales(PRIOR, learns=False)))
    noise = Tuning().ratio_noise
    window = round(Tuning().filter_period / recording.period)
    quantile = np.zeros(len(recording.label))
    for start, stop in recording.stances:
        ground.touch_down(math.inf, dome=False)
        last = math.inf
        for first in range(start, stop, window):
            end = min(first + window, stop)
            ratio = float(recording.ratio[first:end].mean())
            weight = -math.expm1(-0.5 * ((ratio - last) / noise) ** 2)
            last = ratio if math.isinf(last) else last + weight * (ratio - last)
            duration = (end - first) * recording.period
            ground.update(Evidence(ratio, noise, 0.0, 1.0, duration, weight))
            quantile[first:end] = ground.quantile(0.05)
    return quantile - recording.ratio


# --- ranking -------------------------------------------------------------------------------------


def auc_interval(
    score: np.ndarray, recording: Recording, seed: int = 0, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """Return the 95 % interval of the AUC, from stances drawn with replacement.

    Stances are drawn instead of samples because samples of one stance depend on each other, while
    stances are nearly independent.
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
    """Return the AUC over pairs of samples of the same stance, NaN without such pairs.

    Unlike pairs from the whole recording, these are hardly ever from two floors.
    """
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
        """Return the log odds for rows of features, shape (n, k)."""
        return self.intercept + x @ self.slope


def fit(x: np.ndarray, slip: np.ndarray, ridge: float = 1e-4) -> Logistic:
    """Return the logistic fit to rows of features, shape (n, k), and whether each slips.

    A small penalty on the slope of standardised features makes the fit unique even where a
    threshold separates all samples.
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
    """Return the mean squared error of a probability of slip."""
    return float(np.mean((probability - slip) ** 2))


def reliability(
    probability: np.ndarray, slip: np.ndarray, bins: int = 10, least: int = 20
) -> list[tuple[float, float, int]]:
    """Return mean probability, share of slip and number of samples of each bin of probability.

    Bins with fewer than ``least`` samples are left out.
    """
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
    """Recordings with their features, and logistic fits to the same robot and to other robots."""

    def __init__(self, recordings: Sequence[Recording]) -> None:
        self.recordings = list(recordings)
        self.features = {
            each.name: features(each) for each in command.each(self.recordings, 'features', 'file')
        }

    def others(self, recording: Recording) -> list[Recording]:
        """Return the recordings of other robots."""
        return [each for each in self.recordings if each.robot != recording.robot]

    def columns(self, recording: Recording, name: str) -> np.ndarray:
        """Return the features that a detector of :data:`FITTED`, or a single feature, uses.

        The shape is (n, k): samples by features.
        """
        return np.column_stack(
            [self.features[recording.name][each] for each in FITTED.get(name, (name,))]
        )

    def fitted(self, name: str, parts: Sequence[tuple[Recording, slice]]) -> Logistic:
        """Return the fit to samples of parts of recordings that are in stance and have contact."""
        x, slip = [], []
        for recording, part in parts:
            use = recording.standing[part] & (recording.label[part] != NONE)
            x.append(self.columns(recording, name)[part][use])
            slip.append(recording.slipping[part][use])
        return fit(np.concatenate(x), np.concatenate(slip))

    @functools.cache  # noqa: B019 - a process makes only one study
    def log_odds(self, recording: Recording, name: str, own: bool) -> np.ndarray:
        """Return the log odds of slip by sample.

        If ``own``, each half of the recording gets the fit to its other half; otherwise all of the
        recording gets the fit to all other robots.
        """
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
        """Return the end of the stance that divides a recording's labelled slips in halves."""
        slips = np.flatnonzero(recording.slipping)
        return recording.stances[recording.stance[slips[len(slips) // 2]]][1]

    def score(self, recording: Recording, name: str, own: bool) -> np.ndarray:
        """Return the quantity that an alarm compares with its threshold, by sample."""
        if name in FITTED:
            return self.log_odds(recording, name, own)
        return self.features[recording.name][name]

    # --- tables -------------------------------------------------------------------------------

    def labels(self, recording: Recording) -> dict[str, Any]:
        """Return how labels, forces and rates of a recording are related."""
        slip, stick = recording.slipping, recording.sticking
        after, before = _distance_to_edges(recording)
        at_edge = np.minimum(after, before) * recording.period < EDGE_TIME
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
        """Return how well a score separates slip from stick."""
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
        """Return figures of an alarm, with the threshold of this recording and of other robots."""
        found = {}
        for word, own in (('own', True), ('other', False)):
            teachers = [recording] if own else self.others(recording)
            scores = [self.score(each, name, own=True) for each in teachers]
            threshold = operating_threshold(scores, teachers)
            found[word] = alarm_figures(self.score(recording, name, own), threshold, recording)
        return found

    def calibration(self, recording: Recording, name: str) -> dict[str, Any]:
        """Return the accuracy of the probability of slip, fitted to this robot and to others."""
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
        """Return the document with all tables, by recording."""
        document: dict[str, Any] = {
            'source': SOURCE, 'gate': GATE, 'false_per_minute': FALSE_PER_MINUTE,
            'label_rate_rad_s': LABEL_RATE, 'recordings': {},
        }  # fmt: skip
        for each in command.each(self.recordings, 'tables', 'file'):
            document['recordings'][each.name] = {
                'labels': self.labels(each),
                'ranking': {name: self.ranking(each, name) for name in RANKED},
                'alarm': {name: self.alarm(each, name) for name in ALARMED},
                'calibration': {name: self.calibration(each, name) for name in CALIBRATED},
            }
        return document


def _distance_to_edges(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of samples since touch-down and until lift-off; infinite in the air."""
    after = np.full(len(recording.label), math.inf)
    before = after.copy()
    for start, stop in recording.stances:
        after[start:stop] = np.arange(stop - start)
        before[start:stop] = np.arange(stop - start)[::-1]
    return after, before


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


def alarm_figures(
    score: np.ndarray, threshold: float, recording: Recording, fewest: int = FEWEST
) -> dict[str, Any]:
    """Return misses, median delay and false alarms of a threshold.

    The share of misses is None for fewer than ``fewest`` slips.
    """
    slips = recording.events
    above = [np.flatnonzero(score[start:stop] > threshold) for start, stop in slips]
    delays = [float(each[0]) * recording.period for each in above if len(each)]
    return {
        'threshold': threshold,
        'events': len(slips),
        'missed': 1.0 - len(delays) / len(slips) if len(slips) >= fewest else None,
        'delay_s': float(np.median(delays)) if delays else None,
        'false_per_minute': (false_alarms(score, threshold, recording) / recording.quiet_minutes),
    }


# --- tables and pictures -------------------------------------------------------------------------


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
    section('labels, with forces and rates', 'labels', first['labels'], _cell)
    section(
        'AUC of slip over stick in stance, its 95 % interval, and over pairs of one stance',
        'ranking',
        RANKED,
        lambda each: '{} {}-{} {}'.format(
            *(f'{x:.3f}' for x in (each['auc'], *each['interval'], each['within_stance']))
        ),
    )
    section(
        'AUC at all loads; AUC of samples at the friction of the floor over samples below it',
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
        'Brier and accuracy of a constant probability, the share of slip',
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


COLOURS = (SKY, BLUE, GREEN, ORANGE, VERMILION, PURPLE, BLACK)


def draw(study: Study, document: dict[str, Any]) -> Figure:
    """Return the picture: ranking, T/N, angular rate and calibration."""
    rows = document['recordings']
    colours = dict(zip(rows, COLOURS, strict=False))
    mixed = max(study.recordings, key=lambda each: len(each.floors))
    with matplotlib.rc_context(STYLE):
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
    panel.axvline(0.5, color=BLACK, lw=0.9, ls='--')
    panel.set_yticks(range(len(RANKED)), RANKED)
    panel.set(
        ylim=(len(RANKED) - 0.5, -0.5), xlim=(0.1, 1.02), xlabel='AUC of labelled slip, in stance',
        title='a  slip ranked above stable contact',
    )  # fmt: skip
    panel.legend(fontsize=7.5, loc='lower left')


def _draw_ratio(panel: Axes, recording: Recording) -> None:
    bins = np.linspace(0.0, 0.6, 61)
    looks: tuple[dict[str, Any], ...] = (
        {'color': BLUE, 'alpha': 0.45},
        {'color': VERMILION, 'histtype': 'step', 'lw': 1.6},
    )
    masks = {'stable': recording.sticking, 'slip': recording.slipping}
    for (label, mask), look in zip(masks.items(), looks, strict=True):
        weights = np.full(mask.sum(), 100.0 / mask.sum())
        panel.hist(recording.ratio[mask], bins.tolist(), weights=weights, label=label, **look)
    top = panel.get_ylim()[1]
    panel.plot(recording.floors, np.full(len(recording.floors), -0.02 * top), '^', color=BLACK,
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
    panel.axvline(LABEL_RATE, color=BLACK, lw=0.9, ls=':')
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
    panel.plot([0.0, 1.0], [0.0, 1.0], color=BLACK, lw=0.9, ls='--')
    for name, row in rows.items():
        looks: dict[str, dict[str, Any]] = {
            'own': {'ls': '-'},
            'other': {'ls': ':', 'mfc': 'white'},
        }
        for word, look in looks.items():
            points = np.array(row['calibration'][RATE][word]['reliability'])
            panel.plot(points[:, 0], points[:, 1], marker='o', ms=4.0, lw=1.3, clip_on=False,
                       color=colours[name], **look)  # fmt: skip
    panel.plot([], [], 'o-', color='#777777', ms=4.0, label='fitted to its other half')
    panel.plot([], [], 'o:', color='#777777', ms=4.0, mfc='white',
               label='fitted to the other robot')  # fmt: skip
    panel.set(
        xlim=(0.0, 1.0), ylim=(0.0, 1.0), xlabel='probability of slip from the angular rate',
        ylabel='share labelled slip', title='d  calibration of the probability',
    )  # fmt: skip
    panel.legend(fontsize=8, loc='upper left', bbox_to_anchor=(0.16, 0.97))


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
    study = Study(recordings)
    # More than five digits would not be significant.
    document = json.loads(
        json.dumps(study.run()), parse_float=lambda text: float(f'{float(text):.5g}')
    )
    pictures = {'labelled_contacts': draw(study, document)}
    kept = command.write(options.out, 'labelled_contacts', document, pictures)
    command.show(options, kept, table(document))
    return 0
