# SPDX-License-Identifier: Apache-2.0
"""Frames of messages: whose leg they say they are of."""

from __future__ import annotations

import re

from ros_pad.errors import InvalidInput

_OF_A_LEG = re.compile(r'(?:.*/)?leg_(\d+)_', re.DOTALL)


def check_frame(frame: str, leg: int) -> None:
    """Refuse a frame that names another leg: somebody has crossed two cables, or two topics.

    Parameters
    ----------
    frame : str
        ``header.frame_id``. One that names no leg, such as an empty one, ``world`` or a driver's
        own, is allowed; so is a prefix, as in ``robot_2/leg_1_pad``.
    leg : int
        The leg whose topic it came on.

    Raises
    ------
    InvalidInput
        When it names another leg.
    """
    if 'leg_' not in frame:  # most frames, at a tenth of the time
        return
    named = _OF_A_LEG.match(frame)
    if named and named[1] != str(leg):
        raise InvalidInput(
            f'frame_id = {frame[:80]!r} is not allowed on a topic of leg {leg}: empty, or the'
            " frame of this leg's own is needed"
        )
