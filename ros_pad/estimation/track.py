# SPDX-License-Identifier: Apache-2.0
"""Follow one foot from sample to sample: when it stands, how it slips, and what it feels."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import Any, NamedTuple

from ros_pad.estimation import doubt
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.axes import BLOCK, Axes, SharedAxes
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.ground import Ground
from ros_pad.estimation.noise import SensorNoise
from ros_pad.estimation.parts import Gate, Offset, Slip, Window
from ros_pad.estimation.sensing import Sensing
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import LONGEST_GAP, Watch

Sample = Sequence[float]
"""Numbers of a row of :data:`ros_pad.records.SAMPLE`: force, N, moment, N m, position, m,
velocity, m/s, and its variances, m²/s²; last the age of the position, s."""

AIRBORNE_LOAD = 0.3
"""Share of the expected load above which a foot at that height may stand on higher ground. Smaller
readings there are the offset of the sensor."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""

Samples = Sequence[Any]
"""Samples, None where there is none."""


class Setup(NamedTuple):
    """What does not change.

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
    ground : Ground
        What the foot knows of the ground.
    shared : SharedAxes
        What all feet show of their axes.

    Attributes
    ----------
    ground : Ground
        As given.
    sensing, watch, gate, offset, slip
        Stages of this foot.
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
        '_setup', '_slid', '_window', 'fresh', 'gate', 'ground', 'last', 'offset', 'sensing',
        'slip', 'sound', 'time', 'watch',
    )  # fmt: skip

    def __init__(self, ground: Ground, shared: SharedAxes) -> None:
        foot, load, tuning = ground.foot, ground.expected_load, ground.tuning
        joints, shear = tuning.source == 'joints', 1.0 / foot.shear_stiffness
        softness = shear if tuning.pads_shear or not joints else 0.0
        moments = tuning.moment_noise > 0.0
        self._setup = Setup(tuning, joints, moments, shear, softness, foot.turning_radius)
        # An estimated position never stops, and its noise is not that of a marker.
        marker = 0.0 if joints else tuning.position_noise
        self.sensing = Sensing(tuning.force_noise, marker, tuning.force_range or math.inf)
        axes = Axes(load, softness, BODY_CORRELATION if joints else BLOCK, shared)
        self.watch = Watch(SensorNoise(marker, tuning.force_noise, load), axes)
        self.gate = Gate(tuning.load_gate * load, AIRBORNE_LOAD * load)
        memory = BODY_CORRELATION if joints else tuning.smoothing
        self.slip = Slip(SlipAlarm(memory, threshold=tuning.alarm_threshold))
        self.ground, self.offset = ground, Offset(load)
        self._slid = (0.0, 0.0)  # with joints, the sum of the measured velocities, m
        self._window = Window(0.0)
        self.time = -math.inf
        self.sound, self.fresh = True, True
        self.last: Standing | None = Standing()
        self._set_noise()
        self.slip.sd = self.slip.noise

    @property
    def standing(self) -> Standing:
        """Last sample of the present stance; nothing else does not slip."""
        return self.last if self.last and self.gate.stands else NOT_STANDING

    @property
    def margin(self) -> float:
        """Friction margin; NaN from a fault of the sensors until the foot stands again."""
        return self.ground.quantile - self.last.ratio if self.last else math.nan

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
        quiet: Sequence[bool] | None,
    ) -> None:
        """Process samples at some times, s, with a pressure, Pa.

        In quiet samples nothing but landing and lifting can happen, while the sensors are sound.
        """
        row, count = 0, len(times)
        while row < count:
            end = row
            if quiet and quiet[row] and self.sound and self.sensing.calm:
                end = quiet.index(False, row) if False in quiet[row:] else count
                end = bisect_left(times, self.watch.end, row, end)
            if self.gate.stands:
                end = self._stands_until(times, samples, row, end)
                if end > row:
                    self._skip(times, samples, row, end)
                    self._stand(times[row:end], samples[row:end], pressure)
            else:
                end = self._fly(times, samples, row, end)
            if end == row:
                end += 1
                if samples[row]:
                    self._process(times[row], samples[row], pressure)
            row = end

    def _process(self, time: float, sample: Sample, pressure: float) -> None:
        """Process a sample with anything that may happen in it."""
        if not self._take(time, sample, pressure):
            return
        if not self._setup.joints or max(sample[9:11]) < math.inf:
            self._stand((time,), (sample,), pressure)
            return
        # While the motion of the body is in doubt, there is no alarm, and nothing is learnt.
        peak, self._window = self._window.peak, Window(time)
        self._stand((time,), (sample,), pressure)
        self._window = Window(time, True, peak)
        self.slip.alarm.reset()
        assert self.last
        self.last = self.last._replace(slip_speed=0.0, turning=0.0, slipping=False)
        self.fresh |= self.ground.doubt.code != doubt.MOTION
        self.ground.doubt = Doubt(doubt.MOTION)

    def _take(self, time: float, sample: Sample, pressure: float) -> bool:
        """Process a sample up to whether the foot stands, which is returned."""
        setup, gate, offset = self._setup, self.gate, self.offset
        fx, fy, fz, moment, x, y, z, vx, vy, xx, yy, age = sample
        variance = max(xx, yy) if setup.joints else 0.0
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
            self.ground.doubt = Doubt(doubt.NOT_AGAIN)
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
        if watch.end_block(time, sample[6], force, known, self.gate.stands, speed_sd):
            self.sensing.set_noise(watch.noise.force.white, watch.noise.position.white)
            self._set_noise()
        if watch.axes.doubt.code and not was:
            watch.looks = True
            self.ground.forget(time)

    def _set_back(self) -> float:
        """Begin a new stance, because the clock has been set back; return the infinite gap, s."""
        self.gate.stands, self.time = False, -math.inf
        self.ground.set_back()
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
        shear = fx * setup.softness, fy * setup.softness
        self.slip.x, self.slip.y = shear if setup.joints else (x, y)
        self.slip.alarm.reset()
        self.ground.touch_down(time, x, y, pressure)
        self._window = Window(time)

    def _lose(self, time: float, dt: float, x: float, y: float, why: Doubt) -> bool:
        """Undo what has been felt since the sensors are in doubt, and fade; return False."""
        seen, gate = self.sensing.marker_valid, self.gate
        gate.stands = False
        if not seen:
            gate.height = math.inf
        changed = self.ground.lose(dt, (x, y) if seen else None, self.sensing.since, why)
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
            self.time = before
            self.slip.sd = self.slip.noise
            if self._setup.joints:
                self.slip.sd = math.hypot(math.sqrt(max(samples[row - 1][9:11])), self.slip.noise)
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

    def _stands_until(self, times: Sequence[float], samples: Samples, first: int, end: int) -> int:
        """Return the end of the samples in which a foot is sure to stand, and a window lasts."""
        end = min(end, bisect_left(times, self._due, first, end) + 1)
        firm, top, oz = self.gate.firm, self.gate.top, self.offset.z
        for row in range(first, end):
            if samples[row][2] - oz < firm or samples[row][6] > top:
                return row
        return end

    @property
    def _due(self) -> float:
        """End of the window, s."""
        return self._setup.tuning.filter_period + (self._window.start - 1e-9)

    def _stand(self, times: Sequence[float], samples: Samples, pressure: float) -> None:
        """Process samples of a standing foot, of which the last may end a window."""
        (tuning, joints, moments, shear, softness, lever), slip = self._setup, self.slip
        offset, smoothing, own, sx, sy = self.offset, tuning.smoothing, slip.noise, slip.x, slip.y
        noise, turning, before, tests, felt = own, 0.0, self.time, [], []
        ox, oy, oz = offset.x, offset.y, offset.z
        for time, sample in zip(times, samples, strict=True):
            fx, fy, fz, moment, x, y, z, vx, vy, xx, yy, _ = sample
            fx, fy, fz, dt = fx - ox, fy - oy, fz - oz, time - before
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
                turning = abs(moment - offset.moment) / lever if moment == moment else 0.0
            tests.append((speed, noise, dt))
            felt.append((fz, pull, turning, speed, noise))
            before = time
        slip.x, slip.y, slip.sd, self.time = sx, sy, noise, before
        self._window.add(felt)
        if fz >= self.gate.least:
            self.gate.height = z
        self.last = Standing(speed, fx, fy, fz, turning, slip.alarm.update(tests))
        if before >= self._due:
            place, known = (place_x, place_y), moments and moment == moment
            noises = self.watch.noise.force.noise, offset.sd, slip.contact_noise
            self.ground.end_window(before, self._window, place, pressure, noises, known)
            self._window = Window(before, False, self._window.peak)
            self.fresh = True
