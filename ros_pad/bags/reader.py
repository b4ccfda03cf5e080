# SPDX-License-Identifier: Apache-2.0
"""Read bags without ROS, also those whose writer was killed."""

from __future__ import annotations

import os
import pathlib
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from mcap.records import Channel, Schema

from ros_pad.bags import metadata
from ros_pad.bags.codec import MessageType, field_getter, message_type
from ros_pad.bags.storage import RawMessage, raw_messages, scan, shares
from ros_pad.bags.wire import Wire, legs_of
from ros_pad.errors import BadMessage, BagError, reason
from ros_pad.pace import Progress
from ros_pad.records import Block, Kind

Table: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Log times, int64, ns, and a row of numbers for each message."""

Recorded: TypeAlias = tuple[tuple[int, ...], np.ndarray, Block]
"""Numbers of the legs, log times, int64, ns, and all records of a topic."""


class BagReader:
    """Read the messages of a bag, in the order in which they were written.

    Of a bag whose writer was killed, all is read that can be; :attr:`problem` and a warning report
    this, with the number of messages.

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
        Damage that leaves some messages readable; None if none is known of.

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
        self._declared: dict[str, tuple[Channel, Schema | None]] = {
            channel.topic: (channel, part.schemas.get(channel.schema_id))
            for part in parts
            for channel in part.channels.values()
        }
        self._types: dict[str, MessageType] = {}
        self.topics = {
            topic: schema.name if schema else '' for topic, (_, schema) in self._declared.items()
        }
        self.counts: dict[str, int] = {
            topic: sum(part.counts[topic] for part in parts) for topic in self.topics
        }
        self.message_count = sum(self.counts.values())
        filled = [part for part in parts if part.message_count]
        self.start = min((part.start for part in filled), default=0)
        self.end = max((part.end for part in filled), default=0)
        self.problem: str | None = None
        unfinished = ' and '.join(file.name for file, part in self._files if not part.whole)
        if unfinished:
            self.problem = (
                f'{self.path}: {unfinished} was not closed, or is damaged; '
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
        self, topics: Collection[str] | None = None, progress: Progress | None = None
    ) -> Iterator[tuple[str, Any, int]]:
        """Yield topic, decoded message and log time in ns of each message.

        Parameters
        ----------
        topics : collection of str, optional
            Topics to read, by default all; a topic that the bag does not have yields nothing.
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
        topics = self.topics if topics is None else topics
        for topic, log_time, data in self._raw(topics, progress):
            yield topic, self._decoded(topic, data, log_time), log_time

    def tables(self, paths: Mapping[str, Sequence[str]]) -> dict[str, Table]:
        """Return log times and numbers of all messages on some topics.

        Parameters
        ----------
        paths : mapping
            Fields to read, such as ``wrench.force.x``, by topic; a topic that the bag does not
            have yields nothing.

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
        return self.read({}, paths)[1]

    def records(self, kinds: Mapping[str, Kind]) -> dict[str, Recorded]:
        """Return all records on some topics.

        Parameters
        ----------
        kinds : mapping
            Kind of the records, by topic; a topic without messages is left out.

        Returns
        -------
        dict
            By topic: numbers of the legs, log times of all records, int64, ns, and their block.

        Raises
        ------
        BagError
            When a message is no record of its kind, or a chunk of a closed file is damaged.
        """
        return self.read(kinds, {})[0]

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
        times: dict[str, list[int]] = {topic: [] for topic in (*kinds, *paths)}
        wires: dict[str, Wire] = {}
        blocks: dict[str, list[Block]] = {topic: [] for topic in kinds}
        rows: dict[str, list[tuple[float, ...]]] = {topic: [] for topic in paths}
        getters = {topic: field_getter(each) for topic, each in paths.items()}
        for topic, log_time, data in self._raw(times, progress):
            try:
                if topic in getters:
                    message = self._decoded(topic, data, log_time)
                    rows[topic].append(tuple(map(float, getters[topic](message))))
                    times[topic].append(log_time)
                    continue
                if topic not in wires:
                    wires[topic] = Wire(kinds[topic], legs_of(data))
                block = wires[topic].decode(data)
            except (BadMessage, AttributeError, IndexError, TypeError, ValueError) as error:
                raise BagError(f'{self.path}: a message on {topic}: {error}') from error
            blocks[topic].append(block)
            times[topic] += [log_time] * len(block.stamps)
        joined = {topic: np.array(each, np.int64) for topic, each in times.items()}
        records = {
            topic: (wire.legs, joined[topic], Block.joined(wire.kind, blocks[topic], 0))
            for topic, wire in wires.items()
        }
        tables = {
            topic: (joined[topic], np.array(each, float).reshape(len(each), len(paths[topic])))
            for topic, each in rows.items()
        }
        return records, tables

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
        for topic, log_time, _ in self._raw(found, progress):
            found[topic].append(log_time)
        return {topic: np.array(times, np.int64) for topic, times in found.items()}

    def _raw(self, topics: Collection[str], progress: Progress | None) -> Iterator[RawMessage]:
        """Yield topic, log time, ns, and bytes of the messages on some topics."""
        reach = shares([file for file, _ in self._files], progress)
        for (file, contents), each in zip(self._files, reach, strict=True):
            yield from raw_messages(file, contents, topics, each)
        if progress:
            progress(1.0)

    def _decoded(self, topic: str, data: bytes, log_time: int) -> Any:
        if topic not in self._types:
            self._types[topic] = self._type(topic)
        try:
            return self._types[topic].decode(data)
        except Exception as error:  # invalid bytes can raise any exception
            raise BagError(
                f'{self.path}: a message on {topic} at {log_time} ns cannot be decoded: {error}'
            ) from error

    def _type(self, topic: str) -> MessageType:
        channel, schema = self._declared[topic]
        encoding = schema.encoding if schema else 'none'
        if schema is None or (channel.message_encoding, encoding) != ('cdr', 'ros2msg'):
            raise BagError(
                f'{self.path}: topic {topic}: messages with encoding {channel.message_encoding!r}'
                f' and schema encoding {encoding!r} cannot be decoded: encoding'
                " 'cdr' and schema encoding 'ros2msg' are needed"
            )
        try:
            return message_type(schema.name, schema.data.decode())
        except Exception as error:  # an invalid definition can raise any exception
            raise BagError(
                f'{self.path}: topic {topic}: the definition of its message type {schema.name}'
                f' cannot be used: {error}'
            ) from error


__all__ = ['BagReader']
