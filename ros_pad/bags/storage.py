# SPDX-License-Identifier: Apache-2.0
"""Read contents and raw messages of MCAP files, also of those whose writer was killed."""

from __future__ import annotations

import pathlib
import struct
from collections import Counter
from collections.abc import Collection
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from typing import Any

import numpy as np
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

from ros_pad.bags.fields import items_at
from ros_pad.errors import BagError

_MESSAGE_OPCODE = 0x05
_MESSAGE_HEADER = struct.Struct('<BQHIQQ')
_FIELDS = ('opcode', 'length', 'channel', 'sequence', 'log_time', 'publish_time')
_HEADER = np.dtype(list(zip(_FIELDS, ('u1', '<u8', '<u2', '<u4', '<u8', '<u8'), strict=True)))
_RECORD_HEADER_SIZE = 9
_LENGTH = struct.Struct('<Q')
_LENGTH_AT = 1
_BATCH_SIZE = 8 * 1024 * 1024  # bytes
_FEW = 32  # pieces that are followed one by one; more are followed side by side


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


@dataclass(frozen=True)
class Batch:
    """Messages of a file, in the order in which they were written.

    Attributes
    ----------
    data : bytes
        The messages, and records between them.
    channels, log_times, starts, sizes : ndarray of int
        Channel id, log time, ns, first byte in `data` and number of bytes of each message.
    """

    data: bytes
    channels: np.ndarray
    log_times: np.ndarray
    starts: np.ndarray
    sizes: np.ndarray


def raw_messages(
    path: pathlib.Path, contents: Contents, wanted: Collection[int]
) -> Iterator[tuple[int, int, bytes]]:
    """Yield channel id, log time in ns and CDR bytes of the messages on the wanted channels.

    Raises
    ------
    BagError
        When a chunk is damaged.
    """
    for batch in batches(path, contents, wanted):
        ends = batch.starts + batch.sizes
        columns = (batch.channels, batch.log_times, batch.starts, ends)
        for channel, log_time, start, end in zip(
            *(each.tolist() for each in columns), strict=True
        ):
            yield channel, log_time, batch.data[start:end]


def batches(path: pathlib.Path, contents: Contents, wanted: Collection[int]) -> Iterator[Batch]:
    """Yield the messages on the wanted channels, some megabytes at a time.

    Raises
    ------
    BagError
        When a chunk is damaged.
    """
    pieces: list[bytes] = []
    size = 0
    for piece in _pieces(path, contents, wanted):
        pieces.append(piece)
        size += len(piece)
        if size >= _BATCH_SIZE:
            yield _batch(path, pieces, wanted)
            pieces, size = [], 0
    if pieces:
        yield _batch(path, pieces, wanted)


def _pieces(path: pathlib.Path, contents: Contents, wanted: Collection[int]) -> Iterator[bytes]:
    """Yield bytes with whole records in them: chunks, or single messages."""
    if not contents.chunks:
        for record in _readable_records(path, contents):
            if isinstance(record, Message) and record.channel_id in wanted:
                length = _HEADER.itemsize - _RECORD_HEADER_SIZE + len(record.data)
                times = record.log_time, record.publish_time
                header = _MESSAGE_OPCODE, length, record.channel_id, record.sequence, *times
                yield _MESSAGE_HEADER.pack(*header) + record.data
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
            yield records.read(size)


def _batch(path: pathlib.Path, pieces: Sequence[bytes], wanted: Collection[int]) -> Batch:
    """Return the wanted messages in some pieces."""
    data = b''.join(pieces)
    ends = np.cumsum([len(each) for each in pieces])
    try:
        places = _places(data, np.concatenate([[0], ends[:-1]]), ends)
    except ValueError as error:
        raise BagError(f'{path}: is damaged: {error}') from None
    headers = items_at(data, places, f'V{_HEADER.itemsize}').view(_HEADER)
    mine = (headers['opcode'] == _MESSAGE_OPCODE) & np.isin(headers['channel'], list(wanted))
    headers, places = headers[mine], places[mine]
    return Batch(
        data,
        headers['channel'],
        headers['log_time'],
        places + _HEADER.itemsize,
        headers['length'].astype(np.int64) - (_HEADER.itemsize - _RECORD_HEADER_SIZE),
    )


def _places(data: bytes, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the places of all records in pieces of data, in order.

    Pieces are followed side by side, which takes a quarter of the time of one after the other.
    The last record of a piece is left out if it is too short for a message.
    """
    found = []
    while np.count_nonzero(more := starts + _HEADER.itemsize <= ends) > _FEW:
        starts, ends = starts[more], ends[more]
        found.append(starts)
        starts = starts + items_at(data, starts + _LENGTH_AT, '<i8') + _RECORD_HEADER_SIZE
        if np.any((starts > ends) | (starts <= found[-1])):
            raise ValueError('a record is longer than its chunk')
    rest = []
    for place, end in zip(starts.tolist(), ends.tolist(), strict=True):
        while place + _HEADER.itemsize <= end:
            rest.append(place)
            place += _LENGTH.unpack_from(data, place + _LENGTH_AT)[0] + _RECORD_HEADER_SIZE
            if place > end:
                raise ValueError('a record is longer than its chunk')
    return np.sort(np.concatenate([*found, np.array(rest, dtype=np.int64)]))


__all__ = ['Batch', 'Contents', 'batches', 'raw_messages', 'scan']
