# SPDX-License-Identifier: Apache-2.0
"""Estimator of one foot: slip, wetness, friction, and margin to slip."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.contact.pad import number
from ros_pad.contact.resistance import THICK_FILM
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.alarm import SlipAlarms
from ros_pad.estimation.friction import FrictionPrior
from ros_pad.estimation.friction import GroundFilter
from ros_pad.estimation.sensing import DEAD
from ros_pad.estimation.sensing import Sensing

LONGEST_GAP = 0.15
"""Between samples of one stance, s: after a longer silence the foot may have stepped."""

AIRBORNE = 0.01
"""Height above its last stance from which a foot surely touches nothing, m ..."""

AIRBORNE_LOAD = 0.3
"""... unless it carries this share of the expected load, and did not rise with it: what else it
reads is its offset."""

OFFSET_SHARE = 0.05
"""Standard deviation of the offset of a force sensor, of the expected load, until it is known."""

NEW_PLACE = 5e-4
"""Way over which a sliding foot has something new to tell, m."""

TARE_TIME = 0.5
"""Over which the force of a foot in the air is averaged, s."""

LONGEST_STEP = 5.0
"""Between touch-downs of a foot that walks, s: after a longer time its pace is not known."""

NOT_YET = 'not yet: has not stood'
"""Doubt of a foot that has not stood so far."""

HINDSIGHT = DEAD + LONGEST_GAP
"""Time for which earlier beliefs are kept, s: sensors that fail may be believed for so long."""

NOT_AGAIN = 'not yet: has not stood since its sensors were in doubt'
"""Doubt of a foot whose sensors are believed again."""

FADING_STEP = 0.02
"""Way after which belief is faded where a foot feels nothing, m: markers jitter."""


@dataclass(frozen=True)
class Tuning:
    """What an estimator may be told about robot, sensors and ground; defaults suit most.

    Attributes
    ----------
    position_noise : float
        Standard deviation of a marker coordinate, m, 0 or more.
    force_noise : float
        Standard deviation of a force component, N, 0 or more. Sensors with noise that repeat a
        number for long are not believed; of those without, 0, nobody can tell.
    moment_noise : float
        Standard deviation of the moment about the vertical, N m, 0 or more, where one is given.
    force_range : float
        Largest component of force that the sensor shows, N, above 0, or infinite: what is there
        or beyond is no measurement.
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
    moment_noise: float = 5e-4
    force_range: float = math.inf
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
        number('moment_noise', self.moment_noise, 'N m')
        if self.force_range != math.inf:
            number('force_range', self.force_range, 'N', above=True)
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
        Standard deviation of the slip speed, m/s; infinite where nothing is known of it.
    wet_probability : float
        Probability that the ground is wet, 0 to 1.
    friction_mean, friction_sd : float
        Of the coefficient of friction.
    margin : float
        5 % quantile of μ - T/N: below zero, slip is likely. NaN where the
        sensors are not believed, until the foot stands again.
    fresh : bool
        Whether wetness and friction were updated by this sample.
    doubt : str
        Why the foot cannot know what is below it: what it is, a colon, and details; empty where
        it does know. What it says of wetness and friction is then what is left of earlier stances,
        fading.
    sound : bool
        Whether its sensors are believed. If not, `doubt` says why, `standing` and `slipping` are
        False, and nothing is learnt.
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
    doubt: str
    sound: bool


class FootEstimator:
    """Estimates slip, wetness and friction of one foot from its force, marker and pressure.

    What the force sensor reads while the foot is in the air is its offset, and is taken off.
    Sensors that stand still, reach the end of their range or come late are not believed: belief
    returns to what it was before, and fades over the way to the prior.

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
        self._alarm = SlipAlarms(self._speed_noise, tuning.smoothing)
        self._ground = GroundFilter(
            FrictionPrior.of(foot, expected_load),
            wet_prior=tuning.wet_prior,
            patch_length=tuning.patch_length,
            rim_speed=tuning.rim_speed(foot),
            model_error=tuning.ratio_noise,
        )
        self._time = -math.inf
        self._sensing = Sensing(tuning.force_noise, tuning.position_noise, tuning.force_range)
        self._lever = 2.0 / 3.0 * foot.sole_radius
        self._standing = False
        self._height = self._touched_at = math.inf
        self._offset_x = self._offset_y = self._offset_z = self._offset_moment = 0.0
        self._offset_sd = OFFSET_SHARE * expected_load
        self._air_time = 0.0
        self._smooth_x = self._smooth_y = 0.0
        self._footprint: tuple[float, float] | None = None
        self._touched = -math.inf
        self._pace = self._unseen_way = 0.0
        self._beliefs: deque[tuple[float, tuple[np.ndarray, bool]]] = deque()
        self._dome_share = 0.0
        self._peak_load = self._peak_ratio = self._peak_turning = 0.0
        self._window_start = 0.0
        self._first_window = True
        self._told: tuple[float, ...] | None = None
        self._samples = 0
        self._sum_load = self._sum_tangential = self._sum_speed = self._sum_turning = 0.0
        mean, sd = self._ground.friction
        self.estimate = Estimate(
            self._time, False, False, (0.0, 0.0), 0.0, self._speed_noise,
            self._ground.wet_probability, mean, sd, self._ground.quantile(0.05), True,
            NOT_YET, True,
        )  # fmt: skip

    def update(
        self,
        time: float,
        force: Sequence[float],
        position: Sequence[float],
        pressure: float,
        moment: float | None = None,
        position_time: float | None = None,
    ) -> Estimate:
        """Take one sample.

        Parameters
        ----------
        time : float
            s, later than the last one's. A clock that is set back by more than
            :data:`LONGEST_GAP` begins a new stance; what was known stays.
        force : sequence of 3 floats
            Of the ground on the foot, N; z is the normal force.
        position : sequence of 3 floats
            Of the foot's marker, m.
        pressure : float
            Gauge pressure in the pads, Pa.
        moment : float or None
            Of the ground on the foot about the vertical, N m, where it is measured: how much of
            its friction a foot that turns has used up is then known, and need not be guessed.
        position_time : float or None
            When the position was measured, s; None is `time`.

        Returns
        -------
        Estimate
            What is known now.

        Raises
        ------
        InvalidInput
            When a value is not finite, or time does not advance.
        """
        age = 0.0 if position_time is None else abs(time - position_time)
        twist = 0.0 if moment is None else moment
        try:
            fx, fy, fz = force
            x, y, z = position
            finite = math.isfinite(time + fx + fy + fz + x + y + z + pressure + twist + age)
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f'sample at {time!r} s: force = {force!r}, position = {position!r}, pressure ='
                f' {pressure!r}, moment = {moment!r}: three numbers each, and one, are needed'
            ) from error
        if not finite:
            raise _not_finite(time, force, position, pressure, moment, position_time)
        if time <= self._time:
            if time > self._time - LONGEST_GAP:
                raise InvalidInput(
                    f'time = {time!r} s: must be later than the last, {self._time!r} s'
                )
            self._set_back()
        dt, self._time = time - self._time, time
        aloft = not z <= self._height + AIRBORNE < math.inf
        trouble = self._sensing.trouble(time, force, position, age, self._standing, aloft)
        if trouble:
            return self._mistrust(time, dt, x, y, trouble)
        load = fz - self._offset_z
        if self._standing and z > self._touched_at + AIRBORNE:
            self._height, load = self._touched_at, 0.0  # no ground rises with a foot
        if z > self._height + AIRBORNE and load < AIRBORNE_LOAD * self._expected_load:
            self._tare(dt, fx, fy, fz, twist)
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
            self._touch_down(time, contact_x, contact_y, z, pressure)
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
        # On the ellipsoidal limit surface what turning takes up is friction that pull cannot have.
        turning = 0.0 if moment is None else abs(moment - self._offset_moment) / self._lever
        self._samples += 1
        self._sum_load += fz
        self._sum_tangential += tangential
        self._sum_turning += turning
        self._sum_speed += speed
        self._peak_load = max(self._peak_load, fz)
        last = self.estimate
        fresh = time - self._window_start >= self._tuning.filter_period - 1e-9
        if fresh:
            self._follow_pressure(pressure)
            self._filter(time - self._window_start, moment is not None)
            self._window_start = time
            friction_mean, friction_sd = self._ground.friction
            wet = self._ground.wet_probability
            self._quantile = self._ground.quantile(0.05)
            self._remember(time)
            said = self._doubt(friction_mean, friction_sd)
        else:
            friction_mean, friction_sd = last.friction_mean, last.friction_sd
            wet, said = last.wet_probability, last.doubt if last.sound else NOT_AGAIN
        self.estimate = Estimate(
            time, True, slipping, velocity, speed, self._speed_noise,
            wet, friction_mean, friction_sd, self._quantile - math.hypot(tangential, turning) / fz,
            fresh, said, True,
        )  # fmt: skip
        return self.estimate

    def _tare(self, dt: float, fx: float, fy: float, fz: float, moment: float) -> None:
        # The mean of its first time in the air, and from then on one that forgets.
        dt = min(dt, TARE_TIME)
        self._air_time += dt
        share = dt / min(TARE_TIME + dt, self._air_time)
        self._offset_x += share * (fx - self._offset_x)
        self._offset_y += share * (fy - self._offset_y)
        self._offset_z += share * (fz - self._offset_z)
        self._offset_moment += share * (moment - self._offset_moment)
        self._offset_sd *= 1.0 - share

    def _swing(self, time: float) -> Estimate:
        last = self.estimate
        fresh = self._standing or not last.sound
        self._standing = False
        self.estimate = Estimate(
            time, False, False, (0.0, 0.0), 0.0, self._speed_noise, last.wet_probability,
            last.friction_mean, last.friction_sd, last.margin, fresh,
            last.doubt if last.sound else NOT_AGAIN, True,
        )  # fmt: skip
        return self.estimate

    def _mistrust(self, time: float, dt: float, x: float, y: float, trouble: str) -> Estimate:
        """Learn nothing, take back what the sensors said as they failed, and fade."""
        last, ground = self.estimate, self._ground
        since = self._sensing.since
        self._standing = False
        faded = False
        if self._beliefs:
            before = [belief for at, belief in self._beliefs if at <= since]
            if len(before) < len(self._beliefs):
                ground.belief = (before or [self._beliefs[0][1]])[-1]
                faded = True
            self._beliefs.clear()
        if self._sensing.marker_sound:
            way = math.dist(self._footprint, (x, y)) if self._footprint else 0.0
            if way > FADING_STEP or self._footprint is None:
                self._footprint = (x, y)
        else:
            # Where it is now nobody knows: it walks on as it walked.
            self._height = math.inf
            self._unseen_way += 0.0 if math.isinf(dt) else self._pace * dt
            way, self._footprint = self._unseen_way, None
            if way > FADING_STEP:
                self._unseen_way = 0.0
        if way > FADING_STEP:
            ground.go(way)
            faded = True
        mean, sd = ground.friction if faded else (last.friction_mean, last.friction_sd)
        self.estimate = Estimate(
            time, False, False, (0.0, 0.0), 0.0, math.inf, ground.wet_probability, mean, sd,
            math.nan, faded or last.sound, trouble, False,
        )  # fmt: skip
        return self.estimate

    def _set_back(self) -> None:
        """Begin a new stance at a time before the last one."""
        self._time = -math.inf
        self._standing = False
        self._touched = -math.inf
        self._beliefs.clear()
        self._sensing.restart()

    def _touch_down(self, time: float, x: float, y: float, z: float, pressure: float) -> None:
        self._standing = True
        self._alarm.reset()
        self._smooth_x, self._smooth_y = x, y
        before = self._footprint or (x, y)
        way = math.dist(before, (x, y))
        if self._footprint and time - self._touched < LONGEST_STEP:
            self._pace += 0.3 * (way / (time - self._touched) - self._pace)
        self._footprint, self._touched, self._touched_at = (x, y), time, z
        self._dome_share = self._share_on_domes(pressure)
        self._ground.touch_down(way, self._dome_share > doubt.DOMED)
        self._remember(time)
        self._quantile = self._ground.quantile(0.05)
        self._window_start = time
        self._first_window = True
        self._told = None
        self._peak_load = self._peak_ratio = self._peak_turning = 0.0
        self._clear_window()

    def _remember(self, time: float) -> None:
        """Keep what is believed now, and what was when a sensor may have failed unnoticed."""
        beliefs = self._beliefs
        beliefs.append((time, self._ground.belief))
        while len(beliefs) > 1 and beliefs[1][0] <= time - HINDSIGHT:
            beliefs.popleft()

    def _share_on_domes(self, pressure: float) -> float:
        return self._foot.dome_load(self._expected_load, pressure) / self._expected_load

    def _follow_pressure(self, pressure: float) -> None:
        """Begin anew where it stands when the foot changes its shape under load."""
        before, self._dome_share = self._dome_share, self._share_on_domes(pressure)
        if (before > doubt.DOMED) != (self._dome_share > doubt.DOMED):
            self._ground.touch_down(0.0, self._dome_share > doubt.DOMED)
            self._told = None

    def _doubt(self, friction_mean: float, friction_sd: float) -> str:
        ground = self._ground
        stance = doubt.Stance(
            self._dome_share, ground.told, self._peak_load, self._peak_ratio, self._peak_turning,
            ground.wet_probability, friction_mean, friction_sd,
        )  # fmt: skip
        return doubt.doubt(stance, ground.prior, self._expected_load)

    def _clear_window(self) -> None:
        self._samples = 0
        self._sum_load = self._sum_tangential = self._sum_speed = self._sum_turning = 0.0

    def _filter(self, duration: float, turning_known: bool) -> None:
        count = self._samples
        load = self._sum_load / count
        pull, turning = self._sum_tangential / self._sum_load, self._sum_turning / self._sum_load
        ratio = math.hypot(pull, turning)
        tuning = self._tuning
        force_noise = tuning.force_noise
        if turning > 0.0:
            share = turning / ratio
            force_noise = math.hypot(force_noise, share * tuning.moment_noise / self._lever)
        sensors = math.hypot(force_noise / math.sqrt(count), self._offset_sd) / load
        noise = math.hypot(tuning.ratio_noise, sensors * math.sqrt(1.0 + ratio**2))
        self._peak_ratio = max(self._peak_ratio, pull)
        self._peak_turning = max(self._peak_turning, turning)
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
        self._ground.update(
            ratio, noise, self._sum_speed / count, speed_noise, duration, weight, turning_known,
            self._scales(load),
        )  # fmt: skip
        self._clear_window()

    def _scales(self, load: float) -> tuple[float, float]:
        """Return friction at a load, N, over that at the expected one, dry and wet.

        A flat sole that touches all over holds with its adhesion what the load does not add to.
        """
        if self._dome_share > doubt.DOMED:
            return 1.0, 1.0
        kernel, prior = self._foot.resistance_of, self._ground.prior
        dry = kernel(0.0, load, 0.0, 0.0, 0.0) / load
        wet = kernel(0.0, load, 0.0, 0.0, THICK_FILM) / load
        return dry / prior.flat_dry, wet / prior.flat_wet

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
    time: float,
    force: Sequence[float],
    position: Sequence[float],
    pressure: float,
    moment: float | None,
    position_time: float | None,
) -> InvalidInput:
    """Return the error that says which values of a sample are no numbers."""
    values = [('time', time, 's'), ('pressure', pressure, 'Pa')]
    values += [(f'force {axis}', value, 'N') for axis, value in zip('xyz', force, strict=True)]
    values += [
        (f'position {axis}', value, 'm') for axis, value in zip('xyz', position, strict=True)
    ]
    if moment is not None:
        values.append(('moment', moment, 'N m'))
    if position_time is not None:
        values.append(('position_time', position_time, 's'))
    wrong = [
        f'{name} = {value!r} {unit}' for name, value, unit in values if not math.isfinite(value)
    ]
    return InvalidInput(f'sample at {time!r} s: {", ".join(wrong)}: must be finite')
