# SPDX-License-Identifier: Apache-2.0
"""Tripod gait: phases of the feet, and intended motion of body and feet.

The body's intended speed is a raised cosine with two pushes a cycle, one for each tripod,
U(t) = V (1 - cos 4πt/T), V = stride/T. It is zero in the middle of the times at which both tripods
stand. The peak acceleration 4πV/T sets the demand on level ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TRIPODS = ((1, 3, 5), (2, 4, 6))


@dataclass(frozen=True)
class TripodGait:
    """Tripod gait, in which legs 1, 3, 5 and legs 2, 4, 6 push in turn.

    Attributes
    ----------
    cycle : float
        Duration of a gait cycle, s.
    stride : float
        Advance of the body in a cycle without slip, m.
    duty : float
        Share of the cycle in which a foot stands, 0.5 to 0.9.
    lift : float
        Height of the foot in the middle of its swing, m.
    """

    cycle: float
    stride: float
    duty: float
    lift: float

    def body_advance(self, time: float) -> float:
        """Return the intended advance of the body since time zero, m."""
        angle = 4.0 * math.pi * time / self.cycle
        return self.stride / self.cycle * (time - self.cycle / (4.0 * math.pi) * math.sin(angle))

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration of the body, m/s²."""
        return 4.0 * math.pi * self.stride / self.cycle**2

    def phase(self, leg: int, time: float) -> float:
        """Return the time since the leg's last touch-down, as a share of the cycle in [0, 1).

        The foot stands while this is below ``duty``.
        """
        middle = 0.25 if leg in TRIPODS[0] else 0.75
        return (time / self.cycle - middle + self.duty / 2.0) % 1.0

    def reach(self) -> float:
        """Return the distance of a foot ahead of its home position at touch-down, m."""
        half = self.duty * self.cycle / 2.0
        middle = self.cycle / 4.0
        return self.body_advance(middle + half) - self.body_advance(middle)

    def swing(self, phase: float) -> tuple[float, float]:
        """Return the progress of a swing, 0 to 1, and the height of the foot, m, at a phase.

        The phase is a share of the cycle, from ``duty`` (lift-off) to 1 (touch-down).
        """
        share = (phase - self.duty) / (1.0 - self.duty)
        rise = math.sin(math.pi * share)
        return 0.5 - 0.5 * math.cos(math.pi * share), self.lift * rise * rise
