# SPDX-License-Identifier: Apache-2.0
"""Write the records of a replay into a new bag, to be shown beside the recorded one.

This needs no ROS except for the definition of the message type.
"""

from __future__ import annotations

import json
import os

import numpy as np

from ros_pad.bags import BagWriter
from ros_pad.bags.wire import TYPE
from ros_pad.bags.wire import Wire
from ros_pad.pace import Progress
from ros_pad.records import Block
from ros_pad.trials.label import KEY
from ros_pad.trials.replay import Replay

_REPORT_EVERY = 1000  # messages


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
    streams = list(replay.streams.values())
    with BagWriter(folder, {KEY: json.dumps(about)}) as bag:
        for each in streams:
            bag.add_topic(f'{prefix}feet/{each.kind.name}', TYPE)
        wires = [Wire(each.kind, each.legs) for each in streams]
        sources = np.repeat(np.arange(len(streams)), [len(each.times) for each in streams])
        rows = np.concatenate([np.arange(len(each.times)) for each in streams])
        order = np.argsort(np.concatenate([each.times for each in streams]), kind='stable')
        for done, place in enumerate(order, 1):
            stream, row = streams[sources[place]], rows[place]
            record = Block(*(each[row : row + 1] for each in stream.block))
            data = wires[sources[place]].encode(record)
            bag.write(f'{prefix}feet/{stream.kind.name}', data, int(stream.times[row]))
            if progress and (done % _REPORT_EVERY == 0 or done == len(order)):
                progress(done / len(order))


__all__ = ['write']
