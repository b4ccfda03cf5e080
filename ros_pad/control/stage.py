# SPDX-License-Identifier: Apache-2.0
"""Decision stage of a robot: collect the inputs of all legs, and decide at each estimate.

The controller node, the loop without ROS and replay use the same class.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_pad.control.morphology import MorphologyController
from ros_pad.control.policies import DOME
from ros_pad.estimation import doubt as doubts
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.records import COMMAND, Block

OLD = 0.2
"""Age above which the last position of a foot is not used, s."""

_ROW = COMMAND.dtype


@dataclass(slots=True)
class _Leg:
    """What came from a leg until its last decision."""

    position: tuple[float, float] = (math.nan, math.nan)
    positioned: float = 0.0  # time of the last estimate with a new position, s
    load: float = -math.inf  # largest one since the last decision, N
    pressure: float | None = None  # last reading since the last observation
    observed: float = math.nan  # time of the controller's last observation, s
    doubt: float = 0.0  # code of the doubt, if it is a fault of the sensors


class DecisionStage:
    """Collect estimates and pressures of all legs; decide at each estimate.

    A decision uses the largest load since the last one, because a bounce is not a step, and the
    last position, unless it is older than :data:`OLD`. Each pressure is used once. What a leg
    lacks concerns this leg only.

    Parameters
    ----------
    controller : MorphologyController
        Controller of all legs.
    legs : sequence of int
        Numbers of the legs, in the order of the rows of records.
    """

    def __init__(self, controller: MorphologyController, legs: Sequence[int]) -> None:
        self.controller = controller
        self._legs = {leg: _Leg() for leg in legs}
        self._domes: list[bool] = []  # morphologies of the last command

    def pressure(self, record: Block) -> None:
        """Store the readings of a PRESSURE record; NaN is none."""
        pressures = record.rows[-1]['pressure'].tolist()
        for known, pressure in zip(self._legs.values(), pressures, strict=True):
            if not math.isnan(pressure):
                known.pressure = pressure

    def decide(self, record: Block) -> Block:
        """Process an ESTIMATE record, and return the COMMAND record of the same time.

        The set-point of a leg is NaN if its load, position or probability of wet ground is missing
        or not allowed. A channel that receives no set-points vents its pad after the command
        timeout.
        """
        now_ns, row = record.last_ns, record.rows[-1]
        names = ('wetness', 'load', 'position', 'friction', 'doubt')
        estimates = zip(*(row[name].tolist() for name in names), strict=True)
        setpoints = [
            self._decide(leg, now_ns * 1e-9, estimate)
            for leg, estimate in zip(self._legs, estimates, strict=True)
        ]
        return self._command(now_ns, setpoints)

    def tick(self, now_ns: int) -> Block | None:
        """Observe the legs that have no estimates; call it every ``pace.TICK_PERIOD_NS``.

        Return a COMMAND record without set-points if a morphology has changed, else None.
        """
        now, observed = now_ns * 1e-9, False
        for leg, known in self._legs.items():
            if math.isnan(known.observed):
                known.observed = now
            elif abs(now - known.observed) > TICK_PERIOD_NS * 1e-9:
                self._observe(leg, now)
                observed = True
        if not observed:
            return None
        before = self._domes
        record = self._command(now_ns, [math.nan] * len(self._legs))
        return record if self._domes != before else None

    def _observe(self, leg: int, now: float) -> None:
        known = self._legs[leg]
        self.controller.observe(leg, now, known.pressure, known.doubt)
        known.pressure, known.observed = None, now

    def _decide(self, leg: int, now: float, estimate: tuple[Any, ...]) -> float:
        """Return the set-point of a leg, gauge Pa; NaN if there is none."""
        wetness, load, (x, y), friction, doubt = estimate
        known = self._legs[leg]
        if known.load < load < math.inf:
            known.load = load
        if not math.isnan(x + y):
            known.position, known.positioned = (x, y), now
        if not math.isnan(doubt):  # else the last one lasts
            known.doubt = doubt if doubt and doubts.is_fault(doubt) else 0.0
        self._observe(leg, now)
        whole = math.isfinite(load + sum(known.position)) and 0.0 <= wetness <= 1.0
        if not whole or now - known.positioned > OLD:
            return math.nan
        setpoint = self.controller.update(leg, known.load, wetness, known.position, friction)
        known.load = -math.inf
        return setpoint

    def _command(self, stamp_ns: int, setpoints: Sequence[float]) -> Block:
        controller = self.controller
        self._domes = [controller.morphology(leg) == DOME for leg in self._legs]
        rows = np.empty(len(setpoints), _ROW)
        rows['dome'], rows['setpoint'] = self._domes, setpoints
        return Block.of(stamp_ns, rows)
