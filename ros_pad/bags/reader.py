# SPDX-License-Identifier: Apache-2.0
"""Read bags without ROS, also those whose writer was killed."""

from __future__ import annotations

import itertools
import os
import pathlib
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from mcap.records import Channel

from ros_pad.bags import metadata
from ros_pad.bags.codec import MessageType, field_getter, message_type
from ros_pad.bags.storage import Contents, RawMessage, raw_messages, scan, shares
from ros_pad.bags.wire import Wire, legs_of
from ros_pad.errors import BadMessage, BagError, reason
from ros_pad.pace import Progress
from ros_pad.records import Block, Kind

Table: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Log times, int64, ns, and a row of numbers for each message."""

Recorded: TypeAlias = tuple[tuple[int, ...], np.ndarray, Block]
"""Numbers of the legs, log times, int64, ns, and all records of a topic."""

_Batch: TypeAlias = dict[int, tuple[list[int], list[bytes]]]
_BATCH = 10_000  # messages
_NONE = np.empty(0, np.int64)


class BagReader:
    """Read the messages of a bag, in the order in which they were written.

    A bag whose writer was killed is read up to the damage; :attr:`problem` and a warning report
    this, with the number of messages that can be read.

    Parameters
    ----------
    path : path
        The folder of a bag, or one MCAP file.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1, where opening takes long: if a
        file was not closed.

    Attributes
    ----------
    topics : dict of str to str
        Message type of each topic; empty if the file does not name the type.
    counts : dict of str to int
        Number of messages on each topic.
    custom_data : dict of str to str
        Texts about the trial, by key; empty if the path is an MCAP file.
    start : int
        Time of the first message, ns; 0 in an empty bag.
    end : int
        Time of the last message, ns; 0 in an empty bag.
    message_count : int
        Number of messages that can be read.
    problem : str or None
        Damage that leaves some messages readable; None without damage.

    Raises
    ------
    BagError
        When there is no such bag, its metadata is invalid, its storage is not MCAP without a
        compression mode, a file is missing, or no message of a damaged bag can be read.

    Examples
    --------
    A bag of two messages, written and read without ROS; a number in CDR is a header and 8 bytes:

    >>> import struct, tempfile
    >>> from ros_pad.bags import BagReader, BagWriter
    >>> from mcap.records import Channel, Schema
    >>> schema = Schema(1, b'float64 data', 'ros2msg', 'std_msgs/msg/Float64')
    >>> channel = Channel(1, '/leg_1/wetness', 'cdr', {'offered_qos_profiles': '[]'}, 1)
    >>> place = tempfile.TemporaryDirectory()
    >>> with BagWriter(f'{place.name}/bag', {'robot': 'ch3r'}) as bag:
    ...     bag.copy_topic(channel, schema)
    ...     for step, wet in enumerate((0.5, 0.9)):
    ...         message = bytes([0, 1, 0, 0]) + struct.pack('<d', wet)
    ...         bag.write('/leg_1/wetness', message, log_time_ns=20_000_000 * step)
    >>> bag = BagReader(f'{place.name}/bag')
    >>> bag.counts, bag.custom_data
    ({'/leg_1/wetness': 2}, {'robot': 'ch3r'})
    >>> times, values = bag.tables({'/leg_1/wetness': ['data']})['/leg_1/wetness']
    >>> times.tolist(), values.tolist()  # ns
    ([0, 20000000], [[0.5], [0.9]])
    """

    def __init__(self, path: str | os.PathLike[str], progress: Progress | None = None) -> None:
        self.path = pathlib.Path(path)
        self.custom_data: dict[str, str] = {}
        if not self.path.exists():
            raise BagError(f'{self.path}: no such bag')
        files = self._files_of_folder() if self.path.is_dir() else [self.path]
        reach = shares(files, progress)
        self._files = [(file, scan(file, each)) for file, each in zip(files, reach, strict=True)]
        parts = [contents for _, contents in self._files]
        for file, part in self._files:
            for channel in part.channels.values():
                if channel.schema_id and channel.schema_id not in part.schemas:
                    raise BagError(
                        f'{file}: is damaged: it has no message type of topic {channel.topic}'
                    )
        self.topics = {
            channel.topic: part.schemas[channel.schema_id].name if channel.schema_id else ''
            for part in parts
            for channel in part.channels.values()
        }
        self.counts: dict[str, int] = {
            topic: sum(part.counts[topic] for part in parts) for topic in self.topics
        }
        self.message_count = sum(self.counts.values())
        filled = [part for part in parts if part.message_count]
        self.start = min((part.start for part in filled), default=0)
        self.end = max((part.end for part in filled), default=0)
        self.problem: str | None = None
        unfinished = ' and '.join(file.name for file, part in self._files if not part.finished)
        if unfinished:
            self.problem = (
                f'{self.path}: {unfinished} was not closed; '
                f'{self.message_count} messages can still be read'
            )
            if not self.message_count:
                raise BagError(self.problem)
            warnings.warn(self.problem, stacklevel=2)

    def _files_of_folder(self) -> list[pathlib.Path]:
        """Return the MCAP files of the folder, and store its custom data."""
        information = metadata.read(self.path)
        try:
            storage = information['storage_identifier']
            compression = str(information.get('compression_mode', ''))
            names = [str(name) for name in information['relative_file_paths']]
            self.custom_data = dict(information.get('custom_data') or {})
        except (KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{self.path / "metadata.yaml"}: is not the metadata of a bag: {reason(error)}'
            ) from error
        if storage != 'mcap' or compression.lower() not in ('', 'none'):
            raise BagError(
                f'{self.path}: storage {storage!r} with compression mode {compression!r} cannot be'
                " read: storage 'mcap' without a compression mode is needed; convert the bag with"
                " 'ros2 bag convert'"
            )
        files = [self.path / pathlib.PurePath(name).name for name in names]
        for file in files:
            if not file.is_file():
                raise BagError(f'{self.path}: its file {file.name} is missing')
        return files

    def messages(
        self,
        topics: Collection[str] | None = None,
        containing: bytes = b'',
        progress: Progress | None = None,
    ) -> Iterator[tuple[str, Any, int]]:
        """Yield topic, decoded message and log time in ns of each message.

        Parameters
        ----------
        topics : collection of str, optional
            Topics to read, by default all; a topic that the bag does not have yields nothing.
        containing : bytes
            Messages without these bytes are left out.
        progress : callable or None
            Called now and then with the share that is done, 0 to 1.

        Yields
        ------
        topic : str
            Name of the topic.
        message : object
            Decoded message, with its fields as attributes.
        log_time : int
            Time at which it was recorded, ns.

        Raises
        ------
        BagError
            When a message cannot be decoded, or a chunk of a closed file is damaged.
        """
        for file, contents, reach in self._shared(progress):
            wanted = _channels(contents, self.topics if topics is None else topics)
            channels = {channel.id: channel for channel in wanted}
            types: dict[int, MessageType] = {}
            for channel_id, log_time, data in raw_messages(file, contents, channels, reach):
                if containing not in data:
                    continue
                channel = channels[channel_id]
                if channel_id not in types:
                    types[channel_id] = _message_type(file, channel, contents)
                message = _decoded(file, channel.topic, types[channel_id], data, log_time)
                yield channel.topic, message, log_time

    def tables(
        self, paths: Mapping[str, Sequence[str]], progress: Progress | None = None
    ) -> dict[str, Table]:
        """Return log times and numbers of all messages on some topics.

        Parameters
        ----------
        paths : mapping
            Fields to read, such as ``wrench.force.x``, by topic; a topic that the bag does not
            have yields nothing.
        progress : callable or None
            Called now and then with the share that is done, 0 to 1.

        Returns
        -------
        dict
            Log times, int64, ns, and values, by topic. Values have a row for each message and a
            column for each path; they are float64.

        Raises
        ------
        BagError
            When a field cannot be read, or a chunk of a closed file is damaged.
        """
        return self.read({}, paths, progress)[1]

    def records(
        self, kinds: Mapping[str, Kind], progress: Progress | None = None
    ) -> dict[str, Recorded]:
        """Return all records on some topics.

        Parameters
        ----------
        kinds : mapping
            Kind of the records, by topic; a topic without messages is left out.
        progress : callable or None
            Called now and then with the share that is done, 0 to 1.

        Returns
        -------
        dict
            By topic: numbers of the legs, log times, int64, ns, and the block of all records.

        Raises
        ------
        BagError
            When a message is no record of its kind, or a chunk of a closed file is damaged.
        """
        return self.read(kinds, {}, progress)[0]

    def read(
        self,
        kinds: Mapping[str, Kind],
        paths: Mapping[str, Sequence[str]],
        progress: Progress | None = None,
    ) -> tuple[dict[str, Recorded], dict[str, Table]]:
        """Return what :meth:`records` and :meth:`tables` do, in half their time.

        Parameters
        ----------
        kinds : mapping
            Kind of the records, by topic.
        paths : mapping
            Fields to read, by topic.
        progress : callable or None
            Called now and then with the share that is done, 0 to 1.

        Returns
        -------
        records : dict
        tables : dict

        Raises
        ------
        BagError
            As they do.
        """
        wires: dict[str, Wire] = {}
        times: dict[str, list[np.ndarray]] = {topic: [_NONE] for topic in (*kinds, *paths)}
        blocks: dict[str, list[Block]] = {}
        tables = {topic: [np.empty((0, len(each)))] for topic, each in paths.items()}
        for file, contents, reach in self._shared(progress):
            channels = {each.id: each for each in _channels(contents, times)}
            readers = {
                channel.id: _reader(file, channel, contents, paths[channel.topic])
                for channel in channels.values()
                if channel.topic in paths
            }
            for batch in _batches(raw_messages(file, contents, channels, reach)):
                for channel_id, (log_times, messages) in batch.items():
                    topic = channels[channel_id].topic
                    times[topic].append(np.array(log_times, np.int64))
                    if channel_id in readers:
                        of_type, get = readers[channel_id]
                        rows = [
                            get(_decoded(file, topic, of_type, each, log_time))
                            for log_time, each in zip(log_times, messages, strict=True)
                        ]
                        tables[topic].append(np.array(rows, float))
                        continue
                    try:
                        if topic not in wires:
                            wires[topic] = Wire(kinds[topic], legs_of(messages[0]))
                        blocks.setdefault(topic, []).append(wires[topic].table(messages))
                    except BadMessage as error:
                        raise BagError(f'{file}: a message on {topic}: {error}') from error
        if progress:
            progress(1.0)
        joined = {topic: np.concatenate(each) for topic, each in times.items()}
        records = {
            topic: (wire.legs, joined[topic], Block.joined(wire.kind, blocks[topic], 0))
            for topic, wire in wires.items()
        }
        return records, {
            topic: (joined[topic], np.concatenate(each)) for topic, each in tables.items()
        }

    def log_times(self, progress: Progress | None = None) -> dict[str, np.ndarray]:
        """Return the log times of all messages on each topic, int64, ns, in the order of the file.

        Parameters
        ----------
        progress : callable, optional
            Called now and then with the share that is done, 0 to 1.

        Raises
        ------
        BagError
            When a chunk of a closed file is damaged.
        """
        found: dict[str, list[int]] = {topic: [] for topic in self.topics}
        for file, contents, reach in self._shared(progress):
            lists = {each.id: found[each.topic] for each in contents.channels.values()}
            for channel_id, log_time, _ in raw_messages(file, contents, lists, reach):
                lists[channel_id].append(log_time)
        return {topic: np.array(times, np.int64) for topic, times in found.items()}

    def _shared(
        self, progress: Progress | None
    ) -> Iterator[tuple[pathlib.Path, Contents, Progress | None]]:
        """Yield each file with its contents and the callback of its share."""
        reach = shares([file for file, _ in self._files], progress)
        for (file, contents), each in zip(self._files, reach, strict=True):
            yield file, contents, each


def _batches(messages: Iterator[RawMessage]) -> Iterator[_Batch]:
    """Yield log times and bytes of messages by channel id, some thousands at a time."""
    while some := list(itertools.islice(messages, _BATCH)):
        found: _Batch = {}
        for channel_id, log_time, data in some:
            times, own = found.setdefault(channel_id, ([], []))
            times.append(log_time)
            own.append(data)
        yield found


def _channels(contents: Contents, topics: Collection[str]) -> list[Channel]:
    """Return the channels of some topics; each file numbers its channels in its own way."""
    return [
        channel
        for channel in contents.channels.values()
        if contents.counts[channel.topic] and channel.topic in topics
    ]


def _message_type(file: pathlib.Path, channel: Channel, contents: Contents) -> MessageType:
    schema = contents.schemas.get(channel.schema_id)
    encoding = schema.encoding if schema else 'none'
    if schema is None or (channel.message_encoding, encoding) != ('cdr', 'ros2msg'):
        raise BagError(
            f'{file}: topic {channel.topic}: messages with encoding {channel.message_encoding!r}'
            f' and schema encoding {encoding!r} cannot be decoded: encoding'
            " 'cdr' and schema encoding 'ros2msg' are needed"
        )
    try:
        return message_type(schema.name, schema.data.decode())
    except Exception as error:  # an invalid definition can raise any exception
        raise BagError(
            f'{file}: topic {channel.topic}: the definition of its message type {schema.name}'
            f' cannot be used: {error}'
        ) from error


def _reader(
    file: pathlib.Path, channel: Channel, contents: Contents, paths: Sequence[str]
) -> tuple[MessageType, Callable[[Any], tuple[Any, ...]]]:
    """Return message type and getter of the numbers of a channel."""
    of_type, get = _message_type(file, channel, contents), field_getter(paths)
    try:
        np.array(get(of_type.blank()), float)
    except Exception as error:  # no such field, no number, or a type that contains itself
        raise BagError(
            f'{file}: topic {channel.topic}: message type {of_type.name}: {error}'
        ) from error
    return of_type, get


def _decoded(
    file: pathlib.Path, topic: str, of_type: MessageType, data: bytes, log_time: int
) -> Any:
    try:
        return of_type.decode(data)
    except Exception as error:  # invalid bytes can raise any exception
        raise BagError(
            f'{file}: a message on {topic} at {log_time} ns cannot be decoded: {error}'
        ) from error


__all__ = ['BagReader']
