# SPDX-License-Identifier: Apache-2.0
"""Write the messages of a replay into a new bag, to be shown beside the recorded one.

This needs no ROS except for the definitions of the message types.
"""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Iterator

from ros_pad.bags import BagWriter
from ros_pad.bags import codec
from ros_pad.bags.definitions import message_definition
from ros_pad.bags.fields import FieldWriter
from ros_pad.bags.topics import FRAME
from ros_pad.bags.topics import STAMP
from ros_pad.bags.topics import TRIAL
from ros_pad.bags.topics import Topic
from ros_pad.pace import Progress
from ros_pad.trials.comparison import Track
from ros_pad.trials.label import KEY
from ros_pad.trials.replay import Replay

_REPORT_EVERY = 1000  # messages


def write(
    replay: Replay,
    folder: str | os.PathLike[str],
    namespace: str | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the replayed topics of every leg into a new bag.

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
        When the folder exists or cannot be written, or the message types are not installed.
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
    with BagWriter(folder, {KEY: json.dumps(about)}) as bag:
        streams = []
        for (leg, kind), track in replay.replayed.items():
            topic = TRIAL[kind]
            name = prefix + topic.name(leg)
            bag.add_topic(name, topic.type_name)
            streams.append(_messages(name, leg, topic, track))
        total = sum(map(len, replay.replayed.values()))
        merged = heapq.merge(*streams, key=lambda each: each[0])
        for done, (time_ns, name, data) in enumerate(merged, 1):
            bag.write(name, data, time_ns)
            if progress and (done % _REPORT_EVERY == 0 or done == total):
                progress(done / total)


def _messages(name: str, leg: int, topic: Topic, track: Track) -> Iterator[tuple[int, str, bytes]]:
    """Yield time, ns, name of the topic and bytes of each message of a track."""
    message_type = codec.message_type(topic.type_name, message_definition(topic.type_name))
    if topic.text:
        (path,) = topic.values
        for time_ns, text in zip(track.times, track.texts, strict=True):
            yield time_ns, name, FieldWriter(message_type, (), {path: text})()
        return
    if not topic.frame:
        write = FieldWriter(message_type, topic.values)
        for time_ns, values in zip(track.times, track.values.tolist(), strict=True):
            yield time_ns, name, write(*values)
        return
    write = FieldWriter(message_type, STAMP + topic.values, {FRAME: topic.frame.format(leg=leg)})
    columns = track.times, track.keys, track.values.tolist()
    for time_ns, key_ns, values in zip(*columns, strict=True):
        yield time_ns, name, write(*divmod(key_ns, 1_000_000_000), *values)


__all__ = ['write']
