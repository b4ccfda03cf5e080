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
# ``height [mm]``, ``height (mm)``, ``height/mm`` or ``height_mm``; longer names are tried first.
_HEAD = re.compile(rf'({"|".join(sorted(COLUMNS, key=len, reverse=True))})\s*[\[(/_]?(\w*)[\])]?')
# Kinds of rows: columns that a row needs, and those by which its kind is recognised.
_KINDS = {
    'free': (('pressure', 'height'), ()),
    'pressed': (('pressure', 'force'), ('force', 'depth', 'contact_radius', 'gap')),
    'limit': (('pressure', 'force_limit'), ('force_limit',)),
    'friction': (
        ('pressure', 'load', 'tangential_force', SURFACE),
        ('load', 'tangential_force', SURFACE, 'stance_time'),
    ),
}


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

        def columns(kind: str, names: tuple[str, ...]) -> list[Array]:
            return [np.array([row.get(name, math.nan) for row in rows[kind]]) for name in names]

        names = ('pressure', 'load', 'tangential_force', SURFACE, 'stance_time')
        pressure, load, force, surface, stance_time = columns('friction', names)
        return cls(
            source=source,
            free=FreeDomes(*columns('free', FreeDomes._fields)),
            pressed=PressedDomes(*columns('pressed', PressedDomes._fields)),
            force_limits=ForceLimits(*columns('limit', ForceLimits._fields)),
            friction=Friction(pressure, load, force, surface == 1.0, stance_time),
        )


def _header(where: str, cells: list[str]) -> list[tuple[str, float, float]]:
    """Return name, factor to SI and largest value of each column."""
    columns = []
    for cell in map(str.strip, cells):
        if cell == SURFACE:
            columns.append((SURFACE, 1.0, 1.0))
            continue
        match = _HEAD.fullmatch(cell.replace('\N{GREEK SMALL LETTER MU}', '\N{MICRO SIGN}'))
        if match is None:
            raise ConfigError(
                f'{where}: unknown column {cell!r}; allowed, with commas between them, are'
                f' {", ".join((*COLUMNS, SURFACE))}'
            )
        name, unit = match.groups()
        units = _UNITS[COLUMNS[name]]
        if unit not in units:
            raise ConfigError(
                f'{where}: column {cell!r} needs a unit, as in {name} [{next(iter(units))}]: '
                f'one of {", ".join(units)}'
            )
        columns.append((name, units[unit], _LARGEST[COLUMNS[name]]))
    names = [name for name, _, _ in columns]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f'{where}: column {name} occurs twice')
    return columns


def _row(where: str, header: list[tuple[str, float, float]], cells: list[str]) -> dict[str, float]:
    """Return the values of a line by column, in SI; ``surface`` is 0 for dry and 1 for wet."""
    if any(cell.strip() for cell in cells[len(header) :]):
        raise ConfigError(f'{where}: {len(cells)} values for {len(header)} columns')
    row = {}
    for (name, factor, largest), cell in zip(header, map(str.strip, cells), strict=False):
        if not cell:
            continue
        allowed = f'a number from 0 to {largest / factor:g}, in the unit of the column,'
        try:
            if name == SURFACE:
                allowed = 'dry or wet'
                row[name] = float(('dry', 'wet').index(cell))
            else:
                row[name] = float(cell) * factor
        except ValueError:
            row[name] = math.nan
        if not 0.0 <= row[name] <= largest:
            raise ConfigError(f'{where}: {name} = {cell} is not allowed: {allowed} is needed')
    return row


def _kind(where: str, row: dict[str, float]) -> str:
    """Return the kind of a row; raise `ConfigError` where it mixes kinds or lacks a column."""
    shapes = {'depth', 'contact_radius', 'gap'}
    if row.get('force') == 0.0 and not row.keys() & shapes:
        del row['force']  # a free dome
    kinds = [kind for kind, (_, own) in _KINDS.items() if row.keys() & set(own)]
    if 'height' in row and kinds != ['pressed']:  # pressed domes can have a height as well
        kinds.append('free')
    if len(kinds) != 1:
        given = ', '.join(row) or 'nothing'
        raise ConfigError(
            f'{where}: a row is a free dome (pressure, height), a pressed dome (pressure, force'
            ' and shape), a force limit (pressure, force_limit) or friction (pressure, load,'
            f' tangential_force, surface): fill in or delete this one, which has {given}'
        )
    missing = [name for name in _KINDS[kinds[0]][0] if name not in row]
    if not missing and kinds[0] == 'pressed' and not row.keys() & {'height', *shapes}:
        missing = ['height, depth, contact_radius or gap']
    if missing:
        raise ConfigError(f'{where}: a row with {", ".join(row)} also needs {missing[0]}')
    return kinds[0]
