# SPDX-License-Identifier: Apache-2.0
"""Estimation stage of one foot: pair its samples, and emit estimates at a given rate.

The estimator node, the loop without ROS and replay use the same class.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from ros_pad.configuration import Setting
from ros_pad.errors import InvalidInput
from ros_pad.estimation.foot import ContactMotion
from ros_pad.estimation.foot import Estimate
from ros_pad.estimation.foot import FootEstimator
from ros_pad.pace import CONTROL_PERIOD_NS
from ros_pad.pace import Pace

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

Vector = tuple[float, float, float]


class Emission(NamedTuple):
    """An estimate, with what a decision needs of the samples since the last one.

    Attributes
    ----------
    stamp_ns : int
        Time stamp of the wrench, ns.
    estimate : Estimate
        The estimate.
    load : float
        Largest normal force since the last emission, N, also of rejected samples.
    position : tuple of float or None
        Last position x and y of the foot, m; None if none has arrived since the last emission.
    """

    stamp_ns: int
    estimate: Estimate
    load: float
    position: tuple[float, float] | None


class EstimationStage:
    """Pair the wrenches of a foot with its positions, and emit the estimates.

    A wrench is paired with the position of the same time stamp, whichever arrives first. If the
    next wrench arrives before such a position, the last position is used instead. With the setting
    ``source: joints`` wrench, position and velocity of the contact come from one body estimator:
    all three must have the same time stamp, and a sample that lacks one is left out.

    Parameters
    ----------
    estimator : FootEstimator
        Estimator of the foot.
    period_ns : int
        Period of the emitted estimates, ns.
    emit : callable
        Called once a period with an :class:`Emission`.
    emit_doubt : callable
        Called with the doubt of the foot when the kind of the doubt has changed, before the
        estimate of the same sample.
    reject : callable
        Called with the error when a sample is rejected; the sample is not used.

    Attributes
    ----------
    estimator : FootEstimator
        Estimator of the foot, as given.
    samples : int
        Number of samples used so far.
    last_ns : int
        Time stamp of the last sample used, ns; 0 before the first one.
    doubt : str or None
        Doubt emitted last, with the present details after the colon; None before the first sample.
    sound : bool
        Whether the sensors can be used.
    """

    def __init__(
        self,
        estimator: FootEstimator,
        period_ns: int,
        emit: Callable[[Emission], None],
        emit_doubt: Callable[[str], None],
        reject: Callable[[InvalidInput], None],
    ) -> None:
        self.estimator = estimator
        self._pace = Pace(period_ns)
        self._moments = estimator.tuning.moment_noise > 0.0
        self._joints = estimator.tuning.source == 'joints'
        self._motion: tuple[int, ContactMotion] | None = None
        self._body_doubt = ''
        self._emit, self._emit_doubt, self._reject = emit, emit_doubt, reject
        self._pressure = 0.0
        self._wrench: tuple[int, Vector, float | None] | None = None
        self._position: tuple[int, Vector] | None = None
        self._used: tuple[int, Vector] | None = None  # position of the last sample
        self._load = -math.inf  # largest since the last emission
        self._place: tuple[float, float] | None = None  # last position since the last emission
        self._used_ns = 0  # stamp of the wrench with which that position was first used
        self._silent_since_ns: int | None = None
        self._rejection = ''
        self.samples = self.last_ns = 0
        self.doubt: str | None = None
        self.sound = True

    def pressure(self, gauge: float) -> None:
        """Store a gauge pressure of the pads, Pa; ignore NaN and values beyond 1e7 Pa."""
        if abs(gauge) <= LARGEST_PRESSURE:
            self._pressure = gauge

    def wrench(self, stamp_ns: int, force: Vector, moment: float | None) -> None:
        """Process a wrench: time stamp, ns, force, N, and torque z, N m, None if not measured."""
        if self._wrench is not None and self._position is not None and not self._joints:
            # No position came for the last wrench: the marker is hidden or sampled more slowly.
            self._update(self._wrench, self._position)
        self._hold(force[2])
        self._wrench = stamp_ns, force, moment if self._moments else None
        self._match(stamp_ns)

    def position(self, stamp_ns: int, point: Vector) -> None:
        """Process a position of the marker: its time stamp, ns, and coordinates, m."""
        self._place = point[0], point[1]
        # Some motion capture systems send NaN for a hidden marker: keep the last position.
        if math.isfinite(point[0] + point[1] + point[2]):
            self._position = stamp_ns, point
        wrench, position = self._wrench, self._position
        if self._joints:
            self._match(stamp_ns)
        elif wrench is not None and position is not None and wrench[0] == stamp_ns:
            self._update(wrench, position)

    def body_doubt(self, doubt: str) -> None:
        """Store why the body estimator is in doubt; empty if it is not."""
        self._body_doubt = doubt

    def contact_velocity(
        self, stamp_ns: int, x: float, y: float, variance_x: float, variance_y: float
    ) -> None:
        """Process a velocity of the contact point; used with the setting ``source: joints`` only.

        Parameters
        ----------
        stamp_ns : int
            Time stamp, ns.
        x, y : float
            Velocity over the floor, m/s.
        variance_x, variance_y : float
            Variances of the components, m²/s², of which the larger one counts; one below 0 means
            that the velocity must not be used.
        """
        doubt, variance = '', max(variance_x, variance_y)
        if variance_x < 0.0 or variance_y < 0.0:
            doubt, x, y, variance = self._body_doubt or 'no reason was received', 0.0, 0.0, 0.0
        self._motion = stamp_ns, ContactMotion((x, y), math.sqrt(variance), doubt)
        self._match(stamp_ns)

    def _match(self, stamp_ns: int) -> None:
        """Use the sample of a time stamp, ns, if all of it is there."""
        wrench, position, motion = self._wrench, self._position, self._motion
        if wrench is None or position is None or not wrench[0] == position[0] == stamp_ns:
            return
        if not self._joints or (motion and motion[0] == stamp_ns):
            self._update(wrench, position)

    def sample(self, stamp_ns: int, force: Vector, moment: float | None, point: Vector) -> None:
        """Process a wrench and a position of the same time stamp, see :meth:`wrench`."""
        if (
            self._wrench is None
            and not self._joints
            and math.isfinite(point[0] + point[1] + point[2])
        ):
            self._hold(force[2])
            self._place = point[0], point[1]
            self._position = position = stamp_ns, point
            self._update((stamp_ns, force, moment if self._moments else None), position)
        else:
            self.wrench(stamp_ns, force, moment)
            self.position(stamp_ns, point)

    def _hold(self, load: float) -> None:
        if self._load < load <= LARGEST_FORCE:
            self._load = load

    def _update(
        self, wrench: tuple[int, Vector, float | None], position: tuple[int, Vector]
    ) -> None:
        """Process a sample."""
        self._wrench = None
        stamp_ns, force, moment = wrench
        if position is not self._used:
            # The position's own stamp may come from another clock.
            self._used, self._used_ns = position, stamp_ns
        (fx, fy, fz), (x, y, z) = force, position[1]
        try:
            # Only an unusual sample is looked at more closely; squares take less time than abs().
            if fx * fx + fy * fy + fz * fz + x * x + y * y + z * z > LARGEST_FORCE**2 or moment:
                _check_sizes(force, position[1], moment)
            estimate = self.estimator.update(
                stamp_ns * 1e-9,
                force,
                position[1],
                self._pressure,
                moment,
                self._used_ns * 1e-9,
                *([self._motion[1]] if self._joints and self._motion else []),
            )
        except InvalidInput as error:
            self.reject(error)
            return
        self.samples += 1
        self.last_ns = stamp_ns
        self._silent_since_ns, self._rejection = None, ''
        if estimate.doubt != self.doubt or estimate.sound != self.sound:
            self._update_doubt(estimate.doubt, estimate.sound)
        if self._pace.due(stamp_ns):
            emission = Emission(stamp_ns, estimate, self._load, self._place)
            self._load, self._place = -math.inf, None
            self._emit(emission)

    def reject(self, error: InvalidInput) -> None:
        """Report a rejected sample; its error becomes the doubt if no sample follows for long."""
        self._rejection = str(error)
        self._reject(error)

    def _update_doubt(self, doubt: str, sound: bool) -> None:
        before = self.doubt
        self.doubt, self.sound = doubt, sound
        # Details, after the colon, may change with every sample.
        if doubt != before and (
            before is None or doubt.partition(':')[0] != before.partition(':')[0]
        ):
            self._emit_doubt(doubt)

    def tick(self, now_ns: int) -> None:
        """Check at a time, ns, whether samples are missing; call it every `TICK_PERIOD_NS`."""
        if self._silent_since_ns is None:
            self._silent_since_ns = now_ns
        silence = (now_ns - self._silent_since_ns) * 1e-9
        if silence > SILENCE:
            self._update_doubt(self._missing(silence), False)

    def _missing(self, silence: float) -> str:
        if self._rejection:
            return f'sample refused: {self._rejection}'
        if self._position is None and self._wrench is not None:
            return f'no position: for {silence:.1f} s'
        if self._joints and self._wrench is not None:
            return f'no contact velocity: for {silence:.1f} s'
        return f'no wrench: for {silence:.1f} s'


def _check_sizes(force: Vector, point: Vector, moment: float | None) -> None:
    """Refuse numbers that are too large; the estimator refuses numbers that are not finite."""
    _check_size('force', force, LARGEST_FORCE, 'N')
    _check_size('position', point, LARGEST_POSITION, 'm')
    if moment is not None:
        _check_size('moment', (moment,), LARGEST_MOMENT, 'N m')


def _check_size(name: str, values: tuple[float, ...], largest: float, unit: str) -> None:
    """Refuse finite numbers that are larger than ``largest`` in size."""
    for value in values:
        if largest < abs(value) < math.inf:
            raise InvalidInput(
                f'{name} = {value!r} {unit} is not allowed: a number from {-largest:g} to'
                f' {largest:g} {unit} is needed'
            )
