# SPDX-License-Identifier: Apache-2.0
"""Estimator of one foot: slip, wetness, friction, and friction margin."""

from __future__ import annotations

import math
from collections.abc import Callable
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from ros_pad.configuration import instance
from ros_pad.configuration import integer
from ros_pad.configuration import number
from ros_pad.configuration import shown
from ros_pad.contact.resistance import THICK_FILM
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.alarm import SlipAlarms
from ros_pad.estimation.axes import BLOCK
from ros_pad.estimation.axes import LONGEST
from ros_pad.estimation.axes import Axes
from ros_pad.estimation.axes import SharedAxes
from ros_pad.estimation.friction import GroundFilter
from ros_pad.estimation.load_gate import LoadGate
from ros_pad.estimation.noise import SensorNoise
from ros_pad.estimation.parts import History
from ros_pad.estimation.parts import Motion
from ros_pad.estimation.parts import Offset
from ros_pad.estimation.parts import Path
from ros_pad.estimation.parts import Stance
from ros_pad.estimation.parts import Window
from ros_pad.estimation.scales import FrictionPrior
from ros_pad.estimation.scales import FrictionScales
from ros_pad.estimation.sensing import DEAD
from ros_pad.estimation.sensing import Sensing
from ros_pad.estimation.tuning import Tuning

LONGEST_GAP = 0.15
"""Longest gap between samples of one stance, s: in a longer gap the foot may have stepped."""

AIRBORNE = 0.01
"""Rise above the height of its last stance, m, from which on a foot certainly touches nothing."""

AIRBORNE_LOAD = 0.3
"""Share of the expected load above which a foot at that height may stand on higher ground. Smaller
readings there are the offset of the sensor."""

NOT_YET = 'not yet: has not stood'
"""Doubt of a foot that has not stood so far."""

NOT_AGAIN = 'not yet: has not stood since its sensors were in doubt'
"""Doubt of a foot whose sensors can be used again."""

EAGER, PAUSE = 10, 8
"""Stances in which noise is measured and axes are checked at first, and of how many one is later.
Stances are counted anew each second."""

HINDSIGHT = DEAD + LONGEST_GAP
"""Time for which earlier posteriors are kept, s: no sensor fault stays undetected for longer."""

MARGIN_SHARE = 0.05
"""Quantile of friction from which the friction margin is computed."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""


class ContactMotion(NamedTuple):
    """Motion of the contact point of a foot, as a body estimator has it from joints and IMU.

    Attributes
    ----------
    velocity : tuple of float
        Velocity over the floor, x and y, m/s.
    sd : float
        Standard deviation of each component, m/s, from 0.
    doubt : str
        Why the velocity must not be used; empty if it may be.
    """

    velocity: tuple[float, float]
    sd: float
    doubt: str = ''


class Estimate(NamedTuple):
    """Estimate of one foot after a sample.

    Attributes
    ----------
    time : float
        Time of the sample, s.
    standing : bool
        Whether the foot carries load.
    slipping : bool
        Whether the slip alarm is on.
    slip_velocity : tuple of float
        Velocity of the contact over the floor, only its part along the tangential force, x and y,
        m/s.
    slip_speed : float
        Component of this velocity against the tangential force, m/s: positive when the foot gives
        way.
    slip_speed_sd : float
        Standard deviation of the slip speed, m/s; infinite while sensors are faulty.
    wet_probability : float
        Probability that the ground is wet, 0 to 1.
    friction_mean : float
        Mean of the coefficient of friction.
    friction_sd : float
        Standard deviation of the coefficient of friction.
    margin : float
        Friction margin, no unit: 5 % quantile of μ less T/N; below zero, slip is likely. NaN from
        a fault of the sensors until the foot stands again; in swing the last value.
    fresh : bool
        Whether this sample updated wetness and friction, or was the first of a swing or of a
        sensor fault.
    doubt : str
        Why the ground is unobservable: a kind, a colon, and details; empty if it is observable.
        With a doubt, wetness and friction rest on earlier stances, and fade to the prior with the
        distance.
    sound : bool
        Whether the sensors can be used. If not, `doubt` is the reason, `standing` and `slipping`
        are False, and the filter is not updated.
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


Reading = tuple[float, ...]
"""Time, s, position x and y, m, and force x, y and z, N."""

_estimate: Callable[[tuple[object, ...]], Estimate] = partial(tuple.__new__, Estimate)
"""``Estimate(...)`` without the check of its arguments, which takes longer than all the rest."""


class FootEstimator:
    """Estimate slip, wetness and friction of one foot from its force, motion and pressure.

    The motion is the position of a marker, from whose change slip follows, or, with the setting
    ``source: joints``, the velocity of the contact point with its standard deviation, beside a
    position in odom that is used for places only. Then the deviation of each sample sets the noise
    of the alarm and of the filter, so that both become less sensitive as the estimate of the body
    becomes less certain; while the body is in doubt, nothing is learnt, and there is no alarm.

    Markers and joints follow the link above the soft pads. The contact is ahead of it by force
    over shear stiffness, and its velocity by the rate of that, which is added unless the setting
    ``pads_shear`` is false. Simulated robots stand on rigid feet: their joints follow the contact
    itself, and only their markers are displaced.

    The noise of the sensors is measured while the foot stands, beginning with the settings (see
    :mod:`ros_pad.estimation.noise`); with joints only that of the force.

    The reading of the force sensor in the air is its offset, and is subtracted. No sample is used
    while sensors are faulty (see :mod:`ros_pad.estimation.sensing`): the posterior is set back to
    the one before the fault, and fades to the prior with distance.

    Parameters
    ----------
    foot : Foot
        Foot, which gives expected friction and shear stiffness.
    expected_load : float
        Normal force in stance, N, above 0.
    tuning : Tuning
        Settings for sensors and ground.
    shared : FrictionScales or None
        What this foot learns of friction together with others, see :func:`estimators_of`; None:
        it learns alone.
    shared_axes : SharedAxes or None
        Evidence of turned axes that the feet share, likewise.

    Attributes
    ----------
    estimate : Estimate
        Estimate after the last sample.
    ground : GroundFilter
        Posterior of wet ground and friction.
    noise : SensorNoise
        Configured and measured noise of the sensors.

    Raises
    ------
    InvalidInput
        When the expected load is not a number above 0, or foot or tuning is of another class.

    Examples
    --------
    Force and position of a flat foot at 1 kHz. It stands for 0.5 s, then it slips at 40 mm/s,
    although the tangential force is only a sixth of the load: the ground is wet.

    >>> from random import Random
    >>> from ros_pad.contact import Foot
    >>> from ros_pad.estimation import FootEstimator
    >>> estimator, noise = FootEstimator(Foot.load('large19'), expected_load=6.8), Random(0).gauss
    >>> alarms = []
    >>> for step in range(1000):
    ...     x = -0.04 * max(0, step - 500) * 1e-3
    ...     position = [each + noise(0, 1.5e-4) for each in (x, 0, 0)]
    ...     force = [each + noise(0, 0.03) for each in (1.1, 0, 6.8)]
    ...     alarms.append(estimator.update(step * 1e-3, force, position, pressure=0.0).slipping)
    >>> 500 < alarms.index(True) < 600, any(alarms[:500])
    (True, False)
    >>> estimate = estimator.estimate
    >>> estimate.wet_probability > 0.9, round(estimate.friction_mean, 1)
    (True, 0.2)
    """

    def __init__(
        self,
        foot: Foot,
        expected_load: float,
        tuning: Tuning | None = None,
        shared: FrictionScales | None = None,
        shared_axes: SharedAxes | None = None,
    ) -> None:
        instance('foot', foot, Foot)
        expected_load = number('expected_load', expected_load, 'N', above=True)
        self.tuning = tuning = Tuning() if tuning is None else tuning
        instance('tuning', tuning, Tuning)
        self._foot = foot
        self._expected_load = expected_load
        self._least_load = AIRBORNE_LOAD * expected_load  # a smaller one may be an offset, N
        self._measures_moment = tuning.moment_noise > 0.0
        self._stiffness = foot.shear_stiffness
        self._filter_period = tuning.filter_period - 1e-9
        self._lever = foot.turning_radius
        self._gate = LoadGate(expected_load, tuning.load_gate)
        self._joints = tuning.source == 'joints'
        self._softness = 1.0 / foot.shear_stiffness if tuning.pads_shear else 0.0
        # An estimated position never stops, and its noise is not that of a marker.
        marker_noise = 0.0 if self._joints else tuning.position_noise
        self.noise = SensorNoise(marker_noise, tuning.force_noise, expected_load)
        self._speed_noise = self._set_noise()
        self._alarm = SlipAlarms(
            self._speed_noise,
            BODY_CORRELATION if self._joints else tuning.smoothing,
            threshold=tuning.alarm_threshold,
        )
        self.ground = GroundFilter(
            shared or shared_friction(foot, expected_load, tuning),
            wet_prior=tuning.wet_prior,
            patch_length=tuning.patch_length,
            rim_speed=tuning.rim_speed(foot),
        )
        self._sensing = Sensing(tuning.force_noise, marker_noise, tuning.force_range or math.inf)
        self._axes = (
            Axes(expected_load, self._softness, BODY_CORRELATION, shared_axes)
            if self._joints
            else Axes(expected_load, 1.0 / foot.shear_stiffness, shared=shared_axes)
        )
        self._block: list[Reading] = []  # readings since the last block, and two before them
        self._earlier = 0  # how many are before them
        self._block_end = -math.inf
        self._looked = 0  # stances, and seconds in long ones
        self._looks = False  # whether this one is looked at
        self._look_end = math.inf
        self._slid = (0.0, 0.0)  # with joints, the sum of the measured velocities, m
        self._offset = Offset(expected_load)
        self._motion = Motion(tuning.smoothing)  # of the contact; of the pads' shear with joints
        self._place = (0.0, 0.0)  # of the contact, m
        self._window = Window()
        self._stance = Stance()
        self._path = Path()
        self._history = History(HINDSIGHT)
        self._time = -math.inf
        self._height = math.inf  # height of the marker in the last stance, m; infinite if unknown
        mean, sd = self.ground.friction
        self._quantile = self.ground.quantile(MARGIN_SHARE)
        self.estimate = Estimate(
            self._time, False, False, (0.0, 0.0), 0.0, self._speed_noise,
            self.ground.wet_probability, mean, sd, self._quantile, True, NOT_YET, True,
        )  # fmt: skip

    def update(
        self,
        time: float,
        force: Sequence[float],
        position: Sequence[float],
        pressure: float,
        moment: float | None = None,
        position_time: float | None = None,
        motion: ContactMotion | None = None,
    ) -> Estimate:
        """Process one sample.

        Parameters
        ----------
        time : float
            Time of the sample, s, later than that of the last one. When the clock is set back by
            :data:`LONGEST_GAP` or more, a new stance begins and the posterior stays.
        force : sequence of 3 floats
            Force of the ground on the foot, N; z is the normal force.
        position : sequence of 3 floats
            Position of the foot's marker, or of the foot in odom, m.
        pressure : float
            Gauge pressure in the pads, Pa.
        moment : float or None
            Yaw moment of the ground on the foot, N m; None if it is not measured. The part of the
            friction that turning uses follows from it, and is otherwise assumed. Not used with
            the setting ``moment_noise`` 0.
        position_time : float or None
            Time at which the position was measured, s; None if it is `time`.
        motion : ContactMotion or None
            Motion of the contact point; needed with the setting ``source: joints``, else not used.

        Returns
        -------
        Estimate
            Estimate after this sample.

        Raises
        ------
        InvalidInput
            When a value is not a finite number, force or position are not three numbers, time
            does not advance, or the motion is missing or has a deviation below 0.
        """
        motion = motion if self._joints else None
        moment = moment if self._measures_moment else None
        self._check(time, force, position, pressure, moment, position_time, motion)
        (fx, fy, fz), (x, y, z) = force, position
        age = 0.0 if position_time is None else abs(time - position_time)
        yaw = 0.0 if moment is None else moment
        if motion:
            self._speed_noise = math.hypot(motion.sd, self._sensor_speed_noise)
        dt = time - self._time
        if dt <= 0.0:
            dt = self._set_back(time)
        self._time = time
        gate, offset = self._gate, self._offset
        stood = gate.standing
        air = self._height + AIRBORNE
        # With the body in doubt odom may begin anew: no leap of a foot.
        leaps = stood and not (motion and motion.doubt)
        fault = self._sensing.update(time, force, position, age, leaps, not z <= air < math.inf)
        if fault:
            self._restart_blocks()
            return self._without_sensors(time, dt, x, y, fault)
        load = fz - offset.z
        if stood and z > self._stance.height + AIRBORNE:
            self._height, load = self._stance.height, 0.0  # the ground cannot rise with the foot
            air = self._height + AIRBORNE
        if z > air and load < self._least_load:
            offset.update(dt, fx, fy, fz, yaw)
            load = 0.0
        if motion:
            slid_x, slid_y = self._slid
            vx, vy = motion.velocity
            slid = self._slid = slid_x + vx * min(dt, BLOCK), slid_y + vy * min(dt, BLOCK)
            if self._looks:
                self._block.append((time, *slid, fx, fy, fz))
        elif self._looks:
            self._block.append((time, x, y, fx, fy, fz))
        if time >= self._block_end:
            self._end_block(time, z, (fx - offset.x, fy - offset.y, fz - offset.z), motion)
        if self._axes.doubt:
            return self._without_sensors(time, dt, x, y, self._axes.doubt)
        if not gate.update(load):
            return self._swing(time, stood)
        if load >= self._least_load:
            self._height = z
        fx, fy, fz = fx - offset.x, fy - offset.y, fz - offset.z
        # The marker is above the soft pad: subtract the pad's shear to get the contact.
        contact_x, contact_y = x + fx / self._stiffness, y + fy / self._stiffness
        if not stood or dt > LONGEST_GAP:
            self._touch_down(time, contact_x, contact_y, z, pressure)
            if motion:
                self._motion.begin(fx * self._softness, fy * self._softness)
            dt = self.tuning.smoothing / 10.0 if math.isinf(dt) else dt
        if motion:
            shear_x, shear_y = self._motion.update(fx * self._softness, fy * self._softness, dt)
            velocity = motion.velocity[0] + shear_x, motion.velocity[1] + shear_y
            self._place = contact_x, contact_y
            self._alarm.set_noise(self._speed_noise)
            if motion.doubt:
                return self._in_doubt(time, (fx, fy, fz), motion.doubt)
        else:
            velocity = self._motion.update(contact_x, contact_y, dt)
            self._place = self._motion.x, self._motion.y
        # On the ellipsoidal limit surface, friction used by turning is not available to the pull.
        turning = 0.0 if moment is None else abs(moment - offset.moment) / self._lever
        return self._stand(time, dt, (fx, fy, fz), velocity, turning, pressure, moment is not None)

    def _check(
        self,
        time: float,
        force: Sequence[float],
        position: Sequence[float],
        pressure: float,
        moment: float | None,
        position_time: float | None,
        motion: ContactMotion | None,
    ) -> None:
        """Raise `InvalidInput` unless a sample has all its numbers, and all are finite."""
        if self._joints and motion is None:
            raise InvalidInput(
                f'sample at {time!r} s: motion = None is not allowed: with source joints the'
                ' velocity of the contact is needed'
            )
        try:
            (fx, fy, fz), (x, y, z) = force, position
            age = 0.0 if position_time is None else abs(time - position_time)
            yaw = 0.0 if moment is None else moment
            finite = math.isfinite(time + fx + fy + fz + x + y + z + pressure + yaw + age)
        except (TypeError, ValueError) as error:
            raise _not_numbers(time, force, position, pressure, moment) from error
        if not finite:
            raise _not_finite(time, force, position, pressure, moment, position_time)
        if motion:
            _check_motion(time, motion)

    def _restart_blocks(self) -> None:
        """Forget the last readings, and the height of the last stance."""
        self._axes.restart()
        self._block, self._earlier, self._block_end = [], 0, -math.inf

    def _end_block(
        self,
        time: float,
        z: float,
        force: tuple[float, float, float],
        motion: ContactMotion | None,
    ) -> None:
        """Look for turned axes, and measure noise, in the readings of a block that ends now."""
        axes, block, earlier = self._axes, self._block, self._earlier
        duration = time - self._block_end + BLOCK
        self._block, self._earlier = block[-2:], min(2, len(block))
        self._block_end = time + BLOCK - 1e-9
        if duration > BLOCK + LONGEST_GAP or (motion and motion.doubt):
            axes.restart()
            return
        was = axes.doubt
        loaded = axes.update(time, duration, z, force)
        if axes.doubt and not was:
            self._forget(time)
        if self._looks and len(block) > earlier:
            self._look_at(block, earlier, duration, loaded, motion)
        if self._gate.standing and time > self._look_end:
            self._look(time)

    def _look_at(
        self,
        block: Sequence[Reading],
        earlier: int,
        duration: float,
        loaded: bool,
        motion: ContactMotion | None,
    ) -> None:
        """Measure noise and compare motions in a block, which follows on ``earlier`` readings."""
        columns = [*zip(*block, strict=True)]
        count = len(block) - earlier
        means = [sum(each[earlier:]) / count for each in columns[1:]]
        noise, offset = self.noise, self._offset
        if self._gate.standing and noise.add(columns, means, count):
            self._use_noise()
        if loaded and offset.known:
            x, y, fx, fy, _ = means
            sd = noise.position.noise * math.sqrt(2.0 / count)
            if motion:
                sd = motion.sd * BLOCK
            time = columns[0][-1]
            self._axes.compare(time, duration, x, y, fx - offset.x, fy - offset.y, sd)

    def _look(self, time: float) -> None:
        """Decide whether to look at the readings of a stance, or of a second of a long one.

        Noise and axes hardly ever change during a walk.
        """
        self._looked += 1
        self._looks = self._looked <= EAGER or self._looked % PAUSE == 0
        self._look_end = time + LONGEST
        self._block, self._earlier = [], 0
        self.noise.begin()

    def _forget(self, time: float) -> None:
        """Forget what was learnt in wrong axes until a time, s."""
        self._looks = True
        self._history.clear()
        self.ground.forget(time)
        mean, sd = self.ground.friction
        self.estimate = self.estimate._replace(friction_mean=mean, friction_sd=sd)

    def _set_back(self, time: float) -> float:
        """Begin a new stance, because the clock has been set back; return the infinite gap, s."""
        if time > self._time - LONGEST_GAP:
            raise InvalidInput(
                f'time = {shown(time)} s is not allowed: it must be later than that of the last'
                f' sample, {shown(self._time)} s'
            )
        self._gate.standing = False
        self._path.restart()
        self._history.clear()
        self._sensing.restart()
        self._restart_blocks()
        return math.inf

    def _touch_down(self, time: float, x: float, y: float, z: float, pressure: float) -> None:
        self._alarm.reset()
        self._look(time)
        self._motion.begin(x, y)
        self._stance = Stance(z, self._share_on_domes(pressure))
        self.ground.touch_down(
            self._path.touch_down(time, x, y), self._stance.dome_share > doubt.DOMED, time
        )
        self._history.add(time, self.ground.posterior)
        self._quantile = self.ground.quantile(MARGIN_SHARE)
        self._window.begin(time, first=True)

    def _stand(
        self,
        time: float,
        dt: float,
        force: tuple[float, float, float],
        velocity: tuple[float, float],
        turning: float,
        pressure: float,
        turning_known: bool,
    ) -> Estimate:
        """Return the estimate of a standing foot."""
        fx, fy, fz = force
        pull = math.hypot(fx, fy)
        # A foot gives way against its tangential force; the component across it is only noise.
        along = (velocity[0] * fx + velocity[1] * fy) / pull if pull > 0.0 else 0.0
        slip = (along * fx / pull, along * fy / pull) if along else (0.0, 0.0)
        slipping = self._alarm.update(-along, dt)
        stance, window, last = self._stance, self._window, self.estimate
        window.add(fz, pull, turning, -along, self._speed_noise)
        if fz > stance.peak_load:
            stance.peak_load = fz
        fresh = time - window.start >= self._filter_period
        if fresh:
            self._follow_pressure(pressure)
            self._filter(time - window.start, turning_known)
            window.begin(time, first=False)
            friction_mean, friction_sd = self.ground.friction
            wet = self.ground.wet_probability
            self._quantile = self.ground.quantile(MARGIN_SHARE)
            self._history.add(time, self.ground.posterior)
            reason = self._doubt(friction_mean, friction_sd)
        else:
            friction_mean, friction_sd = last.friction_mean, last.friction_sd
            wet, reason = last.wet_probability, last.doubt if last.sound else NOT_AGAIN
        estimate = self.estimate = _estimate((
            time, True, slipping, slip, -along, self._speed_noise,
            wet, friction_mean, friction_sd, self._quantile - math.hypot(pull, turning) / fz,
            fresh, reason, True,
        ))  # fmt: skip
        return estimate

    def _set_noise(self) -> float:
        """Set the noise of the contact; return that of the slip speed without the body's, m/s."""
        tuning, noise = self.tuning, self.noise
        softness = self._softness if self._joints else 1.0 / self._stiffness
        self._contact_noise = math.hypot(noise.position.noise, noise.force.noise * softness)
        self._sensor_speed_noise = math.hypot(
            self._contact_noise / tuning.smoothing, tuning.speed_noise
        )
        return self._sensor_speed_noise

    def _use_noise(self) -> None:
        """Use the noise that the sensors have shown until now."""
        noise = self.noise
        self._sensing.set_noise(noise.force.white, noise.position.white)
        speed_noise = self._set_noise()
        if not self._joints:
            self._speed_noise = speed_noise
            self._alarm.set_noise(speed_noise)

    def _in_doubt(self, time: float, force: tuple[float, float, float], why: str) -> Estimate:
        """Return the estimate of a standing foot while the motion of the body is in doubt."""
        last = self.estimate
        self._alarm.reset()
        self._window.begin(time, first=True)
        margin = self._quantile - math.hypot(force[0], force[1]) / force[2]
        reason = f'{doubt.MOTION}: {why}'
        fresh = not last.standing or last.doubt.partition(':')[0] != doubt.MOTION
        self.estimate = Estimate(
            time, True, False, (0.0, 0.0), 0.0, math.inf, last.wet_probability,
            last.friction_mean, last.friction_sd, margin, fresh, reason, True,
        )  # fmt: skip
        return self.estimate

    def _swing(self, time: float, stood: bool) -> Estimate:
        """Return the estimate of a foot in the air."""
        self._looks = False
        _, _, _, _, _, _, wet, mean, sd, margin, _, reason, sound = self.estimate
        estimate = self.estimate = _estimate((
            time, False, False, (0.0, 0.0), 0.0, self._speed_noise, wet, mean, sd, margin,
            stood or not sound, reason if sound else NOT_AGAIN, True,
        ))  # fmt: skip
        return estimate

    def _without_sensors(self, time: float, dt: float, x: float, y: float, fault: str) -> Estimate:
        """Return the estimate while sensors are faulty: undo the samples since then, and fade."""
        last, ground = self.estimate, self.ground
        self._gate.standing = False
        posterior = self._history.undo(self._sensing.since)
        if posterior is not None:
            ground.posterior = posterior
        if self._sensing.marker_valid:
            distance = self._path.seen(x, y)
        else:
            self._height = math.inf
            distance = self._path.unseen(dt)
        if distance:
            ground.fade(distance)
        changed = posterior is not None or distance > 0.0
        mean, sd = ground.friction if changed else (last.friction_mean, last.friction_sd)
        self.estimate = Estimate(
            time, False, False, (0.0, 0.0), 0.0, math.inf, ground.wet_probability, mean, sd,
            math.nan, changed or last.sound, fault, False,
        )  # fmt: skip
        return self.estimate

    def _share_on_domes(self, pressure: float) -> float:
        return self._foot.dome_load(self._expected_load, pressure) / self._expected_load

    def _follow_pressure(self, pressure: float) -> None:
        """Begin a new stance at the same place when the foot changes its morphology under load."""
        stance = self._stance
        before, stance.dome_share = stance.dome_share, self._share_on_domes(pressure)
        if (before > doubt.DOMED) != (stance.dome_share > doubt.DOMED):
            self.ground.touch_down(0.0, stance.dome_share > doubt.DOMED, self._time)
            stance.forget_counted()

    def _doubt(self, friction_mean: float, friction_sd: float) -> str:
        ground, stance = self.ground, self._stance
        evidence = doubt.StanceEvidence(
            stance.dome_share, ground.log_odds, stance.peak_load, stance.peak_ratio,
            stance.peak_turning, ground.wet_probability, friction_mean, friction_sd,
        )  # fmt: skip
        return doubt.doubt(evidence, ground.expected, self._expected_load)

    def _filter(self, duration: float, turning_known: bool) -> None:
        """Update the filter with the means of the window, which has lasted ``duration``, s."""
        window, stance, tuning = self._window, self._stance, self.tuning
        load = window.load / window.count
        pull, turning = window.pull / window.load, window.turning / window.load
        ratio = math.hypot(pull, turning)
        force_noise = self.noise.force.noise
        if turning > 0.0:
            share = turning / ratio
            force_noise = math.hypot(force_noise, share * tuning.moment_noise / self._lever)
        sensors = math.hypot(force_noise / math.sqrt(window.count), self._offset.sd) / load
        noise = math.hypot(tuning.ratio_noise, sensors * math.sqrt(1.0 + ratio**2))
        stance.peak_ratio = max(stance.peak_ratio, pull)
        stance.peak_turning = max(stance.peak_turning, turning)
        # The mean speed is the displacement of the smoothed contact over the window's duration.
        # The smoother starts from one sample, so its noise is larger at the start of a stance.
        spread = 2.0 * duration / (2.0 * tuning.smoothing * window.count + duration)
        if window.first:
            spread = 0.5 * spread + 1.0
        speed_noise = math.hypot(
            tuning.speed_noise, self._contact_noise * math.sqrt(spread) / duration
        )
        if self._joints:  # the error of the body's velocity is the same in the whole window
            speed_noise = window.noise / window.count
        self.ground.update(
            ratio, noise, window.speed / window.count, speed_noise, duration,
            stance.weight(ratio, noise, *self._place), turning_known,
            self._scales(load),
        )  # fmt: skip

    def _scales(self, load: float) -> tuple[float, float]:
        """Return friction at a load, N, over that at the expected load, on dry and on wet ground.

        The adhesion of a flat sole that touches all over does not grow with the load.
        """
        if self._stance.dome_share > doubt.DOMED:
            return 1.0, 1.0
        kernel, prior = self._foot.resistance_of, self.ground.prior
        dry = kernel(0.0, load, 0.0, 0.0, 0.0) / load
        wet = kernel(0.0, load, 0.0, 0.0, THICK_FILM) / load
        # Friction that is zero at one load is zero at all.
        return (
            dry / prior.flat_dry if prior.flat_dry else 1.0,
            wet / prior.flat_wet if prior.flat_wet else 1.0,
        )


def shared_friction(foot: Foot, expected_load: float, tuning: Tuning) -> FrictionScales:
    """Return what feet of one robot share of friction, before a walk."""
    prior = FrictionPrior.of(foot, expected_load)
    return FrictionScales(prior, tuning.scales, tuning.learn_friction)


def estimators_of(
    count: int, foot: Foot, expected_load: float, tuning: Tuning
) -> tuple[list[FootEstimator], FrictionScales]:
    """Return the estimators of all feet of a robot, and what they share of friction.

    Parameters
    ----------
    count : int
        Number of feet, from 1.
    foot : Foot
        All feet are of this kind.
    expected_load : float
        Normal force on a foot in stance, N, above 0.
    tuning : Tuning
        Settings for sensors and ground.

    Returns
    -------
    list of FootEstimator
        One estimator for each foot.
    FrictionScales
        What the feet learn of friction together.

    Raises
    ------
    InvalidInput
        When the expected load is not a number above 0, the count no whole number from 1, or foot
        or tuning of another class.
    """
    instance('foot', foot, Foot)
    instance('tuning', tuning, Tuning)
    integer('count', count, 1)
    expected_load = number('expected_load', expected_load, 'N', above=True)
    shared, axes = shared_friction(foot, expected_load, tuning), SharedAxes()
    feet = [FootEstimator(foot, expected_load, tuning, shared, axes) for _ in range(count)]
    return feet, shared


def _check_motion(time: float, motion: ContactMotion) -> None:
    """Raise `InvalidInput` unless a motion of the contact is made of finite numbers."""
    (x, y), sd, _ = motion
    if not math.isfinite(x + y + sd) or sd < 0.0:
        raise InvalidInput(
            f'sample at {time!r} s: velocity = ({x!r}, {y!r}) m/s with a deviation of {sd!r} m/s'
            ' is not allowed: finite numbers are needed, and a deviation from 0'
        )


def _not_numbers(
    time: float, force: object, position: object, pressure: float, moment: float | None
) -> InvalidInput:
    """Return the error of a sample that does not consist of numbers."""
    return InvalidInput(
        f'sample at {time!r} s: force = {force!r}, position = {position!r}, pressure ='
        f' {pressure!r}, moment = {moment!r}: three numbers each are needed for force and'
        ' position, one number each for time, pressure and moment'
    )


def _not_finite(
    time: float,
    force: Sequence[float],
    position: Sequence[float],
    pressure: float,
    moment: float | None,
    position_time: float | None,
) -> InvalidInput:
    """Return the error that names the values of a sample that are not finite."""
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
        f'{name} = {shown(value)} {unit}'
        for name, value, unit in values
        if not math.isfinite(value)
    ]
    return InvalidInput(f'sample at {shown(time)} s: {", ".join(wrong)}: must be finite')
