# SPDX-License-Identifier: Apache-2.0
"""From what is heard of a foot, whenever it comes, to samples for its estimator.

The estimator node and the replay of bags listen with the same object, so that both pair wrenches
with positions, and fall silent, alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ros_pad.errors import InvalidInput
from ros_pad.estimation.foot import Estimate
from ros_pad.estimation.foot import FootEstimator
from ros_pad.pace import Pace

SILENCE = 0.4
"""Time without a sample after which a foot is said not to be heard, s."""

LISTEN_PERIOD_NS = 100_000_000
"""How often one should look whether a foot is heard, ns."""

LARGEST_FORCE = 1e5
LARGEST_POSITION = 1e6
LARGEST_PRESSURE = 1e7
LARGEST_MOMENT = 1e5
"""What is believed of a sensor in either direction, N, m, Pa gauge, N m: what is larger, though a
number, would leave its mark on sums and means for good."""

Vector = tuple[float, float, float]


class FootListener:
    """Pairs the wrenches of a foot with its positions, and tells of what its estimator finds.

    A wrench goes with the position of its own time stamp, whichever comes first. When the next
    wrench comes before that, the last position counts.

    Parameters
    ----------
    estimator : FootEstimator
        Takes the samples.
    period_ns : int
        Between the estimates that are told, ns.
    moments : bool
        Whether the torque z of a wrench is measured.
    tell : callable
        Called with each estimate that is due, and the time stamp of its wrench, ns.
    tell_doubt : callable
        Called with the doubt of the foot when it is of another kind.
    refuse : callable
        Called with the error when a sample is no good; it is left out.

    Attributes
    ----------
    samples : int
        Taken so far.
    doubt : str or None
        As told last; details, after the colon, as they are now. None before the first sample.
    sound : bool
        Whether the sensors are believed.
    """

    def __init__(
        self,
        estimator: FootEstimator,
        period_ns: int,
        moments: bool,
        tell: Callable[[int, Estimate], None],
        tell_doubt: Callable[[str], None],
        refuse: Callable[[InvalidInput], None],
    ) -> None:
        self._estimator = estimator
        self._pace = Pace(period_ns)
        self._moments = moments
        self._tell, self._tell_doubt, self._refuse = tell, tell_doubt, refuse
        self._pressure = 0.0
        self._wrench: tuple[int, Vector, float] | None = None
        self._position: tuple[int, Vector] | None = None
        self._used: tuple[int, Vector] | None = None  # position of the last sample ...
        self._used_ns = 0  # ... and when it was first used
        self._heard_ns: int | None = None  # when the last sample came
        self._refusal = ''
        self.samples = 0
        self.doubt: str | None = None
        self.sound = True

    def pressure(self, gauge: float) -> None:
        """Take a gauge pressure of the pads, Pa."""
        # A device that does not answer may be told of so: what it said last counts.
        if abs(gauge) <= LARGEST_PRESSURE:
            self._pressure = gauge

    def wrench(self, stamp_ns: int, force: Vector, moment: float) -> None:
        """Take a wrench: its time stamp, ns, force, N, and torque z, N m."""
        if self._wrench is not None and self._position is not None:
            # No position came with the wrench before: its marker was out of sight, or it is
            # slower than the force. Use the last one.
            self._update(self._wrench, self._position)
        self._wrench = stamp_ns, force, moment
        if self._position is not None and self._position[0] == stamp_ns:
            self._take(self._wrench, self._position)

    def position(self, stamp_ns: int, point: Vector) -> None:
        """Take a position of the marker: its time stamp, ns, and place, m."""
        if math.isfinite(point[0] + point[1] + point[2]):
            self._position = stamp_ns, point
        # Some motion capture says so when a marker is out of sight: then the last one counts.
        elif self._position is None:
            return
        if self._wrench is not None and self._wrench[0] == stamp_ns:
            self._take(self._wrench, self._position)

    def _take(self, wrench: tuple[int, Vector, float], position: tuple[int, Vector]) -> None:
        self._wrench = None
        self._update(wrench, position)

    def _update(self, wrench: tuple[int, Vector, float], position: tuple[int, Vector]) -> None:
        stamp_ns, force, moment = wrench
        if position is not self._used:
            # Its own stamp may be of another clock.
            self._used, self._used_ns = position, stamp_ns
        point = position[1]
        measured_moment = moment if self._moments else None
        try:
            _believe('force', force, LARGEST_FORCE, 'N')
            _believe('position', point, LARGEST_POSITION, 'm')
            _believe('moment', (measured_moment or 0.0,), LARGEST_MOMENT, 'N m')
            estimate = self._estimator.update(
                stamp_ns * 1e-9,
                force,
                point,
                self._pressure,
                measured_moment,
                self._used_ns * 1e-9,
            )
        except InvalidInput as error:
            self.refused(error)
            return
        self.samples += 1
        self._heard_ns, self._refusal = None, ''
        self._say(estimate.doubt, estimate.sound)
        if self._pace.due(stamp_ns):
            self._tell(stamp_ns, estimate)

    def refused(self, error: InvalidInput) -> None:
        """Note that a sample was no good: when the foot falls silent, this is why."""
        self._refusal = str(error)
        self._refuse(error)

    def _say(self, doubt: str, sound: bool) -> None:
        # Details, after the colon, may change with every sample.
        news = self.doubt is None or doubt.partition(':')[0] != self.doubt.partition(':')[0]
        self.doubt, self.sound = doubt, sound
        if news:
            self._tell_doubt(doubt)

    def listen(self, now_ns: int) -> None:
        """Say so when no sample has come for long; call it every :data:`LISTEN_PERIOD_NS`."""
        if self._heard_ns is None:
            self._heard_ns = now_ns
        silence = (now_ns - self._heard_ns) * 1e-9
        if silence > SILENCE:
            self._say(self._missing(silence), False)

    def _missing(self, silence: float) -> str:
        if self._refusal:
            return f'sample refused: {self._refusal}'
        if self._position is None and self._wrench is not None:
            return f'no position: for {silence:.1f} s'
        return f'no wrench: for {silence:.1f} s'


def _believe(name: str, values: tuple[float, ...], largest: float, unit: str) -> None:
    """Refuse numbers beyond what is believed; the estimator itself refuses what is no number."""
    for value in values:
        if largest < abs(value) < math.inf:
            raise InvalidInput(
                f'{name} = {values!r} {unit}: at most {largest:g} {unit} is believed'
            )
