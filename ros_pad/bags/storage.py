# SPDX-License-Identifier: Apache-2.0
"""Read contents and raw messages of MCAP files, also of those whose writer was killed."""

from __future__ import annotations

import io
import itertools
import os
import pathlib
import struct
from collections import Counter
from collections.abc import Collection
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from typing import IO
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import Message
from mcap.records import Schema
from mcap.records import Statistics
from mcap.stream_reader import StreamReader
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from ros_pad.bags.fields import items
from ros_pad.errors import BagError
from ros_pad.pace import Progress
from ros_pad.pace import part

_MESSAGE_HEADER = struct.Struct('<BQHIQQ')
_FIELDS = ('opcode', 'length', 'channel', 'sequence', 'log_time', 'publish_time')
_HEADER = np.dtype(list(zip(_FIELDS, ('u1', '<u8', '<u2', '<u4', '<u8', '<u8'), strict=True)))
_RECORD_HEADER = struct.Struct('<BQ')  # opcode, length
_RECORD_HEADER_SIZE = 9
_FOOTER = struct.Struct('<BQQ')  # opcode, length, place of the summary
_TAIL_SIZE = 37  # bytes, from the footer to the end
_CHUNK_INDEX = struct.Struct('<QQQQI')  # times, place and length of the chunk, bytes of offsets
_OFFSET = np.dtype([('channel', '<u2'), ('offset', '<u8')])
_LENGTH, _LENGTH_AT = '<u4', 1  # type and place in a record; no chunk has records over 4 GiB
_BATCH_SIZE = 8 * 1024 * 1024  # bytes
_FEW = 32  # pieces that are followed one by one; more are followed side by side


class _Undefined(Exception):
    """A summary counts messages of an undefined topic."""


@dataclass
class Contents:
    """Contents of an MCAP file.

    Attributes
    ----------
    finished : bool
        Whether its writer closed it.
    schemas, channels : dict
        Message types and topics, by their number in this file.
    chunks : list of tuple
        Place of each chunk, and ids of the channels in it; empty if the file must be read from its
        beginning.
    counts : Counter of str
        Messages on each topic.
    start, end : int
        Log times of the first and the last message, ns; 0 without messages.
    """

    finished: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[tuple[int, set[int]]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    start: int = 0
    end: int = 0

    @property
    def message_count(self) -> int:
        """Messages on all topics."""
        return self.counts.total()


def shares(files: Sequence[pathlib.Path], progress: Progress | None) -> Iterator[Progress | None]:
    """Yield a callback for each file, in proportion to its size."""
    ends = list(itertools.accumulate((file.stat().st_size for file in files), initial=0))
    total = ends[-1] or 1
    for start, end in itertools.pairwise(ends):
        yield part(progress, start / total, end / total) if progress else None


def scan(path: pathlib.Path, progress: Progress | None = None) -> Contents:
    """Return the contents of an MCAP file, from its summary or, without one, from all its records.

    The callback is called only if all records are read.

    Raises
    ------
    BagError
        When it is not an MCAP file, or has messages of an undefined topic.
    """
    with path.open('rb') as stream:
        magic = stream.read(len(MCAP0_MAGIC))
        if not MCAP0_MAGIC.startswith(magic):
            raise BagError(f'{path}: is not an MCAP file')
        try:
            contents = _from_summary(stream)
        except _Undefined:
            raise BagError(
                f'{path}: is damaged: it counts messages of an undefined topic'
            ) from None
        except Exception:  # a damaged summary can raise any exception; read all records then
            contents = None
    return _from_records(path, progress) if contents is None else contents


def _from_summary(stream: IO[bytes]) -> Contents | None:
    """Return the contents of a closed file; None if it has no summary."""
    stream.seek(-_TAIL_SIZE, os.SEEK_END)
    opcode, _, start = _FOOTER.unpack(stream.read(_FOOTER.size))
    if opcode != Opcode.FOOTER or not start:
        return None
    stream.seek(start)
    contents = Contents(finished=True)
    counts = None
    for record in StreamReader(io.BytesIO(_without_chunks(stream.read(), contents)), True).records:
        if isinstance(record, Schema):
            contents.schemas[record.id] = record
        elif isinstance(record, Channel):
            contents.channels[record.id] = record
        elif isinstance(record, Statistics):
            counts = record.channel_message_counts
            contents.start, contents.end = record.message_start_time, record.message_end_time
    if counts is None:
        return None
    if not contents.channels.keys() >= counts.keys():
        raise _Undefined
    for channel_id, count in counts.items():
        contents.counts[contents.channels[channel_id].topic] += count
    return contents


def _without_chunks(summary: bytes, contents: Contents) -> bytes:
    """Return a summary without its chunk indexes, of which the contents take what they need.

    With all channels in each of thousands of chunks, the mcap package would take longer for them
    than the messages take.
    """
    rest, place = b'', 0
    while place + _RECORD_HEADER_SIZE <= len(summary):
        opcode, length = _RECORD_HEADER.unpack_from(summary, place)
        body, place = place + _RECORD_HEADER_SIZE, place + _RECORD_HEADER_SIZE + length
        if opcode != Opcode.CHUNK_INDEX:
            rest += summary[body - _RECORD_HEADER_SIZE : place]
            continue
        _, _, start, _, size = _CHUNK_INDEX.unpack_from(summary, body)
        offsets = np.frombuffer(
            summary, _OFFSET, size // _OFFSET.itemsize, body + _CHUNK_INDEX.size
        )
        contents.chunks.append((start, set(offsets['channel'].tolist())))
    return rest + summary[place:]


def _from_records(path: pathlib.Path, progress: Progress | None) -> Contents:
    contents = Contents()
    for share, record in _readable_records(path, contents):
        if progress:
            progress(share)
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


def _readable_records(path: pathlib.Path, contents: Contents) -> Iterator[tuple[float, Any]]:
    """Yield the records of an MCAP file from its beginning to its end or its first damage.

    Each comes with the share of the file that is read, 0 to 1.
    """
    with path.open('rb') as stream:
        size = path.stat().st_size
        try:
            for record in StreamReader(stream, validate_crcs=True).records:
                yield stream.tell() / size, record
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
    path: pathlib.Path,
    contents: Contents,
    wanted: Collection[int],
    progress: Progress | None = None,
) -> Iterator[tuple[int, int, bytes]]:
    """Yield channel id, log time in ns and CDR bytes of the messages on the wanted channels.

    Raises
    ------
    BagError
        When a chunk is damaged.
    """
    for batch in batches(path, contents, wanted, progress):
        ends = batch.starts + batch.sizes
        columns = (batch.channels, batch.log_times, batch.starts, ends)
        for channel, log_time, start, end in zip(
            *(each.tolist() for each in columns), strict=True
        ):
            yield channel, log_time, batch.data[start:end]


def batches(
    path: pathlib.Path,
    contents: Contents,
    wanted: Collection[int],
    progress: Progress | None = None,
) -> Iterator[Batch]:
    """Yield the messages on the wanted channels, some megabytes at a time.

    Raises
    ------
    BagError
        When a chunk is damaged.
    """
    pieces: list[bytes] = []
    size = 0
    for share, piece in _pieces(path, contents, wanted):
        pieces.append(piece)
        size += len(piece)
        if size >= _BATCH_SIZE:
            yield _batch(path, pieces, wanted)
            if progress:
                progress(share)
            pieces, size = [], 0
    if pieces:
        yield _batch(path, pieces, wanted)


def _pieces(
    path: pathlib.Path, contents: Contents, wanted: Collection[int]
) -> Iterator[tuple[float, bytes]]:
    """Yield bytes with whole records in them, chunks or single messages, with the share read."""
    if not contents.chunks:
        for share, record in _readable_records(path, contents):
            if isinstance(record, Message) and record.channel_id in wanted:
                length = _HEADER.itemsize - _RECORD_HEADER_SIZE + len(record.data)
                times = record.log_time, record.publish_time
                header = Opcode.MESSAGE, length, record.channel_id, record.sequence, *times
                yield share, _MESSAGE_HEADER.pack(*header) + record.data
        return
    with path.open('rb') as stream:
        chunks = sorted(contents.chunks, key=lambda chunk: chunk[0])
        for number, (start, channels) in enumerate(chunks, 1):
            # Without an index of its messages, the chunk may have messages of any topic.
            if channels and channels.isdisjoint(wanted):
                continue
            try:
                stream.seek(start + _RECORD_HEADER_SIZE)
                chunk = Chunk.read(ReadDataStream(stream))
                records, size = get_chunk_data_stream(chunk, validate_crc=True)
            except Exception as error:  # each decompressor raises another exception type
                raise BagError(f'{path}: is damaged at byte {start}: {error}') from error
            yield number / len(chunks), records.read(size)


def _batch(path: pathlib.Path, pieces: Sequence[bytes], wanted: Collection[int]) -> Batch:
    """Return the wanted messages in some pieces."""
    data = b''.join(pieces)
    ends = np.cumsum([len(each) for each in pieces])
    try:
        places = _places(data, np.concatenate([[0], ends[:-1]]), ends)
    except ValueError as error:
        raise BagError(f'{path}: is damaged: {error}') from None
    headers = items(data, f'V{_HEADER.itemsize}')[places].view(_HEADER)
    mine = (headers['opcode'] == Opcode.MESSAGE) & np.isin(headers['channel'], list(wanted))
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
    lengths = items(data, _LENGTH, _LENGTH_AT)
    too_long = False
    while len(starts) > _FEW:
        more = starts + _HEADER.itemsize <= ends
        if not more.all():
            too_long |= bool(np.any(starts > ends))
            starts, ends = starts[more], ends[more]
        found.append(starts)
        starts = starts + lengths[starts] + _RECORD_HEADER_SIZE
    rest = []
    for place, end in zip(starts.tolist(), ends.tolist(), strict=True):
        while place + _HEADER.itemsize <= end:
            rest.append(place)
            place += int(lengths[place]) + _RECORD_HEADER_SIZE
        too_long |= place > end
    if too_long:
        raise ValueError('a record is longer than its chunk')
    return np.sort(np.concatenate([*found, np.array(rest, dtype=np.int64)]))


__all__ = ['Batch', 'Contents', 'batches', 'raw_messages', 'scan']
