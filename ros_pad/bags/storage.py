# SPDX-License-Identifier: Apache-2.0
"""Read contents and raw messages of MCAP files, also of those whose writer was killed."""

from __future__ import annotations

import contextlib
import itertools
import pathlib
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Footer, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from ros_pad.errors import BagError
from ros_pad.pace import Progress, part

_RECORD_SIZE_LIMIT = 1 << 30  # bytes; a longer record counts as damage

RawMessage: TypeAlias = tuple[str, int, bytes]
"""Topic, log time, ns, and bytes of a message."""


@dataclass
class Contents:
    """Contents of an MCAP file.

    Attributes
    ----------
    closed : bool
        Whether its writer closed it.
    schemas, channels : dict
        Message types and topics, by their number in this file.
    counts : Counter of str
        Messages on each topic.
    start, end : int
        Log times of the first and the last message, ns; 0 without messages.
    damaged_chunks : int
        Chunks that cannot be read.
    lost_messages : int
        Messages whose topic is nowhere declared.
    unread_bytes : int
        Bytes after the last record that can be read.
    """

    closed: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    start: int = 0
    end: int = 0
    damaged_chunks: int = 0
    lost_messages: int = 0
    unread_bytes: int = 0

    @property
    def message_count(self) -> int:
        """Messages on all topics."""
        return self.counts.total()

    @property
    def whole(self) -> bool:
        """Whether all of it can be read."""
        return self.closed and not self.damaged_chunks and not self.lost_messages

    def count(self, counts: Counter[int]) -> None:
        """Take over the numbers of messages by channel."""
        for number, count in counts.items():
            if number in self.channels:
                self.counts[self.channels[number].topic] += count
            else:
                self.lost_messages += count


def shares(files: Sequence[pathlib.Path], progress: Progress | None) -> Iterator[Progress]:
    """Yield a callback for each file, in proportion to its size."""
    ends = list(itertools.accumulate((file.stat().st_size for file in files), initial=0))
    total = ends[-1] or 1
    for start, end in itertools.pairwise(ends):
        yield part(progress, start / total, end / total)


def scan(path: pathlib.Path, progress: Progress | None = None) -> Contents:
    """Return the contents of an MCAP file, from its summary or, without one, from all its records.

    The callback is called only if all records are read.

    Raises
    ------
    BagError
        When it is not an MCAP file.
    """
    with path.open('rb') as stream:
        if not MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC))):
            raise BagError(f'{path}: is not an MCAP file')
        stream.seek(0)
        with contextlib.suppress(Exception):  # a damaged summary can raise any exception
            summary = SeekingReader(stream).get_summary()
            if summary and (known := summary.statistics):
                contents = Contents(True, summary.schemas, summary.channels)
                contents.start, contents.end = known.message_start_time, known.message_end_time
                contents.count(Counter(known.channel_message_counts))
                return contents
    return scan_all(path, progress)


def scan_all(path: pathlib.Path, progress: Progress | None = None) -> Contents:
    """Return the contents of an MCAP file from all of its records that can be read."""
    contents, counts = Contents(), Counter[int]()
    for record in records(path, contents, progress):
        match record:
            case Schema():
                contents.schemas[record.id] = record
            case Channel():
                contents.channels[record.id] = record
            case Message():
                if not counts:
                    contents.start = record.log_time
                counts[record.channel_id] += 1
                contents.start = min(contents.start, record.log_time)
                contents.end = max(contents.end, record.log_time)
    contents.count(counts)  # now, because a topic may be declared after its messages
    return contents


def records(
    path: pathlib.Path, contents: Contents, progress: Progress | None = None
) -> Iterator[Any]:
    """Yield the records of an MCAP file, also those in chunks that can be read.

    What cannot be read is noted in the contents.
    """
    with path.open('rb') as stream:
        reached, size = 0, path.stat().st_size
        reader = StreamReader(stream, emit_chunks=True, record_size_limit=_RECORD_SIZE_LIMIT)
        found = iter(reader.records)
        while True:
            record = None
            with contextlib.suppress(Exception):  # damaged bytes can raise any exception
                record = next(found, None)
            if record is None:
                break
            reached = stream.tell()
            contents.closed = contents.closed or isinstance(record, Footer)
            inside = [record]
            if isinstance(record, Chunk):
                try:
                    inside = breakup_chunk(record, validate_crc=True)
                except Exception:  # each decompressor raises another exception type
                    contents.damaged_chunks += 1
                    inside = []
            yield from inside
            if progress:
                progress(reached / size)
        contents.unread_bytes = 0 if contents.closed else size - reached


def raw_messages(
    path: pathlib.Path, contents: Contents, topics: Collection[str], progress: Progress
) -> Iterator[RawMessage]:
    """Yield the messages on some topics, in the order in which they were written.

    Raises
    ------
    BagError
        When not all of a file can be read whose contents are whole.
    """
    wanted = {n: each.topic for n, each in contents.channels.items() if each.topic in topics}
    if not wanted:
        return
    read = Contents()
    for record in records(path, read, progress):
        if isinstance(record, Message) and record.channel_id in wanted:
            yield wanted[record.channel_id], record.log_time, record.data
    if contents.whole and not read.whole:
        raise BagError(f'{path}: is damaged: one of its chunks or records cannot be read')


__all__ = ['Contents', 'RawMessage', 'raw_messages', 'records', 'scan', 'scan_all', 'shares']
