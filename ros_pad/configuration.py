# SPDX-License-Identifier: Apache-2.0
"""Check values, and read the YAML files under ``config/`` strictly.

Every value from outside (argument, YAML key, ROS parameter) is checked by :func:`quantity`,
:func:`number`, :func:`integer`, :func:`text`, :func:`choice` or :func:`instance`. A
:class:`Setting` describes one named value. A :class:`Table` is one mapping of a YAML file; keys
that are never read are an error.
"""

from __future__ import annotations

import difflib
import math
import os
import pathlib
import reprlib
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_pad.errors import ConfigError, InvalidInput, reason

_REQUIRED: Any = object()

_REPR = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _REPR.maxlong = 200
_REPR.maxlist = _REPR.maxtuple = 12
_REPR.maxlevel = 2


def shown(value: Any) -> str:
    """Return a value for an error message, shortened where YAML aliases make it very long."""
    return _REPR.repr(value.item() if isinstance(value, np.generic) else value)


def nearest(value: Any, known: Sequence[str]) -> str:
    """Return a question that ends an error message if a value may be a misspelling."""
    near = difflib.get_close_matches(str(value), known, n=1)
    return f'. Did you mean {near[0]!r}?' if near else ''


def _not_allowed(name: str, value: Any, allowed: str, hint: str = '') -> InvalidInput:
    return InvalidInput(f'{name} = {shown(value)} is not allowed: {allowed} is needed{hint}')


def _range(what: str, low: float, high: float, unit: str, above: bool = False) -> str:
    """Return an allowed range in words, for example ``a number from 1 to 5 N``."""
    start, end = f'{low:.10g}', f'{high:.10g}'
    if low > -math.inf and high < math.inf:
        words = (
            f'{what} above {start} and up to {end}' if above else f'{what} from {start} to {end}'
        )
    else:
        words = what.replace('a number', 'a finite number')
        if low > -math.inf:
            words += f' above {start}' if above else f' of at least {start}'
        elif high < math.inf:
            words += f' of at most {end}'
    return f'{words} {unit}'.rstrip()


def quantity(
    name: str,
    value: npt.ArrayLike,
    unit: str,
    low: float = 0.0,
    high: float = math.inf,
    above: bool = False,
) -> npt.NDArray[np.float64]:
    """Check that a physical quantity is finite and in range.

    Parameters
    ----------
    name, unit : str
        Name and unit for the error message.
    value : number or array of numbers
        Numbers of any shape.
    low, high : float
        Allowed range, both ends included.
    above : bool
        Exclude the lower end.

    Returns
    -------
    array
        The value as float64; for a scalar a NumPy scalar, which is much faster than a 0-d array.

    Raises
    ------
    InvalidInput
        When a value is not allowed; the message has the first such value, its unit and the range.
    """
    if type(value) is float and low < value <= high and value != math.inf:
        return np.float64(value)
    bad: Any = value
    with suppress(TypeError, ValueError):  # raised for lists with rows of different lengths
        numbers = np.asarray(value)
        if numbers.dtype.kind in 'iuf':
            floats = numbers.astype(np.float64)
            good = np.isfinite(floats) & (floats <= high)
            good &= floats > low if above else floats >= low
            if good.all():
                return floats[()]
            bad = numbers[~good].flat[0].item()
    raise _not_allowed(name, bad, _range('a number', low, high, unit, above))


def number(
    name: str,
    value: float,
    unit: str,
    low: float = 0.0,
    high: float = math.inf,
    above: bool = False,
) -> float:
    """Check one number as :func:`quantity` does; refuse lists and arrays, except of shape ()."""
    # A list is refused unconverted, because one with YAML aliases can have millions of elements.
    if isinstance(value, (int, float, np.number, np.ndarray)):
        checked = quantity(name, value, unit, low, high, above)
        if not np.ndim(checked):
            return float(checked)
    raise _not_allowed(name, value, _range('a number', low, high, unit, above))


def integer(name: str, value: int, low: float = 0, high: float = math.inf, unit: str = '') -> int:
    """Check that a value is a whole number in [low, high]; raise `InvalidInput` if not."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or not low <= value <= high:
        raise _not_allowed(name, value, _range('a whole number', low, high, unit))
    return int(value)


def text(name: str, value: str) -> str:
    """Check that a value is a string; raise `InvalidInput` if not."""
    if not isinstance(value, str):
        raise _not_allowed(name, value, 'text')
    return value


def instance(name: str, value: object, *kinds: type) -> None:
    """Check that a value is an object of one of the classes; raise `InvalidInput` if not."""
    if not isinstance(value, kinds):
        raise _not_allowed(name, value, f'a {" or ".join(kind.__name__ for kind in kinds)}')


def choice(name: str, value: str, allowed: Sequence[str]) -> str:
    """Check that a value is one of the allowed words; raise `InvalidInput` if not."""
    if not isinstance(value, str) or value not in allowed:
        raise _not_allowed(name, value, f'one of {", ".join(allowed)}', nearest(value, allowed))
    return value


def refuse(path: str | os.PathLike[str], force: bool) -> None:
    """Raise InvalidInput if a path exists, unless it is a regular file and ``force`` is True."""
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise InvalidInput(f'{path}: is no regular file, and only regular files are replaced')
    if not force and path.exists():
        raise InvalidInput(f'{path}: exists already; --force (force=True) replaces it')


@dataclass(frozen=True)
class Setting:
    """Description of one setting, from which checks, ROS descriptors and documentation are made.

    Attributes
    ----------
    name : str
        Name of the parameter or YAML key.
    default : bool, int, float, str, list of int, or one of the types bool, int, float, str, list
        Default value, whose type is the type of the setting. If it is itself a type, there is no
        default: the setting is required.
    description : str
        One sentence.
    unit : str
        Empty for text, counts and ratios.
    low, high : float
        Allowed range of a number, both ends included.
    choices : tuple of str
        Allowed words of a text; empty for any text.
    """

    name: str
    default: Any
    description: str
    unit: str = ''
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def value_type(self) -> type:
        """Type of the values: bool, int, float, str or list."""
        return self.default if isinstance(self.default, type) else type(self.default)

    @property
    def allowed(self) -> str:
        """The allowed values in words, for example ``a number from 1 to 5 N``."""
        if self.choices:
            return f'one of {", ".join(self.choices)}'
        if self.value_type is list:
            return _range('a list of different whole numbers', self.low, self.high, self.unit)
        if self.value_type is int:
            return _range('a whole number', self.low, self.high, self.unit)
        if self.value_type is float:
            return _range('a number', self.low, self.high, self.unit)
        return 'true or false' if self.value_type is bool else 'text'

    def accept(self, value: Any) -> Any:
        """Return a value as the type of this setting; a whole number is accepted as a float.

        Raises
        ------
        InvalidInput
            When the value has another type or is outside the allowed values.
        """
        if self.value_type is float:
            return number(self.name, value, self.unit, self.low, self.high)
        if self.value_type is int:
            return integer(self.name, value, self.low, self.high, self.unit)
        if self.choices:
            return choice(self.name, value, self.choices)
        if self.value_type is str:
            return text(self.name, value)
        if self.value_type is bool:
            good = isinstance(value, bool)
        else:
            good = isinstance(value, list) and all(map(self._holds, value))
            good = good and len(set(value)) == len(value) > 0
        if not good:
            raise _not_allowed(self.name, value, self.allowed)
        return value

    def _holds(self, element: Any) -> bool:
        return type(element) is int and self.low <= element <= self.high


def shared_folder() -> pathlib.Path:
    """Return the folder with ``feet/``, ``scenes/`` and ``params.yaml``.

    In a source tree (also an editable install) this is ``config/`` beside the package. Otherwise
    it is ``share/ros_pad/config`` under the prefix into which the package is installed (a virtual
    environment, a colcon workspace, ``pip install --user`` or ``--target``), or else in a folder
    of ``AMENT_PREFIX_PATH`` or in ``sys.prefix``.

    Raises
    ------
    ConfigError
        When no such folder is found.
    """
    package = pathlib.Path(__file__).absolute().parent
    source = package.resolve().parent / 'config'
    # From the folder of the package (--target) to three above it (lib/python3.12/site-packages).
    prefixes: list[str | pathlib.Path] = [*package.parents[:4]]
    prefixes += filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    folders = [source]
    folders += [pathlib.Path(p) / 'share' / 'ros_pad' / 'config' for p in [*prefixes, sys.prefix]]
    for folder in folders:
        if (folder / 'scenes').is_dir():
            return folder
    raise ConfigError(
        f'no config folder of ros_pad found; looked in {", ".join(map(str, folders))}: install'
        ' ros_pad with pip or colcon, which put it there; a copy of the package alone lacks it'
    )


def names(kind: str) -> list[str]:
    """Return the sorted names of the shipped files of a kind (``feet`` or ``scenes``).

    Raises
    ------
    ConfigError
        When the folder of the shipped files is not found.
    """
    return sorted(path.stem for path in (shared_folder() / kind).glob('*.yaml'))


def locate(kind: str, name_or_path: str | os.PathLike[str]) -> pathlib.Path:
    """Return the file for a shipped name, or for a path that ends in ``.yaml`` or ``.yml``.

    Raises
    ------
    ConfigError
        When there is no such file; for a name, the message lists the shipped ones.
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
    raise ConfigError(
        f'no {kind[:-1] if kind != "feet" else "foot"} named {text!r}'
        f'{nearest(text, known) or "."} There are:'
        f' {", ".join(known)}; a path to a .yaml file works too.'
    )


class Table:
    """One mapping of a YAML file, read key by key.

    Parameters
    ----------
    values : mapping
        The parsed mapping.
    origin : str
        File, and keys that lead to the mapping: the start of every error message.

    Raises
    ------
    ConfigError
        When ``values`` is not a mapping.
    """

    def __init__(self, values: Any, origin: str) -> None:
        if not isinstance(values, dict):
            found = 'nothing' if values is None else shown(values)
            raise ConfigError(f'{origin}: expected a table of keys, found {found}')
        self._values = dict(values)
        self._taken: set[str] = set()
        self._known: set[str] = set()
        self.origin = origin

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Table:
        """Read a YAML file; raise `ConfigError`, with line and column, if it is not valid."""
        try:
            text = pathlib.Path(path).read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f'{os.fspath(path)}: cannot be read: {reason(error)}') from error
        return cls.parse(text, os.fspath(path))

    @classmethod
    def parse(cls, text: str, origin: str) -> Table:
        """Read YAML from a text; raise `ConfigError`, with line and column, if it is not valid."""
        from ros_pad import yaml_text  # here, because a pad made of numbers needs no PyYAML

        try:
            values = yaml_text.read_yaml(text)
        except Exception as error:
            # YAMLError, or others: see read_yaml; a chain of aliases may still be too deep.
            mark = getattr(error, 'problem_mark', None)
            place = f', line {mark.line + 1}, column {mark.column + 1}' if mark else ''
            problem = getattr(error, 'problem', None) or str(error) or type(error).__name__
            if mark and any('\t' in row for row in text.splitlines()[mark.line : mark.line + 1]):
                problem += ' (a tab: YAML is indented with spaces)'
            raise ConfigError(f'{origin}{place}: not valid YAML: {problem}') from error
        return cls(values, origin)

    def __contains__(self, key: str) -> bool:
        self._known.add(key)
        return key in self._values

    def _take(self, key: str, default: Any) -> Any:
        self._taken.add(key)
        self._known.add(key)
        if key in self._values:
            return self._values[key]
        if default is _REQUIRED:
            others = [str(each) for each in self._values if each not in self._taken]
            near = difflib.get_close_matches(key, others, n=1, cutoff=0.7)
            hint = f'; is {near[0]!r} a misspelling of it?' if near else ''
            raise ConfigError(f'{self.origin}: key {key!r} is missing{hint}')
        return default

    def value(self, setting: Setting, default: Any = _REQUIRED) -> Any:
        """Read the value of a setting, or the default where the key is absent.

        Raises
        ------
        ConfigError
            When a required key is missing, or the value is not allowed.
        """
        if default is _REQUIRED and not isinstance(setting.default, type):
            default = setting.default
        value = self._take(setting.name, default)
        if setting.value_type is float and isinstance(value, str):
            # PyYAML reads 90e3 as text (YAML 1.1 requires 90.0e+3).
            with suppress(ValueError):
                value = float(value)
        try:
            return setting.accept(value)
        except InvalidInput as error:
            raise ConfigError(f'{self.origin}: {error}') from None

    def values(self, settings: Sequence[Setting]) -> dict[str, Any]:
        """Read several settings with :meth:`value`; return their values by name."""
        return {setting.name: self.value(setting) for setting in settings}

    def number(
        self,
        key: str,
        unit: str,
        low: float = -math.inf,
        high: float = math.inf,
        default: Any = _REQUIRED,
    ) -> float:
        """Read a finite number in [low, high]."""
        return self.value(Setting(key, float, '', unit, low, high), default)

    def integer(self, key: str, low: int, high: int, default: Any = _REQUIRED) -> int:
        """Read a whole number in [low, high]."""
        return self.value(Setting(key, int, '', '', low, high), default)

    def choice(self, key: str, allowed: Sequence[str], default: Any = _REQUIRED) -> str:
        """Read one of the allowed words."""
        return self.value(Setting(key, str, '', choices=tuple(allowed)), default)

    def text(self, key: str, default: Any = _REQUIRED) -> str:
        """Read a string."""
        return self.value(Setting(key, str, ''), default)

    def vector(
        self,
        key: str,
        unit: str,
        size: int = 3,
        low: float = -math.inf,
        high: float = math.inf,
        default: Any = _REQUIRED,
    ) -> npt.NDArray[np.float64]:
        """Read a list of ``size`` finite numbers in [low, high]."""
        value = self._take(key, default)
        try:
            numbers = quantity(key, value, unit, low, high)
            if numbers.shape != (size,):
                raise _not_allowed(key, value, f'a list of {size} numbers')
        except InvalidInput as error:
            raise ConfigError(f'{self.origin}: {error}') from None
        return numbers

    def sequence(self, key: str, default: Any = _REQUIRED) -> tuple[Any, ...]:
        """Read a list of different numbers or texts, which may not be empty."""
        value = self._take(key, default)
        if isinstance(value, tuple):
            return value
        plain = isinstance(value, list) and all(isinstance(e, (str, int, float)) for e in value)
        if not plain or not len(set(value)) == len(value) > 0:
            wanted = 'a list of different numbers or texts'
            raise ConfigError(f'{self.origin}: {_not_allowed(key, value, wanted)}')
        return tuple(value)

    @property
    def keys(self) -> tuple[Any, ...]:
        """The keys of the mapping, in the order of the file."""
        return tuple(self._values)

    @contextmanager
    def table(self, key: str, default: Any = _REQUIRED) -> Iterator[Table]:
        """Read a nested table; at the end of the block, unknown keys raise `ConfigError`."""
        nested = Table(self._take(key, default), f'{self.origin}: {key}')
        yield nested
        nested.finish()

    def finish(self) -> None:
        """Raise `ConfigError` for keys that were not read."""
        unknown = [key for key in self._values if key not in self._taken]
        if unknown:
            known = sorted(self._known)
            raise ConfigError(
                f'{self.origin}: unknown key {unknown[0]!r}{nearest(unknown[0], known) or "."}'
                f' Allowed: {", ".join(known)}'
            )
