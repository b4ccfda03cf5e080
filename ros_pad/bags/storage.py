# SPDX-License-Identifier: Apache-2.0
"""Read contents and raw messages of MCAP files, also of those whose writer was killed."""

from __future__ import annotations

import pathlib
import struct
from collections import Counter
from collections.abc import Collection
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import ChunkIndex
from mcap.records import Message
from mcap.records import Schema
from mcap.records import Statistics
from mcap.stream_reader import StreamReader
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from ros_pad.errors import BagError

_MESSAGE_OPCODE = 0x05
_MESSAGE_HEADER = struct.Struct('<BQHIQQ')  # opcode, length, channel, sequence, log, publish
_RECORD_HEADER_SIZE = 9


@dataclass
class Contents:
    """Contents of an MCAP file.

    Attributes
    ----------
    finished : bool
        Whether its writer closed it.
    schemas, channels : dict
        Message types and topics, by their number in this file.
    chunks : list of ChunkIndex
        Places of the chunks; empty if the file must be read from its beginning.
    counts : Counter of str
        Messages on each topic.
    start, end : int
        Log times of the first and the last message, ns; 0 without messages.
    """

    finished: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    start: int = 0
    end: int = 0

    @property
    def message_count(self) -> int:
        """Messages on all topics."""
        return self.counts.total()


def scan(path: pathlib.Path) -> Contents:
    """Return the contents of an MCAP file, from its summary or, without one, from all its records.

    Raises
    ------
    BagError
        When it is not an MCAP file, or has messages of an undefined topic.
    """
    with path.open('rb') as stream:
        magic = stream.read(len(MCAP0_MAGIC))
        if not MCAP0_MAGIC.startswith(magic):
            raise BagError(f'{path}: is not an MCAP file')
        stream.seek(0)
        try:
            summary = make_reader(stream).get_summary()
        except Exception:  # a damaged summary can raise any exception; read all records then
            summary = None
    if summary is not None and summary.statistics is not None:
        return _from_summary(path, summary, summary.statistics)
    return _from_records(path)


def _from_summary(path: pathlib.Path, summary: Summary, statistics: Statistics) -> Contents:
    counts: Counter[str] = Counter()
    for channel_id, count in statistics.channel_message_counts.items():
        if channel_id not in summary.channels:
            raise BagError(f'{path}: is damaged: it counts messages of an undefined topic')
        counts[summary.channels[channel_id].topic] += count
    return Contents(
        finished=True,
        schemas=summary.schemas,
        channels=summary.channels,
        chunks=summary.chunk_indexes,
        counts=counts,
        start=statistics.message_start_time,
        end=statistics.message_end_time,
    )


def _from_records(path: pathlib.Path) -> Contents:
    contents = Contents()
    for record in _readable_records(path, contents):
        if isinstance(record, Schema):
            contents.schemas[record.id] = record
        elif isinstance(record, Channel):
            contents.channels[record.id] = record
        elif isinstance(record, Message):
            if not contents.counts:
                contents.start = contents.end = record.log_time
            contents.start = min(contents.start, record.log_time)
            contents.end = max(contents.end, record.log_time)
            if record.channel_id not in contents.channels:
                raise BagError(f'{path}: is damaged: a message refers to an undefined topic')
            contents.counts[contents.channels[record.channel_id].topic] += 1
    return contents


def _readable_records(path: pathlib.Path, contents: Contents) -> Iterator[Any]:
    """Yield the records of an MCAP file from its beginning to its end or its first damage."""
    with path.open('rb') as stream:
        try:
            yield from StreamReader(stream, validate_crcs=True).records
            contents.finished = True
        except Exception:
            # A damaged record can raise any exception; the records before it are valid.
            return


def raw_messages(
    path: pathlib.Path, contents: Contents, wanted: Collection[int]
) -> Iterator[tuple[int, int, bytes]]:
    """Yield channel id, log time in ns and CDR bytes of the messages on the wanted channels.

    Raises
    ------
    BagError
        When a chunk is damaged.
    """
    if not contents.chunks:
        for record in _readable_records(path, contents):
            if isinstance(record, Message) and record.channel_id in wanted:
                yield record.channel_id, record.log_time, record.data
        return
    with path.open('rb') as stream:
        for index in sorted(contents.chunks, key=lambda index: index.chunk_start_offset):
            # Without offsets in the index, the chunk may have messages of any topic.
            if index.message_index_offsets and not any(
                channel_id in wanted for channel_id in index.message_index_offsets
            ):
                continue
            try:
                stream.seek(index.chunk_start_offset + _RECORD_HEADER_SIZE)
                chunk = Chunk.read(ReadDataStream(stream))
                records, size = get_chunk_data_stream(chunk, validate_crc=True)
            except Exception as error:  # each decompressor raises another exception type
                raise BagError(
                    f'{path}: is damaged at byte {index.chunk_start_offset}: {error}'
                ) from error
            yield from _messages_of_chunk(records.read(size), wanted)


def _messages_of_chunk(data: bytes, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
    """Yield the wanted messages of a chunk; the mcap package takes ten times as long."""
    unpack = _MESSAGE_HEADER.unpack_from
    position = 0
    # Remaining bytes that are too few for a message are a schema or a channel.
    while position + _MESSAGE_HEADER.size <= len(data):
        opcode, length, channel_id, _, log_time, _ = unpack(data, position)
        end = position + _RECORD_HEADER_SIZE + length
        if opcode == _MESSAGE_OPCODE and channel_id in wanted:
            yield channel_id, log_time, data[position + _MESSAGE_HEADER.size : end]
        position = end


__all__ = ['Contents', 'raw_messages', 'scan']
