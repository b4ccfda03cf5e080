# SPDX-License-Identifier: Apache-2.0
"""Writes what a replay says into a bag of its own, so that other tools show it beside the first.

The few message types that estimator and controller send are serialized here (CDR, little-endian):
that needs no ROS, but for the definitions of the types.
"""

from __future__ import annotations

import heapq
import json
import os
import struct
from collections.abc import Iterator

from ros_pad.trials.bag import BagWriter
from ros_pad.trials.comparison import Track
from ros_pad.trials.label import KEY
from ros_pad.trials.recorded import message_type
from ros_pad.trials.replay import Replay

_CDR = b'\x00\x01\x00\x00'  # little-endian, no options
_COVARIANCE_YY = 7  # place in the 6 x 6 matrix, row by row


def write(replay: Replay, folder: str | os.PathLike[str], namespace: str | None = None) -> None:
    """Write the replayed topics of every leg into a new bag.

    Parameters
    ----------
    replay : Replay
        What is to be written.
    folder : path
        Of the bag; must not exist.
    namespace : str or None
        Before the names of the topics.

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
            topic = f'{prefix}leg_{leg}/{kind}'
            bag.add_topic(topic, message_type(kind))
            streams.append(_messages(topic, leg, kind, track))
        for time_ns, topic, data in heapq.merge(*streams, key=lambda each: each[0]):
            bag.write(topic, data, time_ns)


def _messages(topic: str, leg: int, kind: str, track: Track) -> Iterator[tuple[int, str, bytes]]:
    if kind in ('doubt', 'morphology'):
        for time_ns, text in zip(track.times, track.texts, strict=True):
            yield time_ns, topic, _CDR + _string(text)
        return
    for time_ns, key_ns, numbers in zip(
        track.times, track.keys, track.values.tolist(), strict=True
    ):
        if kind == 'slip':
            covariance = [0.0] * 36
            x, y, covariance[0], covariance[_COVARIANCE_YY] = numbers
            body = _header(key_ns, 'world')
            body += struct.pack('<42d', x, y, 0.0, 0.0, 0.0, 0.0, *covariance)
        elif kind == 'pressure_setpoint':
            body = _header(key_ns, f'leg_{leg}_pad') + struct.pack('<2d', numbers[0], 0.0)
        elif kind == 'slipping':
            body = struct.pack('<?', numbers[0] > 0.0)
        else:
            body = struct.pack('<d', numbers[0])
        yield time_ns, topic, _CDR + body


def _string(text: str) -> bytes:
    data = text.encode() + b'\0'
    return struct.pack('<I', len(data)) + data


def _header(stamp_ns: int, frame: str) -> bytes:
    """Return a std_msgs/Header, and what aligns the doubles that follow it."""
    data = struct.pack('<iI', *divmod(stamp_ns, 1_000_000_000)) + _string(frame)
    return data + bytes(-len(data) % 8)


__all__ = ['write']
