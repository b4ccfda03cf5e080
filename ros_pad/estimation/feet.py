# SPDX-License-Identifier: Apache-2.0
"""Estimator of all feet of a robot: slip, wetness, friction, and friction margin.

Each foot follows a whole block of samples before the next one does: as long as it stands, or
swings, and its readings are ordinary, little is to be done for a sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import sub

import numpy as np

from ros_pad.configuration import instance, integer, number, shown
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation.axes import SharedAxes
from ros_pad.estimation.friction import GroundModel
from ros_pad.estimation.ground import Ground, shared_friction
from ros_pad.estimation.scales import DELAY
from ros_pad.estimation.sensing import LEAP_DISTANCE, READINGS
from ros_pad.estimation.track import Sample, Track
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import LONGEST_GAP
from ros_pad.records import Array


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
        self.shared, axes = shared_friction(foot, load, tuning), SharedAxes()
        model = GroundModel(
            self.shared, tuning.wet_prior, tuning.patch_length, rim_speed=tuning.rim_speed(foot)
        )
        self.tracks = [Track(Ground(foot, load, tuning, model), axes) for _ in range(count)]

    def quiet(self, times: Sequence[float], values: Array) -> list[list[bool]] | None:
        """Find the samples of each foot in which all readings change, and none of them leaps.

        Parameters
        ----------
        times : sequence of float
            Times, s, that advance.
        values : array (samples, feet, numbers)
            Complete samples, N, m and m/s.

        Returns
        -------
        list of list of bool, or None
            Whether they are such; None if this is unknown, because samples are missing.
        """
        gaps = map(sub, times, (min(each.time for each in self.tracks), *times))
        if max(gaps) > LONGEST_GAP:
            return None
        readings = values[:, :, READINGS]
        last = np.array([[each.sensing.last for each in self.tracks]])
        moves = np.abs(readings - np.concatenate((last, readings[:-1])))
        # Forces leap as they like.
        quiet = ((moves > 0.0) & (moves <= FARTHEST)).all(axis=2)
        found: list[list[bool]] = quiet.T.tolist()
        return found

    def update(
        self,
        times: Sequence[float],
        samples: Sequence[Sequence[Sample | None]],
        pressures: Sequence[float],
        quiet: Sequence[Sequence[bool]] | None = None,
    ) -> None:
        """Process the samples of some times; a clock may have been set back in between.

        Parameters
        ----------
        times : sequence of float
            Times, s.
        samples : sequence of sequence of Sample or None
            For each foot a sample at each time, None where it has none.
        pressures : sequence of float
            Gauge pressure in the pads of each foot, Pa.
        quiet : sequence of sequence of bool or None
            For each foot the samples in which nothing but landing and lifting can happen, see
            :meth:`quiet`; None: unknown.
        """
        for track in self.tracks:
            track.fresh = False
        first, count = 0, len(times)
        while first < count:
            end = first + 1
            # In a shorter time feet cannot hear of each other.
            while end < count and abs(times[end] - times[first]) < 0.9 * DELAY:
                end += 1
            part = slice(first, end)
            for place, track in enumerate(self.tracks):
                calm = quiet[place][part] if quiet else None
                track.update(times[part], samples[place][part], pressures[place], calm)
            first = end


FARTHEST = np.array(3 * [math.inf] + 3 * [0.5 * LEAP_DISTANCE])
"""Largest changes of force and position in samples in which nothing leaps."""

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
