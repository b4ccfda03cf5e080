# SPDX-License-Identifier: Apache-2.0
"""Estimator of all feet of a robot: slip, wetness, friction, and friction margin.

Arrays are of samples, numbers and feet, in this order. What happens in each sample is done for all
feet and for several samples together; what is rare (touch-downs, faults, updates of a filter) foot
by foot.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ros_pad.configuration import instance
from ros_pad.configuration import integer
from ros_pad.configuration import number
from ros_pad.configuration import shown
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.axes import BLOCK
from ros_pad.estimation.axes import Axes
from ros_pad.estimation.axes import SharedAxes
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.ground import Grounds
from ros_pad.estimation.ground import shared_friction
from ros_pad.estimation.noise import SensorNoise
from ros_pad.estimation.parts import AIRBORNE
from ros_pad.estimation.parts import Ahead
from ros_pad.estimation.parts import Offset
from ros_pad.estimation.parts import SlipSpeed
from ros_pad.estimation.parts import Stances
from ros_pad.estimation.sensing import Faults
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import LONGEST_GAP
from ros_pad.estimation.watch import Moment
from ros_pad.estimation.watch import Watch
from ros_pad.records import Array

AIRBORNE_LOAD = 0.3
"""Share of the expected load above which a foot at that height may stand on higher ground. Smaller
readings there are the offset of the sensor."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""

FORCE, MOMENT, PLACE, HEIGHT = slice(0, 3), 3, slice(4, 6), 6
VELOCITY, VARIANCE = slice(7, 9), slice(9, 11)
"""Places of the numbers of a sample."""

(
    TIME, SPEED, PULL_X, PULL_Y, LOAD, TURNING, RAISED, SPEED_SD,
    SPEED_NOISE, FORCE_NOISE, OFFSET_SD, CONTACT_NOISE,
) = range(12)  # fmt: skip
"""Rows of :attr:`FeetEstimator.last`."""


class Samples(NamedTuple):
    """Samples of all feet at successive moments.

    Attributes
    ----------
    times : sequence of float
        Times, s.
    values : array (samples, numbers, feet)
        The numbers of a record of :data:`ros_pad.records.SAMPLE`.
    pressures : sequence of float
        Gauge pressure in the pads of each foot, Pa.
    ages : array (samples, feet) or None
        Ages of the positions, s; None: all are new.
    used : array of bool (samples, feet) or None
        Which ones to use; None: all.
    """

    times: Sequence[float]
    values: Array
    pressures: Sequence[float]
    ages: Array | None = None
    used: Array | None = None


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
    watches : list of Watch
        Measured noise, and axes, of each foot.
    stances : Stances
        Which feet stand.
    doubts : list of Doubt
        Why the ground below each foot is unobservable.
    sound : array of bool (feet,)
        Whether its sensors can be used.
    fresh : array of bool (feet,)
        Whether the last samples updated wetness and friction, or were the first of a swing or of
        a fault.
    last : array (12, feet)
        Last time, s; of the last standing sample slip speed, m/s, tangential force x and y, normal
        force and friction used by turning, N, and alarm; standard deviation of the slip speed,
        m/s; and noises: of the slip speed without that of the body, m/s, of the force, of its
        offset, N, and of the contact, m.

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
        joints = tuning.source == 'joints'
        # An estimated position never stops, and its noise is not that of a marker.
        marker_noise = 0.0 if joints else tuning.position_noise
        memory = BODY_CORRELATION if joints else BLOCK
        softness, shared = self._softness(foot), SharedAxes()
        self.watches = [
            Watch(
                SensorNoise(marker_noise, tuning.force_noise, load),
                Axes(load, softness, memory, shared),
            )
            for _ in range(count)
        ]
        self._foot = foot
        limit = tuning.force_range or math.inf
        self._faults = Faults(tuning.force_noise, marker_noise, limit, count)
        self._offset = Offset(load, count)
        self.stances = Stances(tuning.load_gate * load, AIRBORNE_LOAD * load, count)
        self._speed = SlipSpeed(tuning.smoothing, count)
        memory = BODY_CORRELATION if joints else tuning.smoothing
        self._alarm = SlipAlarm(memory, threshold=tuning.alarm_threshold, feet=count)
        self.grounds = Grounds(foot, load, tuning, shared_friction(foot, load, tuning), count)
        self._slid = np.zeros((2, count))  # with joints, the sums of the measured velocities, m
        self.doubts = [Doubt(doubt.NOT_YET)] * count
        self.sound, self.fresh = np.ones((2, count), bool)
        self.last = np.zeros((12, count))
        self.last[TIME], self.last[LOAD] = -math.inf, 1.0
        for each in range(count):
            self._set_noise(each)
        self.last[SPEED_SD] = self.last[SPEED_NOISE]

    def _softness(self, foot: Foot) -> float:
        """Return the motion of the measured point against the contact, by force, m/N."""
        rigid = self.tuning.source == 'joints' and not self.tuning.pads_shear
        return 0.0 if rigid else 1.0 / foot.shear_stiffness

    def _set_noise(self, foot: int) -> None:
        """Use the noise that the sensors of a foot have shown until now."""
        tuning, noise = self.tuning, self.watches[foot].noise
        contact = math.hypot(noise.position.noise, noise.force.noise * self._softness(self._foot))
        speed = math.hypot(contact / tuning.smoothing, tuning.speed_noise)
        self.last[SPEED_NOISE, foot], self.last[CONTACT_NOISE, foot] = speed, contact
        self.last[FORCE_NOISE, foot] = noise.force.noise

    def update(self, samples: Samples) -> None:
        """Process samples; the time of each foot advances, but a clock may be set back.

        The array of the values is changed.
        """
        self.fresh[:] = False
        moments = samples.values[:, MOMENT]
        if self.tuning.moment_noise > 0.0:
            known = ~np.isnan(moments)
            moments[~known] = 0.0
        else:
            known, moments[:] = None, 0.0
        alone = self._alone(samples)
        first, count = 0, len(samples.times)
        while first < count:
            if alone[first] or any(each.axes.doubt.code for each in self.watches):
                self._take_alone(samples, known, first)
                first += 1
            else:
                end = alone.index(True, first) if True in alone[first:] else count
                first = self._advance(samples, known, first, end)

    def _alone(self, samples: Samples) -> list[bool]:
        """Return which samples to process one by one: those in which something is unusual."""
        times, values, _, ages, used = samples
        gaps = [times[0] - float(self.last[TIME].min())]
        gaps += [after - before for before, after in pairwise(times)]
        period = min(gaps)
        plain = self._faults.plain(values, ages, period)
        if plain is None:
            found = [False] * len(times)
        else:
            found = (~plain).tolist()
        if used is not None:
            found = [a or not all(b) for a, b in zip(found, used.tolist(), strict=True)]
        if max(gaps) > LONGEST_GAP or period <= 0.0:
            found = [a or not 0.0 < b <= LONGEST_GAP for a, b in zip(found, gaps, strict=True)]
        if self.tuning.source == 'joints':
            unknown = np.isinf(values[:, VARIANCE]).any(axis=(1, 2)).tolist()
            found = [a or b for a, b in zip(found, unknown, strict=True)]
        return found

    def _take_alone(self, samples: Samples, known: Array | None, row: int) -> None:
        """Process the samples of a moment, some of which may be faulty or missing."""
        times, values, _, ages, used = samples
        time, now = times[row], values[row]
        skip = ~used[row] if used is not None else np.zeros(now.shape[1], bool)
        dt = time - self.last[TIME]
        for foot in np.flatnonzero(~skip & (dt <= 0.0)).tolist():
            self._set_back(foot)
            dt[foot] = math.inf
        missing = self._kept([self._faults.state, *self._states], skip)
        steady = self.stances.stands
        if self.tuning.source == 'joints':  # in doubt, odom may begin anew: no leap of a foot
            steady = steady & ~np.isinf(now[VARIANCE]).any(axis=0)
        old = np.zeros(len(skip)) if ages is None else ages[row]
        faults = self._faults.update(time, now, old, steady, self.stances.height + AIRBORNE)
        faults = {foot: fault for foot, fault in faults.items() if not skip[foot]}
        for foot in faults:
            self.watches[foot].restart()
        faulty = np.isin(np.arange(len(skip)), list(faults))
        broken = self._kept(self._states, faulty)
        self._advance(samples, known, row, row + 1, skip | faulty)
        self._put_back(broken)
        self._put_back(missing)
        for foot, fault in faults.items():
            self._lose(foot, time, float(dt[foot]), now, fault)
        self.last[TIME, ~skip] = time

    @property
    def _states(self) -> list[Array]:
        """All that is known of each foot, except of its readings."""
        return [self._slid, self._offset.state, *self._estimates]

    @property
    def _estimates(self) -> list[Array]:
        """All that rests on readings of right axes."""
        return [
            self.stances.state, self._speed.state, self._alarm.state, self.grounds.state, self.last
        ]  # fmt: skip

    @staticmethod
    def _kept(states: list[Array], feet: Array) -> list[tuple[Array, Array, Array]]:
        """Return what is known of some feet."""
        return [(state, feet, state[:, feet]) for state in states] if feet.any() else []

    @staticmethod
    def _put_back(kept: list[tuple[Array, Array, Array]]) -> None:
        for state, feet, values in kept:
            state[:, feet] = values

    def _advance(
        self,
        samples: Samples,
        known: Array | None,
        first: int,
        end: int,
        skip: Array | None = None,
    ) -> int:
        """Process samples from a first one on, up to an end; return where the next ones begin.

        No foot lands, lifts off, or ends a block of readings in between. Feet to skip may change.
        """
        times, values, dt = samples.times, samples.values[first:end], self._dt(samples, first, end)
        forces, heights = values[:, :4], values[:, HEIGHT]
        ahead = self.stances.ahead(dt, forces, heights, self._offset, None)
        places = values[:, PLACE]
        if self.tuning.source == 'joints':
            places = self._slid + np.add.accumulate(
                values[:, VELOCITY] * np.minimum(dt, BLOCK)[:, None]
            )
        noted = self._end_blocks(times[first], values, places, ahead, skip)
        wrong = np.array([each.axes.doubt.code > 0 for each in self.watches])
        if skip is not None:
            wrong &= ~skip
        doubted = self._kept(self._estimates, wrong)
        change = ahead.change & ~wrong if skip is None else ahead.change & ~(skip | wrong)
        again = self.stances.stands & ~change & (dt[0] > LONGEST_GAP)
        if skip is not None:
            again &= ~(skip | wrong)
        if change.any() or again.any():
            lifted = self._change(
                change, again, times[first], values[0], ahead.rise, samples.pressures
            )
            ahead = self.stances.ahead(dt, forces, heights, self._offset, lifted)
            noted.update(np.flatnonzero(change | again).tolist())
        next_end = min(each.end for each in self.watches)
        count = 1 if wrong.any() or skip is not None else ahead.count
        end = bisect_left(times, next_end, first + 1, first + count)
        count = end - first
        if ahead.moved:
            self._offset.use(count)
        self._note(times[first:end], places[:count], forces[:count], noted)
        if self.tuning.source == 'joints':
            self._slid[:] = places[count - 1]
        self.stances.use(heights[:count], ahead.light[:count])
        self._follow(
            samples, known, first, end, dt[:count], wrong | skip if skip is not None else wrong
        )
        if skip is None:
            self._faults.skip(times[end - 1], values[count - 1])
        self._put_back(doubted)
        self.last[TIME] = times[end - 1]
        for foot in np.flatnonzero(wrong).tolist():
            self._lose(
                foot, times[first], float(dt[0, foot]), values[0], self.watches[foot].axes.doubt
            )
        return end

    def _dt(self, samples: Samples, first: int, end: int) -> Array:
        """Return the times since the last samples, s."""
        times = np.array(samples.times[first:end])[:, None]
        dt = np.empty((end - first, len(self.watches)))
        dt[0] = times[0] - self.last[TIME]
        dt[1:] = times[1:] - times[:-1]
        dt[0, dt[0] <= 0.0] = math.inf  # the clock has been set back
        return dt

    def _end_blocks(
        self, time: float, values: Array, places: Array, ahead: Ahead, skip: Array | None
    ) -> set[int]:
        """End the blocks of readings that end at a time, s; return the feet."""
        ended = set()
        for foot, watch in enumerate(self.watches):
            if time < watch.end or (skip is not None and skip[foot]):
                continue
            if watch.looks:
                self._note([time], places[:1], values[:1, :4], set(), [foot])
            ended.add(foot)
            self._end_block(foot, time, values[0], ahead)
        return ended

    def _end_block(self, foot: int, time: float, values: Array, ahead: Ahead) -> None:
        """End a block of readings of a foot."""
        watch, offset = (
            self.watches[foot],
            self._offset.first if ahead.moved else self._offset.state[:4],
        )
        x, y, z, _ = offset[:, foot].tolist()
        fx, fy, fz = values[FORCE, foot].tolist()
        seen = self._offset.state[5, foot] > 0.0 or ahead.air[0, foot]
        sd = None
        if self.tuning.source == 'joints':
            sd = math.sqrt(values[VARIANCE, foot].max())
        was = watch.axes.doubt.code
        if watch.end_block(Moment(
            time, float(values[HEIGHT, foot]), (fx - x, fy - y, fz - z), (x, y) if seen else None,
            bool(self.stances.stands[foot]), sd,
        )):  # fmt: skip
            self._set_noise(foot)
            noise = watch.noise
            self._faults.set_noise(foot, noise.force.white, noise.position.white)
        if watch.axes.doubt.code and not was:
            watch.looks = True
            self.grounds.forget(foot, time)

    def _note(
        self,
        times: Sequence[float],
        places: Array,
        forces: Array,
        noted: set[int],
        feet: Sequence[int] = (),
    ) -> None:
        """Take note of readings; the first ones of some feet have been used already."""
        for foot in feet or [each for each, watch in enumerate(self.watches) if watch.looks]:
            begin = foot in noted
            rows = np.concatenate((places[begin:, :, foot], forces[begin:, :3, foot]), axis=1)
            self.watches[foot].note(
                [[time, *row] for time, row in zip(times[begin:], rows.tolist(), strict=True)]
            )

    def _change(
        self,
        change: Array,
        again: Array,
        time: float,
        values: Array,
        rise: Array,
        pressures: Sequence[float],
    ) -> Array:
        """Let feet lift off and touch down at a time, s; return which ones have lifted off."""
        lifted = change & self.stances.stands
        for foot in np.flatnonzero(lifted).tolist():
            self.stances.lift(foot, bool(rise[foot]))
            self.watches[foot].looks = False
            self.fresh[foot] = True
        softness = 1.0 / self._foot.shear_stiffness
        for foot in np.flatnonzero((change & ~lifted) | again).tolist():
            force = values[:2, foot] - self._offset.state[:2, foot]
            x, y = (values[PLACE, foot] + softness * force).tolist()
            self.stances.land(foot, float(values[HEIGHT, foot]))
            self._alarm.state[:, foot] = 0.0
            self.watches[foot].look(time)
            self._speed.state[:, foot] = x, y
            if self.tuning.source == 'joints':
                self._speed.state[:, foot] = force * self._softness(self._foot)
            self.grounds.touch_down(foot, time, x, y, pressures[foot])
        return lifted & rise

    def _follow(
        self, samples: Samples, known: Array | None, first: int, end: int, dt: Array, skip: Array
    ) -> None:
        """Follow slip and friction of standing feet."""
        tuning, values, last = self.tuning, samples.values[first:end], self.last
        force = values[:, FORCE] - self._offset.state[:3]
        pulls, loads, softness = force[:, :2], force[:, 2], 1.0 / self._foot.shear_stiffness
        # The marker is above the soft pad: subtract the pad's shear to get the contact.
        places, noises = values[:, PLACE] + softness * pulls, last[SPEED_NOISE][None]
        if dt[0].max() == math.inf:
            dt = np.where(dt == math.inf, 0.1 * tuning.smoothing, dt)
        unknown = None
        if tuning.source == 'joints':
            variance = values[:, VARIANCE].max(axis=1)
            unknown = variance[-1] == math.inf
            noises = np.sqrt(np.where(variance == math.inf, 0.0, variance) + noises * noises)
            _, speeds = self._speed.update(self._softness(self._foot) * pulls, dt)
            velocity = values[:, VELOCITY] + speeds
        else:
            places, velocity = self._speed.update(places, dt)
        pull = np.hypot(pulls[:, 0], pulls[:, 1])
        # A foot gives way against its tangential force; the component across it is only noise.
        speeds = -(velocity * pulls).sum(axis=1) / np.maximum(pull, 1e-300)
        turning = 0.0
        if known is not None:
            turning = np.abs(values[:, MOMENT] - self._offset.state[3]) / self._foot.turning_radius
            turning[~known[first:end]] = 0.0
        raised = self._alarm.update(speeds, noises, dt)
        sums = np.empty((end - first, 6, len(skip)))
        for row, each in enumerate((1.0, loads, pull, turning, speeds, noises)):
            sums[:, row] = each
        stands = self.stances.stands & ~skip
        if unknown is not None and unknown.any():
            stands &= ~unknown
        last[OFFSET_SD] = self._offset.state[4]
        found = self.grounds.add(
            samples.times[first:end], sums, stands, places, samples.pressures,
            last[FORCE_NOISE:], None if known is None else known[first:end],
        )  # fmt: skip
        self._heal(skip)
        for foot, reason in found.items():
            self.doubts[foot], self.fresh[foot] = reason, True
        last[SPEED_SD] = noises[-1]
        new = np.array([speeds[-1], *pulls[-1], loads[-1], sums[-1, 3], raised])
        np.copyto(last[SPEED : RAISED + 1], new, where=self.stances.stands)
        if unknown is not None and unknown.any():
            self._in_doubt(unknown & self.stances.stands & ~skip, samples.times[end - 1])

    def _heal(self, skip: Array) -> None:
        """Take the sensors of feet that have had a sample for sound."""
        if not self.sound.all():
            for foot in np.flatnonzero(~self.sound & ~skip).tolist():
                self.doubts[foot] = Doubt(doubt.NOT_AGAIN)
                self.fresh[foot] |= not self.stances.stands[foot]
                self.sound[foot] = True

    def _in_doubt(self, feet: Array, time: float) -> None:
        """Stop alarm and learning of standing feet while the motion of the body is in doubt."""
        self._alarm.state[:, feet] = 0.0
        for row, value in ((SPEED, 0.0), (TURNING, 0.0), (RAISED, 0.0), (SPEED_SD, math.inf)):
            self.last[row, feet] = value
        for foot in np.flatnonzero(feet).tolist():
            self.grounds.begin(foot, time)
            if self.doubts[foot].code != doubt.MOTION:
                self.fresh[foot] = True
            self.doubts[foot] = Doubt(doubt.MOTION)

    def _set_back(self, foot: int) -> None:
        """Begin a new stance of a foot, because the clock has been set back."""
        self.stances.lift(foot)
        self.grounds.paths[foot].restart()
        self.grounds.histories[foot].clear()
        self._faults.restart(foot)
        self.watches[foot].restart()

    def _lose(self, foot: int, time: float, dt: float, values: Array, why: Doubt) -> None:
        """Undo what has been felt since the sensors of a foot are in doubt, and fade."""
        valid = self._faults.marker_valid[foot] > 0.0
        self.stances.lift(foot)
        if not valid:
            self.stances.height[foot] = math.inf
        x, y = values[PLACE, foot].tolist()
        changed = self.grounds.lose(foot, dt, (x, y) if valid else None, self._faults.since[foot])
        self.fresh[foot] = changed or bool(self.sound[foot])
        self.doubts[foot], self.sound[foot] = why, False
        self.last[SPEED_SD, foot], self.last[PULL_X, foot] = math.inf, math.nan

    @property
    def slips(self) -> tuple[Array, Array, Array]:
        """Slip velocity, m/s, along the tangential force, slip speed, m/s, and alarm of each foot.

        Only standing feet have them.
        """
        now = self.stances.stands
        speed = np.where(now, self.last[SPEED], 0.0)
        pulls = np.where(now, self.last[PULL_X : PULL_Y + 1], 0.0)
        ahead = pulls / np.maximum(np.hypot(*pulls), 1e-300)
        return -speed * ahead, speed, now & (self.last[RAISED] > 0.0)

    @property
    def margins(self) -> Array:
        """Friction margin of each foot; NaN from a fault of its sensors until it stands again."""
        _, _, x, y, load, turning, *_ = self.last
        found: Array = self.grounds.quantiles - np.sqrt(x * x + y * y + turning * turning) / load
        return found


def late(time: float, last: float) -> None:
    """Refuse a time, s, that is hardly before the last one, s: no clock was set back so little."""
    if last - LONGEST_GAP < time <= last:
        raise InvalidInput(
            f'time = {shown(time)} s is not allowed: it must be later than that of the last'
            f' sample, {shown(last)} s'
        )
