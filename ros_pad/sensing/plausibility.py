# SPDX-License-Identifier: Apache-2.0
"""Readings that contradict each other.

Sensors that repeat, force sensors that are off zero in the air, joints whose velocity is not
theirs, legs that move against the others, joints later than the IMU.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array, cross
from ros_pad.sensing.body_filter import Flags

# Samples of which one is looked at, where that is enough.
EVERY = 4

# Time constant of the share of its stances in which a foot slips, s of stance.
STANCES = 4.0

# Share below which a foot moves with the others.
AGREES = 0.5

# Share above which a foot moves against the others, if half of all feet are below AGREES, and mean
# speed of its contact point over that of the foot against the body from which on it does.
AGAINST, FASTER = 0.9, 0.6

# Speed of a foot against body or ground from which on it shows something, m/s.
MOVES = 0.02

# Number of readings in the air whose median is that of the sensor.
READINGS = 20

# Shares of the expected load up to which readings in the air are left as they are (contacts begin
# and end while feet move), and above which they are no error of the sensor alone.
NOTHING, TOO_MUCH = 0.05, 0.5

# Largest difference of joint positions from the sum of their velocities over half a second, rad,
# and what is added to it, as a share of the largest motion.
UNLIKE, UNLIKE_SHARE = 0.08, 0.3

# Delay between IMU and joints above which there is a doubt, s, and standard deviations of the
# delay that it must be above that.
LATE, SURE = 2e-3, 2.0

# Half of the time over which the gyro is differentiated, s.
HALF = 0.008


class Repeats:
    """Sensors that repeat their last reading although the robot moves.

    Parameters
    ----------
    gyro_noise, velocity_noise : float
        Standard deviations of the gyro and of joint velocities, rad/s.
    """

    def __init__(self, gyro_noise: float, velocity_noise: float) -> None:
        self._turns, self._steps = 0.1 + 5.0 * gyro_noise, 0.1 + 5.0 * velocity_noise
        self._last: list[Array | None] = [None] * 4
        self._since = [math.nan] * 4
        self._turn, self._doubt = 0, ''

    def update(
        self, time: float, gyro: Array, force: Array, q: Array, dq: Array, loads: Array | None
    ) -> str:
        """Return what repeats at a time, s, or an empty text."""
        self._turn += 1
        if self._turn % EVERY:
            return self._doubt
        self._doubt = ''
        turns = bool(np.abs(gyro).max() > self._turns)
        steps = bool(np.abs(dq).max() > self._steps)
        shakes = turns or steps
        sensors = (  # with the time, s, for which they may repeat while the robot moves
            ('imu: the gyro repeats its reading', gyro, steps, 0.2),
            # Readings without any noise, as of a calculated motion, are no fault.
            ('imu: the accelerometer repeats its reading', force, shakes and gyro.any(), 0.2),
            ('joints: all joint positions repeat', q, turns, 0.4),
            # Forces may come from contacts that are made or not.
            ('force: all foot forces repeat', loads, steps, 2.0),
        )
        for index, (doubt, values, moves, patience) in enumerate(sensors):
            last = self._last[index]
            if values is None or last is None or not (values == last).all():
                self._last[index], self._since[index] = values, time
            elif moves and time - self._since[index] > patience and values.any():
                self._doubt = doubt
        return self._doubt


class Unloaded:
    """What force sensors of the feet show in the air: the error of their zero.

    Parameters
    ----------
    names : tuple of str
        Of the legs.
    expected : float
        Load that a foot is expected to carry, N.

    Attributes
    ----------
    offset : array (legs, 3)
        The error, N, in the axes of the readings; 0 where it is small or not known.
    """

    def __init__(self, names: tuple[str | int, ...], expected: float) -> None:
        self._names, self._expected = names, expected
        self._rows = np.zeros((len(names), READINGS, 3))
        self._count = np.zeros(len(names), dtype=int)
        self._next = -math.inf  # time of the next reading, s
        self._much: Flags = np.zeros(len(names), dtype=bool)
        self.offset = np.zeros((len(names), 3))

    def update(self, time: float, forces: Array, climbing: Array) -> Array:
        """Return readings, (legs, 3), N, without the error, and learn it from them.

        Parameters
        ----------
        time : float
            Time, s.
        forces : array (legs, 3)
            The readings, N.
        climbing : array (legs,)
            Vertical speeds of the feet over the ground, m/s.
        """
        if time >= self._next:
            self._next = time + 0.016
            for leg in np.flatnonzero(np.abs(climbing) > 0.1).tolist():  # m/s: in the air
                self._rows[leg, self._count[leg] % READINGS] = forces[leg]
                self._count[leg] += 1
                if not self._count[leg] % READINGS:
                    self._learn(leg)
        return forces - self.offset

    def _learn(self, leg: int) -> None:
        rows = self._rows[leg]
        offset = np.median(rows, axis=0)
        size, least = float(np.abs(offset).max()), NOTHING * self._expected
        # Contacts that last have readings that are not alike.
        if np.median(np.abs(rows - offset), axis=0).max() > 0.15 * max(size, least):
            return
        self._much[leg] = size > TOO_MUCH * self._expected
        wrong = size > least and not self._much[leg]
        self.offset[leg] = offset if wrong else 0.0

    def doubt(self) -> str:
        """Return which feet show too much, or an empty text."""
        feet = _named(self._names, self._much)
        return feet and f'force: foot {feet} shows more than half of the expected load in the air'


class Joints:
    """Joints whose position does not follow their velocity.

    Parameters
    ----------
    names : tuple of str
        Of the joints.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._begin = math.nan
        self._first: Array = np.zeros(0)
        self._path: Array = np.zeros(0)
        self._apart, self._most = self._path, self._path  # largest difference and motion
        self._turn = 0
        self._bad: Flags = np.zeros(len(names), dtype=bool)
        self._doubt = ''

    def update(self, time: float, dt: float, q: Array, dq: Array) -> str:
        """Return which joint does not, after a step of dt, s, or an empty text."""
        if not 0.0 < dt < 0.05 or math.isnan(self._begin):
            self._restart(time, q)
            return self._doubt
        self._path += dt * dq
        self._turn += 1
        if self._turn % EVERY:
            return self._doubt
        moved = q - self._first
        np.maximum(self._apart, np.abs(moved - self._path), out=self._apart)
        np.maximum(self._most, np.maximum(np.abs(moved), np.abs(self._path)), out=self._most)
        if time - self._begin >= 0.5:
            bad = (self._apart > UNLIKE + UNLIKE_SHARE * self._most).ravel()
            both = np.flatnonzero(bad & self._bad)
            self._bad, self._doubt = bad, ''
            if both.size:
                name = self._names[int(both[0])]
                self._doubt = f'joints: the position of {name} does not follow its velocity'
            self._restart(time, q)
        return self._doubt

    def _restart(self, time: float, q: Array) -> None:
        self._begin, self._first = time, q
        self._path, self._apart, self._most = np.zeros((3, *q.shape))


class Legs:
    """Legs that move against the others.

    Parameters
    ----------
    robot : Robot

    Attributes
    ----------
    against : array of bool (legs,)
        Which do.
    """

    def __init__(self, robot: Robot) -> None:
        self._names = robot.legs
        # Share of slips, and mean speeds of contact points and of feet against the body.
        self._means = np.zeros((3, len(robot.legs)))
        self.against: Flags = np.zeros(len(robot.legs), dtype=bool)
        self._time = np.zeros(len(robot.legs))  # of stance in motion, s
        self._turn, self._spent = 0, 0.0

    def update(
        self, dt: float, standing: Flags, slipping: Flags, slips: Array, moves: Array
    ) -> None:
        """Add a step.

        Parameters
        ----------
        dt : float
            Length of the step, s.
        standing, slipping : array of bool (legs,)
            Feet that carry load, and those that slip.
        slips, moves : array (legs,)
            Speeds of the contact points, and of the feet against the body, m/s.
        """
        self._turn += 1
        self._spent += dt
        if self._turn % EVERY:
            return
        dt, self._spent = self._spent, 0.0
        means = self._means
        # Feet that neither move nor slip show nothing.
        counts = standing & ((moves > MOVES) | (slips > MOVES))
        self._time += counts * dt
        gain = counts * dt / np.clip(self._time, max(dt, 1e-9), STANCES)
        means += gain * (np.stack([slipping, slips, moves]) - means)
        shares = means[0]
        # Where all feet slip for half of their stances, some do so nearly always.
        most = 2 * int((shares < AGREES).sum()) >= len(shares)
        wrong = (shares > AGAINST) & (means[1] > FASTER * means[2]) & most
        wrong &= self._time > 0.5 * STANCES
        self.against = wrong | (self.against & (shares > AGREES))

    def doubt(self) -> str:
        """Return which legs do, or an empty text."""
        legs = _named(self._names, self.against)
        words = 'moves against the other legs: joint reversed or wrong foot link?'
        return legs and f'kinematics: leg {legs} {words}'


class Delay:
    """Delay of the joints behind the IMU, from the rates at which gyro and standing legs turn.

    The difference of the velocities of two feet that stand is ω x (s1 - s2) less what joints show;
    if joints are late by τ, it is τ dω/dt x (s1 - s2): a line whose slope is τ, by least squares,
    less what the noise of dω/dt takes from it. Feet that slip bend this line in x and y, feet that
    sink in bend it in z, and both repeat with the gait: a delay shows in both.

    Parameters
    ----------
    gyro_noise : float
        Standard deviation of a sample of the gyro, rad/s.

    Attributes
    ----------
    value, deviation : float
        The delay (mean of both lines) and its standard deviation, s; NaN before they are known.
    """

    def __init__(self, gyro_noise: float) -> None:
        self._noise = 2.0 * gyro_noise**2  # of both ends
        self._rows: deque[tuple[float, Array, Array, Array, Flags]] = deque(maxlen=64)
        # Products of the line with velocities and with itself, in x and y, and in z.
        self._blocks: deque[Array] = deque(maxlen=12)
        self._sums = np.zeros((2, 2))
        self._spent = 0.0
        self._turn = 0
        self.value = self.deviation = math.nan
        self._least, self._spread = 0.0, 0.0

    def update(self, time: float, rate: Array, places: Array, slips: Array, stands: Flags) -> None:
        """Add a sample.

        Parameters
        ----------
        time : float
            Time, s.
        rate : array (3,)
            Angular velocity, rad/s.
        places, slips : array (legs, 3)
            Feet from the body, m, and velocities of the contact points, m/s, up to a velocity that
            all of them share.
        stands : array of bool (legs,)
            Feet that stand and do not slip.
        """
        rows = self._rows
        rows.append((time, rate, places, slips, stands))
        self._turn += 1
        if self._turn % EVERY or time - rows[0][0] < 2.0 * HALF:
            return
        while time - rows[1][0] >= 2.0 * HALF:
            rows.popleft()
        middle = rows[len(rows) // 2]
        feet = np.flatnonzero(rows[0][4] & middle[4] & stands)
        span = time - rows[0][0]
        if len(feet) < 2 or span > 4.0 * HALF:
            return
        speeds = middle[3][feet]
        speeds = speeds - speeds.sum(0) / len(feet)
        if np.abs(speeds).max() > 0.1:  # m/s: one of them slips
            return
        arms = middle[2][feet]
        arms = arms - arms.sum(0) / len(feet)
        lines = cross((rate - rows[0][1]) / span, arms)
        squares = (arms * arms).sum(0)
        noise = self._noise / span**2 * (squares.sum() - squares)
        both = np.stack([(speeds * lines).sum(0), (lines * lines).sum(0) - noise])
        self._sums[0] += both[:, 0] + both[:, 1]
        self._sums[1] += both[:, 2]
        self._spent += EVERY * span / len(rows)
        if self._spent >= 2.0:  # s
            self._close()

    def _close(self) -> None:
        """End a stretch of walking."""
        if self._sums[:, 1].min() > 10.0:  # m²/s⁴: feet were moved enough
            self._blocks.append(self._sums)
        self._sums, self._spent = np.zeros((2, 2)), 0.0
        if len(self._blocks) >= 4:
            blocks = np.array(self._blocks)
            total = blocks.sum(0)
            level, upright = slopes = total[:, 0] / total[:, 1]
            rest = (blocks[..., 0] - slopes * blocks[..., 1]) / total[:, 1]
            self._spread = max(float(np.sqrt((rest * rest).sum(0).max())), 2.5e-4)  # s, of slips
            self._least = min(abs(level), abs(upright)) if level * upright > 0.0 else 0.0
            self.value = float(level + upright) / 2.0
            self.deviation = math.hypot(self._spread, (level - upright) / 2.0)

    def doubt(self) -> str:
        """Return a doubt, or an empty text."""
        if self._least < LATE + SURE * self._spread:
            return ''
        word = 'later' if self.value > 0.0 else 'earlier'
        return f'delay: joints are {1e3 * abs(self.value):.0f} ms {word} than the IMU'


def _named(names: tuple[str | int, ...], which: Flags) -> str:
    """Return the names of some legs, with commas between them."""
    return ', '.join(str(names[leg]) for leg in np.flatnonzero(which).tolist())
