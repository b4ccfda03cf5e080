# SPDX-License-Identifier: Apache-2.0
"""Records: what is measured, estimated and commanded at one moment, for all feet of a robot.

A record has a time stamp and one row for each foot, in the order of the robot's legs. Sensors make
*samples*, the estimator makes *estimates* of them, the controller *commands*, and the regulators
answer with *pressures*. Records of one kind at one or more moments are a :class:`Block`.

All fields are float64 in SI units, pressures are gauge pressures. NaN means that a value is
missing: a foot without a wrench, a pad without a reading, a leg without a set-point. A row with
missing values concerns its own leg only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

TIME = 'time'
"""Name of the column of a table that holds the time after the first record, s."""


def split(time_ns: int) -> tuple[int, int]:
    """Return a time in ns as whole seconds and the nanoseconds after them.

    Seconds beyond the 32 bits of a stamp wrap round, as they do in rclpy.
    """
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return (seconds + 2**31) % 2**32 - 2**31, rest


class Field(NamedTuple):
    """A field of a row.

    Attributes
    ----------
    name, unit, meaning : str
        Name, unit (empty for numbers without one), and what it says.
    axes : str
        Names of the components of a vector, such as ``xyz``; empty for a single number.
    """

    name: str
    unit: str
    meaning: str
    axes: str = ''

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the numbers in it."""
        return tuple(f'{self.name}_{axis}' for axis in self.axes) or (self.name,)


@dataclass(frozen=True)
class Kind:
    """A kind of record.

    Attributes
    ----------
    name : str
        Name, which is also that of its topic, ``feet/<name>``.
    meaning : str
        What it is.
    fields : tuple of Field
        Fields of a row.
    """

    name: str
    meaning: str
    fields: tuple[Field, ...]

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of all numbers in a row."""
        return tuple(column for field in self.fields for column in field.columns)

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """Structured type of a row."""
        return np.dtype(
            [(each.name, 'f8', (len(each.axes),) if each.axes else ()) for each in self.fields]
        )

    def rows(self, *shape: int) -> np.ndarray:
        """Return rows of this shape in which all values are missing."""
        return np.full((*shape, len(self.columns)), np.nan).view(self.dtype)[..., 0]

    def names(self, legs: Sequence[int]) -> tuple[str, ...]:
        """Return the names of all numbers of a record, such as ``leg_1/force_z``."""
        return tuple(f'leg_{leg}/{column}' for leg in legs for column in self.columns)


SAMPLE = Kind(
    'sample',
    'What sensors measure, or a body estimator finds from them.',
    (
        Field('force', 'N', 'force of the ground on the foot, z up', 'xyz'),
        Field('moment', 'N m', 'yaw moment of the ground on the foot'),
        Field('position', 'm', 'marker in world, or foot in odom; new ones only', 'xyz'),
        Field('velocity', 'm/s', 'velocity of the contact over the floor, from joints', 'xy'),
        Field(
            'variance', 'm²/s²',
            'variance of each of its components; infinite: it must not be used', 'xy',
        ),
    ),
)  # fmt: skip

ESTIMATE = Kind(
    'estimate',
    'What the estimator makes of the samples since its last estimate.',
    (
        Field('position', 'm', 'last position, if one has come since the last estimate', 'xy'),
        Field('load', 'N', 'largest normal force since the last estimate'),
        Field('slip', 'm/s', 'slip velocity along the tangential force', 'xy'),
        Field('slip_speed', 'm/s', 'slip speed, positive where the foot gives way'),
        Field('slip_speed_sd', 'm/s', 'standard deviation of the slip speed'),
        Field('slipping', '', 'slip alarm: 1 on, 0 off'),
        Field('wetness', '', 'probability that the ground is wet, 0 to 1'),
        Field('friction', '', 'mean coefficient of friction'),
        Field('friction_sd', '', 'its standard deviation'),
        Field('margin', '', 'friction margin: 5 % quantile of friction less T/N'),
        Field('doubt', '', 'code of the reason why the ground is unobservable; 0: none'),
        Field('detail', '', 'two numbers of the doubt', 'ab'),
    ),
)  # fmt: skip

COMMAND = Kind(
    'command',
    'What the controller decides.',
    (
        Field('dome', '', 'morphology: 1 dome, 0 flat'),
        Field('setpoint', 'Pa', 'set-point, gauge; without one for long, the pad is vented'),
    ),
)  # fmt: skip

PRESSURE = Kind(
    'pressure',
    'What the regulators answer.',
    (
        Field('pressure', 'Pa', 'measured pressure, gauge'),
        Field('setpoint', 'Pa', 'set-point in force, gauge'),
        Field('pad', 'Pa', 'true pressure of a simulated pad, gauge'),
        Field('fault', '', 'code of the fault of regulator or pad; 0: none'),
        Field('detail', '', 'two numbers of the fault', 'ab'),
    ),
)  # fmt: skip

KINDS = (SAMPLE, ESTIMATE, COMMAND, PRESSURE)
"""All kinds, in the order in which a force becomes a pressure."""


class Block(NamedTuple):
    """Records of one kind at successive moments.

    Attributes
    ----------
    stamps : array of int64 (n,)
        Time stamps, ns.
    rows : structured array (n, feet)
        A row for each moment and foot.
    """

    stamps: npt.NDArray[np.int64]
    rows: np.ndarray

    @classmethod
    def of(cls, stamp_ns: int, rows: np.ndarray) -> Block:
        """Return a block of the one record of a moment, ns; rows: (feet,)."""
        return cls(np.array([stamp_ns]), rows[None])

    @property
    def last_ns(self) -> int:
        """Time stamp of the last record, ns."""
        return int(self.stamps[-1])

    @classmethod
    def joined(cls, kind: Kind, blocks: Sequence[Block], feet: int) -> Block:
        """Return the records of several blocks as one block; of so many feet if there are none."""
        if not blocks:
            return cls(np.empty(0, np.int64), kind.rows(0, feet))
        # NumPy joins plain numbers ten times as fast as structured rows.
        numbers = np.concatenate([rows.view('f8') for _, rows in blocks])
        return cls(np.concatenate([stamps for stamps, _ in blocks]), numbers.view(kind.dtype))
