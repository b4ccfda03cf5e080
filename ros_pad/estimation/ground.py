# SPDX-License-Identifier: Apache-2.0
"""What the feet feel of the ground: their samples in windows, and the filters that these update."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ros_pad.contact.resistance import THICK_FILM
from ros_pad.contact.resistance import Foot
from ros_pad.estimation import doubt
from ros_pad.estimation import friction
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.friction import MODEL_ERROR
from ros_pad.estimation.friction import Evidence
from ros_pad.estimation.friction import GroundFilter
from ros_pad.estimation.friction import GroundModel
from ros_pad.estimation.parts import History
from ros_pad.estimation.parts import Path
from ros_pad.estimation.parts import Stance
from ros_pad.estimation.scales import FrictionPrior
from ros_pad.estimation.scales import FrictionScales
from ros_pad.estimation.sensing import DEAD
from ros_pad.estimation.tuning import Tuning
from ros_pad.estimation.watch import LONGEST_GAP
from ros_pad.records import Array

HINDSIGHT = DEAD + LONGEST_GAP
"""Time for which earlier posteriors are kept, s: no sensor fault stays undetected for longer."""

MARGIN_SHARE = 0.05
"""Quantile of friction from which the friction margin is computed."""

SUMS = 6
"""Sums over a window: samples, normal force, tangential force, friction used by turning, slip
speed, and its standard deviation."""


class Window:
    """A window of the samples of a foot, as the filter needs it.

    Attributes
    ----------
    foot : int
        Place of the foot.
    row : int
        Its last sample.
    time, start : float
        Its end and beginning, s.
    first : bool
        Whether it is the first one of its stance.
    sums : list of float
        See :data:`SUMS`.
    """

    __slots__ = ('first', 'foot', 'row', 'start', 'sums', 'time')

    def __init__(
        self, foot: int, row: int, time: float, start: float, first: bool, sums: list[float]
    ) -> None:
        self.foot, self.row, self.time, self.start = foot, row, time, start
        self.first, self.sums = first, sums


class Grounds:
    """What each foot knows of the ground.

    Parameters
    ----------
    foot : Foot
        All feet are of this kind.
    expected_load : float
        Normal force in stance, N.
    tuning : Tuning
        Settings for sensors and ground.
    shared : FrictionScales
        What the feet learn of friction together.
    feet : int
        Number of feet.

    Attributes
    ----------
    shared : FrictionScales
        As given.
    filters : list of GroundFilter
        Posterior of each foot.
    beliefs : list of tuple
        Probability of wet ground, and mean and standard deviation of friction, of each foot.
    quantiles : list of float
        Friction of each foot that is exceeded with a probability of 1 - :data:`MARGIN_SHARE`.
    state : array (9, feet)
        Sums over the present window, its start, whether it is the first of its stance, and the
        largest normal force of the stance, N.
    """

    def __init__(
        self, foot: Foot, expected_load: float, tuning: Tuning, shared: FrictionScales, feet: int
    ) -> None:
        self._foot, self._expected_load, self._tuning = foot, expected_load, tuning
        self.shared = shared
        model = GroundModel(
            shared, tuning.wet_prior, tuning.patch_length, 0.5, tuning.rim_speed(foot), MODEL_ERROR
        )
        self.filters = [GroundFilter(shared, model=model) for _ in range(feet)]
        self.paths = [Path() for _ in range(feet)]
        self.histories = [History(HINDSIGHT) for _ in range(feet)]
        self._stances = [Stance() for _ in range(feet)]
        self.beliefs = [(tuning.wet_prior, *each.friction) for each in self.filters]
        self.quantiles = np.array([each.quantile(MARGIN_SHARE) for each in self.filters])
        self.state = np.zeros((SUMS + 3, feet))

    def touch_down(self, foot: int, time: float, x: float, y: float, pressure: float) -> None:
        """Begin a stance of a foot at a time, s, and place, m, with a pressure, Pa."""
        ground, stance = self.filters[foot], Stance(self._share_on_domes(pressure))
        self._stances[foot] = stance
        ground.touch_down(
            self.paths[foot].touch_down(time, x, y), stance.dome_share > doubt.DOMED, time
        )
        self.histories[foot].add(time, ground.posterior)
        self.quantiles[foot] = ground.quantile(MARGIN_SHARE)
        self.begin(foot, time)
        self.state[SUMS + 2, foot] = 0.0

    def begin(self, foot: int, time: float) -> None:
        """Begin a window of a foot at a time, s, as in the beginning of a stance."""
        self.state[:SUMS, foot] = 0.0
        self.state[SUMS : SUMS + 2, foot] = time, 1.0

    def lose(self, foot: int, dt: float, place: tuple[float, float] | None, since: float) -> bool:
        """Undo what a foot has felt since a time, s, as its sensors are in doubt, and fade.

        The sample is dt seconds after the last one, at a place, m, None if that is unknown.
        Return whether the posterior has changed.
        """
        ground, path = self.filters[foot], self.paths[foot]
        posterior = self.histories[foot].undo(since)
        if posterior is not None:
            ground.posterior = posterior
        distance = path.seen(*place) if place else path.unseen(dt)
        if distance:
            ground.fade(distance)
        changed = posterior is not None or distance > 0.0
        friction = ground.friction if changed else self.beliefs[foot][1:]
        self.beliefs[foot] = ground.wet_probability, *friction
        return changed

    def forget(self, foot: int, time: float) -> None:
        """Forget what a foot has learnt in wrong axes until a time, s."""
        self.histories[foot].clear()
        self.filters[foot].forget(time)
        self.beliefs[foot] = self.beliefs[foot][0], *self.filters[foot].friction

    def add(
        self,
        times: Sequence[float],
        values: Array,
        stands: Array,
        places: Array,
        pressures: Sequence[float],
        noises: Array,
        known: Array | None,
    ) -> dict[int, Doubt]:
        """Process samples; return the doubts of the feet whose filters have been updated.

        Parameters
        ----------
        times : sequence of float
            Times, s.
        values : array (samples, SUMS, feet)
            What is summed up in windows.
        stands : array of bool (feet,)
            Which feet stand; the others do not count.
        places : array (samples, 2, feet)
            Places of the contacts, m.
        pressures : sequence of float
            Gauge pressures in the pads, Pa.
        noises : array (3, feet)
            Standard deviations of a component of the force, of its offset, N, and of a coordinate
            of the contact, m.
        known : array of bool (samples, feet) or None
            Whether the torque about z was measured; None: never.
        """
        state, found = self.state, {}
        sums = np.add.accumulate(values)
        period = self._tuning.filter_period - 1e-9
        while True:
            due = np.flatnonzero(stands & (times[-1] - state[SUMS] >= period)).tolist()
            if not due:
                break
            windows = [self._window(foot, times, sums, period) for foot in due]
            for each in windows:
                peak = values[: each.row + 1, 1, each.foot].max()
                self._stances[each.foot].peak_load = max(state[SUMS + 2, each.foot], peak)
                self._follow_pressure(each, pressures[each.foot])
            samples = [
                self._evidence(
                    each, places[each.row, :, each.foot].tolist(),
                    noises[:, each.foot].tolist(),
                    known is not None and bool(known[each.row, each.foot]),
                ) for each in windows
            ]  # fmt: skip
            friction.update([self.filters[foot] for foot in due], samples)
            for each in windows:
                found[each.foot] = self._use(each)
        state[:SUMS] += sums[-1]
        state[SUMS + 2] = np.maximum(state[SUMS + 2], np.maximum.reduce(values[:, 1]))
        return found

    def _window(self, foot: int, times: Sequence[float], sums: Array, period: float) -> Window:
        """Return the next window of a foot that ends in these samples, and begin another one."""
        start, first = self.state[SUMS : SUMS + 2, foot].tolist()
        row = next(row for row, time in enumerate(times) if time - start >= period)
        found = self.state[:SUMS, foot] + sums[row, :, foot]
        self.state[:SUMS, foot] = -sums[row, :, foot]
        self.state[SUMS : SUMS + 2, foot] = times[row], 0.0
        return Window(foot, row, times[row], start, first > 0.0, found.tolist())

    def _use(self, window: Window) -> Doubt:
        """Use the updated filter of a foot; return why its ground is unobservable."""
        foot, ground, stance = window.foot, self.filters[window.foot], self._stances[window.foot]
        self.histories[foot].add(window.time, ground.posterior)
        self.quantiles[foot] = ground.quantile(MARGIN_SHARE)
        self.beliefs[foot] = wet, mean, sd = ground.wet_probability, *ground.friction
        evidence = doubt.StanceEvidence(
            stance.dome_share, ground.log_odds, stance.peak_load, stance.peak_ratio,
            stance.peak_turning, wet, mean, sd,
        )  # fmt: skip
        return doubt.of_ground(evidence, ground.expected.medians, self._expected_load)

    def _share_on_domes(self, pressure: float) -> float:
        return self._foot.dome_load(self._expected_load, pressure) / self._expected_load

    def _follow_pressure(self, window: Window, pressure: float) -> None:
        """Begin a new stance at the same place when a foot changes its morphology under load."""
        stance = self._stances[window.foot]
        before, stance.dome_share = stance.dome_share, self._share_on_domes(pressure)
        dome = stance.dome_share > doubt.DOMED
        if (before > doubt.DOMED) != dome:
            self.filters[window.foot].touch_down(0.0, dome, window.time)
            stance.counted = None

    def _evidence(
        self, window: Window, place: list[float], noises: list[float], turning_known: bool
    ) -> Evidence:
        """Return what a window shows."""
        count, load, pull, turning, speed, speed_noise = window.sums
        (force_noise, offset_sd, contact_noise), tuning = noises, self._tuning
        stance, duration = self._stances[window.foot], window.time - window.start
        pull, turning, load = pull / load, turning / load, load / count
        ratio = math.hypot(pull, turning)
        if turning > 0.0:
            share = turning / ratio / self._foot.turning_radius
            force_noise = math.hypot(force_noise, share * tuning.moment_noise)
        sensors = math.hypot(force_noise / math.sqrt(count), offset_sd) / load
        noise = math.hypot(tuning.ratio_noise, sensors * math.sqrt(1.0 + ratio**2))
        stance.peak_ratio = max(stance.peak_ratio, pull)
        stance.peak_turning = max(stance.peak_turning, turning)
        # The error of the body's velocity is the same in the whole window.
        speed_noise /= count
        if tuning.source != 'joints':
            # The mean speed is the displacement of the smoothed contact over the duration. The
            # smoother starts from one sample, so its noise is larger at the start of a stance.
            spread = 2.0 * duration / (2.0 * tuning.smoothing * count + duration)
            if window.first:
                spread = 0.5 * spread + 1.0
            speed_noise = math.hypot(
                tuning.speed_noise, contact_noise * math.sqrt(spread) / duration
            )
        weight = stance.weight(ratio, noise, *place)
        scales = self._scales(load, stance.dome_share)
        return Evidence(
            ratio, noise, speed / count, speed_noise, duration, weight, turning_known, scales
        )

    def _scales(self, load: float, dome_share: float) -> tuple[float, float]:
        """Return friction at a load, N, over that at the expected load, on dry and on wet ground.

        The adhesion of a flat sole that touches all over does not grow with the load.
        """
        if dome_share > doubt.DOMED:
            return 1.0, 1.0
        kernel, prior = self._foot.resistance_of, self.shared.prior
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
