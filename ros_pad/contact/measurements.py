# SPDX-License-Identifier: Apache-2.0
"""Measured shapes and forces of pads, read from a CSV file whose header names quantity and unit.

All kinds of rows are in one table; cells in columns of other kinds stay empty.

=====================  ==============================================  =========================
row                    required columns                                optional columns
=====================  ==============================================  =========================
free dome              pressure, height
pressed dome           pressure, force, one of height, depth,          the others
                       contact_radius, gap
force limit            pressure, force_limit
friction of a foot     pressure (0 is flat), load, tangential_force,   stance_time (wet rows)
                       surface (dry or wet)
=====================  ==============================================  =========================
"""

from __future__ import annotations

import csv
import math
import os
import pathlib
import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.contact.pad import Array
from ros_pad.errors import ConfigError, reason

# Factors to SI, usual unit first, and largest plausible value in SI.
_UNITS = {
    'pressure': {'kPa': 1e3, 'Pa': 1.0, 'MPa': 1e6, 'mbar': 1e2, 'bar': 1e5, 'psi': 6894.757293},
    'length': {'mm': 1e-3, 'm': 1.0, 'cm': 1e-2, 'um': 1e-6, 'µm': 1e-6},
    'force': {'N': 1.0, 'mN': 1e-3, 'kN': 1e3},
    'time': {'s': 1.0, 'ms': 1e-3},
}
_LARGEST = {'pressure': 1e6, 'length': 0.1, 'force': 1e4, 'time': 3600.0}
COLUMNS = {
    'pressure': 'pressure',
    'force': 'force',
    'height': 'length',
    'depth': 'length',
    'contact_radius': 'length',
    'gap': 'length',
    'force_limit': 'force',
    'load': 'force',
    'tangential_force': 'force',
    'stance_time': 'time',
}
SURFACE = 'surface'
_SHAPE = ('height', 'depth', 'contact_radius', 'gap')
# ``height [mm]``, ``height (mm)``, ``height/mm`` or ``height_mm``; longer names are tried first.
_NAMES = '|'.join(sorted(COLUMNS, key=len, reverse=True))
_HEAD = re.compile(rf'(?P<name>{_NAMES})(?:\s*\[(.*)\]|\s*\((.*)\)|\s*/(.*)|_(.*))?')


class FreeDomes(NamedTuple):
    """Free domes: pressure, Pa, and height, m."""

    pressure: Array
    height: Array


class PressedDomes(NamedTuple):
    """Pressed domes: pressure, Pa, force, N, lengths, m; NaN where not measured."""

    pressure: Array
    force: Array
    height: Array
    depth: Array
    contact_radius: Array
    gap: Array


class ForceLimits(NamedTuple):
    """Largest normal force on one pad, N, and its pressure, Pa."""

    pressure: Array
    force_limit: Array


class Friction(NamedTuple):
    """Tangential force at which a whole foot slips, N, with load, N, and pressure, Pa (0: flat).

    ``wet`` is true on a wet floor; ``stance_time``, s, is the time from touch-down to slip (NaN
    where not given).
    """

    pressure: Array
    load: Array
    tangential_force: Array
    wet: npt.NDArray[np.bool_]
    stance_time: Array


@dataclass(frozen=True)
class Measurements:
    """Content of one file of measurements, in SI units.

    Attributes
    ----------
    source : str
        Path of the file.
    free : FreeDomes
        Free domes, as arrays with one entry for each row of this kind, in the order of the file;
        so are the others.
    pressed : PressedDomes
        Domes pressed on a floor.
    force_limits : ForceLimits
        Highest loads of pads.
    friction : Friction
        Tangential forces of feet at slip.
    """

    source: str
    free: FreeDomes
    pressed: PressedDomes
    force_limits: ForceLimits
    friction: Friction

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Measurements:
        """Read a CSV file; lines that start with ``#`` are comments.

        Parameters
        ----------
        path : str or path
            A file with a header; columns and units: docs/calibrate.md.

        Returns
        -------
        Measurements
            All rows, in SI units.

        Raises
        ------
        ConfigError
            When the file cannot be read or has no rows, a column is unknown, has no unit or occurs
            twice, a value is not a number or out of range, or a row is of no kind or of several.
            The message names file, line and column.
        """
        source = os.fspath(path)
        try:
            text = pathlib.Path(path).read_text(encoding='utf-8-sig')
            lines = [
                (number, cells)
                for number, cells in enumerate(csv.reader(text.splitlines()), start=1)
                if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith('#')
            ]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise ConfigError(f'{source}: cannot be read: {reason(error)}') from error
        if len(lines) < 2:
            raise ConfigError(
                f'{source}: a header and at least one row are needed besides comments and empty'
                ' lines'
            )
        header = _header(f'{source}:{lines[0][0]}', lines[0][1])
        rows: dict[str, list[dict[str, float]]] = {kind: [] for kind in _KINDS}
        for number, cells in lines[1:]:
            where = f'{source}:{number}'
            row = _row(where, header, cells)
            rows[_kind(where, row)].append(row)

        def column(kind: str, name: str) -> Array:
            return np.array([row.get(name, math.nan) for row in rows[kind]], dtype=np.float64)

        def columns(kind: str, names: tuple[str, ...]) -> list[Array]:
            return [column(kind, name) for name in names]

        return cls(
            source=source,
            free=FreeDomes(*columns('free', FreeDomes._fields)),
            pressed=PressedDomes(*columns('pressed', PressedDomes._fields)),
            force_limits=ForceLimits(*columns('limit', ForceLimits._fields)),
            friction=Friction(
                pressure=column('friction', 'pressure'),
                load=column('friction', 'load'),
                tangential_force=column('friction', 'tangential_force'),
                wet=column('friction', SURFACE) == 1.0,
                stance_time=column('friction', 'stance_time'),
            ),
        )


# Kinds of rows, and the columns by which a kind is recognised.
_KINDS = {
    'friction': ('load', 'tangential_force', SURFACE, 'stance_time'),
    'limit': ('force_limit',),
    'pressed': ('force', 'depth', 'contact_radius', 'gap'),
    'free': ('height',),
}


def _header(where: str, cells: list[str]) -> list[tuple[str, float, float]]:
    """Return name, factor to SI and largest value of each column."""
    columns = []
    for cell in cells:
        head = cell.strip()
        if head == SURFACE:
            columns.append((SURFACE, 1.0, 1.0))
            continue
        if re.search(rf'[;\t]\s*({_NAMES}|{SURFACE})', head):
            raise ConfigError(f'{where}: commas are needed between columns, unlike in {head!r}')
        match = _HEAD.fullmatch(head)
        if match is None:
            known = ', '.join((*COLUMNS, SURFACE))
            raise ConfigError(f'{where}: unknown column {head!r}; allowed are {known}')
        name, *given = match.groups()
        unit = next((text.strip() for text in given if text is not None), '')
        unit = unit.replace('\N{GREEK SMALL LETTER MU}', '\N{MICRO SIGN}')
        units = _UNITS[COLUMNS[name]]
        if unit not in units:
            raise ConfigError(
                f'{where}: column {head!r} needs a unit, as in {name} [{next(iter(units))}]: '
                f'one of {", ".join(units)}'
            )
        columns.append((name, units[unit], _LARGEST[COLUMNS[name]]))
    names = [name for name, _, _ in columns]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f'{where}: column {twice[0]} occurs twice')
    return columns


def _row(where: str, header: list[tuple[str, float, float]], cells: list[str]) -> dict[str, float]:
    """Return the values of a line by column, in SI; ``surface`` is 0 for dry and 1 for wet."""
    if len(cells) > len(header) and any(cell.strip() for cell in cells[len(header) :]):
        raise ConfigError(
            f'{where}: {len(cells)} values for {len(header)} columns: a row must not have more'
            ' values than the header has columns'
        )
    row = {}
    for (name, factor, largest), cell in zip(header, cells, strict=False):
        value = cell.strip()
        if not value:
            continue
        if name == SURFACE:
            if value not in ('dry', 'wet'):
                raise ConfigError(
                    f'{where}: surface = {value!r} is not allowed: dry or wet is needed'
                )
            row[name] = float(value == 'wet')
            continue
        try:
            number = float(value) * factor
        except ValueError:
            raise ConfigError(
                f'{where}: {name} = {value!r} is not allowed: a number is needed'
            ) from None
        if not 0.0 <= number <= largest:
            raise ConfigError(
                f'{where}: {name} = {value} is not allowed: from 0 to {largest / factor:g}, in the'
                ' unit of the column, is needed'
            )
        row[name] = number
    return row


def _kind(where: str, row: dict[str, float]) -> str:
    """Return the kind of a row; raise `ConfigError` where it mixes kinds or lacks a column."""
    if row.get('force') == 0.0 and not row.keys() & {'depth', 'contact_radius', 'gap'}:
        del row['force']  # a free dome
    kinds = [kind for kind, own in _KINDS.items() if row.keys() & set(own)]
    if kinds == ['pressed', 'free']:  # pressed domes can have a height as well
        kinds = ['pressed']
    if len(kinds) != 1:
        given = ', '.join(row) or 'nothing'
        raise ConfigError(
            f'{where}: a row is a free dome (pressure, height), a pressed dome (pressure, force'
            ' and shape), a force limit (pressure, force_limit) or friction (pressure, load,'
            f' tangential_force, surface); this one has {given}'
        )
    needed = {
        'friction': ('pressure', 'load', 'tangential_force', SURFACE),
        'limit': ('pressure', 'force_limit'),
        'pressed': ('pressure', 'force'),
        'free': ('pressure', 'height'),
    }[kinds[0]]
    missing = [name for name in needed if name not in row]
    if not missing and kinds[0] == 'pressed' and not row.keys() & set(_SHAPE):
        missing = ['height, depth, contact_radius or gap']
    if missing:
        raise ConfigError(f'{where}: a row with {", ".join(row)} also needs {missing[0]}')
    return kinds[0]
