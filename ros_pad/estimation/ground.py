# SPDX-License-Identifier: Apache-2.0
"""What each foot knows of the ground, from the windows of its samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ros_pad.contact import laws
from ros_pad.contact.resistance import THICK_FILM, Foot
from ros_pad.estimation import alarm, doubt
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.friction import Evidence, GroundFilter, GroundModel
from ros_pad.estimation.tuning import Tuning

if TYPE_CHECKING:
    from ros_pad.estimation.track import Window

MARGIN_SHARE = 0.05
"""Quantile of friction from which the friction margin is computed."""

RATIO_NOISE = 0.03
"""Model error of T/N, added to that of the sensors."""

CONCLUSIVE = 1.0
"""Change of the log odds of wet ground, up or down, above which a stance is conclusive."""

SURE = 0.9
"""Probability of wet or of dry ground above which a stance with enough pull leaves no doubt, even
if it is not conclusive."""

DOMED = 0.1
"""Share of the load on domes above which wet and dry ground cannot be distinguished."""

ALL_DOMED = 0.9
"""Share of the load on domes above which a foot is a dome, and not half inflated."""

PULLED = 1.5
"""Ratio of T/N to the expected friction of wet ground up to which a foot was not pulled enough:
the true friction of wet ground may be 1.5 times the expected one."""

LIGHT = 0.3
"""Share of the expected load below which sensor noise hides the friction."""

LONGEST_GAP = 0.15
"""Longest gap between samples of one stance, s: in a longer gap the foot may have stepped."""

NEW_PLACE = 5e-4
"""Distance over which a sliding foot meets new ground, m."""


class Stance:
    """Evidence of one stance.

    Attributes
    ----------
    dome_share : float
        Share of the expected load that domes carry, 0 to 1.
    peak_ratio, peak_turning : float
        Largest T/N of the pull, and of the friction used by turning, each
        as the mean of a window.
    counted : tuple of float or None
        T/N and place, m, of what earlier windows have shown; None to give the next full weight.
    """

    def __init__(self, dome_share: float = 0.0) -> None:
        self.dome_share = dome_share
        self.peak_ratio = self.peak_turning = 0.0
        self.counted: tuple[float, float, float] | None = None

    def weight(self, ratio: float, noise: float, x: float, y: float) -> float:
        """Return the share of a window that is new evidence, 0 to 1.

        A foot at the same place under the same pull repeats its measurement. So the weight grows
        with the change of T/N (relative to its noise) and of the place, m, since earlier windows.
        """
        if self.counted is None:
            self.counted = ratio, x, y
            return 1.0
        old_ratio, old_x, old_y = self.counted
        pull, dx, dy = ratio - old_ratio, x - old_x, y - old_y
        change = (pull / noise) ** 2 + (dx * dx + dy * dy) / NEW_PLACE**2
        weight = -math.expm1(-0.5 * change)
        self.counted = old_ratio + weight * pull, old_x + weight * dx, old_y + weight * dy
        return weight


class Ground:
    """What a foot knows of the ground.

    Parameters
    ----------
    foot : Foot
        The foot.
    expected_load : float
        Normal force in stance, N.
    tuning : Tuning
        Settings for sensors and ground.
    model : GroundModel
        What is assumed of the ground below all feet.

    Attributes
    ----------
    foot, expected_load, tuning
        As given.
    filter : GroundFilter
        Posterior.
    belief : tuple of float
        Probability of wet ground, and mean and standard deviation of friction.
    doubt : Doubt
        Why the ground is unobservable.
    quantile : float
        Friction that is exceeded with a probability of 1 - :data:`MARGIN_SHARE`.
    """

    def __init__(
        self, foot: Foot, expected_load: float, tuning: Tuning, model: GroundModel
    ) -> None:
        self.foot, self.expected_load, self.tuning = foot, expected_load, tuning
        self.filter = GroundFilter(model)
        self._stance = Stance()
        self._footprint: tuple[float, float] | None = None  # of the last stance, m
        self.belief = (tuning.wet_prior, *self.filter.friction)
        self.quantile = float(self.filter.quantile(MARGIN_SHARE))
        self.doubt = Doubt(doubt.NOT_YET)

    def touch_down(self, time: float, x: float, y: float, pressure: float) -> None:
        """Begin a stance at a time, s, and place, m, with a pressure, Pa."""
        self._stance = Stance(self._share_on_domes(pressure))
        distance = math.dist(self._footprint or (x, y), (x, y))
        self._footprint = x, y
        self.filter.touch_down(distance, self._stance.dome_share > DOMED, time)
        self.quantile = float(self.filter.quantile(MARGIN_SHARE))

    def lose(self) -> None:
        """Return to the prior, because the sensors are in doubt."""
        self.filter.reset()
        self.belief = self.filter.wet_probability, *self.filter.friction

    def forget(self, time: float) -> None:
        """Forget what the foot has learnt in wrong axes until a time, s."""
        self.filter.forget(time)
        self.belief = self.belief[0], *self.filter.friction

    def end_window(
        self,
        time: float,
        window: Window,
        place: Sequence[float],
        pressure: float,
        noises: tuple[float, float, float],
        turning_known: bool,
    ) -> None:
        """Use a window that ends at a time, s.

        Parameters
        ----------
        time : float
            Time, s.
        window : Window
            The window.
        place : tuple of float
            Place of the contact, m.
        pressure : float
            Gauge pressure in the pads, Pa.
        noises : tuple of float
            Standard deviations of a component of the force, of its offset, N, and of a coordinate
            of the contact, m.
        turning_known : bool
            Whether the torque about z was measured.
        """
        ground = self.filter
        self._follow_pressure(time, pressure)
        ground.update(self._evidence(time - window.start, window, place, noises, turning_known))
        self.quantile = float(ground.quantile(MARGIN_SHARE))
        self.belief = ground.wet_probability, *ground.friction
        self.doubt = self._unobservable(window.peak)

    def _unobservable(self, load: float) -> Doubt:
        """Return why this stance with its largest load, N, does not show the ground, if so."""
        stance, wet_friction = self._stance, self.filter.expected.flat_wet
        if stance.dome_share > ALL_DOMED:
            return Doubt(doubt.ALL_DOME)
        if stance.dome_share > DOMED:
            return Doubt(doubt.HALF, 100.0 * stance.dome_share)
        if abs(self.filter.log_odds) >= CONCLUSIVE:
            return Doubt()
        if load < LIGHT * self.expected_load:
            return Doubt(doubt.FAINT, load, self.expected_load)
        if stance.peak_turning > stance.peak_ratio:
            return Doubt(doubt.TURNING, stance.peak_turning, stance.peak_ratio)
        if stance.peak_ratio < PULLED * wet_friction:
            return Doubt(doubt.NOT_PULLED, stance.peak_ratio, wet_friction)
        if not 1.0 - SURE < self.belief[0] < SURE:
            return Doubt()
        return Doubt(doubt.UNDECIDED, *self.belief[1:])

    def _share_on_domes(self, pressure: float) -> float:
        return self.foot.dome_load(self.expected_load, pressure) / self.expected_load

    def _follow_pressure(self, time: float, pressure: float) -> None:
        """Begin a new stance at the same place when the foot changes its shape under load."""
        stance = self._stance
        before, stance.dome_share = stance.dome_share, self._share_on_domes(pressure)
        dome = stance.dome_share > DOMED
        if (before > DOMED) != dome:
            self.filter.touch_down(0.0, dome, time)
            stance.counted = None

    def _evidence(
        self,
        duration: float,
        window: Window,
        place: Sequence[float],
        noises: tuple[float, float, float],
        turning_known: bool,
    ) -> Evidence:
        """Return what a window shows."""
        count, (load, pull, turning, speed, speed_noise) = window.count, window.sums
        (force_noise, offset_sd, contact_noise), tuning = noises, self.tuning
        stance = self._stance
        pull, turning, load = pull / load, turning / load, load / count
        ratio = math.hypot(pull, turning)
        if turning > 0.0:
            share = turning / ratio / self.foot.turning_radius
            force_noise = math.hypot(force_noise, share * tuning.moment_noise)
        sensors = math.hypot(force_noise / math.sqrt(count), offset_sd) / load
        noise = math.hypot(RATIO_NOISE, sensors * math.sqrt(1.0 + ratio**2))
        stance.peak_ratio = max(stance.peak_ratio, pull)
        stance.peak_turning = max(stance.peak_turning, turning)
        # The error of the body's velocity is the same in the whole window.
        speed_noise /= count
        if tuning.source != 'joints':
            # The mean speed is the displacement of the smoothed contact over the duration. The
            # smoother starts from one sample, so its noise is larger at the start of a stance.
            spread = 2.0 * duration / (2.0 * alarm.SMOOTHING * count + duration)
            if window.first:
                spread = 0.5 * spread + 1.0
            marker = contact_noise * math.sqrt(spread) / duration
            speed_noise = math.hypot(alarm.SPEED_NOISE, marker)
        weight = stance.weight(ratio, noise, *place)
        scales = self._scales(load, stance.dome_share)
        return Evidence(
            ratio, noise, speed / count, speed_noise, duration, weight, turning_known, scales
        )

    def _scales(self, load: float, dome_share: float) -> tuple[float, float]:
        """Return friction at a load, N, over that at the expected load, on dry and on wet ground.

        The adhesion of a flat sole that touches all over does not grow with the load.
        """
        if dome_share > DOMED:
            return 1.0, 1.0
        prior = self.filter.shared.prior
        dry = self.foot.grip(load, 0.0) / load
        wet = laws.resistance(self.foot, 0.0, load, 0.0, 0.0, THICK_FILM) / load
        # Friction that is zero at one load is zero at all.
        return (
            dry / prior.flat_dry if prior.flat_dry else 1.0,
            wet / prior.flat_wet if prior.flat_wet else 1.0,
        )
