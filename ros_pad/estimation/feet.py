# SPDX-License-Identifier: Apache-2.0
"""Estimator of all feet of a robot: slip, wetness, friction, and friction margin.

Each foot follows a whole block of samples before the next one does: as long as it stands, or
swings, and its readings are ordinary, little is to be done for a sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ros_pad.configuration import instance
from ros_pad.configuration import integer
from ros_pad.configuration import number
from ros_pad.configuration import shown
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.axes import BLOCK
from ros_pad.estimation.axes import Axes
from ros_pad.estimation.axes import SharedAxes
from ros_pad.estimation.ground import Grounds
from ros_pad.estimation.ground import shared_friction
from ros_pad.estimation.noise import SensorNoise
from ros_pad.estimation.parts import Gate
from ros_pad.estimation.parts import Offset
from ros_pad.estimation.parts import Slip
from ros_pad.estimation.scales import DELAY
from ros_pad.estimation.sensing import LEAP_DISTANCE
from ros_pad.estimation.sensing import READINGS
from ros_pad.estimation.sensing import Sensing
from ros_pad.estimation.track import Sample
from ros_pad.estimation.track import Setup
from ros_pad.estimation.track import Track
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import LONGEST_GAP
from ros_pad.estimation.watch import Watch
from ros_pad.records import Array

AIRBORNE_LOAD = 0.3
"""Share of the expected load above which a foot at that height may stand on higher ground. Smaller
readings there are the offset of the sensor."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""


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
    grounds : Grounds
        What each foot knows of the ground, with the friction that all learn together.
    tracks : list of Track
        What each foot does.

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
        self.grounds = Grounds(foot, load, tuning, shared_friction(foot, load, tuning), count)
        setup, axes = Setup.of(foot, tuning), SharedAxes()
        self.tracks = [self._track(place, load, setup, axes) for place in range(count)]

    def _track(self, place: int, load: float, setup: Setup, shared: SharedAxes) -> Track:
        tuning = self.tuning
        # An estimated position never stops, and its noise is not that of a marker.
        marker = 0.0 if setup.joints else tuning.position_noise
        memory = BODY_CORRELATION if setup.joints else BLOCK
        axes = Axes(load, setup.softness, memory, shared)
        memory = BODY_CORRELATION if setup.joints else tuning.smoothing
        return Track(
            place,
            setup,
            self.grounds,
            Sensing(tuning.force_noise, marker, tuning.force_range or math.inf),
            Watch(SensorNoise(marker, tuning.force_noise, load), axes),
            Gate(tuning.load_gate * load, AIRBORNE_LOAD * load),
            Offset(load),
            Slip(SlipAlarm(memory, threshold=tuning.alarm_threshold)),
        )

    def update_all(
        self, times: Sequence[float], values: Array, pressures: Sequence[float]
    ) -> None:
        """Process samples of all feet, with new positions, at times that advance.

        Parameters
        ----------
        times : sequence of float
            Times, s.
        values : array (times, feet, 11)
            Numbers of SAMPLE rows in their units (no unit of their own); none is missing.
        pressures : sequence of float
            Gauge pressure in the pads of each foot, Pa.
        """
        gaps = [time - before for before, time in pairwise((self.tracks[0].time, *times))]
        quiet = None
        if max(gaps) <= LONGEST_GAP and self._in_step:
            quiet = self._quiet(values)
        samples = values.transpose(1, 0, 2).tolist()
        self.update(times, samples, pressures, quiet=quiet)

    @property
    def _in_step(self) -> bool:
        """Whether all feet have had their last sample at the same time."""
        return len({each.time for each in self.tracks}) == 1

    def _quiet(self, values: Array) -> list[list[bool]]:
        """Return for each foot whether all its readings change, and none of them leaps."""
        last = np.array([[each.sensing.last for each in self.tracks]])
        readings = values[:, :, READINGS]
        moves = np.abs(readings - np.concatenate((last, readings[:-1])))
        if moves.all() and moves[:, :, 3:].max() <= 0.5 * LEAP_DISTANCE:
            return [[True] * len(values)] * len(self.tracks)
        found = moves.all(axis=2) & (moves[:, :, 3:] <= 0.5 * LEAP_DISTANCE).all(axis=2)
        quiet: list[list[bool]] = found.T.tolist()
        return quiet

    def update(
        self,
        times: Sequence[float],
        samples: Sequence[Sequence[Sample | None]],
        pressures: Sequence[float],
        ages: Sequence[Sequence[float]] | None = None,
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
        ages : sequence of sequence of float or None
            For each foot the ages of its positions, s; None: all are new.
        quiet : sequence of sequence of bool or None
            For each foot the samples in which nothing but landing and lifting can happen, see
            :meth:`update_all`; None: unknown.
        """
        for track in self.tracks:
            track.fresh = False
        first, count = 0, len(times)
        while first < count:
            end = first + 1
            # In a shorter time feet cannot hear of each other.
            while end < count and abs(times[end] - times[first]) < 0.9 * DELAY:
                end += 1
            whole = end - first == count
            for place, track in enumerate(self.tracks):
                mine, part = samples[place], slice(first, end)
                old = ages[place][part] if ages else None
                calm = quiet[place][part] if quiet else None
                track.update(
                    times[part], mine if whole else mine[part], pressures[place], old, calm
                )
            first = end


def late(time: float, last: float) -> None:
    """Refuse a time, s, that is hardly before the last one, s: no clock was set back so little."""
    if last - LONGEST_GAP < time <= last:
        raise InvalidInput(
            f'time = {shown(time)} s is not allowed: it must be later than that of the last'
            f' sample, {shown(last)} s'
        )
