# SPDX-License-Identifier: Apache-2.0
"""Repair a bag that a killed recorder, a full disk or a power cut left incomplete."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from mcap.records import Channel, Message, Schema

from ros_pad.bags import metadata
from ros_pad.bags.storage import Contents, records, scan_all, shares
from ros_pad.bags.writer import BagWriter
from ros_pad.errors import BagError
from ros_pad.pace import Progress, part

KEY = 'ros_pad_repair'
"""Key of the custom data in which a repaired bag lists what was lost."""


@dataclass
class Repair:
    """Findings of :func:`repair`.

    Attributes
    ----------
    messages : int
        Messages that can be read; a repair writes them into the new bag.
    damaged_chunks : int
        Chunks that cannot be read; a repair leaves them out.
    lost_messages : int
        Messages that can be read, but whose topic was declared in a damaged chunk.
    unread_bytes : int
        Bytes after the last record that can be read.
    closed : bool
        Whether every file was closed by its writer.
    described : bool
        Whether ``metadata.yaml`` names all files and the number of messages that can be read.
    """

    messages: int = 0
    damaged_chunks: int = 0
    lost_messages: int = 0
    unread_bytes: int = 0
    closed: bool = True
    described: bool = True

    @property
    def sound(self) -> bool:
        """Whether there is nothing to repair."""
        whole = self.closed and not self.damaged_chunks and not self.unread_bytes
        return whole and self.described


def inspect(source: str | os.PathLike[str], progress: Progress | None = None) -> Repair:
    """Return what a repair would find, without writing anything.

    Parameters
    ----------
    source : path
        Folder of a bag, with or without its metadata, or one MCAP file.
    progress : callable, optional
        Called with the share that is done, 0 to 1.

    Raises
    ------
    BagError
        When there is no MCAP file.
    """
    return _examine(pathlib.Path(source), part(progress, 0.0, 1.0))[1]


def repair(
    source: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    progress: Progress | None = None,
) -> Repair:
    """Write every message that can be read into a new bag.

    Parameters
    ----------
    source : path
        Folder of a bag, with or without its metadata, or one MCAP file. It is not changed.
    folder : path
        Folder of the new bag, which must not exist.
    progress : callable, optional
        Called with the share that is done, 0 to 1.

    Returns
    -------
    Repair
        Numbers of messages that were written, and of what was lost.

    Raises
    ------
    BagError
        When there is no MCAP file, no message can be read, a topic has two types, the new bag
        exists, or the disk is full.
    """
    source = pathlib.Path(source)
    files, found = _examine(source, part(progress, 0.0, 0.5))
    if not found.messages:
        raise BagError(f'{source}: none of its messages can be read: nothing can be repaired')
    done, reach = 0, part(progress, 0.5, 1.0)
    about = _known(source).get('custom_data')
    texts = about.items() if isinstance(about, dict) else ()
    with BagWriter(folder, {str(key): str(text) for key, text in texts}) as writer:
        for name, (channel, schema) in _topics(source, files.values()).items():
            writer.copy_topic(dataclasses.replace(channel, topic=name), schema)
        for path, contents in files.items():
            for record in records(path, Contents()):
                if isinstance(record, Message) and record.channel_id in contents.channels:
                    topic = contents.channels[record.channel_id].topic
                    writer.write(topic, record.data, record.log_time, record.publish_time)
                    done += 1
                    reach(done / found.messages)
        writer.describe({KEY: json.dumps({'source': source.name} | asdict(found))})
    return found


def _files(source: pathlib.Path) -> list[pathlib.Path]:
    """Return the MCAP files in the order of their numbers; metadata may be missing or wrong."""
    if source.is_file():
        return [source]
    if not source.is_dir():
        raise BagError(f'{source}: no such bag')

    def number(path: pathlib.Path) -> tuple[int, str]:
        found = re.search(r'_(\d+)$', path.stem)
        return int(found[1]) if found else -1, path.name

    files = sorted(source.glob('*.mcap'), key=number)
    if not files:
        raise BagError(f'{source}: has no MCAP file: only MCAP files can be repaired')
    return files


def _examine(
    source: pathlib.Path, progress: Progress
) -> tuple[dict[pathlib.Path, Contents], Repair]:
    """Return the contents of all files, and the findings."""
    files = _files(source)
    reach = shares(files, progress)
    found = {file: scan_all(file, each) for file, each in zip(files, reach, strict=True)}
    parts = found.values()
    messages = sum(each.message_count for each in parts)
    return found, Repair(
        messages=messages,
        damaged_chunks=sum(each.damaged_chunks for each in parts),
        lost_messages=sum(each.lost_messages for each in parts),
        unread_bytes=sum(each.unread_bytes for each in parts),
        closed=all(each.closed for each in parts),
        described=_described(source, files, messages),
    )


def _topics(source: pathlib.Path, files: Iterable[Contents]) -> dict[str, tuple[Channel, Schema]]:
    """Return channel and message type of each topic in all files."""
    topics: dict[str, tuple[Channel, Schema]] = {}
    for file in files:
        for channel in file.channels.values():
            none = Schema(id=0, name='', encoding='', data=b'')
            schema = file.schemas.get(channel.schema_id, none)
            _, known = topics.setdefault(channel.topic, (channel, schema))
            if known.name != schema.name:
                raise BagError(
                    f'{source}: topic {channel.topic} has the message types {known.name} and'
                    f' {schema.name}: a repaired bag can have only one'
                )
    return topics


def _known(source: pathlib.Path) -> dict[str, Any]:
    """Return the metadata of a bag; empty when it is missing or damaged."""
    try:
        return metadata.read(source)
    except BagError:
        return {}


def _described(source: pathlib.Path, files: list[pathlib.Path], messages: int) -> bool:
    """Return whether the metadata names these files and this number of messages."""
    known = _known(source)
    names = known.get('relative_file_paths')
    return (
        isinstance(names, list)
        and sorted(pathlib.PurePath(str(name)).name for name in names)
        == sorted(file.name for file in files)
        and known.get('message_count') == messages
    )
