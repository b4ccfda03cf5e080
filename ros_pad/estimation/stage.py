# SPDX-License-Identifier: Apache-2.0
"""Estimation stage of all feet: check their samples, and make estimates of them at a given rate.

The estimator node, the loop without ROS and replay use the same class.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import Setting
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.feet import FeetEstimator
from ros_pad.estimation.feet import late
from ros_pad.estimation.track import Sample
from ros_pad.estimation.tuning import Tuning
from ros_pad.pace import CONTROL_PERIOD_NS
from ros_pad.pace import Pace
from ros_pad.records import ESTIMATE
from ros_pad.records import Array
from ros_pad.records import Block

PUBLISH_RATE = Setting(
    'publish_rate', 1e9 / CONTROL_PERIOD_NS, 'Estimates a second.', 'Hz', 5.0, 1000.0
)

SILENCE = 0.4
"""Time without a sample after which the sensors of a foot count as faulty, s."""

LARGEST_FORCE = 1e5
LARGEST_POSITION = 1e6
LARGEST_PRESSURE = 1e7
LARGEST_MOMENT = 1e5
"""Largest sizes of sensor values: force, N, position, m, gauge pressure, Pa, and moment, N m. A
larger value, though finite, would spoil sums and means for ever."""


class Input:
    """What has come from the sensors of a foot.

    Parameters
    ----------
    tuning : Tuning
        Settings for sensors and ground.

    Attributes
    ----------
    position : tuple of float or None
        Last position, m.
    first_ns : int
        Stamp of the sample with which that was first used, ns.
    place : tuple of float
        Last position x and y since the last estimate, m; NaN if none has come.
    load : float
        Largest normal force since the last estimate, N, also of refused samples; NaN if there is
        none.
    silent_ns : int or None
        Time since which no sample has been used, ns, as far as it was noticed.
    missing : int
        Code of the doubt that follows from a longer silence.
    """

    __slots__ = (
        '_joints', '_moments', 'first_ns', 'load', 'missing', 'place', 'position', 'silent_ns',
    )  # fmt: skip

    def __init__(self, tuning: Tuning) -> None:
        self._joints, self._moments = tuning.source == 'joints', tuning.moment_noise > 0.0
        self.position: tuple[float, ...] | None = None
        self.first_ns = 0
        self.silent_ns: int | None = None
        self.missing = doubt.NO_WRENCH
        self.clear()

    def clear(self) -> None:
        """Begin anew after an estimate."""
        self.place: tuple[float, ...] = (math.nan, math.nan)
        self.load = math.nan

    def note(self, stamp_ns: int, position: Sequence[float], load: float) -> None:
        """Take note of samples that may all be used: the last position, and the largest load."""
        self.position, self.first_ns, self.place = tuple(position), stamp_ns, tuple(position[:2])
        if not load <= self.load:
            self.load = load
        self.used()

    def used(self) -> None:
        """Take note that a sample has been used."""
        self.silent_ns, self.missing = None, doubt.NO_WRENCH

    def take(self, stamp_ns: int, sample: Sample) -> Sample | None:
        """Return the sample to use of the numbers of a row; None if something is missing.

        Raises
        ------
        InvalidInput
            When a number is too large or infinite.
        """
        fx, fy, fz, moment, *position, vx, vy, variance_x, variance_y = sample
        new = all(map(math.isfinite, position))
        if new and max(map(abs, position)) <= LARGEST_POSITION:
            self.place = position[0], position[1]
        if fz <= LARGEST_FORCE and not fz <= self.load and fz > -math.inf:
            self.load = fz
        if math.isnan(fx + fy + fz) and math.inf not in map(abs, (fx, fy, fz)):
            return None
        if self._joints:
            self._miss(doubt.NO_VELOCITY)
            if not new or math.isnan(variance_x + variance_y):
                return None
            if math.inf in (variance_x, variance_y):
                vx = vy = 0.0
                variance_x = variance_y = math.inf
            elif math.isnan(vx + vy):
                return None
            _check_velocity(vx, vy, variance_x, variance_y)
        elif not new and self.position is None:
            self._miss(doubt.NO_POSITION)
            return None
        if not new:
            assert self.position
            position = [*self.position]
        moment = moment if self._moments else math.nan
        _check_size('force', (fx, fy, fz), LARGEST_FORCE, 'N')
        _check_size('position', position, LARGEST_POSITION, 'm')
        _check_size('moment', () if math.isnan(moment) else (moment,), LARGEST_MOMENT, 'N m')
        if new:
            self.position, self.first_ns = tuple(position), stamp_ns
        return fx, fy, fz, moment, *position, vx, vy, variance_x, variance_y

    def _miss(self, code: int) -> None:
        if self.missing != doubt.REFUSED:
            self.missing = code


class EstimationStage:
    """Check the samples of all feet, and make estimates of them.

    A foot whose force is NaN has no sample at this moment; the others go on. Where a position is
    NaN, the last one is used again, as old as it is. With the setting ``source: joints`` force,
    position and velocity come from one body estimator: a sample that lacks one is left out. One
    with an infinite variance teaches nothing.

    Parameters
    ----------
    foot : Foot
        All feet are of this kind.
    expected_load : float
        Normal force on a foot in stance, N, above 0.
    tuning : Tuning
        Settings for sensors and ground.
    legs : sequence of int
        Numbers of the legs, in the order of the rows.
    period_ns : int
        Period of the estimates, ns.
    reject : callable or None
        Called with the number of a leg, and the error, when its sample is refused; it is not used.

    Attributes
    ----------
    estimator : FeetEstimator
        Estimator of the feet.
    samples : int
        Number of moments used so far, in which at least one foot had a sample that could be used.
    used : array of int (feet,)
        Number of samples used so far, by foot.
    last_ns : int
        Time stamp of the last moment used, ns; 0 before the first one.
    """

    def __init__(
        self,
        foot: Foot,
        expected_load: float,
        tuning: Tuning,
        legs: Sequence[int],
        period_ns: int = CONTROL_PERIOD_NS,
        reject: Callable[[int, InvalidInput], None] | None = None,
    ) -> None:
        self.estimator = FeetEstimator(len(legs), foot, expected_load, tuning)
        self._legs, self._reject, self._pace = legs, reject, Pace(period_ns)
        self._inputs = [Input(tuning) for _ in legs]
        self._pressures = [0.0] * len(legs)
        self._silences: dict[int, Doubt] = {}  # doubts of feet that are silent
        self.used: npt.NDArray[np.int64] = np.zeros(len(legs), np.int64)
        self.samples = self.last_ns = 0

    def pressure(self, rows: np.ndarray) -> None:
        """Store gauge pressures of the pads, rows of PRESSURE; not NaN and beyond 1e7 Pa."""
        for place, gauge in enumerate(rows['pressure'].tolist()):
            if abs(gauge) <= LARGEST_PRESSURE:
                self._pressures[place] = gauge

    def process(self, block: Block) -> list[Block]:
        """Process samples; return the estimates that are due in them."""
        values = np.ascontiguousarray(block.rows).view(float).reshape(*block.rows.shape, -1)
        stamps = block.stamps.tolist()
        ordinary, found, first = self._ordinary(stamps, values), [], 0
        for row, stamp_ns in enumerate(stamps):
            if not ordinary:
                self._use_some(stamp_ns, values[row])
            # Who waits for an estimate receives one, also of feet without samples.
            if not self._pace.due(stamp_ns):
                continue
            if ordinary:
                self._use(stamps[first : row + 1], values[first : row + 1])
                first = row + 1
            found.append(self.estimate(stamp_ns))
            for each in self._inputs:
                each.clear()
        if ordinary and first < len(stamps):
            self._use(stamps[first:], values[first:])
        return found

    def _ordinary(self, stamps: list[int], values: Array) -> bool:
        """Return whether all samples can be used."""
        last = max(each.time for each in self.estimator.tracks)
        if not stamps or stamps[0] * 1e-9 <= last or sorted(set(stamps)) != stamps:
            return False
        # Not a number is not within limits either.
        forces, places = np.abs(values[:, :, :3]).max(), np.abs(values[:, :, 4:7]).max()
        if not (forces <= LARGEST_FORCE and places <= LARGEST_POSITION):
            return False
        tuning = self.estimator.tuning
        if tuning.moment_noise > 0.0 and (np.abs(values[:, :, 3]) > LARGEST_MOMENT).any():
            return False
        # A variance that is infinite, whatever the velocity, is for the check of single samples.
        return tuning.source != 'joints' or bool(
            np.isfinite(values[:, :, 7:]).all() and (values[:, :, 9:] >= 0.0).all()
        )

    def _use(self, stamps: list[int], values: Array) -> None:
        """Use samples of all feet."""
        self.estimator.update_all([each * 1e-9 for each in stamps], values, self._pressures)
        loads = values[:, :, 2].max(axis=0).tolist()
        for each, mine, load in zip(self._inputs, values[-1, :, 4:7].tolist(), loads, strict=True):
            each.note(stamps[-1], mine, load)
        self._silences.clear()
        self._count(stamps[-1], len(stamps), np.ones(len(self._legs), np.int64))

    def _use_some(self, stamp_ns: int, values: Array) -> None:
        """Use those samples of a moment that can be used."""
        time, samples = stamp_ns * 1e-9, []
        for place, sample in enumerate(values.tolist()):
            found = None
            try:
                found = self._inputs[place].take(stamp_ns, sample)
                if found:
                    late(time, self.estimator.tracks[place].time)
            except InvalidInput as error:
                found, self._inputs[place].missing = None, doubt.REFUSED
                if self._reject:
                    self._reject(self._legs[place], error)
            if found:
                self._inputs[place].used()
                self._silences.pop(place, None)
            samples.append((found,))
        used = np.array([bool(each) for (each,) in samples], np.int64)
        if not used.any():
            return
        ages = [(abs(time - each.first_ns * 1e-9),) for each in self._inputs]
        self.estimator.update(
            (time,), samples, self._pressures, ages if any(age for (age,) in ages) else None
        )
        self._count(stamp_ns, 1, used)

    def _count(self, stamp_ns: int, moments: int, used: npt.NDArray[np.int64]) -> None:
        self.samples += moments
        self.used += moments * used
        self.last_ns = stamp_ns

    def tick(self, now_ns: int) -> None:
        """Check at a time, ns, whether samples are missing; call it every `TICK_PERIOD_NS`."""
        for place, each in enumerate(self._inputs):
            if each.silent_ns is None:
                each.silent_ns = now_ns
            silence = (now_ns - each.silent_ns) * 1e-9
            if silence > SILENCE:
                self._silences[place] = Doubt(each.missing, silence)

    @property
    def doubts(self) -> list[Doubt]:
        """Why the ground below each foot is unobservable."""
        known = self.estimator.grounds.doubts
        return [self._silences.get(place, each) for place, each in enumerate(known)]

    def estimate(self, stamp_ns: int) -> Block:
        """Return the present estimates as a record of a time, ns."""
        table, estimator = [], self.estimator
        for each, track, belief, why in zip(
            self._inputs, estimator.tracks, estimator.grounds.beliefs, self.doubts, strict=True
        ):
            now = track.standing
            table.append((
                *each.place, each.load, *now.slip_velocity, now.slip_speed, track.slip.sd,
                now.slipping, *belief, track.margin, *why,
            ))  # fmt: skip
        rows = np.array(table, float).view(ESTIMATE.dtype)[:, 0]
        return Block.of(stamp_ns, rows)


def _check_size(name: str, values: Sequence[float], largest: float, unit: str) -> None:
    """Refuse numbers that are larger than ``largest`` in size, or no numbers."""
    for value in values:
        if not abs(value) <= largest:
            raise InvalidInput(
                f'{name} = {value!r} {unit} is not allowed: a number from {-largest:g} to'
                f' {largest:g} {unit} is needed'
            )


def _check_velocity(x: float, y: float, variance_x: float, variance_y: float) -> None:
    """Refuse a velocity of the contact that is infinite, or has a variance below 0."""
    if not (math.isfinite(x + y) and variance_x >= 0.0 and variance_y >= 0.0):
        raise InvalidInput(
            f'velocity = ({x!r}, {y!r}) m/s with variances of {variance_x!r} and {variance_y!r}'
            ' m²/s² is not allowed: finite numbers are needed, and variances from 0'
        )
