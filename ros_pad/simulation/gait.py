# SPDX-License-Identifier: Apache-2.0
"""Tripod gait: when each foot stands, and where in the body it is meant to be.

The body's intended speed is a raised cosine with two pushes a cycle, one for each tripod,
U(t) = V (1 - cos 4πt/T), V = stride/T. It is zero when the tripods change, so that both can
stand together there, and its peak acceleration 4πV/T is what makes grip matter on level ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TRIPODS = ((1, 3, 5), (2, 4, 6))


@dataclass(frozen=True)
class TripodGait:
    """Legs 1, 3, 5 and legs 2, 4, 6 push in turn.

    Attributes
    ----------
    cycle : float
        Duration of a gait cycle, s.
    stride : float
        Advance of the body in a cycle without slip, m.
    duty : float
        Share of the cycle that a foot stands, in [0.5, 0.9].
    lift : float
        Height of the foot in the middle of its swing, m.
    """

    cycle: float
    stride: float
    duty: float
    lift: float

    def body_speed(self, time: float) -> float:
        """Intended speed of the body, m/s."""
        return self.stride / self.cycle * (1.0 - math.cos(4.0 * math.pi * time / self.cycle))

    def body_advance(self, time: float) -> float:
        """Intended advance of the body since time zero, m."""
        angle = 4.0 * math.pi * time / self.cycle
        return self.stride / self.cycle * (time - self.cycle / (4.0 * math.pi) * math.sin(angle))

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration of the body, m/s²."""
        return 4.0 * math.pi * self.stride / self.cycle**2

    def phase(self, leg: int, time: float) -> float:
        """Time since the leg's last touch-down, as a share of the cycle in [0, 1).

        The foot stands while this is below ``duty``.
        """
        middle = 0.25 if leg in TRIPODS[0] else 0.75
        return (time / self.cycle - middle + self.duty / 2.0) % 1.0

    def load_share(self, phase: float) -> float:
        """How much of a full share of the body's weight a foot takes, 0 in swing to 1."""
        overlap = self.duty - 0.5
        if phase >= self.duty:
            return 0.0
        edge = min(phase, self.duty - phase)
        if edge >= overlap:
            return 1.0
        ramp = edge / overlap
        return ramp * ramp * (3.0 - 2.0 * ramp)

    def reach(self) -> float:
        """Distance of the foot ahead of its home position at touch-down, m."""
        half = self.duty * self.cycle / 2.0
        middle = self.cycle / 4.0
        return self.body_advance(middle + half) - self.body_advance(middle)

    def swing(self, phase: float) -> tuple[float, float]:
        """Progress from lift-off (0) to touch-down (1), and height of the foot, m."""
        share = (phase - self.duty) / (1.0 - self.duty)
        rise = math.sin(math.pi * share)
        return 0.5 - 0.5 * math.cos(math.pi * share), self.lift * rise * rise
