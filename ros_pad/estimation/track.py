# SPDX-License-Identifier: Apache-2.0
"""Follow one foot from sample to sample: when it stands, how it slips, and what it feels."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import Any
from typing import NamedTuple

from ros_pad.contact.resistance import Foot
from ros_pad.estimation import doubt
from ros_pad.estimation.axes import BLOCK
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.ground import Grounds
from ros_pad.estimation.parts import Gate
from ros_pad.estimation.parts import Offset
from ros_pad.estimation.parts import Slip
from ros_pad.estimation.parts import Window
from ros_pad.estimation.sensing import Sensing
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import LONGEST_GAP
from ros_pad.estimation.watch import Moment
from ros_pad.estimation.watch import Watch

Sample = Sequence[float]
"""Numbers of a row of :data:`ros_pad.records.SAMPLE`: force, N, moment, N m, position, m,
velocity, m/s, and its variances, m²/s²."""

Samples = Sequence[Any]
"""Samples, None where there is none."""


class Setup(NamedTuple):
    """What is the same for all feet.

    Attributes
    ----------
    tuning : Tuning
        Settings for sensors and ground.
    joints, moments : bool
        Whether slip comes from joints, and whether yaw moments are measured.
    shear, softness : float
        Motion of the marker, and of the point whose motion is measured, against the contact, by
        force, m/N.
    lever : float
        Lever of friction against turning, m.
    """

    tuning: Tuning
    joints: bool
    moments: bool
    shear: float
    softness: float
    lever: float

    @classmethod
    def of(cls, foot: Foot, tuning: Tuning) -> Setup:
        """Return what is the same for all feet of a kind."""
        joints, shear = tuning.source == 'joints', 1.0 / foot.shear_stiffness
        softness = shear if tuning.pads_shear or not joints else 0.0
        return cls(tuning, joints, tuning.moment_noise > 0.0, shear, softness, foot.turning_radius)


class Standing(NamedTuple):
    """The last sample of a stance.

    Attributes
    ----------
    slip_speed : float
        Slip speed, m/s.
    pull_x, pull_y, load, turning : float
        Tangential force, normal force, and friction used by turning, N.
    slipping : bool
        Whether the slip alarm is on.
    """

    slip_speed: float = 0.0
    pull_x: float = 0.0
    pull_y: float = 0.0
    load: float = 1.0
    turning: float = 0.0
    slipping: bool = False

    @property
    def ratio(self) -> float:
        """Friction in use over load."""
        return math.hypot(self.pull_x, self.pull_y, self.turning) / self.load

    @property
    def slip_velocity(self) -> tuple[float, float]:
        """Slip velocity along the tangential force, m/s."""
        pull = math.hypot(self.pull_x, self.pull_y)
        if not self.slip_speed or not pull:
            return 0.0, 0.0
        return -self.slip_speed * self.pull_x / pull, -self.slip_speed * self.pull_y / pull


NOT_STANDING = Standing()


class Track:
    """Follow one foot.

    Parameters
    ----------
    place : int
        Its place among the feet.
    setup : Setup
        What is the same for all feet.
    grounds : Grounds
        What the feet know of the ground.
    sensing, watch, gate, offset, slip
        Stages of this foot.

    Attributes
    ----------
    sensing, watch, gate, offset, slip
        As given.
    time : float
        Time of the last sample, s.
    sound : bool
        Whether its sensors can be used.
    fresh : bool
        Whether the last samples updated wetness and friction, or were the first of a swing or of
        a fault.
    last : Standing or None
        Last sample of its last stance; None from a fault of its sensors until it stands again.
    """

    __slots__ = (
        '_grounds', '_place', '_setup', '_slid', '_window', 'fresh', 'gate', 'last', 'offset',
        'sensing', 'slip', 'sound', 'time', 'watch',
    )  # fmt: skip

    def __init__(
        self,
        place: int,
        setup: Setup,
        grounds: Grounds,
        sensing: Sensing,
        watch: Watch,
        gate: Gate,
        offset: Offset,
        slip: Slip,
    ) -> None:
        self._place, self._setup, self._grounds = place, setup, grounds
        self.sensing, self.watch, self.gate = sensing, watch, gate
        self.offset, self.slip = offset, slip
        self._slid = (0.0, 0.0)  # with joints, the sum of the measured velocities, m
        self._window = Window(0.0)
        self.time = -math.inf
        self.sound, self.fresh = True, True
        self.last: Standing | None = Standing()
        self._set_noise()
        slip.sd = slip.noise

    @property
    def standing(self) -> Standing:
        """Last sample of the present stance; nothing else does not slip."""
        return self.last if self.last and self.gate.stands else NOT_STANDING

    @property
    def margin(self) -> float:
        """Friction margin; NaN from a fault of the sensors until the foot stands again."""
        return self._grounds.quantiles[self._place] - self.last.ratio if self.last else math.nan

    def _set_noise(self) -> None:
        """Use the noise that the sensors have shown until now."""
        tuning, noise, slip = self._setup.tuning, self.watch.noise, self.slip
        softness = self._setup.softness
        slip.contact_noise = math.hypot(noise.position.noise, noise.force.noise * softness)
        slip.noise = math.hypot(slip.contact_noise / tuning.smoothing, tuning.speed_noise)

    def update(
        self,
        times: Sequence[float],
        samples: Samples,
        pressure: float,
        ages: Sequence[float] | None,
        quiet: Sequence[bool] | None,
    ) -> None:
        """Process samples at some times, s, with a pressure, Pa, and ages of positions, s.

        In quiet samples nothing but landing and lifting can happen, while the sensors are sound.
        """
        row, count = 0, len(times)
        while row < count:
            done = end = row
            if quiet and quiet[row] and self.sound and self.sensing.calm:
                end = quiet.index(False, row) if False in quiet[row:] else count
                end = bisect_left(times, self.watch.end, row, end)
            if end > row and self.gate.stands:
                done = self._stand(times, samples, row, end, pressure)
            elif end > row:
                done = self._fly(times, samples, row, end)
            if done == row:
                done += 1
                if samples[row] is not None:
                    old = ages[row] if ages else 0.0
                    self._take_and_stand(times, samples, row, old, pressure)
            row = done

    def _take_and_stand(
        self, times: Sequence[float], samples: Samples, row: int, age: float, pressure: float
    ) -> None:
        """Process a sample with anything that may happen in it."""
        if not self._take(times[row], samples[row], age, pressure):
            return
        if self._setup.joints and max(samples[row][9:]) == math.inf:
            self._in_doubt(times[row], samples[row])
        else:
            self._stand(times, samples, row, row + 1, pressure, taken=True)

    def _take(self, time: float, sample: Sample, age: float, pressure: float) -> bool:
        """Process a sample up to whether the foot stands, which is returned."""
        setup, gate, offset = self._setup, self.gate, self.offset
        fx, fy, fz, moment, x, y, z, vx, vy, *variances = sample
        variance = max(variances) if setup.joints else 0.0
        dt = time - self.time
        if dt <= 0.0:
            dt = self._set_back()
        stood = gate.stands
        # With the body in doubt odom may begin anew: no leap of a foot.
        steady = stood and variance < math.inf
        fault = self.sensing.update(time, (fx, fy, fz, x, y, z), age, steady, gate.air)
        if fault:
            self.watch.restart()
            return self._lose(time, dt, x, y, fault)
        load = fz - offset.z
        if gate.aloft(load, z):
            offset.update(dt, fx, fy, fz, moment if setup.moments and moment == moment else 0.0)
            load = 0.0
        place = x, y
        if setup.joints:
            moved = min(dt, BLOCK)
            place = self._slid = self._slid[0] + vx * moved, self._slid[1] + vy * moved
        if self.watch.looks:
            self.watch.note([(time, *place, fx, fy, fz)])
        if time >= self.watch.end:
            self._end_block(time, sample, math.sqrt(variance) if setup.joints else None)
        if self.watch.axes.doubt.code:
            return self._lose(time, dt, x, y, self.watch.axes.doubt)
        if not self.sound:
            self._grounds.doubts[self._place] = Doubt(doubt.NOT_AGAIN)
        if gate.update(load):
            if not stood or dt > LONGEST_GAP:
                self._touch_down(time, sample, pressure)
            self.fresh |= not stood and variance == math.inf
            self.sound = True
            return True
        self.fresh |= stood or not self.sound
        self.sound, self.watch.looks, self.time = True, False, time
        known = math.sqrt(variance) if variance < math.inf else 0.0
        self.slip.sd = math.hypot(known, self.slip.noise)
        return False

    def _end_block(self, time: float, sample: Sample, speed_sd: float | None) -> None:
        """End a block of readings."""
        watch, offset = self.watch, self.offset
        was = watch.axes.doubt.code
        force = sample[0] - offset.x, sample[1] - offset.y, sample[2] - offset.z
        known = (offset.x, offset.y) if offset.known else None
        if watch.end_block(Moment(time, sample[6], force, known, self.gate.stands, speed_sd)):
            self.sensing.set_noise(watch.noise.force.white, watch.noise.position.white)
            self._set_noise()
        if watch.axes.doubt.code and not was:
            watch.looks = True
            self._grounds.forget(self._place, time)

    def _set_back(self) -> float:
        """Begin a new stance, because the clock has been set back; return the infinite gap, s."""
        self.gate.stands, self.time = False, -math.inf
        self._grounds.set_back(self._place)
        self.sensing.restart()
        self.watch.restart()
        return math.inf

    def _touch_down(self, time: float, sample: Sample, pressure: float) -> None:
        """Begin a stance."""
        setup = self._setup
        fx, fy = sample[0] - self.offset.x, sample[1] - self.offset.y
        x, y = sample[4] + fx * setup.shear, sample[5] + fy * setup.shear
        self.watch.look(time)
        self.gate.touch_down(sample[6])
        self.slip.begin(*((fx * setup.softness, fy * setup.softness) if setup.joints else (x, y)))
        self._grounds.touch_down(self._place, time, x, y, pressure)
        self._window = Window(time)

    def _lose(self, time: float, dt: float, x: float, y: float, why: Doubt) -> bool:
        """Undo what has been felt since the sensors are in doubt, and fade; return False."""
        seen, gate = self.sensing.marker_valid, self.gate
        gate.stands = False
        if not seen:
            gate.height = math.inf
        changed = self._grounds.lose(
            self._place, dt, (x, y) if seen else None, self.sensing.since, why
        )
        self.fresh |= changed or self.sound
        self.sound, self.last, self.slip.sd, self.time = False, None, math.inf, time
        return False

    def _fly(self, times: Sequence[float], samples: Samples, first: int, end: int) -> int:
        """Process ordinary samples of a foot in the air; return the next one."""
        offset, gate, before, row = self.offset, self.gate, self.time, first
        least, air, moments = gate.least, gate.air, self._setup.moments
        while row < end:
            fx, fy, fz, moment, _, _, z, *_ = samples[row]
            if not (z > air and fz - offset.z < least):
                break
            yaw = moment if moments and moment == moment else 0.0
            offset.update(times[row] - before, fx, fy, fz, yaw)
            before, row = times[row], row + 1
        if row > first:
            self._skip(times, samples, first, row)
            self.slip.sd = self.slip.noise
            if self._setup.joints:
                self.slip.sd = math.hypot(math.sqrt(max(samples[row - 1][9:])), self.slip.noise)
        return row

    def _skip(self, times: Sequence[float], samples: Samples, first: int, end: int) -> None:
        """Take note of ordinary samples."""
        joints, looks, noted, before = self._setup.joints, self.watch.looks, [], self.time
        if joints or looks:
            for row in range(first, end):
                fx, fy, fz, _, x, y, _, vx, vy, *_ = samples[row]
                if joints:
                    dt = min(times[row] - before, BLOCK)
                    x, y = self._slid = self._slid[0] + vx * dt, self._slid[1] + vy * dt
                before = times[row]
                noted.append((before, x, y, fx, fy, fz))
        if looks:
            self.watch.note(noted)
        fx, fy, fz, _, x, y, z, *_ = samples[end - 1]
        self.sensing.skip(times[end - 1], (fx, fy, fz, x, y, z))
        self.time = times[end - 1]

    def _stand(
        self,
        times: Sequence[float],
        samples: Samples,
        first: int,
        end: int,
        pressure: float,
        taken: bool = False,
    ) -> int:
        """Process ordinary samples of a standing foot, or the one that has been taken.

        Stop where the foot may lift off, or a window ends; return the next one.
        """
        (tuning, joints, moments, shear, softness, lever), slip = self._setup, self.slip
        offset, window, gate = self.offset, self._window, self.gate
        ox, oy, oz, sx, sy, top, firm = (
            offset.x, offset.y, offset.z, slip.x, slip.y, gate.top, gate.firm,
        )  # fmt: skip
        count, loads, pulls, turnings, speeds, noises = window.sums
        smoothing, own, peak, due = tuning.smoothing, slip.noise, window.peak, tuning.filter_period
        noise, turning, known, before, tests, row = own, 0.0, False, self.time, [], first
        due += window.start - 1e-9
        while row < end:
            fx, fy, fz, moment, x, y, z, vx, vy, xx, yy = samples[row]
            time = times[row]
            fx, fy, fz, dt = fx - ox, fy - oy, fz - oz, time - before
            if (fz < firm or z > top) and not taken:
                break
            if not 0.0 < dt < math.inf:
                dt = 0.1 * smoothing
            # The marker is above the soft pad: subtract the pad's shear to get the contact.
            share, place_x, place_y = dt / (smoothing + dt), x + fx * shear, y + fy * shear
            to_x, to_y = (fx * softness, fy * softness) if joints else (place_x, place_y)
            sx += share * (to_x - sx)
            sy += share * (to_y - sy)
            if joints:
                noise = math.hypot(own, math.sqrt(max(xx, yy)))
                vx, vy = vx + (to_x - sx) / smoothing, vy + (to_y - sy) / smoothing
            else:
                vx, vy, place_x, place_y = (to_x - sx) / smoothing, (to_y - sy) / smoothing, sx, sy
            pull = math.sqrt(fx * fx + fy * fy)
            # A foot gives way against its tangential force; the rest of its speed is only noise.
            speed = -(vx * fx + vy * fy) / pull if pull > 0.0 else 0.0
            if moments:
                known = moment == moment
                turning = abs(moment - offset.moment) / lever if known else 0.0
                turnings += turning
            tests.append((speed, noise, dt))
            count, loads, pulls, speeds = count + 1.0, loads + fz, pulls + pull, speeds + speed
            noises += noise
            if fz > peak:
                peak = fz
            if fz >= gate.least:
                gate.height = z
            before, standing, row = time, (speed, fx, fy, fz, turning), row + 1
            if time >= due:
                break
        if row == first:
            return row
        slip.x, slip.y, slip.sd = sx, sy, noise
        window.sums, window.peak = (count, loads, pulls, turnings, speeds, noises), peak
        self.last = Standing(*standing, slip.alarm.update(tests))
        if not taken:
            self._skip(times, samples, first, row)
        self.time = before
        if before >= due:
            self._end_window(before, (place_x, place_y), pressure, known)
        return row

    def _end_window(
        self, time: float, place: tuple[float, float], pressure: float, known: bool
    ) -> None:
        """Use the samples of a window that ends, and begin another one."""
        noises = self.watch.noise.force.noise, self.offset.sd, self.slip.contact_noise
        self._grounds.end_window(self._place, time, self._window, place, pressure, noises, known)
        self._window = Window(time, False, self._window.peak)
        self.fresh = True

    def _in_doubt(self, time: float, sample: Sample) -> None:
        """Stop alarm and learning of a standing foot while the motion of the body is in doubt."""
        slip, offset, setup, smoothing = (
            self.slip, self.offset, self._setup, self._setup.tuning.smoothing,
        )  # fmt: skip
        fx, fy, fz = sample[0] - offset.x, sample[1] - offset.y, sample[2] - offset.z
        dt = time - self.time
        share = dt / (smoothing + dt) if 0.0 < dt < math.inf else 0.1 / 1.1
        slip.x += share * (fx * setup.softness - slip.x)
        slip.y += share * (fy * setup.softness - slip.y)
        slip.alarm.reset()
        if fz >= self.gate.least:
            self.gate.height = sample[6]
        self._window = Window(time, True, self._window.peak)
        self.last, slip.sd, self.time = Standing(0.0, fx, fy, fz), math.inf, time
        self.fresh |= self._grounds.doubt(self._place)
