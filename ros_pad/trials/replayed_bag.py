# SPDX-License-Identifier: Apache-2.0
"""Write the records of a replay into a new bag, to be shown beside the recorded one."""

from __future__ import annotations

import json
import os

from ros_pad.bags import BagWriter
from ros_pad.bags.wire import TYPE, Wire
from ros_pad.records import Block
from ros_pad.trials.bag_notes import KEY
from ros_pad.trials.replay import Replay


def write(replay: Replay, folder: str | os.PathLike[str], namespace: str | None = None) -> None:
    """Write the estimates and commands of a replay into a new bag.

    Parameters
    ----------
    replay : Replay
        The replay to write.
    folder : path
        Folder of the new bag; must not exist.
    namespace : str or None
        Namespace of the topics.

    Raises
    ------
    BagError
        When the folder exists or cannot be written.
    """
    known = replay.as_dict()['settings']
    about = {name: known[name] for name in ('policy', 'ambient_pressure')}
    about['settings'] = {'replay_of': replay.bag, 'replayed_with': known} | {
        name: known[name] for name in ('foot', 'expected_load')
    }
    prefix = f'/{(namespace or "").strip("/")}/feet/'.replace('//', '/')
    messages = []
    with BagWriter(folder, {KEY: json.dumps(about)}) as bag:
        for kind, stream in replay.streams.items():
            bag.add_topic(prefix + kind, TYPE)
            wire = Wire(stream.kind, stream.legs)
            for time_ns, stamp_ns, rows in zip(
                stream.times.tolist(), stream.block.stamps.tolist(), stream.block.rows, strict=True
            ):
                messages.append((time_ns, prefix + kind, wire.encode(Block.of(stamp_ns, rows))))
        for time_ns, name, data in sorted(messages):
            bag.write(name, data, time_ns)


__all__ = ['write']
