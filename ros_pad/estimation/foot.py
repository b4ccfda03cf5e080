# SPDX-License-Identifier: Apache-2.0
"""Estimators of one foot and of all: slip, wetness, friction, and friction margin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ros_pad.configuration import instance, integer, number, shown
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import doubt
from ros_pad.estimation.friction import GroundFilter, GroundModel
from ros_pad.estimation.ground import LONGEST_GAP, Ground, shared_friction
from ros_pad.estimation.noise import SensorNoise
from ros_pad.estimation.track import Sample, Track
from ros_pad.estimation.tuning import Tuning


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
    shared : FrictionScales
        What the feet learn of friction together.
    tracks : list of Track
        What each foot does, and knows of the ground.

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
        self.shared = shared_friction(foot, load, tuning)
        model = GroundModel(
            self.shared, tuning.wet_prior, tuning.patch_length, rim_speed=tuning.rim_speed(foot)
        )
        self.tracks = [Track(Ground(foot, load, tuning, model)) for _ in range(count)]

    def update(
        self, time: float, samples: Sequence[Sample | None], pressures: Sequence[float]
    ) -> None:
        """Process the samples of a time; the clock may have been set back.

        Parameters
        ----------
        time : float
            Time, s.
        samples : sequence of Sample or None
            A sample of each foot, None where it has none.
        pressures : sequence of float
            Gauge pressure in the pads of each foot, Pa.
        """
        for track, sample, pressure in zip(self.tracks, samples, pressures, strict=True):
            track.fresh = False
            if sample:
                track.update(time, sample, pressure)


LARGEST_FORCE, LARGEST_POSITION, LARGEST_PRESSURE = 1e5, 1e6, 1e7
"""Largest size of a force, N, and moment, N m, of a position, m, and of a gauge pressure, Pa."""

NUMBERS = (
    *((f'force {axis}', -LARGEST_FORCE, LARGEST_FORCE, 'N') for axis in 'xyz'),
    ('moment', -LARGEST_FORCE, LARGEST_FORCE, 'N m'),
    *((f'position {axis}', -LARGEST_POSITION, LARGEST_POSITION, 'm') for axis in 'xyz'),
    *((f'velocity {axis}', -1e6, 1e6, 'm/s') for axis in 'xy'),
    *((f'variance {axis}', 0.0, math.inf, 'm²/s²') for axis in 'xy'),
    ('age of the position', 0.0, 1e12, 's'),
    ('pressure', -LARGEST_PRESSURE, LARGEST_PRESSURE, 'Pa'),
    ('deviation', 0.0, 1e6, 'm/s'),
)
"""Names, limits and units of the numbers of a sample, and of what comes with it. A larger value,
though finite, would spoil sums and means for ever."""


def wrong_numbers(time: float, numbers: Sequence[float]) -> list[str]:
    """Return what is outside its limits of a time, s, and :data:`NUMBERS`, or the first of them.

    The moment may be NaN.
    """
    wrong = [
        f'{name} = {shown(value)} {unit}'
        for (name, low, high, unit), value in zip(NUMBERS, numbers, strict=False)
        if not (low <= value <= high or (name == 'moment' and value != value))
    ]
    return wrong if abs(time) < math.inf else [*wrong, f'time = {shown(time)} s']


def refuse(time: float, last: float, wrong: Sequence[str]) -> None:
    """Refuse a sample of a time, s, with wrong numbers, or hardly before the last one, s.

    No clock is set back by so little.
    """
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
    tuning : Tuning
        Settings for sensors and ground.

    Attributes
    ----------
    estimate : Estimate
        Estimate after the last sample.
    feet : FeetEstimator
        The estimator of all feet of a robot, mostly of this one alone.

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

    def __init__(self, foot: Foot, expected_load: float, tuning: Tuning | None = None) -> None:
        self.feet, self._place = FeetEstimator(1, foot, expected_load, tuning), 0
        self.estimate = self._estimate()

    @classmethod
    def of(cls, feet: FeetEstimator) -> list[FootEstimator]:
        """Return an estimator for each foot of a robot, which learn together.

        Parameters
        ----------
        feet : FeetEstimator
            The estimator of all feet.

        Returns
        -------
        list of FootEstimator
            They share its state.
        """
        found = []
        for place in range(len(feet.tracks)):
            found.append(cls.__new__(cls))
            found[-1].feet, found[-1]._place = feet, place
            found[-1].estimate = found[-1]._estimate()
        return found

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
        tuning, track = self.feet.tuning, self.feet.tracks[self._place]
        velocity, sd, why = (0.0, 0.0), 0.0, ''
        if tuning.source == 'joints':
            if motion is None:
                raise InvalidInput(
                    f'sample at {time!r} s: motion = None is not allowed: with source joints the'
                    ' velocity of the contact is needed'
                )
            velocity, sd, why = motion
        yaw = math.nan if moment is None or not tuning.moment_noise else moment
        try:
            (fx, fy, fz), (x, y, z) = force, position
            age = 0.0 if position_time is None else abs(time - position_time)
            variance = math.inf if why else sd**2
            sample = fx, fy, fz, yaw, x, y, z, *velocity, variance, variance, age
            wrong = wrong_numbers(time, (*sample, pressure, sd))
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f'sample at {time!r} s: force = {force!r}, position = {position!r}, pressure ='
                f' {pressure!r}, moment = {moment!r}: three numbers each are needed for force and'
                ' position, one number each for time, pressure and moment'
            ) from error
        refuse(time, track.time, wrong)
        track.fresh = False
        track.update(time, sample, pressure)
        self.estimate = self._estimate()
        return self.estimate

    @property
    def ground(self) -> GroundFilter:
        """Posterior of wet ground and friction."""
        return self.feet.tracks[self._place].ground.filter

    @property
    def noise(self) -> SensorNoise:
        """Configured and measured noise of the sensors."""
        return self.feet.tracks[self._place].watch.noise

    def _estimate(self) -> Estimate:
        track = self.feet.tracks[self._place]
        now, ground = track.standing, track.ground
        return Estimate(
            track.time, track.stands, now.slipping, now.slip_velocity, now.slip_speed,
            track.slip.sd, *ground.belief, track.margin, track.fresh, doubt.text(*ground.doubt),
            track.sound,
        )  # fmt: skip
