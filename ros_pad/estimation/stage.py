# SPDX-License-Identifier: Apache-2.0
"""Estimation stage of all feet: check their samples, and make estimates of them at a given rate.

The estimator node, the loop without ROS and replay use the same class.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ros_pad.configuration import Setting
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.foot import LARGEST_PRESSURE
from ros_pad.estimation.friction import GroundModel
from ros_pad.estimation.ground import Ground
from ros_pad.estimation.track import LARGEST_FORCE, LARGEST_POSITION, Sample, Track, check
from ros_pad.estimation.tuning import Tuning
from ros_pad.pace import CONTROL_PERIOD_NS, Pace
from ros_pad.records import ESTIMATE, Block

PUBLISH_RATE = Setting(
    'publish_rate', 1e9 / CONTROL_PERIOD_NS, 'Estimates a second.', 'Hz', 5.0, 1000.0
)

SILENCE = 0.4
"""Time without a sample after which the sensors of a foot count as faulty, s."""


class _Arrivals:
    """What has come from the sensors of a foot."""

    def __init__(self, tuning: Tuning) -> None:
        self._joints, self._moments = tuning.source == 'joints', tuning.moment_noise > 0.0
        self._position: tuple[float, float, float] | None = None  # last one, m
        self._seen_ns = 0  # stamp of the sample with which that was first used
        self.time = -math.inf  # of the last sample used, s
        self.used = 0  # number of samples used so far
        self._use()
        self.clear()

    def clear(self) -> None:
        """Begin anew after an estimate."""
        self.place: tuple[float, ...] = (math.nan, math.nan)  # last position since then, m
        self.load = math.nan  # largest normal force since then, N, also of refused samples

    def _use(self) -> None:
        """Take note that a sample is used."""
        self.missing = doubt.NO_WRENCH  # code of the doubt that follows from silence
        self._silent_ns: int | None = None  # since when, as far as it was noticed
        self.silence: Doubt | None = None  # that no sample has been used for long

    def tick(self, now_ns: int) -> None:
        """Check at a time, ns, for how long nothing has been used."""
        if self._silent_ns is None:
            self._silent_ns = now_ns
        silence = (now_ns - self._silent_ns) * 1e-9
        if silence > SILENCE:
            self.silence = Doubt(self.missing, silence)

    def take(self, stamp_ns: int, numbers: Sequence[float]) -> Sample | None:
        """Return the sample to use of the numbers of a row; None if something is missing.

        Raises
        ------
        InvalidInput
            When a number is too large or infinite, or the time does not advance.
        """
        time, age, variance = stamp_ns * 1e-9, 0.0, 0.0
        fx, fy, fz, moment, x, y, z, vx, vy, xx, yy = numbers
        new = math.isfinite(x + y + z)
        if new and max(abs(x), abs(y), abs(z)) <= LARGEST_POSITION:
            self.place = x, y
        if fz <= LARGEST_FORCE and not fz <= self.load and fz > -math.inf:
            self.load = fz
        nan = fx != fx or fy != fy or fz != fz
        if nan and math.inf not in (abs(fx), abs(fy), abs(fz)):
            return None
        if self._joints:
            self._miss(doubt.NO_VELOCITY)
            if math.inf in (xx, yy):
                vx, vy, xx, yy = 0.0, 0.0, math.inf, math.inf
            variance = max(xx, yy) if min(xx, yy) >= 0.0 else min(xx, yy)  # refused below 0
            if not new or math.isnan(xx + yy) or math.isnan(vx + vy):
                return None
        else:
            vx = vy = 0.0
        if not new:
            self._miss(doubt.NO_POSITION)
            if not self._position:
                return None
            (x, y, z), age = self._position, abs(time - self._seen_ns * 1e-9)
        sample = Sample(
            fx, fy, fz, moment if self._moments else math.nan, x, y, z, vx, vy, variance, age
        )
        check(sample, time, self.time)
        if new:
            self._position, self._seen_ns = (x, y, z), stamp_ns
        self.time = time
        self.used += 1
        self._use()
        return sample

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
    model : GroundModel
        What is assumed of the ground, and what the feet learn of friction together.
    tracks : list of Track
        What each foot does, and knows of the ground.
    samples : int
        Number of moments used so far, in which at least one foot had a sample that could be used.
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
        self.model = GroundModel.of(foot, expected_load, tuning)
        self.tracks = [Track(Ground(foot, expected_load, tuning, self.model)) for _ in legs]
        self._legs, self._reject, self._pace = legs, reject, Pace(period_ns)
        self._arrivals = [_Arrivals(tuning) for _ in legs]
        self._pressures = [0.0] * len(legs)
        self.samples = self.last_ns = 0

    def pressure(self, record: Block) -> None:
        """Store gauge pressures of a PRESSURE record, unless missing or too large."""
        for place, gauge in enumerate(record.rows[-1]['pressure'].tolist()):
            if abs(gauge) <= LARGEST_PRESSURE:
                self._pressures[place] = gauge

    def process(self, block: Block) -> list[Block]:
        """Process samples; return the estimates that are due in them."""
        numbers = np.ascontiguousarray(block.rows).view(float).reshape(*block.rows.shape, -1)
        found = []
        for stamp_ns, moment in zip(block.stamps.tolist(), numbers.tolist(), strict=True):
            used = [self._use(place, stamp_ns, each) for place, each in enumerate(moment)]
            if any(used):
                self.samples += 1
                self.last_ns = stamp_ns
            # Who waits for an estimate receives one, also of feet without samples.
            if self._pace.due(stamp_ns):
                found.append(self.estimate(stamp_ns))
                for each in self._arrivals:
                    each.clear()
        return found

    @property
    def used(self) -> list[int]:
        """Number of samples used so far, by foot."""
        return [each.used for each in self._arrivals]

    def _use(self, place: int, stamp_ns: int, numbers: Sequence[float]) -> bool:
        """Process the row of a foot; return whether it could be used."""
        try:
            sample = self._arrivals[place].take(stamp_ns, numbers)
        except InvalidInput as error:
            self._arrivals[place].missing = doubt.REFUSED
            if self._reject:
                self._reject(self._legs[place], error)
            return False
        if sample:
            self.tracks[place].update(stamp_ns * 1e-9, sample, self._pressures[place])
        return bool(sample)

    def tick(self, now_ns: int) -> None:
        """Check at a time, ns, whether samples are missing; call it every `TICK_PERIOD_NS`."""
        for each in self._arrivals:
            each.tick(now_ns)

    def estimate(self, stamp_ns: int) -> Block:
        """Return the present estimates as a record of a time, ns."""
        table = []
        for each, track in zip(self._arrivals, self.tracks, strict=True):
            now, ground = track.standing, track.ground
            table.append((
                *each.place, each.load, *now.slip_velocity, now.slip_speed, track.slip.sd,
                now.slipping, *ground.belief, track.margin, *(each.silence or ground.doubt),
            ))  # fmt: skip
        rows = np.array(table, float).view(ESTIMATE.dtype)[:, 0]
        return Block.of(stamp_ns, rows)
