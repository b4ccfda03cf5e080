# SPDX-License-Identifier: Apache-2.0
"""Estimator of one foot: slip, wetness, friction, and friction margin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ros_pad.configuration import number
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.friction import GroundFilter, GroundModel
from ros_pad.estimation.ground import Ground
from ros_pad.estimation.track import Sample, Track, check
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import Watch

LARGEST_PRESSURE = 1e7
"""Largest size of a gauge pressure, Pa."""


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
    while sensors are faulty (see :mod:`ros_pad.estimation.sensor_faults`): the posterior is set
    back to the one before the fault, and fades to the prior with distance.

    Parameters
    ----------
    foot : Foot
        Foot, which gives expected friction and shear stiffness.
    expected_load : float
        Normal force in stance, N, above 0.
    tuning : Tuning or None
        Settings for sensors and ground; None takes the defaults.
    model : GroundModel or None
        Model of the ground, that of another foot if both learn together; None makes one.

    Attributes
    ----------
    estimate : Estimate
        Estimate after the last sample.

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
        model: GroundModel | None = None,
    ) -> None:
        tuning = Tuning() if tuning is None else tuning
        model = model or GroundModel.of(foot, expected_load, tuning)
        self._track = Track(Ground(foot, expected_load, tuning, model))
        self.estimate = self._estimate()

    def update(
        self,
        time: float,
        force: Sequence[float],
        position: Sequence[float],
        pressure: float,
        moment: float | None = None,
        position_time: float | None = None,
        velocity: Sequence[float] = (0.0, 0.0),
        variance: float = math.inf,
    ) -> Estimate:
        """Process one sample.

        Parameters
        ----------
        time : float
            Time of the sample, s, later than that of the last one. When the clock is set back by
            0.15 s or more, a new stance begins and the posterior stays.
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
        velocity : sequence of 2 floats
            Velocity of the contact point over the floor, x and y, m/s, as a body estimator has it;
            needed with the setting ``source: joints``, else not used.
        variance : float
            Variance of each of its components, m²/s²; infinite if it must not be used.

        Returns
        -------
        Estimate
            Estimate after this sample.

        Raises
        ------
        InvalidInput
            When a value is not a finite number, force or position are not three numbers, time
            does not advance, or the variance is below 0.
        """
        tuning, track = self._track.ground.tuning, self._track
        if tuning.source != 'joints':
            velocity, variance = (0.0, 0.0), 0.0
        number('pressure', pressure, 'Pa', -LARGEST_PRESSURE, LARGEST_PRESSURE)
        yaw = math.nan if moment is None or not tuning.moment_noise else moment
        try:
            (fx, fy, fz), (x, y, z) = force, position
            age = 0.0 if position_time is None else abs(time - position_time)
            numbers = fx, fy, fz, yaw, x, y, z, *velocity, variance, age
            sample = Sample(*map(float, numbers))
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f'sample at {time!r} s: force = {force!r}, position = {position!r}, moment ='
                f' {moment!r}: three numbers each are needed for force and position, one number'
                ' each for time and moment'
            ) from error
        check(sample, time, track.time)
        track.update(time, sample, pressure)
        self.estimate = self._estimate()
        return self.estimate

    @property
    def ground(self) -> GroundFilter:
        """Posterior of wet ground and friction."""
        return self._track.ground.filter

    @property
    def noise(self) -> Watch:
        """Configured and measured noise of the sensors: its ``position`` and ``force``."""
        return self._track.watch

    def _estimate(self) -> Estimate:
        track = self._track
        now, ground = track.standing, track.ground
        return Estimate(
            track.time, track.stands, now.slipping, now.slip_velocity, now.slip_speed,
            track.slip.sd, *ground.belief, track.margin, track.fresh, doubt.text(*ground.doubt),
            track.sound,
        )  # fmt: skip
