# SPDX-License-Identifier: Apache-2.0
"""Estimator of all feet of a robot: slip, wetness, friction, and friction margin."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ros_pad.configuration import instance, integer, number, shown
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation.friction import GroundModel
from ros_pad.estimation.ground import LONGEST_GAP, Ground, shared_friction
from ros_pad.estimation.track import Sample, Track
from ros_pad.estimation.tuning import Tuning


class FeetEstimator:
    """Estimate slip, wetness and friction of all feet of a robot, which learn together.

    See :class:`ros_pad.estimation.FootEstimator` for what it does; samples are not checked.

    Parameters
    ----------
    count : int
        Number of feet, from 1.
    foot : Foot
        All feet are of this kind.
    expected_load : float
        Normal force on a foot in stance, N, above 0.
    tuning : Tuning or None
        Settings for sensors and ground.

    Attributes
    ----------
    tuning : Tuning
        As given.
    shared : FrictionScales
        What the feet learn of friction together.
    tracks : list of Track
        What each foot does, and knows of the ground.

    Raises
    ------
    InvalidInput
        When the expected load is not a number above 0, the count no whole number from 1, or foot
        or tuning of another class.
    """

    def __init__(
        self, count: int, foot: Foot, expected_load: float, tuning: Tuning | None = None
    ) -> None:
        instance('foot', foot, Foot)
        self.tuning = tuning = Tuning() if tuning is None else tuning
        instance('tuning', tuning, Tuning)
        integer('count', count, 1)
        load = number('expected_load', expected_load, 'N', above=True)
        self.shared = shared_friction(foot, load, tuning)
        model = GroundModel(
            self.shared, tuning.wet_prior, tuning.patch_length, rim_speed=tuning.rim_speed(foot)
        )
        self.tracks = [Track(Ground(foot, load, tuning, model)) for _ in range(count)]

    def update(
        self, time: float, samples: Sequence[Sample | None], pressures: Sequence[float]
    ) -> None:
        """Process the samples of a time; the clock may have been set back.

        Parameters
        ----------
        time : float
            Time, s.
        samples : sequence of Sample or None
            A sample of each foot, None where it has none.
        pressures : sequence of float
            Gauge pressure in the pads of each foot, Pa.
        """
        for track, sample, pressure in zip(self.tracks, samples, pressures, strict=True):
            track.fresh = False
            if sample:
                track.update(time, sample, pressure)


LARGEST_FORCE, LARGEST_POSITION, LARGEST_PRESSURE = 1e5, 1e6, 1e7
"""Largest size of a force, N, and moment, N m, of a position, m, and of a gauge pressure, Pa."""

NUMBERS = (
    *((f'force {axis}', -LARGEST_FORCE, LARGEST_FORCE, 'N') for axis in 'xyz'),
    ('moment', -LARGEST_FORCE, LARGEST_FORCE, 'N m'),
    *((f'position {axis}', -LARGEST_POSITION, LARGEST_POSITION, 'm') for axis in 'xyz'),
    *((f'velocity {axis}', -1e6, 1e6, 'm/s') for axis in 'xy'),
    *((f'variance {axis}', 0.0, math.inf, 'm²/s²') for axis in 'xy'),
    ('age of the position', 0.0, 1e12, 's'),
    ('pressure', -LARGEST_PRESSURE, LARGEST_PRESSURE, 'Pa'),
    ('deviation', 0.0, 1e6, 'm/s'),
)
"""Names, limits and units of the numbers of a sample, and of what comes with it. A larger value,
though finite, would spoil sums and means for ever."""


def wrong_numbers(time: float, numbers: Sequence[float]) -> list[str]:
    """Return what is outside its limits of a time, s, and :data:`NUMBERS`, or the first of them.

    The moment may be NaN.
    """
    wrong = [
        f'{name} = {shown(value)} {unit}'
        for (name, low, high, unit), value in zip(NUMBERS, numbers, strict=False)
        if not (low <= value <= high or (name == 'moment' and value != value))
    ]
    return wrong if abs(time) < math.inf else [*wrong, f'time = {shown(time)} s']


def refuse(time: float, last: float, wrong: Sequence[str]) -> None:
    """Refuse a sample of a time, s, with wrong numbers, or hardly before the last one, s.

    No clock is set back by so little.
    """
    if wrong:
        raise InvalidInput(
            f'sample at {shown(time)} s: {", ".join(wrong)}: must be finite, and not larger than'
            ' a sensor can show'
        )
    if last - LONGEST_GAP < time <= last:
        raise InvalidInput(
            f'time = {shown(time)} s is not allowed: it must be later than that of the last'
            f' sample, {shown(last)} s'
        )
