# SPDX-License-Identifier: Apache-2.0
"""Write bags in the format of ROS 2 Jazzy; a killed writer loses about one second."""

from __future__ import annotations

import contextlib
import os
import pathlib
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import IO, Any

from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from ros_pad.bags import metadata
from ros_pad.bags.codec import definition_of
from ros_pad.bags.storage import Contents, scan
from ros_pad.errors import BagError, InvalidInput

CHUNK_SIZE = 192 * 1024
"""Size of a chunk of messages, bytes; a killed writer may lose its last chunk."""

FLUSH_PERIOD = 1.0
"""Wall time between two flushes to the disk, s."""

# Measured on wrenches with noise in chunks of 64 KiB: a message takes 5.4 us of time and 44 bytes
# of file with zstd, 5.0 us and 55 bytes with LZ4, 4.8 us and 123 bytes without compression.
COMPRESSION = CompressionType.ZSTD


class BagWriter:
    """Write a new bag; use it as a context manager.

    The first message and the end write ``metadata.yaml``, as do topics and custom data in between.
    If the process dies or the power fails, all but about the last second can still be read, and
    `ros_pad.bags.repair` makes a complete bag of it.

    Parameters
    ----------
    folder : path
        Folder to create. It must not exist: no bag is ever overwritten.
    custom_data : mapping of str to str, optional
        Texts about the trial, for ``metadata.yaml``.

    Raises
    ------
    BagError
        When the folder exists or cannot be created.
    InvalidInput
        When `custom_data` holds anything but text.

    Attributes
    ----------
    folder : pathlib.Path
        As given.
    message_count : int
        Number of messages written so far.
    """

    def __init__(
        self, folder: str | os.PathLike[str], custom_data: Mapping[str, str] | None = None
    ) -> None:
        self.folder = pathlib.Path(folder)
        self.message_count = 0
        self._custom_data = metadata.texts({} if custom_data is None else custom_data)
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError:
            raise BagError(
                f'{self.folder}: exists already, and bags are never overwritten: choose another'
                ' folder'
            ) from None
        except OSError as error:
            raise BagError(f'{self.folder}: cannot be created: {error.strerror}') from error
        self._path = self.folder / f'{self.folder.name}_0.mcap'
        self._topics: dict[str, dict[str, Any]] = {}  # entries of metadata.yaml
        self._channels: dict[str, int] = {}  # empty once the bag is closed
        self._schemas: dict[str, int] = {}
        self._next_flush = 0.0
        self._stream: IO[bytes] | None = None
        # Another thread waits for the disk, so that the caller does not.
        self._disk = ThreadPoolExecutor(1, 'bag to disk')
        self._synced: Future[None] | None = None
        try:
            self._stream = self._path.open('xb')
            self._writer = Writer(self._stream, chunk_size=CHUNK_SIZE, compression=COMPRESSION)
            self._writer.start(profile='ros2', library='ros_pad')
        except OSError as error:
            self._fail(error)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def add_topic(self, name: str, type_name: str, qos: str = '[]') -> None:
        """Declare a topic before the first message on it.

        Parameters
        ----------
        name : str
            Full name of the topic, such as ``/leg_1/wrench``.
        type_name : str
            Such as ``geometry_msgs/msg/WrenchStamped``.
        qos : str
            The offered QoS profiles as YAML, see :func:`ros_pad.nodes.qos.offered`.

        Raises
        ------
        BagError
            When the type is not installed, the topic is there already, or the bag is closed.
        """
        definition, known_hash = definition_of(type_name)
        about = {'offered_qos_profiles': qos, 'topic_type_hash': known_hash}
        self.copy_topic(
            Channel(id=0, topic=name, message_encoding='cdr', metadata=about, schema_id=0),
            Schema(id=0, name=type_name, encoding='ros2msg', data=definition.encode()),
        )

    def copy_topic(self, channel: Channel, schema: Schema) -> None:
        """Declare a topic as in another bag; its message type need not be installed.

        Parameters
        ----------
        channel : mcap.records.Channel
            Name, encoding and metadata of the topic; its id is not used.
        schema : mcap.records.Schema
            Message type of the topic, with the definitions of all types in it.

        Raises
        ------
        BagError
            When the topic is there already, or the bag is closed.
        """
        name = channel.topic
        if self._stream is None:
            raise BagError(f'bag {self.folder} is closed: topic {name} cannot be added')
        if name in self._topics:
            raise BagError(f'bag {self.folder} has topic {name} already')
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        self._channels[name] = self._writer.register_channel(
            name, channel.message_encoding, self._schemas[schema.name], channel.metadata
        )
        self._topics[name] = metadata.topic_metadata(channel, schema)
        self._next_flush = 0.0  # the next message brings file and metadata.yaml up to date

    def write(
        self, topic: str, cdr_bytes: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> None:
        """Append one message.

        Parameters
        ----------
        topic : str
            Name of a topic that was added.
        cdr_bytes : bytes
            The serialized message, with its 4-byte CDR header.
        log_time_ns, publish_time_ns : int
            Times of receipt and of publication, ns >= 0; by default they are the same.

        Raises
        ------
        BagError
            When the topic was not added, the bag is closed, or the disk is full. A full disk
            closes the bag; the error then says how many messages are saved.
        InvalidInput
            When a time is negative.
        """
        channel = self._channels.get(topic)
        if channel is None:
            cause = 'the bag is closed' if self._stream is None else 'this topic was not added'
            raise BagError(f'{self.folder}: cannot write a message on topic {topic}: {cause}')
        if publish_time_ns is None:
            publish_time_ns = log_time_ns
        if log_time_ns < 0 or publish_time_ns < 0:
            raise InvalidInput(
                f'topic {topic}: time of a message = {min(log_time_ns, publish_time_ns)} ns '
                'is not allowed: at least 0 ns is needed'
            )
        try:
            self._writer.add_message(channel, log_time_ns, cdr_bytes, publish_time_ns)
            self.message_count += 1
            if time.monotonic() >= self._next_flush:
                self.flush()
        except OSError as error:
            self._fail(error)

    def describe(self, custom_data: Mapping[str, str]) -> None:
        """Add custom data about the trial; the next flush writes it.

        Parameters
        ----------
        custom_data : mapping of str to str
            Texts by key, added to the earlier ones.

        Raises
        ------
        InvalidInput
            When `custom_data` holds anything but text.
        """
        self._custom_data |= metadata.texts(custom_data)
        self._next_flush = 0.0

    def flush(self) -> None:
        """Send everything written so far to the operating system, and from there to the disk.

        This does not wait for the disk: its errors are raised by the next flush.

        Raises
        ------
        BagError
            When the bag is closed or the disk is full.
        """
        if self._stream is None:
            raise BagError(f'bag {self.folder} is closed: nothing more can be written')
        try:
            self._writer.flush()
            if self._next_flush == 0.0:  # topics or custom data are new
                self._write_metadata(Contents())
            if self._synced is None or self._synced.done():
                if self._synced:
                    self._synced.result()
                self._synced = self._disk.submit(os.fsync, self._stream.fileno())
        except OSError as error:
            self._fail(error)
        self._next_flush = time.monotonic() + FLUSH_PERIOD

    def close(self) -> None:
        """Finish the file and write ``metadata.yaml`` with true counts and times.

        A second call does nothing.

        Raises
        ------
        BagError
            When the disk is full; it says how many messages are saved.
        """
        if self._stream is None:
            return
        try:
            self._writer.finish()
            self._disk.shutdown()
            if self._synced:
                self._synced.result()  # the operating system reports a failed write only once
            os.fsync(self._stream.fileno())
            self._stream.close()
            self._stream = None
            self._channels = {}
            self._write_metadata(scan(self._path))
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        """Save what a full disk still accepts, and raise."""
        self._disk.shutdown()
        if self._stream is not None:
            with contextlib.suppress(OSError):
                self._stream.close()
        self._stream = None
        self._channels = {}
        contents = scan(self._path) if self._path.is_file() else Contents()
        with contextlib.suppress(OSError):
            self._write_metadata(contents)
        raise BagError(
            f'{self._path}: cannot be written: {error.strerror}; '
            f'{contents.message_count} messages are saved in it'
        ) from error

    def _write_metadata(self, contents: Contents) -> None:
        metadata.write(self._path, self._topics.values(), contents, self._custom_data)


__all__ = ['BagWriter']
