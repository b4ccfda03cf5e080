# SPDX-License-Identifier: Apache-2.0
"""Write the records of a replay into a new bag, to be shown beside the recorded one.

This needs no ROS except for the definition of the message type.
"""

from __future__ import annotations

import heapq
import json
import operator
import os
from collections.abc import Iterator

from ros_pad.bags import BagWriter
from ros_pad.bags.wire import TYPE, Wire
from ros_pad.pace import Progress
from ros_pad.records import Block
from ros_pad.trials.comparison import Stream
from ros_pad.trials.label import KEY
from ros_pad.trials.replay import Replay

_REPORT_EVERY = 100  # messages


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
    settings = replay.settings
    about = {
        'scene': settings.scene,
        'seed': settings.seed,
        'policy': settings.policy,
        'ambient_pressure': settings.ambient_pressure,
        'settings': {
            'foot': settings.foot.source,
            'expected_load': settings.expected_load,
            'replay_of': replay.bag,
            'replayed_with': replay.as_dict()['settings'],
        },
    }
    prefix = f'/{(namespace or "").strip("/")}/'.replace('//', '/')
    streams = [_messages(each, prefix) for each in replay.streams.values()]
    total = sum(len(each.times) for each in replay.streams.values())
    with BagWriter(folder, {KEY: json.dumps(about)}) as bag:
        for kind in replay.streams:
            bag.add_topic(f'{prefix}feet/{kind}', TYPE)
        merged = heapq.merge(*streams, key=operator.itemgetter(0))
        for done, (time_ns, name, data) in enumerate(merged, 1):
            bag.write(name, data, time_ns)
            if progress and (done % _REPORT_EVERY == 0 or done == total):
                progress(done / total)


def _messages(stream: Stream, prefix: str) -> Iterator[tuple[int, str, bytes]]:
    """Yield log time, ns, topic and bytes of each record."""
    encode, name = Wire(stream.kind, stream.legs).encode, f'{prefix}feet/{stream.kind.name}'
    for row, time_ns in enumerate(stream.times.tolist()):
        stamps, rows = stream.block
        yield time_ns, name, encode(Block(stamps[row : row + 1], rows[row : row + 1]))


__all__ = ['write']
