# SPDX-License-Identifier: Apache-2.0
"""Check the leg that the frame of a message names."""

from __future__ import annotations

import functools
import re

from ros_pad.errors import InvalidInput

_OF_A_LEG = re.compile(r'(?:.*/)?leg_(\d+)_', re.DOTALL)


@functools.lru_cache(maxsize=64)
def check_frame(frame: str, leg: int) -> None:
    """Refuse a frame that names another leg, because two cables or topics may be swapped.

    Parameters
    ----------
    frame : str
        ``header.frame_id``. A frame that names no leg, for instance an empty one or ``world``, is
        allowed; so is a prefix, as in ``robot_2/leg_1_pad``.
    leg : int
        The leg of the topic.

    Raises
    ------
    InvalidInput
        When the frame names another leg.
    """
    named = _OF_A_LEG.match(frame)
    if named and named[1] != str(leg):
        raise InvalidInput(
            f'frame_id = {frame[:80]!r} is not allowed on a topic of leg {leg}: a frame of this'
            ' leg is needed, or one that names no leg'
        )
