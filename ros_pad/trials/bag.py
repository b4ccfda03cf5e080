# SPDX-License-Identifier: Apache-2.0
"""Bags: recorded trials as rosbag2 of ROS 2 Jazzy writes them, without needing ROS to read them.

A bag is a folder with ``metadata.yaml`` (version 9) and one MCAP file (profile ``ros2``, CDR
messages, ``ros2msg`` schemas). Times are nanoseconds of the clock of the trial, which is
simulated time in a simulated trial.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pathlib
import re
import struct
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterator
from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import IO
from typing import Any

import yaml
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import ChunkIndex
from mcap.records import Message
from mcap.records import Schema
from mcap.stream_reader import StreamReader
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC
from mcap.writer import CompressionType
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput

CHUNK_SIZE = 64 * 1024
"""Bytes of messages that are compressed together, and that a killed writer may lose."""

FLUSH_PERIOD = 1.0
"""Seconds of wall time after which a write also sends everything so far on to the disk."""

# Measured on wrenches with noise in chunks of 64 KiB: a message takes 5.4 us of time and 44 bytes
# of file with zstd, 5.0 us and 55 bytes with LZ4, 4.8 us and 123 bytes without compression.
COMPRESSION = CompressionType.ZSTD

# Type and name of a field of a .msg file; a constant has an equals sign after its name.
_FIELD = re.compile(
    r'^[ \t]*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?[ \t]+\w+[ \t]*(=?)', re.MULTILINE
)
_PRIMITIVE = re.compile(r'bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string')
_RULE = '=' * 80
_MESSAGE_OPCODE = 0x05
_MESSAGE_HEADER = struct.Struct('<BQHIQQ')  # opcode, length, channel, sequence, log, publish
_RECORD_HEADER_SIZE = 9


def _interface_file(type_name: str, suffix: str) -> pathlib.Path:
    """Return the installed file of a message type such as ``std_msgs/msg/Float64``."""
    package, name = type_name.split('/')[0], type_name.split('/')[-1]
    # The ament prefixes of a sourced workspace, then the environment that ROS wheels live in.
    prefixes = [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    for prefix in [*prefixes, sys.prefix]:
        path = pathlib.Path(prefix) / 'share' / package / 'msg' / (name + suffix)
        if path.is_file():
            return path
    raise BagError(
        f'no definition of message type {type_name!r}: no share/{package}/msg/{name}{suffix} in '
        f'{os.pathsep.join([*prefixes, sys.prefix])}. Is {package} installed, and ROS sourced?'
    )


def _nested_types(definition: str, package: str) -> set[str]:
    """Return the message types (``package/Name``) of the fields of one ``.msg`` text."""
    return {
        name if '/' in name else f'{package}/{name}'
        for name, constant in _FIELD.findall(definition)
        if not constant and not _PRIMITIVE.fullmatch(name)
    }


def message_definition(type_name: str) -> str:
    """Return the definition of a message type followed by all that it refers to.

    This is the ``ros2msg`` schema text: parts are separated by a line of 80 ``=`` and a line
    ``MSG: package/Name``.

    Raises
    ------
    BagError
        When the type, or one inside it, is not installed.
    """
    seen: set[str] = set()

    def expand(name: str) -> str:
        text = _interface_file(name, '.msg').read_text(encoding='utf-8')
        for inner in sorted(_nested_types(text, package=name.split('/')[0])):
            if inner not in seen:
                seen.add(inner)
                text += f'\n{_RULE}\nMSG: {inner}\n{expand(inner)}'
        return text

    return expand(type_name)


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of a message type, as its build computed it.

    Raises
    ------
    BagError
        When the type is not installed, or was built without a description.
    """
    path = _interface_file(type_name, '.json')
    for entry in json.loads(path.read_text(encoding='utf-8'))['type_hashes']:
        if entry['type_name'] == type_name:
            return str(entry['hash_string'])
    raise BagError(f'{path}: has no hash of {type_name}')


class BagWriter:
    """Writes a new bag; use it as a context manager.

    Should the process die, or the power fail, all but the last second or so can still be read,
    and `ros_pad.trials.repair` makes a whole bag of it.

    Parameters
    ----------
    folder : path
        Folder to create. It must not exist: no bag is ever overwritten.
    custom_data : mapping of str to str, optional
        What ``metadata.yaml`` is to carry about the trial.

    Raises
    ------
    BagError
        When the folder exists or cannot be created.
    InvalidInput
        When `custom_data` holds anything but text.

    Attributes
    ----------
    folder : pathlib.Path
        The folder.
    message_count : int
        Messages written so far.
    """

    def __init__(
        self, folder: str | os.PathLike[str], custom_data: Mapping[str, str] | None = None
    ) -> None:
        self.folder = pathlib.Path(folder)
        self.message_count = 0
        self._custom_data = _texts(custom_data)
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError:
            raise BagError(f'{self.folder}: exists, and no bag is overwritten') from None
        except OSError as error:
            raise BagError(f'{self.folder}: cannot be created: {error.strerror}') from error
        self._path = self.folder / f'{self.folder.name}_0.mcap'
        self._topics: dict[str, dict[str, Any]] = {}  # as metadata.yaml has them
        self._channels: dict[str, int] = {}  # empty once the bag is closed
        self._schemas: dict[str, int] = {}
        self._next_flush = 0.0
        self._stream: IO[bytes] | None = None
        # A disk may take its time to write, and a recorder has none: another thread waits.
        self._disk = ThreadPoolExecutor(1, 'bag to disk')
        self._synced: Future[None] | None = None
        try:
            self._stream = self._path.open('xb')
            self._writer = Writer(self._stream, chunk_size=CHUNK_SIZE, compression=COMPRESSION)
            self._writer.start(profile='ros2', library='ros_pad')
            self._write_metadata(_Contents())
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
            The offered QoS profiles as YAML, see :func:`ros_pad.nodes.qos.offered_profiles`.

        Raises
        ------
        BagError
            When the type is unknown, the topic is there already, or the bag is closed.
        """
        digest = type_hash(type_name)
        definition = message_definition(type_name).encode()
        metadata = {'offered_qos_profiles': qos, 'topic_type_hash': digest}
        self.copy_topic(
            Channel(id=0, topic=name, message_encoding='cdr', metadata=metadata, schema_id=0),
            Schema(id=0, name=type_name, encoding='ros2msg', data=definition),
        )

    def copy_topic(self, channel: Channel, schema: Schema) -> None:
        """Declare a topic as another bag has it; its types need not be installed.

        Parameters
        ----------
        channel : mcap.records.Channel
            Its name, encoding and metadata; its numbers are given anew.
        schema : mcap.records.Schema
            Its message type, with all that this refers to.

        Raises
        ------
        BagError
            When the topic is there already, or the bag is closed.
        """
        name = channel.topic
        if self._stream is None:
            raise BagError(f'{self.folder}: is closed, no topic {name} can be added')
        if name in self._topics:
            raise BagError(f'{self.folder}: has topic {name} already')
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        self._channels[name] = self._writer.register_channel(
            name, channel.message_encoding, self._schemas[schema.name], channel.metadata
        )
        self._topics[name] = {
            'name': name,
            'type': schema.name,
            'serialization_format': channel.message_encoding,
            'offered_qos_profiles': yaml.safe_load(
                channel.metadata.get('offered_qos_profiles', '[]')
            )
            or [],
            'type_description_hash': channel.metadata.get('topic_type_hash', ''),
        }
        self._next_flush = 0.0  # the next message brings file and metadata.yaml up to date

    def write(
        self, topic: str, cdr_bytes: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> None:
        """Append one message.

        Parameters
        ----------
        topic : str
            One that was added.
        cdr_bytes : bytes
            The serialized message, with its 4-byte CDR header.
        log_time_ns, publish_time_ns : int
            When it was received and sent, ns >= 0; sent is the same as received by default.

        Raises
        ------
        BagError
            When the topic was not added, the bag is closed, or the disk is full; then the
            message says how many messages are saved, and the bag is closed.
        InvalidInput
            When a time is negative.
        """
        channel = self._channels.get(topic)
        if channel is None:
            closed = self._stream is None
            raise BagError(
                f'{self.folder}: cannot write on {topic}: '
                f'{"the bag is closed" if closed else "that topic was not added"}'
            )
        if publish_time_ns is None:
            publish_time_ns = log_time_ns
        if log_time_ns < 0 or publish_time_ns < 0:
            raise InvalidInput(
                f'{topic}: time of a message = {min(log_time_ns, publish_time_ns)} ns '
                'is not allowed: 0 ns or more is needed'
            )
        try:
            self._writer.add_message(channel, log_time_ns, cdr_bytes, publish_time_ns)
            self.message_count += 1
            if time.monotonic() >= self._next_flush:
                self.flush()
        except OSError as error:
            self._fail(error)

    def describe(self, custom_data: Mapping[str, str]) -> None:
        """Add to what ``metadata.yaml`` carries about the trial; it is there after the next flush.

        Raises
        ------
        InvalidInput
            When `custom_data` holds anything but text.
        """
        self._custom_data |= _texts(custom_data)
        self._next_flush = 0.0

    def flush(self) -> None:
        """Hand everything written so far to the operating system, and that to the disk.

        The disk is not waited for: what it could not take is raised by the next flush.

        Raises
        ------
        BagError
            When the bag is closed or the disk is full.
        """
        if self._stream is None:
            raise BagError(f'{self.folder}: is closed')
        try:
            self._writer.flush()
            if self._next_flush == 0.0:  # there is more to say
                self._write_metadata(_Contents())
            if self._synced is None or self._synced.done():
                if self._synced:
                    self._synced.result()
                self._synced = self._disk.submit(os.fsync, self._stream.fileno())
        except OSError as error:
            self._fail(error)
        self._next_flush = time.monotonic() + FLUSH_PERIOD

    def close(self, custom_data: Mapping[str, str] | None = None) -> None:
        """Finish the file and write ``metadata.yaml`` with true counts and times.

        Parameters
        ----------
        custom_data : mapping of str to str, optional
            Added to what the constructor was given. A second call does nothing.

        Raises
        ------
        BagError
            When the disk is full: says how many messages are saved.
        """
        if self._stream is None:
            return
        self.describe(custom_data or {})
        try:
            self._writer.finish()
            self._disk.shutdown()
            if self._synced:
                self._synced.result()  # the disk tells only once what it could not take
            os.fsync(self._stream.fileno())
            self._stream.close()
            self._stream = None
            self._channels = {}
            self._write_metadata(_scan(self._path))
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        """Leave what can be left on a disk that takes no more, and raise."""
        self._disk.shutdown()
        if self._stream is not None:
            with contextlib.suppress(OSError):
                self._stream.close()
        self._stream = None
        self._channels = {}
        contents = _scan(self._path) if self._path.is_file() else _Contents()
        with contextlib.suppress(OSError):
            self._write_metadata(contents)
        raise BagError(
            f'{self._path}: cannot be written: {error.strerror}; '
            f'{contents.message_count} messages are saved in it'
        ) from error

    def _write_metadata(self, contents: _Contents) -> None:
        starting_time = {'nanoseconds_since_epoch': contents.start}
        duration = {'nanoseconds': contents.end - contents.start}
        information = {
            'version': 9,
            'storage_identifier': 'mcap',
            'duration': duration,
            'starting_time': starting_time,
            'message_count': contents.message_count,
            'topics_with_message_count': [
                {'topic_metadata': topic, 'message_count': contents.counts[name]}
                for name, topic in self._topics.items()
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [self._path.name],
            'files': [
                {
                    'path': self._path.name,
                    'starting_time': starting_time,
                    'duration': duration,
                    'message_count': contents.message_count,
                }
            ],
            'custom_data': self._custom_data,
            'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
        }
        _replace_metadata(self.folder, information)


def annotate(folder: str | os.PathLike[str], custom_data: Mapping[str, str]) -> None:
    """Add to what a closed bag says about its trial.

    Parameters
    ----------
    folder : path
        Folder of the bag.
    custom_data : mapping of str to str
        Replaces what the bag has under the same keys.

    Raises
    ------
    BagError
        When the folder has no metadata, or it cannot be written.
    """
    folder = pathlib.Path(folder)
    try:
        metadata = yaml.safe_load((folder / 'metadata.yaml').read_text(encoding='utf-8'))
        information = metadata['rosbag2_bagfile_information']
        information['custom_data'] = (information.get('custom_data') or {}) | _texts(custom_data)
        _replace_metadata(folder, information)
    except (OSError, KeyError, TypeError, yaml.YAMLError) as error:
        raise BagError(f'{folder}: metadata.yaml cannot be changed: {error}') from error


def _replace_metadata(folder: pathlib.Path, information: dict[str, Any]) -> None:
    """Write metadata.yaml as a whole, so that a full disk or a kill leaves the earlier one."""
    new = folder / 'metadata.yaml.new'
    text = yaml.dump(
        {'rosbag2_bagfile_information': information},
        Dumper=_NoAliasDumper,
        sort_keys=False,
        allow_unicode=True,
    )
    try:
        with new.open('w', encoding='utf-8') as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())  # or the name may reach the disk before the contents
        new.replace(folder / 'metadata.yaml')
    except OSError:
        with contextlib.suppress(OSError):
            new.unlink()
        raise


class BagReader:
    """Reads the messages of a bag, in the order in which they were written.

    A bag whose writer was killed is read as far as it goes; that it was not closed, and how
    many messages can be read, is in :attr:`problem` and issued as a warning.

    Parameters
    ----------
    path : path
        The folder of a bag, or one MCAP file.

    Attributes
    ----------
    topics : dict of str to str
        Message type of each topic.
    counts : dict of str to int
        Number of messages on each topic.
    custom_data : dict of str to str
        What the writer said about the trial; empty for a lone MCAP file.
    start, end : int
        Times of the first and the last message, ns; 0 in an empty bag.
    message_count : int
        Messages that can be read.
    problem : str or None
        What is wrong with the bag although it can be read.

    Raises
    ------
    BagError
        When there is no such bag, or no message of it can be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = pathlib.Path(path)
        self.custom_data: dict[str, str] = {}
        if not self.path.exists():
            raise BagError(f'{self.path}: no such bag')
        files = self._files_of_folder() if self.path.is_dir() else [self.path]
        self._files = [(file, _scan(file)) for file in files]
        parts = [contents for _, contents in self._files]
        for file, part in self._files:
            for channel in part.channels.values():
                if channel.schema_id and channel.schema_id not in part.schemas:
                    raise BagError(f'{file}: is damaged: no message type of {channel.topic}')
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
        """Return the MCAP files of the folder, and take ``custom_data`` on the way."""
        metadata = self.path / 'metadata.yaml'
        if not metadata.is_file():
            raise BagError(f'{self.path}: is no bag, it has no metadata.yaml')
        try:
            content = yaml.safe_load(metadata.read_text(encoding='utf-8'))
            information = content['rosbag2_bagfile_information']
            storage = information['storage_identifier']
            compression = str(information.get('compression_mode', ''))
            names = [str(name) for name in information['relative_file_paths']]
            self.custom_data = dict(information.get('custom_data') or {})
        except Exception as error:  # YAML, or what it says, may be wrong in any way
            raise BagError(f'{metadata}: is not the metadata of a bag: {error!r}') from error
        if storage != 'mcap' or compression.lower() not in ('', 'none'):
            raise BagError(
                f'{self.path}: storage {storage!r} with compression mode {compression!r} cannot '
                "be read, only 'mcap' without; 'ros2 bag convert' makes one of the other"
            )
        files = [self.path / pathlib.PurePath(name).name for name in names]
        for file in files:
            if not file.is_file():
                raise BagError(f'{self.path}: has lost its file {file.name}')
        return files

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, Any, int]]:
        """Yield topic, decoded message and log time in ns of each message.

        Parameters
        ----------
        topics : collection of str, optional
            Only these; a topic that the bag does not have yields nothing.

        Raises
        ------
        BagError
            When a message cannot be decoded.
        """
        for file, contents in self._files:
            # Decoders need the schemas of this file: ids mean nothing in another one.
            decoders: dict[int, tuple[str, Callable[[bytes], Any]]] = {
                channel.id: (channel.topic, _decoder(channel, contents.schemas))
                for channel in contents.channels.values()
                if topics is None or channel.topic in topics
            }
            for channel_id, log_time, data in _raw_messages(file, contents, decoders):
                topic, decode = decoders[channel_id]
                try:
                    message = decode(data)
                except Exception as error:  # bytes that are not of its type fail in any way
                    raise BagError(
                        f'{file}: a message on {topic} at {log_time} ns cannot be decoded: {error}'
                    ) from error
                yield topic, message, log_time


@dataclasses.dataclass
class _Contents:
    """What an MCAP file holds."""

    finished: bool = False
    schemas: dict[int, Schema] = dataclasses.field(default_factory=dict)
    channels: dict[int, Channel] = dataclasses.field(default_factory=dict)
    chunks: list[ChunkIndex] = dataclasses.field(default_factory=list)
    counts: Counter[str] = dataclasses.field(default_factory=Counter)
    start: int = 0
    end: int = 0

    @property
    def message_count(self) -> int:
        return self.counts.total()


def _scan(path: pathlib.Path) -> _Contents:
    """Read the summary at the end of an MCAP file or, if there is none, the file itself."""
    contents = _Contents()
    with path.open('rb') as stream:
        magic = stream.read(len(MCAP0_MAGIC))
        if not MCAP0_MAGIC.startswith(magic):
            raise BagError(f'{path}: is no MCAP file')
        stream.seek(0)
        try:
            summary = make_reader(stream).get_summary()
        except Exception:  # what is torn fails in any way; the records from the start count then
            summary = None
    if summary is not None and summary.statistics is not None:
        statistics = summary.statistics
        contents.finished = True
        contents.schemas = summary.schemas
        contents.channels = summary.channels
        contents.chunks = summary.chunk_indexes
        for channel_id, count in statistics.channel_message_counts.items():
            if channel_id not in summary.channels:
                raise BagError(f'{path}: is damaged: it counts messages of no topic')
            contents.counts[summary.channels[channel_id].topic] += count
        contents.start = statistics.message_start_time
        contents.end = statistics.message_end_time
        return contents
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
                raise BagError(f'{path}: is damaged: a message is on no topic')
            contents.counts[contents.channels[record.channel_id].topic] += 1
    return contents


def _readable_records(path: pathlib.Path, contents: _Contents) -> Iterator[Any]:
    """Yield the records of an MCAP file from its beginning until it ends or makes no sense."""
    with path.open('rb') as stream:
        try:
            yield from StreamReader(stream, validate_crcs=True).records
            contents.finished = True
        except Exception:
            # A torn record can make the parser, or a decompressor, fail in any way; all that
            # counts is what came before it.
            return


def _raw_messages(
    path: pathlib.Path, contents: _Contents, wanted: Collection[int]
) -> Iterator[tuple[int, int, bytes]]:
    """Yield channel id, log time in ns and CDR bytes of the messages on the wanted channels."""
    if not contents.chunks:
        for record in _readable_records(path, contents):
            if isinstance(record, Message) and record.channel_id in wanted:
                yield record.channel_id, record.log_time, record.data
        return
    with path.open('rb') as stream:
        for index in sorted(contents.chunks, key=lambda index: index.chunk_start_offset):
            # An index without offsets says nothing about what is in the chunk.
            if index.message_index_offsets and not any(
                channel_id in wanted for channel_id in index.message_index_offsets
            ):
                continue
            try:
                stream.seek(index.chunk_start_offset + _RECORD_HEADER_SIZE)
                chunk = Chunk.read(ReadDataStream(stream))
                records, size = get_chunk_data_stream(chunk, validate_crc=True)
            except Exception as error:  # each decompressor has an error of its own
                raise BagError(
                    f'{path}: is damaged at byte {index.chunk_start_offset}: {error}'
                ) from error
            yield from _messages_of_chunk(records.read(size), wanted)


def _messages_of_chunk(data: bytes, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
    """Split a chunk; the reader of the mcap package takes ten times as long."""
    unpack = _MESSAGE_HEADER.unpack_from
    position = 0
    # What is too short for a message can only be a schema or channel that nothing follows.
    while position + _MESSAGE_HEADER.size <= len(data):
        opcode, length, channel_id, _, log_time, _ = unpack(data, position)
        end = position + _RECORD_HEADER_SIZE + length
        if opcode == _MESSAGE_OPCODE and channel_id in wanted:
            yield channel_id, log_time, data[position + _MESSAGE_HEADER.size : end]
        position = end


def _decoder(channel: Channel, schemas: Mapping[int, Schema]) -> Callable[[bytes], Any]:
    """Return a function from CDR bytes to a message."""
    schema = schemas.get(channel.schema_id)
    try:
        decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
    except Exception as error:  # a definition that is no text, or makes no sense
        raise BagError(
            f'topic {channel.topic}: its message type cannot be understood: {error}'
        ) from error
    if decode is None:
        encoding = schema.encoding if schema else 'nothing'
        raise BagError(
            f'topic {channel.topic}: messages in {channel.message_encoding!r} described in '
            f"{encoding!r} cannot be decoded, only 'cdr' described in 'ros2msg'"
        )
    return decode


def _texts(custom_data: Mapping[str, str] | None) -> dict[str, str]:
    for key, value in (custom_data or {}).items():
        if not isinstance(key, str) or not isinstance(value, str):
            raise InvalidInput(f'custom_data: {key!r}: {value!r} is not allowed: text is needed')
    return dict(custom_data or {})


class _NoAliasDumper(yaml.SafeDumper):
    """Writes what occurs twice twice: rosbag2's metadata has no YAML anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


__all__ = ['BagReader', 'BagWriter', 'annotate', 'message_definition', 'type_hash']
