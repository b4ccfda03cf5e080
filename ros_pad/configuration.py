# SPDX-License-Identifier: Apache-2.0
"""Strict reading of the YAML files under ``config/``.

A :class:`Table` is one mapping of such a file. Each value is taken by name with its unit and
range; what was not taken by the end is an unknown key. Nothing is guessed and nothing is clamped.
"""

from __future__ import annotations

import difflib
import math
import os
import pathlib
import reprlib
import sys
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from contextlib import suppress
from typing import Any

import yaml

from ros_pad.errors import ConfigError

_REQUIRED: Any = object()


def shared_folder() -> pathlib.Path:
    """Return the folder with ``feet/``, ``scenes/`` and ``params.yaml``.

    In a source tree (also an editable install) that is ``config/`` beside the package; in an
    installed workspace it is ``share/ros_pad/config`` of the first ament prefix that has it.
    """
    source = pathlib.Path(__file__).resolve().parent.parent / 'config'
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    installed = [pathlib.Path(p) / 'share' / 'ros_pad' / 'config' for p in prefixes if p]
    for folder in [source, *installed]:
        if (folder / 'scenes').is_dir():
            return folder
    looked = ', '.join(str(f) for f in [source, *installed])
    raise ConfigError(f'no config folder of ros_pad found; looked in {looked}')


def names(kind: str) -> list[str]:
    """Return the sorted names of the shipped files of a kind (``feet`` or ``scenes``)."""
    return sorted(path.stem for path in (shared_folder() / kind).glob('*.yaml'))


def locate(kind: str, name_or_path: str | os.PathLike[str]) -> pathlib.Path:
    """Return the file for a shipped name, or for a path that ends in ``.yaml``.

    Raises
    ------
    ConfigError
        When there is no such file; lists the shipped names and the nearest one.
    """
    text = os.fspath(name_or_path)
    if text.endswith(('.yaml', '.yml')):
        path = pathlib.Path(text)
        if not path.is_file():
            raise ConfigError(f'{text}: no such file')
        return path
    known = names(kind)
    if text in known:
        return shared_folder() / kind / f'{text}.yaml'
    near = difflib.get_close_matches(text, known, n=1, cutoff=0.4)
    hint = f' Did you mean {near[0]!r}?' if near else ''
    raise ConfigError(
        f'no {kind[:-1] if kind != "feet" else "foot"} named {text!r}.{hint}'
        f' There are: {", ".join(known)}; a path to a .yaml file works too.'
    )


class _Loader(yaml.SafeLoader):
    """The safe loader, but a key that is there twice is an error, not the last one's win."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f'key {key.value!r} is there twice', key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


_REPR = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _REPR.maxlong = 200
_REPR.maxlevel = 3


def shown(value: Any) -> str:
    """Return a value as an error is to show it: in short where aliases of YAML make it vast."""
    return _REPR.repr(value)


class Table:
    """One mapping of a YAML file, read key by key.

    Parameters
    ----------
    values : mapping
        The parsed mapping.
    origin : str
        Where it came from, used at the head of every message (file, then key path).
    """

    def __init__(self, values: Any, origin: str) -> None:
        if not isinstance(values, dict):
            raise ConfigError(f'{origin}: expected a table of keys, found {shown(values)}')
        self._values = dict(values)
        self._taken: set[str] = set()
        self.origin = origin

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Table:
        """Read a YAML file; a syntax error names file, line and column."""
        try:
            text = pathlib.Path(path).read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f'{os.fspath(path)}: cannot be read: {error}') from error
        return cls.parse(text, os.fspath(path))

    @classmethod
    def parse(cls, text: str, origin: str) -> Table:
        """Read YAML in a text; a syntax error names origin, line and column."""
        try:
            values = yaml.load(text, Loader=_Loader)
        except yaml.YAMLError as error:
            mark = getattr(error, 'problem_mark', None)
            place = f', line {mark.line + 1}, column {mark.column + 1}' if mark else ''
            problem = getattr(error, 'problem', None) or str(error)
            raise ConfigError(f'{origin}{place}: not valid YAML: {problem}') from error
        except Exception as error:
            # PyYAML has no word for what only looks like a date or a number (2026-99-99,
            # !!int ''), nor for what is nested too deeply: each fails in a way of its own.
            problem = str(error) or type(error).__name__
            raise ConfigError(f'{origin}: not valid YAML: {problem}') from error
        return cls(values, origin)

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def _take(self, key: str, default: Any) -> Any:
        self._taken.add(key)
        if key in self._values:
            return self._values[key]
        if default is _REQUIRED:
            others = [str(each) for each in self._values if each not in self._taken]
            near = difflib.get_close_matches(key, others, n=1)
            hint = f'; is {near[0]!r} meant to be it?' if near else ''
            raise ConfigError(f'{self.origin}: key {key!r} is missing{hint}')
        return default

    def number(
        self,
        key: str,
        unit: str,
        low: float = -math.inf,
        high: float = math.inf,
        default: Any = _REQUIRED,
    ) -> float:
        """Take a finite number in [low, high]."""
        value = self._take(key, default)
        if isinstance(value, str):
            # PyYAML reads 90e3 as text (YAML 1.1 wants 90.0e+3); to everyone else it is a number.
            with suppress(ValueError):
                value = float(value)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        # The largest float rather than infinity: a whole number of YAML can be larger than it.
        largest = sys.float_info.max
        if not number or not max(low, -largest) <= value <= min(high, largest):
            raise ConfigError(
                f'{self.origin}: {key} = {shown(value)} is not allowed: '
                f'a number from {low:g} to {high:g} {unit} is needed'
            )
        return float(value)

    def integer(self, key: str, low: int, high: int, default: Any = _REQUIRED) -> int:
        """Take a whole number in [low, high]."""
        value = self._take(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise ConfigError(
                f'{self.origin}: {key} = {shown(value)} is not allowed: '
                f'a whole number from {low} to {high} is needed'
            )
        return value

    def choice(self, key: str, allowed: Sequence[str], default: Any = _REQUIRED) -> str:
        """Take one of the allowed words."""
        value = self._take(key, default)
        if value not in allowed:
            raise ConfigError(
                f'{self.origin}: {key} = {shown(value)} is not allowed: '
                f'one of {", ".join(allowed)} is needed'
            )
        return str(value)

    def text(self, key: str, default: Any = _REQUIRED) -> str:
        """Take a string."""
        value = self._take(key, default)
        if not isinstance(value, str):
            raise ConfigError(
                f'{self.origin}: {key} = {shown(value)} is not allowed: text is needed'
            )
        return value

    @contextmanager
    def table(self, key: str, default: Any = _REQUIRED) -> Iterator[Table]:
        """Take a nested table; on leaving the block its unknown keys are refused."""
        nested = Table(self._take(key, default), f'{self.origin}: {key}')
        yield nested
        nested.finish()

    def finish(self) -> None:
        """Refuse keys that nobody asked for."""
        unknown = [key for key in self._values if key not in self._taken]
        if unknown:
            near = difflib.get_close_matches(str(unknown[0]), sorted(self._taken), n=1)
            hint = f' Did you mean {near[0]!r}?' if near else ''
            raise ConfigError(
                f'{self.origin}: unknown key {unknown[0]!r}.{hint}'
                f' Allowed: {", ".join(sorted(self._taken))}'
            )
