# SPDX-License-Identifier: Apache-2.0
"""Gait of a simulated robot: phases of the feet, and intended motion of body and feet.

In a gait with pushes, as that of the thesis' hexapod, the legs stand in two groups in turn. The
body's intended speed is a raised cosine with two pushes a cycle, one for each group, U(t) = V (1 -
cos 4πt/T), V = stride/T. It is zero in the middle of the times at which both groups stand. The
peak acceleration 4πV/T sets the demand on level ground. In other gaits the speed rises to V in the
first cycle and then stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from ros_pad.simulation import planar_step

SHORTEST_OVERLAP = 0.02
"""Least share of the cycle in which a foot takes over its load."""

Place = tuple[float, float, float]


@dataclass(frozen=True)
class WalkingGait:
    """When each leg stands, and how the body moves meanwhile.

    Attributes
    ----------
    cycle : float
        Duration of a gait cycle, s.
    stride : float
        Advance of the body in a cycle without slip, m.
    duty : float
        Share of the cycle in which a foot stands.
    lift : float
        Height of the foot in the middle of its swing, m.
    middles : tuple of float
        Share of the cycle at which the stance of each leg is in its middle.
    pushes : bool
        Whether the body speeds up and brakes twice a cycle; the middles are then 0.25 and 0.75.
    """

    cycle: float
    stride: float
    duty: float
    lift: float
    middles: tuple[float, ...]
    pushes: bool

    @property
    def stance(self) -> float:
        """Duration of a stance, s."""
        return self.duty * self.cycle

    @cached_property
    def fewest(self) -> int:
        """Fewest legs that stand at once, at least 1."""
        # The number falls only where a leg lifts off.
        ends = [middle + 0.5 * self.duty + 1e-9 for middle in self.middles]
        return max(1, min(sum(map(self._stands, [end] * len(ends), self.middles)) for end in ends))

    def _stands(self, share: float, middle: float) -> bool:
        return (share - middle + 0.5 * self.duty) % 1.0 < self.duty

    @cached_property
    def overlap(self) -> float:
        """Share of the cycle in which load passes from a leg that lifts off to one that landed."""
        if self.pushes:
            return self.duty - 0.5
        waits = [
            (other - each + self.duty) % 1.0 for each in self.middles for other in self.middles
        ]
        shortest = min(wait for wait in waits if wait > 0.5 * SHORTEST_OVERLAP)
        return max(SHORTEST_OVERLAP, min(shortest, 0.5 * self.duty))

    def body_advance(self, time: float) -> float:
        """Return the intended advance of the body since time zero, m."""
        return planar_step.body_advance(self, time)

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration of the body, m/s²."""
        return (4.0 if self.pushes else 0.5) * math.pi * self.stride / self.cycle**2

    def phase(self, index: int, time: float) -> float:
        """Return the time since a leg's last touch-down, as a share of the cycle in [0, 1).

        The foot stands while this is below ``duty``. Legs count from 0.
        """
        return (time / self.cycle - self.middles[index] + self.duty / 2.0) % 1.0

    def reach(self) -> float:
        """Return the distance of a foot ahead of its home position at touch-down, m."""
        if not self.pushes:
            return 0.5 * self.duty * self.stride
        half = self.duty * self.cycle / 2.0
        middle = self.cycle / 4.0
        return self.body_advance(middle + half) - self.body_advance(middle)

    def planted(self) -> list[tuple[float, float]]:
        """Return phase, and distance ahead of home, m, of each foot at time 0.

        The feet are placed as if the gait had run before.
        """
        reach, found = self.reach(), []
        for leg in range(len(self.middles)):
            phase = self.phase(leg, 0.0)
            if phase < self.duty:
                ahead = reach + self.body_advance(-phase * self.cycle)
            else:
                ahead = (2.0 * self.swing(phase)[0] - 1.0) * reach
            found.append((phase, ahead))
        return found

    def swing(self, phase: float) -> tuple[float, float]:
        """Return the progress of a swing, 0 to 1, and the height of the foot, m, at a phase.

        The phase is a share of the cycle, from ``duty`` (lift-off) to 1 (touch-down).
        """
        share = (phase - self.duty) / (1.0 - self.duty)
        rise = math.sin(math.pi * share)
        return 0.5 - 0.5 * math.cos(math.pi * share), self.lift * rise * rise


class FootPath:
    """Positions of the feet in the body that the gait prescribes.

    Parameters
    ----------
    gait : WalkingGait
        Gait, whose clock starts at zero; the feet are placed as if the gait had run before.
    homes : sequence of (float, float, float)
        Home positions of the feet in the body, fore, left and up, m.

    Attributes
    ----------
    feet : list of tuple
        Positions of the feet in the body: fore, left and up, m.
    swings : list of bool
        For each of these feet, whether it is in swing.
    """

    def __init__(self, gait: WalkingGait, homes: Sequence[Place]) -> None:
        self._gait = gait
        self._homes = homes
        self._reach = gait.reach()
        self._advance = gait.body_advance(0.0)
        planted = gait.planted()
        self.swings = [phase >= gait.duty for phase, _ in planted]
        self._offsets = [(ahead, 0.0) for _, ahead in planted]
        self._lifted = list(self._offsets)
        self.feet = list(homes)
        self.move(0.0, 0.0)

    def move(self, time: float, turn: float) -> None:
        """Move the feet to a time of the gait, s, to turn the body by an angle, rad, meanwhile."""
        before, self._advance = self._advance, self._gait.body_advance(time)
        advance = self._advance - before
        offsets, feet, gait = self._offsets, self.feet, self._gait
        swings, self.swings = self.swings, []
        for index, (home_x, home_y, height) in enumerate(self._homes):
            x, y = offsets[index]
            phase = gait.phase(index, time)
            self.swings.append(phase >= gait.duty)
            if phase < gait.duty:
                # The foot moves in the body against the motion of the body.
                x, y = x - advance + turn * (home_y + y), y - turn * (home_x + x)
            else:
                if not swings[index]:
                    self._lifted[index] = (x, y)
                progress, rise = gait.swing(phase)
                height += rise
                from_x, from_y = self._lifted[index]
                x, y = from_x + progress * (self._reach - from_x), from_y * (1.0 - progress)
            offsets[index] = (x, y)
            feet[index] = (home_x + x, home_y + y, height)
