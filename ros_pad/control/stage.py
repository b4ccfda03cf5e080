# SPDX-License-Identifier: Apache-2.0
"""Decision stage of one leg: collect its inputs, and decide when an estimate arrives.

The controller node, the loop without ROS and replay use the same class. Only the probability of
wet ground (``wetness``) triggers a decision, because the estimator publishes it last of the values
of an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from ros_pad.control.morphology import FootState
from ros_pad.control.morphology import MorphologyController
from ros_pad.errors import InvalidInput
from ros_pad.estimation import sensor_fault
from ros_pad.estimation.stage import Emission
from ros_pad.pace import TICK_PERIOD_NS

OLD = 0.2
"""Age above which the last position of a foot is not used, s."""

NOWHERE = (math.nan, math.nan)


class Decision(NamedTuple):
    """Result of an estimate.

    Attributes
    ----------
    setpoint : float or None
        Gauge pressure, Pa; None if load, position or estimate is missing, rejected or not finite.
        A channel that receives no set-points vents its pad after the command timeout.
    morphology : str or None
        ``flat`` or ``dome`` if it differs from that of the last decision, else None.
    """

    setpoint: float | None
    morphology: str | None


class DecisionStage:
    """Collect loads, positions, pressures, friction and doubts of a leg; decide at each estimate.

    A decision uses the largest load since the last one, because a bounce is not a step, and the
    last position. Each pressure is used once.

    Parameters
    ----------
    controller : MorphologyController
        Controller, which all legs share.
    leg : int
        Number of the leg.
    reject : callable or None
        Called with the error when an estimate is rejected; no set-point follows from it.
    """

    def __init__(
        self,
        controller: MorphologyController,
        leg: int,
        reject: Callable[[InvalidInput], None] | None = None,
    ) -> None:
        self.controller = controller
        self.leg = leg
        self._reject = reject
        self._position = NOWHERE
        self._new_position = False
        self._position_time = 0.0  # time of the last estimate with a new position, s
        self._load, self._largest = math.nan, -math.inf
        self._friction = math.nan
        self._pressure: float | None = None  # last reading since the last observation
        self._observed: float | None = None  # time of the controller's last observation, s
        self._morphology = ''
        self._sensor_fault = ''

    def load(self, load: float) -> None:
        """Process a normal force, N."""
        self._load = load
        if self._largest < load < math.inf:
            self._largest = load

    def position(self, x: float, y: float) -> None:
        """Store a position of the foot, m."""
        self._position = x, y
        self._new_position = True

    def pressure(self, gauge: float) -> None:
        """Store a gauge pressure of the pad, Pa."""
        self._pressure = gauge

    def friction(self, friction: float) -> None:
        """Store an estimate of the coefficient of friction."""
        self._friction = friction

    def doubt(self, doubt: str) -> None:
        """Process a doubt of the estimator; only faults of sensors change decisions."""
        self._sensor_fault = sensor_fault(doubt)

    def estimate(self, now: float, wet_probability: float) -> Decision:
        """Process an estimate, and decide.

        Parameters
        ----------
        now : float
            Present time, s; the same clock for all legs.
        wet_probability : float
            Probability of wet ground, 0 to 1.
        """
        state = self._state(now, wet_probability)
        setpoint = None
        try:
            setpoint = self.controller.decide(self.leg, state)
        except InvalidInput as error:
            if self._reject:
                self._reject(error)
        if setpoint is not None:
            self._largest = -math.inf
        return Decision(setpoint, self._new_morphology())

    def take(self, now: float, emission: Emission) -> Decision:
        """Process an emission of the estimation stage at the present time, s, and decide."""
        self.load(emission.load)
        if emission.position is not None:
            self.position(*emission.position)
        self.friction(emission.estimate.friction_mean)
        return self.estimate(now, emission.estimate.wet_probability)

    def tick(self, now: float) -> Decision | None:
        """Observe a leg that has no estimates; call it every ``pace.TICK_PERIOD_NS``.

        Return a decision without a set-point, or None if the leg has had an estimate.
        """
        if self._observed is None:
            self._observed = now
        elif abs(now - self._observed) > TICK_PERIOD_NS * 1e-9:
            self.controller.observe(self.leg, now, self._take_pressure(now), self._sensor_fault)
            return Decision(None, self._new_morphology())
        return None

    def _state(self, now: float, wet_probability: float) -> FootState:
        """Return the inputs of a decision; NaN for those that are missing."""
        if self._new_position:
            self._new_position = False
            self._position_time = now
        current = now - self._position_time <= OLD
        load = self._load
        return FootState(
            time=now,
            wet_probability=wet_probability,
            # If no load has arrived since the last decision, the last load is used again.
            load=max(self._largest, load) if math.isfinite(load) else load,
            position=self._position if current else NOWHERE,
            pressure=self._take_pressure(now),
            sensor_fault=self._sensor_fault,
            friction=self._friction,
        )

    def _take_pressure(self, now: float) -> float | None:
        pressure, self._pressure = self._pressure, None
        self._observed = now
        return pressure

    def _new_morphology(self) -> str | None:
        morphology = self.controller.morphology(self.leg)
        if morphology == self._morphology:
            return None
        self._morphology = morphology
        return morphology
