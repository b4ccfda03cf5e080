# SPDX-License-Identifier: Apache-2.0
"""Write the records of a replay into a new bag, to be shown beside the recorded one."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator

from ros_pad.bags import BagWriter
from ros_pad.bags.wire import TYPE, Wire
from ros_pad.pace import Progress
from ros_pad.records import Block
from ros_pad.trials.comparison import Stream
from ros_pad.trials.label import KEY
from ros_pad.trials.replay import Replay


def write(
    replay: Replay,
    folder: str | os.PathLike[str],
    namespace: str | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the estimates and commands of a replay into a new bag.

    Parameters
    ----------
    replay : Replay
        The replay to write.
    folder : path
        Folder of the new bag; must not exist.
    namespace : str or None
        Namespace of the topics.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Raises
    ------
    BagError
        When the folder exists or cannot be written, or the message type is not installed.
    """
    known = replay.as_dict()['settings']
    about = {
        'policy': known['policy'],
        'ambient_pressure': known['ambient_pressure'],
        'settings': {
            'foot': known['foot'],
            'expected_load': known['expected_load'],
            'replay_of': replay.bag,
            'replayed_with': known,
        },
    }
    prefix = f'/{(namespace or "").strip("/")}/feet/'.replace('//', '/')
    messages = sorted(
        message for stream in replay.streams.values() for message in _messages(stream, prefix)
    )
    with BagWriter(folder, {KEY: json.dumps(about)}) as bag:
        for kind in replay.streams:
            bag.add_topic(prefix + kind, TYPE)
        for done, (time_ns, name, data) in enumerate(messages, 1):
            bag.write(name, data, time_ns)
            if progress and (done % 100 == 0 or done == len(messages)):
                progress(done / len(messages))


def _messages(stream: Stream, prefix: str) -> Iterator[tuple[int, str, bytes]]:
    """Yield log time, ns, topic and bytes of each record."""
    encode, (stamps, rows) = Wire(stream.kind, stream.legs).encode, stream.block
    for row, time_ns in enumerate(stream.times.tolist()):
        each = Block(stamps[row : row + 1], rows[row : row + 1])
        yield time_ns, prefix + stream.kind.name, encode(each)


__all__ = ['write']
