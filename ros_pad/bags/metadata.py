# SPDX-License-Identifier: Apache-2.0
"""``metadata.yaml`` of a bag, in version 9 of rosbag2."""

from __future__ import annotations

import contextlib
import functools
import os
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any

import yaml
from mcap.records import Channel, Schema

from ros_pad.bags.storage import Contents
from ros_pad.configuration import instance, text
from ros_pad.errors import BagError, reason
from ros_pad.yaml_text import read_yaml

_NAME = 'metadata.yaml'
_ROOT = 'rosbag2_bagfile_information'
_TOPICS = 'topics_with_message_count'


def topic_metadata(channel: Channel, schema: Schema) -> dict[str, Any]:
    """Return the entry of one topic in ``metadata.yaml``."""
    profiles = channel.metadata.get('offered_qos_profiles', '[]')
    return {
        'name': channel.topic,
        'type': schema.name,
        'serialization_format': channel.message_encoding,
        'offered_qos_profiles': _parsed(profiles),
        'type_description_hash': channel.metadata.get('topic_type_hash', ''),
    }


@functools.lru_cache(maxsize=256)
def _parsed(profiles: str) -> list[Any]:
    """Return QoS profiles from their YAML text, cached because many topics have the same."""
    return read_yaml(profiles) or []


def write(
    file: pathlib.Path,
    topics: Iterable[Mapping[str, Any]],
    contents: Contents,
    custom_data: Mapping[str, str],
) -> None:
    """Write the metadata of a bag that has one MCAP file, into the folder of this file.

    Parameters
    ----------
    file : path
        The MCAP file.
    topics : iterable of mapping
        Entries of :func:`topic_metadata`.
    contents : Contents
        Counts and times of the messages.
    custom_data : mapping of str to str
        Texts about the trial, by key.

    Raises
    ------
    OSError
        When the metadata cannot be written; the earlier metadata stays.
    """
    starting_time = {'nanoseconds_since_epoch': contents.start}
    duration = {'nanoseconds': contents.end - contents.start}
    information = {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': duration,
        'starting_time': starting_time,
        'message_count': contents.message_count,
        _TOPICS: [
            {'topic_metadata': dict(topic), 'message_count': contents.counts[topic['name']]}
            for topic in topics
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.name],
        'files': [
            {
                'path': file.name,
                'starting_time': starting_time,
                'duration': duration,
                'message_count': contents.message_count,
            }
        ],
        'custom_data': dict(custom_data),
        'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
    }
    _replace(file.parent, information)


def read(folder: pathlib.Path) -> dict[str, Any]:
    """Return the metadata of a bag, without its root key.

    Parameters
    ----------
    folder : path
        Folder of the bag.

    Raises
    ------
    BagError
        When there is no metadata, or it is invalid.
    """
    path = folder / _NAME
    if not path.is_file():
        raise BagError(f'{folder}: is not a bag, or an incomplete one: it has no {_NAME}')
    try:
        return dict(read_yaml(path.read_text(encoding='utf-8'))[_ROOT])
    except Exception as error:  # invalid YAML or content can raise any exception
        raise BagError(f'{path}: is not the metadata of a bag: {reason(error)}') from error


def annotate(folder: str | os.PathLike[str], custom_data: Mapping[str, str]) -> None:
    """Add custom data to a closed bag.

    Parameters
    ----------
    folder : path
        Folder of the bag.
    custom_data : mapping of str to str
        Texts by key; they replace those that the bag has under the same keys.

    Raises
    ------
    BagError
        When the folder has no valid metadata, or the metadata cannot be written.
    InvalidInput
        When `custom_data` holds anything but text.
    """
    added = texts(custom_data)
    folder = pathlib.Path(folder)
    information = read(folder)
    try:
        information['custom_data'] = {**(information.get('custom_data') or {}), **added}
        _replace(folder, information)
    except (OSError, TypeError) as error:
        raise BagError(f'{folder}: {_NAME} cannot be changed: {error}') from error


def texts(custom_data: Mapping[str, str]) -> dict[str, str]:
    """Return a copy of custom data; raise `InvalidInput` if a key or a value is not text."""
    instance('custom_data', custom_data, Mapping)
    for key, value in custom_data.items():
        text('key of custom_data', key)
        text(f'custom_data[{key!r}]', value)
    return dict(custom_data)


def _replace(folder: pathlib.Path, information: Mapping[str, Any]) -> None:
    """Replace the metadata as a whole, so that a full disk or a kill leaves the earlier one."""
    new = folder / f'{_NAME}.new'
    content = yaml.dump(
        {_ROOT: dict(information)}, Dumper=_NoAliasDumper, sort_keys=False, allow_unicode=True
    )
    try:
        with new.open('w', encoding='utf-8') as stream:
            stream.write(content)
            stream.flush()
            # Otherwise the new name may reach the disk before the contents.
            os.fsync(stream.fileno())
        new.replace(folder / _NAME)
    except OSError:
        with contextlib.suppress(OSError):
            new.unlink()
        raise


class _NoAliasDumper(getattr(yaml, 'CSafeDumper', yaml.SafeDumper)):  # type: ignore[misc]
    """Write equal values in full each time: the metadata of rosbag2 has no YAML anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


__all__ = ['annotate', 'read', 'texts', 'topic_metadata', 'write']
