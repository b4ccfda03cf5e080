# SPDX-License-Identifier: Apache-2.0
"""Estimator of one foot: slip, wetness, friction, and margin to slip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ros_pad.contact.pad import number
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.friction import FrictionPrior
from ros_pad.estimation.friction import GroundFilter

LONGEST_GAP = 0.15
"""Between samples of one stance, s: after a longer silence the foot may have stepped."""

AIRBORNE = 0.01
"""Height above its last stance from which a foot surely touches nothing, m ..."""

AIRBORNE_LOAD = 0.3
"""... unless it carries this share of the expected load: what else it reads is its offset."""

NEW_PLACE = 5e-4
"""Way over which a sliding foot has something new to tell, m."""

TARE_TIME = 0.5
"""Over which the force of a foot in the air is averaged, s."""


@dataclass(frozen=True)
class Tuning:
    """What an estimator may be told about robot, sensors and ground; defaults suit most.

    Attributes
    ----------
    position_noise : float
        Standard deviation of a marker coordinate, m, 0 or more.
    force_noise : float
        Standard deviation of a force component, N, 0 or more.
    load_gate : float
        Share of the expected load above which a foot stands, above 0 up to 1. Feet slide most as
        they land and lift off, lightly loaded.
    smoothing : float
        Time constant of the speed, s, above 0.
    filter_period : float
        Between updates of the wetness and friction filter, s, above 0.
    wet_prior : float
        Probability of wet ground where nothing is known, 0.01 to 0.99.
    patch_length : float
        Way over which wet and dry ground change, m, above 0.
    ratio_noise : float
        Model error of T/N, added to the sensors', above 0.
    speed_noise : float
        Model error of the slip speed, m/s, added to the sensors', above 0: feet also roll and
        bend.
    turning_rate : float
        Root mean square of the rate at which a standing foot turns about the vertical, rad/s, 0 or
        more: of legs without an ankle the speed of the body over the length of the leg.

    Raises
    ------
    InvalidInput
        Naming the value that is outside its range.
    """

    position_noise: float = 1.5e-4
    force_noise: float = 0.03
    load_gate: float = 0.1
    smoothing: float = 0.02
    filter_period: float = 0.04
    wet_prior: float = 0.5
    patch_length: float = 1.5
    ratio_noise: float = 0.03
    speed_noise: float = 2e-3
    turning_rate: float = 4.0

    def __post_init__(self) -> None:
        number('position_noise', self.position_noise, 'm')
        number('force_noise', self.force_noise, 'N')
        number('load_gate', self.load_gate, '(share)', high=1.0, above=True)
        number('smoothing', self.smoothing, 's', above=True)
        number('filter_period', self.filter_period, 's', above=True)
        number('wet_prior', self.wet_prior, '(probability)', 0.01, 0.99)
        number('patch_length', self.patch_length, 'm', above=True)
        number('ratio_noise', self.ratio_noise, '(ratio)', above=True)
        number('speed_noise', self.speed_noise, 'm/s', above=True)
        number('turning_rate', self.turning_rate, 'rad/s')

    def rim_speed(self, foot: Foot) -> float:
        """Return how fast the sole of a turning foot scrubs, m/s: at 2/3 of its radius."""
        return 2.0 / 3.0 * foot.sole_radius * self.turning_rate


class Estimate(NamedTuple):
    """What is known of a foot after a sample.

    Attributes
    ----------
    time : float
        Of the sample, s.
    standing : bool
        Whether the foot carries load.
    slipping : bool
        Alarm.
    slip_velocity : tuple of float
        Velocity of the contact over the floor along its tangential force, m/s, x and y.
    slip_speed : float
        The same against that force, m/s: positive when the foot gives way.
    slip_speed_sd : float
        Standard deviation of the slip speed, m/s.
    wet_probability : float
        Probability that the ground is wet, 0 to 1.
    friction_mean, friction_sd : float
        Of the coefficient of friction.
    margin : float
        5 % quantile of μ - T/N: below zero, slip is likely.
    fresh : bool
        Whether wetness and friction were updated by this sample.
    """

    time: float
    standing: bool
    slipping: bool
    slip_velocity: tuple[float, float]
    slip_speed: float
    slip_speed_sd: float
    wet_probability: float
    friction_mean: float
    friction_sd: float
    margin: float
    fresh: bool


class FootEstimator:
    """Estimates slip, wetness and friction of one foot from its force, marker and pressure.

    What the force sensor reads while the foot is in the air is its offset, and is taken off.

    Parameters
    ----------
    foot : Foot
        The foot: expected friction and shear stiffness come from it.
    expected_load : float
        Normal force in stance, N, > 0.
    tuning : Tuning
        Noise and ground.

    Raises
    ------
    InvalidInput
        When the expected load is not a number above 0.
    """

    def __init__(self, foot: Foot, expected_load: float, tuning: Tuning | None = None) -> None:
        expected_load = number('expected_load', expected_load, 'N', above=True)
        self._tuning = tuning = tuning or Tuning()
        self._foot = foot
        self._expected_load = expected_load
        self._gate = tuning.load_gate * expected_load
        noise = math.hypot(tuning.position_noise, tuning.force_noise / foot.shear_stiffness)
        self._contact_noise = noise
        self._speed_noise = math.hypot(noise / tuning.smoothing, tuning.speed_noise)
        self._alarm = SlipAlarm(self._speed_noise, tuning.smoothing)
        self._ground = GroundFilter(
            FrictionPrior.of(foot, expected_load),
            wet_prior=tuning.wet_prior,
            patch_length=tuning.patch_length,
            rim_speed=tuning.rim_speed(foot),
            model_error=tuning.ratio_noise,
        )
        self._time = -math.inf
        self._standing = False
        self._height = math.inf
        self._offset_x = self._offset_y = self._offset_z = 0.0
        self._smooth_x = self._smooth_y = 0.0
        self._footprint: tuple[float, float] | None = None
        self._window_start = 0.0
        self._first_window = True
        self._told: tuple[float, ...] | None = None
        self._samples = 0
        self._sum_load = self._sum_tangential = self._sum_speed = 0.0
        mean, sd = self._ground.friction
        self.estimate = Estimate(
            self._time, False, False, (0.0, 0.0), 0.0, self._speed_noise,
            self._ground.wet_probability, mean, sd, self._ground.quantile(0.05), True,
        )  # fmt: skip

    def update(
        self,
        time: float,
        force: Sequence[float],
        position: Sequence[float],
        pressure: float,
    ) -> Estimate:
        """Take one sample.

        Parameters
        ----------
        time : float
            s, later than the last one's.
        force : sequence of 3 floats
            Of the ground on the foot, N; z is the normal force.
        position : sequence of 3 floats
            Of the foot's marker, m.
        pressure : float
            Gauge pressure in the pads, Pa.

        Returns
        -------
        Estimate
            What is known now.

        Raises
        ------
        InvalidInput
            When a value is not finite, or time does not advance.
        """
        try:
            fx, fy, fz = force
            x, y, z = position
            finite = math.isfinite(time + fx + fy + fz + x + y + z + pressure)
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f'sample at {time!r} s: force = {force!r}, position = {position!r}, pressure ='
                f' {pressure!r}: three numbers each, and one, are needed'
            ) from error
        if not finite:
            raise _not_finite(time, force, position, pressure)
        if time <= self._time:
            raise InvalidInput(f'time = {time!r} s: must be later than the last, {self._time!r} s')
        dt, self._time = time - self._time, time
        load = fz - self._offset_z
        if z > self._height + AIRBORNE and load < AIRBORNE_LOAD * self._expected_load:
            self._tare(dt, fx, fy, fz)
            return self._swing(time)
        if load < self._gate:
            return self._swing(time)
        if load >= AIRBORNE_LOAD * self._expected_load:  # else its sensor may only say so
            self._height = z
        fx, fy, fz = fx - self._offset_x, fy - self._offset_y, fz - self._offset_z
        # The marker rides on a soft pad: take its shear off to see the contact itself.
        contact_x = x + fx / self._foot.shear_stiffness
        contact_y = y + fy / self._foot.shear_stiffness
        if not self._standing or dt > LONGEST_GAP:
            self._touch_down(time, contact_x, contact_y, pressure)
            dt = self._tuning.smoothing / 10.0 if math.isinf(dt) else dt
        smoothing = self._tuning.smoothing
        share = dt / (smoothing + dt)
        self._smooth_x += share * (contact_x - self._smooth_x)
        self._smooth_y += share * (contact_y - self._smooth_y)
        velocity_x = (contact_x - self._smooth_x) / smoothing
        velocity_y = (contact_y - self._smooth_y) / smoothing
        tangential = math.hypot(fx, fy)
        # A foot gives way against the force that holds it; across it there is only noise.
        along = (velocity_x * fx + velocity_y * fy) / tangential if tangential > 0.0 else 0.0
        velocity = (along * fx / tangential, along * fy / tangential) if along else (0.0, 0.0)
        speed = -along
        slipping = self._alarm.update(speed, dt)
        self._samples += 1
        self._sum_load += fz
        self._sum_tangential += tangential
        self._sum_speed += speed
        last = self.estimate
        fresh = time - self._window_start >= self._tuning.filter_period - 1e-9
        if fresh:
            self._filter(time - self._window_start)
            self._window_start = time
            friction_mean, friction_sd = self._ground.friction
            wet = self._ground.wet_probability
            quantile = self._ground.quantile(0.05)
            self._quantile = quantile
        else:
            friction_mean, friction_sd = last.friction_mean, last.friction_sd
            wet, quantile = last.wet_probability, self._quantile
        self.estimate = Estimate(
            time, True, slipping, velocity, speed, self._speed_noise,
            wet, friction_mean, friction_sd, quantile - tangential / fz, fresh,
        )  # fmt: skip
        return self.estimate

    def _tare(self, dt: float, fx: float, fy: float, fz: float) -> None:
        share = dt / (TARE_TIME + dt)
        self._offset_x += share * (fx - self._offset_x)
        self._offset_y += share * (fy - self._offset_y)
        self._offset_z += share * (fz - self._offset_z)

    def _swing(self, time: float) -> Estimate:
        last = self.estimate
        fresh = self._standing
        self._standing = False
        self.estimate = Estimate(
            time, False, False, (0.0, 0.0), 0.0, self._speed_noise, last.wet_probability,
            last.friction_mean, last.friction_sd, last.margin, fresh,
        )  # fmt: skip
        return self.estimate

    def _touch_down(self, time: float, x: float, y: float, pressure: float) -> None:
        self._standing = True
        self._alarm.reset()
        self._smooth_x, self._smooth_y = x, y
        before = self._footprint or (x, y)
        self._footprint = (x, y)
        domed = self._foot.dome_load(self._expected_load, pressure) > 0.5 * self._expected_load
        self._ground.touch_down(math.dist(before, (x, y)), domed)
        self._quantile = self._ground.quantile(0.05)
        self._window_start = time
        self._first_window = True
        self._told = None
        self._clear_window()

    def _clear_window(self) -> None:
        self._samples = 0
        self._sum_load = self._sum_tangential = self._sum_speed = 0.0

    def _filter(self, duration: float) -> None:
        count = self._samples
        load = self._sum_load / count
        ratio = self._sum_tangential / self._sum_load
        tuning = self._tuning
        noise = math.hypot(
            tuning.ratio_noise, tuning.force_noise * math.sqrt((1.0 + ratio**2) / count) / load
        )
        # The mean speed is the way of the smoothed contact over the window. The smoother starts
        # a stance from one sample, and averages later.
        spread = 2.0 * duration / (2.0 * tuning.smoothing * count + duration)
        if self._first_window:
            spread = 0.5 * spread + 1.0
            self._first_window = False
        speed_noise = math.hypot(
            tuning.speed_noise, self._contact_noise * math.sqrt(spread) / duration
        )
        weight = self._news(ratio, noise)
        self._ground.update(ratio, noise, self._sum_speed / count, speed_noise, duration, weight)
        self._clear_window()

    def _news(self, ratio: float, noise: float) -> float:
        """Return how much of what a foot tells is new, 0 to 1.

        One that stands where it stood, pulled as it was, repeats itself: windows are evidence as
        far as T/N or the place has changed since they were last counted.
        """
        now = (ratio, self._smooth_x, self._smooth_y)
        if self._told is None:
            self._told = now
            return 1.0
        pull, x, y = (after - before for after, before in zip(now, self._told, strict=True))
        change = (pull / noise) ** 2 + (x * x + y * y) / NEW_PLACE**2
        weight = -math.expm1(-0.5 * change)
        told = zip(self._told, (pull, x, y), strict=True)
        self._told = tuple(before + weight * step for before, step in told)
        return weight


def _not_finite(
    time: float, force: Sequence[float], position: Sequence[float], pressure: float
) -> InvalidInput:
    """Return the error that says which values of a sample are no numbers."""
    values = [('time', time, 's'), ('pressure', pressure, 'Pa')]
    values += [(f'force {axis}', value, 'N') for axis, value in zip('xyz', force, strict=True)]
    values += [
        (f'position {axis}', value, 'm') for axis, value in zip('xyz', position, strict=True)
    ]
    wrong = [
        f'{name} = {value!r} {unit}' for name, value, unit in values if not math.isfinite(value)
    ]
    return InvalidInput(f'sample at {time!r} s: {", ".join(wrong)}: must be finite')
