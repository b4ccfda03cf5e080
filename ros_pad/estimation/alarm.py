# SPDX-License-Identifier: Apache-2.0
"""Slip speed, and its alarm: a one-sided CUSUM test (Page 1954) of the displacement."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ros_pad.contact.resistance import Foot
from ros_pad.estimation.tuning import Tuning

if TYPE_CHECKING:
    from ros_pad.estimation.track import Sample

SMOOTHING = 0.02
"""Time constant of the slip speed, s."""

SPEED_NOISE = 2e-3
"""Model error of the slip speed, added to that of the sensors, m/s: feet also roll and bend."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""

SLOWEST_SLIP = 0.015
"""Speed up to which a contact may move without an alarm, m/s: feet roll and bend."""

SURE_SPEED, SURE_PLACE = 2.0, 3.0
"""Standard deviations of a measured velocity, and of a place, that are no slip."""


class SlipAlarm:
    """Raise an alarm when a contact has moved on by a distance.

    The displacement d ← max(0, d + (v - a) dt) counts what is faster than the allowed speed a,
    from when it last was none.

    Attributes
    ----------
    displacement : float
        The displacement, m, from 0 to 1.25 times the distance, so that the alarm ends soon after
        the slip.
    """

    def __init__(self) -> None:
        self.displacement = 0.0

    def update(self, speed: float, allowed: float, distance: float, dt: float) -> bool:
        """Process a slip speed, m/s, dt seconds after the last one; return if the alarm is on.

        ``allowed`` is the allowed speed, m/s, and ``distance`` that of an alarm, m.
        """
        moved = max(0.0, self.displacement + (speed - allowed) * dt)
        self.displacement = min(moved, 1.25 * distance)
        return moved > distance


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
        self._joints = tuning.source == 'joints'
        self._shear = 1.0 / foot.shear_stiffness
        self.softness = self._shear if tuning.pads_shear or not self._joints else 0.0
        self.alarm, self._distance = SlipAlarm(), tuning.alarm_distance
        # Smoothed position of the contact, m; with joints smoothed shear of the pads.
        self._x = self._y = self.noise = self.contact_noise = self.sd = 0.0

    def set_noise(self, position: float, force: float) -> None:
        """Use the noise of a coordinate, m, and of a component of the force, N."""
        self.contact_noise = math.hypot(position, force * self.softness)
        self.noise = math.hypot(self.contact_noise / SMOOTHING, SPEED_NOISE)

    def touch_down(self, sample: Sample, fx: float, fy: float) -> tuple[float, float]:
        """Begin a stance; return the contact, m: the pads shear under a force, N."""
        x, y = sample.x + fx * self._shear, sample.y + fy * self._shear
        sheared = fx * self.softness, fy * self.softness
        self._x, self._y = sheared if self._joints else (x, y)
        self.alarm.displacement = 0.0
        self.sd = math.hypot(self.noise, math.sqrt(sample.variance))
        return x, y

    def update(
        self, dt: float, sample: Sample, fx: float, fy: float
    ) -> tuple[float, bool, tuple[float, float]]:
        """Process a sample and its force without offset, N, dt seconds after the last one.

        Return slip speed, m/s, whether the alarm is on, and the place of the contact, m.
        """
        x, y = to_x, to_y = sample.x + fx * self._shear, sample.y + fy * self._shear
        if self._joints:
            to_x, to_y = fx * self.softness, fy * self.softness
        share = dt / (SMOOTHING + dt)
        self._x += share * (to_x - self._x)
        self._y += share * (to_y - self._y)
        self.sd = self.noise
        along_x, along_y = (to_x - self._x) / SMOOTHING, (to_y - self._y) / SMOOTHING
        if self._joints:
            self.sd = math.hypot(self.noise, math.sqrt(sample.variance))
            along_x, along_y = sample.vx + along_x, sample.vy + along_y
        else:
            x, y = self._x, self._y
        along = along_x * fx + along_y * fy
        pull = math.sqrt(fx * fx + fy * fy)
        # A foot gives way against its tangential force; the rest of its speed is only noise.
        speed = -along / pull if pull > 0.0 else 0.0
        # Errors of a velocity last, those of a place do not.
        allowed = max(SLOWEST_SLIP, SURE_SPEED * self.sd if self._joints else 0.0)
        distance = max(self._distance, SURE_PLACE * self.contact_noise)
        return speed, self.alarm.update(speed, allowed, distance, dt), (x, y)
