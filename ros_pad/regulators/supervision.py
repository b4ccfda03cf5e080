# SPDX-License-Identifier: Apache-2.0
"""Supervision of all pressure regulators of a robot, on records.

Each channel works by itself, on its own clock; no message is needed to vent a pad.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ros_pad.records import PRESSURE, Block
from ros_pad.regulators.channel import Health, Level, SupervisedChannel

_ROW = PRESSURE.dtype


class Supervision:
    """Supervise the channels of a robot.

    Times ``elapsed_ns`` are on a clock that does not follow the time of day, stamps on that of the
    records.

    Parameters
    ----------
    channels : sequence of SupervisedChannel
        Channels of the legs, in the order of the rows of records.

    Attributes
    ----------
    channels : tuple of SupervisedChannel
        As given.
    """

    def __init__(self, channels: Sequence[SupervisedChannel]) -> None:
        self.channels = tuple(channels)
        self._ticked_ns = 0

    def activate(self, elapsed_ns: int) -> None:
        """Accept commands from now on, also of pads that were held."""
        self._ticked_ns = elapsed_ns
        for channel in self.channels:
            channel.activate(elapsed_ns)

    def deactivate(self, reason: str) -> None:
        """Vent all pads and accept no more commands."""
        for channel in self.channels:
            channel.deactivate(reason)

    def vent(self, reason: str) -> None:
        """Vent all pads; a vent that fails is logged, and :meth:`tick` tries again."""
        for channel in self.channels:
            channel.vent(reason)

    def close(self, reason: str) -> None:
        """Vent all pads, then close the devices; errors are logged, not raised."""
        # All vents first, because closing a device may take time.
        self.deactivate(f'closing the device: {reason}')
        for channel in self.channels:
            channel.close(reason)

    def command(self, record: Block, now_ns: int, elapsed_ns: int) -> None:
        """Process a COMMAND record.

        A set-point that is missing or not accepted concerns its own leg only.

        Parameters
        ----------
        record : Block
            The record; its age is that of its stamp.
        now_ns : int
            Present time, ns, on the clock of the stamp.
        elapsed_ns : int
            Present time, ns, on the clock of :meth:`tick`.
        """
        # Many commands may delay the tick that vents a pad of which they say nothing.
        for channel in self.channels:
            channel.expire(elapsed_ns)
        age = (now_ns - record.last_ns) * 1e-9
        setpoints = record.rows[-1]['setpoint'].tolist()
        for channel, setpoint in zip(self.channels, setpoints, strict=True):
            if not math.isnan(setpoint):
                channel.command(setpoint, age, elapsed_ns)

    def tick(self, elapsed_ns: int) -> None:
        """Vent pads whose command is too old, and repeat failed vents.

        Call this at every step of the clock, at least every 10 ms. When the clock is set back, the
        age of commands is unknown, and all pads are vented.
        """
        set_back, self._ticked_ns = elapsed_ns < self._ticked_ns, elapsed_ns
        for channel in self.channels:
            if channel.commanded_ns is None:
                if not channel.vented:
                    channel.vent(channel.held or 'an earlier vent was not confirmed')
            elif set_back:
                channel.vent('the clock was set back')
            else:
                channel.expire(elapsed_ns)

    def read(self, stamp_ns: int, elapsed_ns: int) -> Block:
        """Read all devices, and return the PRESSURE record of a time stamp, ns."""
        rows = np.array([channel.row(elapsed_ns) for channel in self.channels], _ROW)
        return Block.of(stamp_ns, rows)


def supply_health(channels: Sequence[SupervisedChannel]) -> Health:
    """Return level and message of the air supply that all channels share."""
    filled = [each for each in channels if each.sent]
    sagging = [str(each.leg) for each in filled if each.sags]
    # One sagging pad has a leak; when most of them sag, the supply is low.
    if len(sagging) > max(1, len(filled) // 2):
        return Health(
            Level.ERROR,
            f'the supply of air is low: pads of legs {", ".join(sagging)} are below their'
            ' set-points',
        )
    return Health(Level.OK, 'the supply of air is not low')
