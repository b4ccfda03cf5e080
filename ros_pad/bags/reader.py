# SPDX-License-Identifier: Apache-2.0
"""Read bags without ROS, also those whose writer was killed."""

from __future__ import annotations

import os
import pathlib
import warnings
from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterator
from typing import Any

from mcap.records import Channel
from mcap.records import Schema

from ros_pad.bags import codec
from ros_pad.bags import metadata
from ros_pad.bags.storage import raw_messages
from ros_pad.bags.storage import scan
from ros_pad.errors import BagError


class BagReader:
    """Read the messages of a bag, in the order in which they were written.

    A bag whose writer was killed is read up to the damage; :attr:`problem` and a warning report
    this, with the number of messages that can be read.

    Parameters
    ----------
    path : path
        The folder of a bag, or one MCAP file.

    Attributes
    ----------
    topics : dict of str to str
        Message type of each topic; empty if the file does not name the type.
    counts : dict of str to int
        Number of messages on each topic.
    custom_data : dict of str to str
        Texts about the trial, by key; empty if the path is an MCAP file.
    start, end : int
        Times of the first and the last message, ns; 0 in an empty bag.
    message_count : int
        Number of messages that can be read.
    problem : str or None
        Damage that leaves some messages readable; None without damage.

    Raises
    ------
    BagError
        When there is no such bag, its metadata is invalid, its storage is not MCAP without a
        compression mode, a file is missing, or no message of a damaged bag can be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = pathlib.Path(path)
        self.custom_data: dict[str, str] = {}
        if not self.path.exists():
            raise BagError(f'{self.path}: no such bag')
        files = self._files_of_folder() if self.path.is_dir() else [self.path]
        self._files = [(file, scan(file)) for file in files]
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
                f'{self.path / "metadata.yaml"}: is not the metadata of a bag: {error!r}'
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

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, Any, int]]:
        """Yield topic, decoded message and log time in ns of each message.

        Parameters
        ----------
        topics : collection of str, optional
            Topics to read, by default all; a topic that the bag does not have yields nothing.

        Raises
        ------
        BagError
            When a message cannot be decoded, or a chunk of a closed file is damaged.
        """
        for file, contents in self._files:
            # Each file numbers its channels and schemas in its own way.
            decoders = {
                channel.id: (
                    channel.topic,
                    _decoder(file, channel, contents.schemas.get(channel.schema_id)),
                )
                for channel in contents.channels.values()
                if contents.counts[channel.topic] and (topics is None or channel.topic in topics)
            }
            for channel_id, log_time, data in raw_messages(file, contents, decoders):
                topic, decode = decoders[channel_id]
                try:
                    message = decode(data)
                except Exception as error:  # invalid bytes can raise any exception
                    raise BagError(
                        f'{file}: a message on {topic} at {log_time} ns cannot be decoded: {error}'
                    ) from error
                yield topic, message, log_time


def _decoder(
    file: pathlib.Path, channel: Channel, schema: Schema | None
) -> Callable[[bytes], Any]:
    """Return a function from CDR bytes to a message."""
    encoding = schema.encoding if schema else 'none'
    if schema is None or (channel.message_encoding, encoding) != ('cdr', 'ros2msg'):
        raise BagError(
            f'{file}: topic {channel.topic}: messages with encoding {channel.message_encoding!r}'
            f' and schema encoding {encoding!r} cannot be decoded: encoding'
            " 'cdr' and schema encoding 'ros2msg' are needed"
        )
    try:
        return codec.message_type(schema.name, schema.data.decode()).decode
    except Exception as error:  # an invalid definition can raise any exception
        raise BagError(
            f'{file}: topic {channel.topic}: the definition of its message type {schema.name}'
            f' cannot be used: {error}'
        ) from error


__all__ = ['BagReader']
