# SPDX-License-Identifier: Apache-2.0
"""Follow one foot from sample to sample: when it stands, how it slips, and what it feels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ros_pad.configuration import shown
from ros_pad.errors import InvalidInput
from ros_pad.estimation import alarm, doubt
from ros_pad.estimation.alarm import BODY_CORRELATION, Slip
from ros_pad.estimation.axes import BLOCK, Axes, Vector
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.ground import LONGEST_GAP, Ground
from ros_pad.estimation.sensor_faults import SensorFaults
from ros_pad.estimation.watch import Watch

LOAD_GATE = 0.1
"""Share of the expected load above which a foot stands."""

AIRBORNE_LOAD = 0.3
"""Share of the expected load above which a foot at that height may stand on higher ground. Smaller
readings there are the offset of the sensor."""

AIRBORNE = 0.01
"""Rise above the height of its last stance, m, from which on a foot certainly touches nothing."""

TARE_TIME = 0.5
"""Time over which the force of a foot in the air is averaged, s."""

LARGEST_FORCE, LARGEST_POSITION = 1e5, 1e6
"""Largest size of a force, N, or moment, N m, and of a position, m. A larger value, though finite,
would spoil sums and means for ever."""


class Sample(NamedTuple):
    """What the sensors of a foot read at a moment.

    Attributes
    ----------
    fx, fy, fz : float
        Force of the ground on the foot, N; z is the normal force.
    moment : float
        Yaw moment, N m; NaN if it is not measured.
    x, y, z : float
        Position of the marker, or of the foot in odom, m.
    vx, vy : float
        Velocity of the contact over the floor, m/s; 0 with markers.
    variance : float
        Variance of its components, m²/s²; infinite if it must not be used, 0 with markers.
    age : float
        Age of the position, s.
    """

    fx: float
    fy: float
    fz: float
    moment: float
    x: float
    y: float
    z: float
    vx: float = 0.0
    vy: float = 0.0
    variance: float = 0.0
    age: float = 0.0


_LIMITS = (
    *((f'force {axis}', -LARGEST_FORCE, LARGEST_FORCE, 'N') for axis in 'xyz'),
    ('moment', -LARGEST_FORCE, LARGEST_FORCE, 'N m'),
    *((f'position {axis}', -LARGEST_POSITION, LARGEST_POSITION, 'm') for axis in 'xyz'),
    *((f'velocity {axis}', -1e6, 1e6, 'm/s') for axis in 'xy'),
    ('variance', 0.0, math.inf, 'm²/s²'),
    ('age of the position', 0.0, 1e12, 's'),
)


def check(sample: Sample, time: float, last: float) -> None:
    """Refuse a sample of a time, s, with wrong numbers, or hardly later than the last one, s.

    Raises
    ------
    InvalidInput
        When a number is too large or not finite, or the time does not advance: no clock is set
        back by so little.
    """
    wrong = [
        f'{name} = {shown(value)} {unit}'
        for (name, low, high, unit), value in zip(_LIMITS, sample, strict=True)
        if not (low <= value <= high or (name == 'moment' and value != value))
    ]
    if not abs(time) < math.inf:
        wrong.append(f'time = {shown(time)} s')
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

    def update(self, dt: float, sample: Sample) -> None:
        """Process a sample read in the air dt seconds after the last one."""
        # This is a plain mean at first, and an exponential one after TARE_TIME.
        dt = min(dt, TARE_TIME)
        self._air_time += dt
        self.known = True
        share = dt / min(TARE_TIME + dt, self._air_time)
        self.x += share * (sample.fx - self.x)
        self.y += share * (sample.fy - self.y)
        self.z += share * (sample.fz - self.z)
        moment = 0.0 if math.isnan(sample.moment) else sample.moment
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
        fault.
    last : Standing or None
        Last sample of its last stance; None from a fault of its sensors until it stands again.
    slip : Slip
        Slip of its contact.
    """

    def __init__(self, ground: Ground) -> None:
        load, tuning = ground.expected_load, ground.tuning
        joints = tuning.source == 'joints'
        # An estimated position never stops, and its noise is not that of a marker.
        marker = 0.0 if joints else tuning.position_noise
        self._faults = SensorFaults(tuning.force_noise, marker, tuning.force_range or math.inf)
        self.ground, self.slip = ground, Slip(ground.foot, tuning)
        axes = Axes(load, self.slip.softness, BODY_CORRELATION if joints else BLOCK)
        self.watch = Watch(marker, tuning.force_noise, load, axes, joints)
        self._offset, self._heights = Offset(load), Heights()
        self._window, self._touched = Window(0.0), -math.inf
        self.time, self.stands = -math.inf, False
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
        self.fresh = False
        known = sample.variance < math.inf
        dt = time - self.time
        if dt <= 0.0:
            dt = self._set_back()
        # With the body in doubt odom may begin anew: no leap of a foot.
        fault = self._faults.update(time, sample, self.stands and known, self._heights.air)
        if fault:
            self.watch.restart()
            self._lose(time, fault)
            return
        offset, expected_load = self._offset, self.ground.expected_load
        load = sample.fz - offset.z
        if self._heights.aloft(self.stands, load < AIRBORNE_LOAD * expected_load, sample.z):
            offset.update(dt, sample)
            load = 0.0
        force = sample.fx - offset.x, sample.fy - offset.y, sample.fz - offset.z
        self._look(time, dt, sample, force)
        if self.watch.axes.doubt.code:
            self._lose(time, self.watch.axes.doubt)
            return
        if not self.sound:
            self.ground.doubt = Doubt(doubt.NOT_AGAIN)
        stood, self.stands = self.stands, load >= LOAD_GATE * expected_load
        if not self.stands:
            self.fresh = stood or not self.sound
            self.sound, self.watch.looks, self.time = True, False, time
            body_sd = math.sqrt(sample.variance) if known else 0.0
            self.slip.sd = math.hypot(body_sd, self.slip.noise)
            return
        self.sound = True
        if not stood or dt > LONGEST_GAP:
            self._touch_down(time, sample, force, pressure)
        if load >= AIRBORNE_LOAD * expected_load:
            self._heights.last = sample.z
        if known and time - self._touched > alarm.SMOOTHING - 1e-9:
            self._stand(time, sample, force, pressure)
            return
        # While the foot lands, or the motion of the body is in doubt, there is no alarm, and
        # nothing is learnt.
        self._window = Window(time, True, max(self._window.peak, load))
        self.slip.touch_down(sample, force[0], force[1])
        self.last, self.time = Standing(0.0, *force), time
        if not known:
            self.fresh |= not stood or self.ground.doubt.code != doubt.MOTION
            self.ground.doubt = Doubt(doubt.MOTION)

    def _set_back(self) -> float:
        """Begin a new stance, because the clock has been set back; return the infinite gap, s."""
        self.stands, self.time = False, -math.inf
        self._faults.restart()
        self.watch.restart()
        return math.inf

    def _look(self, time: float, dt: float, sample: Sample, force: Vector) -> None:
        """Watch over the sensors; the force is without offset, N."""
        watch, was = self.watch, self.watch.axes.doubt.code
        if watch.update(time, dt, sample, force, self._offset, self.stands):
            self._faults.set_noise(watch.force.white, watch.position.white)
            self.slip.set_noise(watch.position.noise, watch.force.noise)
        if watch.axes.doubt.code and not was:
            watch.looks = True
            self.ground.forget(time)

    def _touch_down(self, time: float, sample: Sample, force: Vector, pressure: float) -> None:
        """Begin a stance."""
        self.watch.look(time)
        self._heights.base = sample.z
        x, y = self.slip.touch_down(sample, force[0], force[1])
        self.ground.touch_down(time, x, y, pressure)
        self._window, self._touched = Window(time), time

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

    def _stand(self, time: float, sample: Sample, force: Vector, pressure: float) -> None:
        """Process a sample of a standing foot, which may end a window."""
        ground, slip, (fx, fy, fz) = self.ground, self.slip, force
        speed, slipping, place = slip.update(time - self.time, sample, fx, fy)
        turning, known = 0.0, not math.isnan(sample.moment)
        if known:
            turning = abs(sample.moment - self._offset.moment) / ground.foot.turning_radius
        self._window.add(fz, math.sqrt(fx * fx + fy * fy), turning, speed, slip.sd)
        self.last, self.time = Standing(speed, fx, fy, fz, turning, slipping), time
        if time >= ground.tuning.filter_period + (self._window.start - 1e-9):
            noises = self.watch.force.noise, self._offset.sd, slip.contact_noise
            ground.end_window(time, self._window, place, pressure, noises, known)
            self._window = Window(time, False, self._window.peak)
            self.fresh = True
