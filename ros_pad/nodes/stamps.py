# SPDX-License-Identifier: Apache-2.0
"""Time stamps of messages in ns."""

from __future__ import annotations

from builtin_interfaces.msg import Time


def nanoseconds(stamp: Time) -> int:
    """Return a stamp in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def split(time_ns: int) -> tuple[int, int]:
    """Return a time in ns as whole seconds and the nanoseconds after them.

    Seconds beyond the 32 bits of a stamp wrap round, as they do in rclpy.
    """
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return (seconds + 2**31) % 2**32 - 2**31, rest


def set_stamp(stamp: Time, time_ns: int) -> None:
    """Write a time in ns into a stamp."""
    stamp.sec, stamp.nanosec = divmod(time_ns, 1_000_000_000)
