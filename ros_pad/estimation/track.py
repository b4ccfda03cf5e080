# SPDX-License-Identifier: Apache-2.0
"""Follow one foot from sample to sample: when it stands, how it slips, and what it feels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ros_pad.contact.resistance import Foot
from ros_pad.estimation import doubt
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.axes import BLOCK, Axes
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.ground import LONGEST_GAP, Ground
from ros_pad.estimation.noise import SensorNoise
from ros_pad.estimation.sensor_faults import SensorFaults
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import Watch

Sample = Sequence[float]
"""Numbers of a row of :data:`ros_pad.records.SAMPLE`: force, N, moment, N m, position, m,
velocity, m/s, and its variances, m²/s²; last the age of the position, s."""

AIRBORNE_LOAD = 0.3
"""Share of the expected load above which a foot at that height may stand on higher ground. Smaller
readings there are the offset of the sensor."""

AIRBORNE = 0.01
"""Rise above the height of its last stance, m, from which on a foot certainly touches nothing."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""

TARE_TIME = 0.5
"""Time over which the force of a foot in the air is averaged, s."""


class Offset:
    """Offset of a force sensor: the mean of its readings in the air.

    Attributes
    ----------
    x, y, z, moment : float
        Mean force, N, and mean torque about z, N m.
    sd : float
        Standard deviation of the offset of the force, N.
    known : bool
        Whether the foot was in the air.
    """

    def __init__(self, expected_load: float) -> None:
        self.x = self.y = self.z = self.moment = 0.0
        self.sd = 0.05 * expected_load
        self.known, self._air_time = False, 0.0

    def update(self, dt: float, fx: float, fy: float, fz: float, moment: float) -> None:
        """Process forces, N, and a torque, N m, read in the air dt seconds after the last ones."""
        # This is a plain mean at first, and an exponential one after TARE_TIME.
        dt = min(dt, TARE_TIME)
        self._air_time += dt
        self.known = True
        share = dt / min(TARE_TIME + dt, self._air_time)
        self.x += share * (fx - self.x)
        self.y += share * (fy - self.y)
        self.z += share * (fz - self.z)
        self.moment += share * (moment - self.moment)
        self.sd *= 1.0 - share


class Heights:
    """Heights of a foot that tell whether it can touch the ground.

    Attributes
    ----------
    last : float
        Height of the marker in the last stance, m; infinite if unknown.
    base : float
        Height at which the present stance began, m.
    """

    def __init__(self) -> None:
        self.last = self.base = math.inf

    @property
    def air(self) -> float:
        """Height above which a foot with little load touches nothing, m."""
        return self.last + AIRBORNE

    def aloft(self, stands: bool, light: bool, height: float) -> bool:
        """Return whether a foot at a height, m, is in the air."""
        if stands and height > self.base + AIRBORNE:
            self.last = self.base  # the ground cannot rise with the foot
            return True
        return light and height > self.air


class Slip:
    """Slip of the contact of a foot.

    Attributes
    ----------
    softness : float
        Motion of the point whose motion is measured against the contact, by force, m/N.
    alarm : SlipAlarm
        Slip alarm.
    sd : float
        Standard deviation of the last slip speed, m/s; infinite while it is not known.
    noise, contact_noise : float
        That of the slip speed without the body's, m/s, and of a coordinate of the contact, m.
    """

    def __init__(self, foot: Foot, tuning: Tuning) -> None:
        self._tuning, self._joints = tuning, tuning.source == 'joints'
        self._shear = 1.0 / foot.shear_stiffness
        self.softness = self._shear if tuning.pads_shear or not self._joints else 0.0
        memory = BODY_CORRELATION if self._joints else tuning.smoothing
        self.alarm = SlipAlarm(memory, threshold=tuning.alarm_threshold)
        # Smoothed position of the contact, m; with joints smoothed shear of the pads.
        self._x = self._y = self.noise = self.contact_noise = self.sd = 0.0

    def set_noise(self, position: float, force: float) -> None:
        """Use the noise of a coordinate, m, and of a component of the force, N."""
        self.contact_noise = math.hypot(position, force * self.softness)
        speed = self.contact_noise / self._tuning.smoothing
        self.noise = math.hypot(speed, self._tuning.speed_noise)

    def contact(self, x: float, y: float, fx: float, fy: float) -> tuple[float, float]:
        """Return the contact, m: the marker is above the soft pad, which a force, N, shears."""
        return x + fx * self._shear, y + fy * self._shear

    def touch_down(self, x: float, y: float, fx: float, fy: float) -> tuple[float, float]:
        """Begin a stance; return the contact, m."""
        contact = self.contact(x, y, fx, fy)
        sheared = fx * self.softness, fy * self.softness
        self._x, self._y = sheared if self._joints else contact
        self.alarm.reset()
        return contact

    def update(self, dt: float, force: Sequence[float], sample: Sample) -> tuple[float, ...]:
        """Process a sample and its force without offset, N; return speed, m/s, and place, m."""
        (fx, fy, _), (x, y, _, vx, vy, xx, yy, _) = force, sample[4:]
        smoothing = self._tuning.smoothing
        x, y = self.contact(x, y, fx, fy)
        to_x, to_y = (fx * self.softness, fy * self.softness) if self._joints else (x, y)
        share = dt / (smoothing + dt)
        self._x += share * (to_x - self._x)
        self._y += share * (to_y - self._y)
        rate_x, rate_y = (to_x - self._x) / smoothing, (to_y - self._y) / smoothing
        self.sd = self.noise
        if self._joints:
            self.sd = math.hypot(self.noise, math.sqrt(max(xx, yy)))
            rate_x, rate_y = vx + rate_x, vy + rate_y
        else:
            x, y = self._x, self._y
        pull = math.sqrt(fx * fx + fy * fy)
        # A foot gives way against its tangential force; the rest of its speed is only noise.
        return -(rate_x * fx + rate_y * fy) / pull if pull > 0.0 else 0.0, x, y


class Window:
    """Sums of the samples of a stance since the last update of the filter.

    Attributes
    ----------
    start : float
        Its beginning, s.
    first : bool
        Whether it is the first one of its stance.
    count : int
        Number of samples.
    sums : sequence of float
        Sums of normal force, tangential force, friction used by turning, N,
        slip speed, and standard deviation of that, m/s.
    peak : float
        Largest normal force of the stance, N.
    """

    def __init__(self, start: float, first: bool = True, peak: float = 0.0) -> None:
        self.start, self.first, self.peak = start, first, peak
        self.count = 0
        self.sums: Sequence[float] = (0.0,) * 5

    def add(self, *sample: float) -> None:
        """Add the numbers of a sample."""
        self.sums = [a + b for a, b in zip(self.sums, sample, strict=True)]
        self.count += 1
        self.peak = max(self.peak, sample[0])


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

    Attributes
    ----------
    ground : Ground
        As given.
    watch : Watch
        Noise and axes of its sensors.
    time : float
        Time of the last sample, s.
    stands : bool
        Whether it carries load.
    sound : bool
        Whether its sensors can be used.
    fresh : bool
        Whether the last sample updated wetness and friction, or was the first of a swing or of a
        fault; only ever set here.
    last : Standing or None
        Last sample of its last stance; None from a fault of its sensors until it stands again.
    slip : Slip
        Slip of its contact.
    """

    def __init__(self, ground: Ground) -> None:
        load, tuning = ground.expected_load, ground.tuning
        self._joints = tuning.source == 'joints'
        # An estimated position never stops, and its noise is not that of a marker.
        marker = 0.0 if self._joints else tuning.position_noise
        self._faults = SensorFaults(tuning.force_noise, marker, tuning.force_range or math.inf)
        self.ground, self.slip = ground, Slip(ground.foot, tuning)
        memory = BODY_CORRELATION if self._joints else BLOCK
        axes = Axes(load, self.slip.softness, memory)
        self.watch = Watch(SensorNoise(marker, tuning.force_noise, load), axes)
        self._offset, self._heights = Offset(load), Heights()
        self._slid = (0.0, 0.0)  # with joints, the sum of the measured velocities, m
        self._window, self.time, self.stands = Window(0.0), -math.inf, False
        self.sound, self.fresh = True, True
        self.last: Standing | None = Standing()
        self.slip.set_noise(marker, tuning.force_noise)
        self.slip.sd = self.slip.noise

    @property
    def standing(self) -> Standing:
        """Last sample of the present stance; nothing else does not slip."""
        return self.last if self.last and self.stands else NOT_STANDING

    @property
    def margin(self) -> float:
        """Friction margin; NaN from a fault of the sensors until the foot stands again."""
        return self.ground.quantile - self.last.ratio if self.last else math.nan

    def update(self, time: float, sample: Sample, pressure: float) -> None:
        """Process a sample of a time, s, with a pressure in the pads, Pa."""
        fx, fy, fz, moment, x, y, z, vx, vy, xx, yy, age = sample
        variance = max(xx, yy) if self._joints else 0.0
        dt = time - self.time
        if dt <= 0.0:
            dt = self._set_back()
        # With the body in doubt odom may begin anew: no leap of a foot.
        steady, air = self.stands and variance < math.inf, self._heights.air
        fault = self._faults.update(time, (fx, fy, fz, x, y, z), age, steady, air)
        if fault:
            self.watch.restart()
            self._lose(time, fault)
            return
        offset, tuning = self._offset, self.ground.tuning
        load, least = fz - offset.z, AIRBORNE_LOAD * self.ground.expected_load
        if self._heights.aloft(self.stands, load < least, z):
            known = tuning.moment_noise > 0.0 and moment == moment
            offset.update(dt, fx, fy, fz, moment if known else 0.0)
            load = 0.0
        if self._joints:
            moved = min(dt, BLOCK)
            x, y = self._slid = self._slid[0] + vx * moved, self._slid[1] + vy * moved
        if self.watch.looks:
            self.watch.readings.append((time, x, y, fx, fy, fz))
        if time >= self.watch.end:
            self._end_block(time, sample, math.sqrt(variance) if self._joints else None)
        if self.watch.axes.doubt.code:
            self._lose(time, self.watch.axes.doubt)
            return
        if not self.sound:
            self.ground.doubt = Doubt(doubt.NOT_AGAIN)
        stood, self.stands = self.stands, load >= tuning.load_gate * self.ground.expected_load
        if not self.stands:
            self.fresh |= stood or not self.sound
            self.sound, self.watch.looks, self.time = True, False, time
            body_sd = math.sqrt(variance) if variance < math.inf else 0.0
            self.slip.sd = math.hypot(body_sd, self.slip.noise)
            return
        if not stood or dt > LONGEST_GAP:
            self._touch_down(time, sample, pressure)
        self.fresh |= not stood and variance == math.inf
        self.sound = True
        peak = self._window.peak
        if variance == math.inf:
            self._window = Window(time)
        self._stand(time, sample, pressure)
        if variance == math.inf:
            # While the motion of the body is in doubt, there is no alarm, and nothing is learnt.
            self._window = Window(time, True, peak)
            self.slip.alarm.reset()
            assert self.last
            self.last = self.last._replace(slip_speed=0.0, turning=0.0, slipping=False)
            self.fresh |= self.ground.doubt.code != doubt.MOTION
            self.ground.doubt = Doubt(doubt.MOTION)

    def _set_back(self) -> float:
        """Begin a new stance, because the clock has been set back; return the infinite gap, s."""
        self.stands, self.time = False, -math.inf
        self._faults.restart()
        self.watch.restart()
        return math.inf

    def _end_block(self, time: float, sample: Sample, speed_sd: float | None) -> None:
        """End a block of readings."""
        watch, offset = self.watch, self._offset
        was = watch.axes.doubt.code
        force = sample[0] - offset.x, sample[1] - offset.y, sample[2] - offset.z
        known = (offset.x, offset.y) if offset.known else None
        if watch.end_block(time, sample[6], force, known, self.stands, speed_sd):
            noise = watch.noise
            self._faults.set_noise(noise.force.white, noise.position.white)
            self.slip.set_noise(noise.position.noise, noise.force.noise)
        if watch.axes.doubt.code and not was:
            watch.looks = True
            self.ground.forget(time)

    def _touch_down(self, time: float, sample: Sample, pressure: float) -> None:
        """Begin a stance."""
        fx, fy = sample[0] - self._offset.x, sample[1] - self._offset.y
        self.watch.look(time)
        self._heights.base = sample[6]
        x, y = self.slip.touch_down(sample[4], sample[5], fx, fy)
        self.ground.touch_down(time, x, y, pressure)
        self._window = Window(time)

    def _lose(self, time: float, why: Doubt) -> None:
        """Use no sample, because the sensors are in doubt."""
        self.stands = False
        if not self._faults.marker_valid:
            self._heights.last = math.inf
        if self.sound:
            self.ground.lose()
            self.fresh = True
        self.ground.doubt = why
        self.sound, self.last, self.slip.sd, self.time = False, None, math.inf, time

    def _stand(self, time: float, sample: Sample, pressure: float) -> None:
        """Process a sample of a standing foot, which may end a window."""
        offset, tuning, ground, slip = self._offset, self.ground.tuning, self.ground, self.slip
        moment, dt = sample[3], time - self.time
        fx, fy, fz = force = sample[0] - offset.x, sample[1] - offset.y, sample[2] - offset.z
        if not 0.0 < dt < math.inf:
            dt = 0.1 * tuning.smoothing
        speed, *place = slip.update(dt, force, sample)
        turning, known = 0.0, tuning.moment_noise > 0.0 and moment == moment
        if known:
            turning = abs(moment - offset.moment) / ground.foot.turning_radius
        self._window.add(fz, math.sqrt(fx * fx + fy * fy), turning, speed, slip.sd)
        if fz >= AIRBORNE_LOAD * ground.expected_load:
            self._heights.last = sample[6]
        slipping = slip.alarm.update(speed, slip.sd, dt)
        self.last, self.time = Standing(speed, fx, fy, fz, turning, slipping), time
        if time >= tuning.filter_period + (self._window.start - 1e-9):
            noises = self.watch.noise.force.noise, offset.sd, slip.contact_noise
            ground.end_window(time, self._window, place, pressure, noises, known)
            self._window = Window(time, False, self._window.peak)
            self.fresh = True
