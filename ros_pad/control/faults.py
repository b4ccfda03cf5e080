# SPDX-License-Identifier: Apache-2.0
"""Faults of pads, regulators and legs: codes with two numbers, and their texts.

Records hold a fault as three numbers; its text is made where a person reads it.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from ros_pad.estimation import doubt as doubts


class Kind(Enum):
    """Kinds of fault.

    In a text {a} and {b} are the two numbers, and {p} and {q} the same as pressures in kPa.

    Attributes
    ----------
    code : int
        Code in records.
    label : str
        The kind in a few words.
    template : str
        Text with numbers.
    numbers : str
        Meaning of the two numbers; empty for a fault without them.
    """

    # fmt: off
    NONE = 0, '', '', ''
    SENSOR = (1, 'its pressure sensor is faulty',
              'reads {p}, which no pad can have: its pressure sensor is faulty', 'reading, Pa')
    CEILING = 2, 'above the ceiling', '{p} is above the ceiling of {q}', 'pressure and ceiling, Pa'
    STUCK = 3, 'stuck', 'stuck: {p}, neither fills nor vents', 'pressure, Pa'
    RISES = 4, 'rises', 'rises: {p} at a set-point of {q}', 'pressure and set-point, Pa'
    SAGS = 5, 'sags', 'sags: {p} at a set-point of {q}', 'pressure and set-point, Pa'
    NO_VENT = (6, 'does not vent', 'does not vent: {p} {b:.1f} s after the command',
               'pressure, Pa, and time since the command, s')
    NO_FILL = (7, 'does not fill', 'does not fill: {p} {b:.1f} s after the command',
               'pressure, Pa, and time since the command, s')
    LEAK = (8, 'leaks or lacks air', 'leaks or lacks air: {p}, {q} below the set-point',
            'pressure, and what is missing, Pa')
    SILENCE = (9, 'no reading', 'no reading for {a:.1f} s, the last was {q}',
               'time without a reading, s, and last reading, Pa')
    DEVICE = 10, 'device error', 'device error', ''
    HELD = (11, 'held', 'vented until the node is activated again',
            'code of the fault for which the pad is held')
    TIMEOUT = (12, 'no estimate', 'no load, position or estimate for {a:.1f} s',
               'time without an estimate, s')
    NO_STEP = (13, 'no step measured',
               'no step measured while the other legs took {a:.0f}: its load is not measured, or'
               ' the leg does not step', 'steps of the other legs')
    DOUBT = 14, 'sensors', '', 'code of the doubt of the estimator'
    # fmt: on

    def __init__(self, code: int, label: str, template: str, numbers: str) -> None:
        self.code, self.label, self.template, self.numbers = code, label, template, numbers

    def __call__(self, a: float = 0.0, b: float = 0.0) -> Fault:
        """Return a fault of this kind with its two numbers."""
        return Fault(self, a, b)


KINDS: dict[float, Kind] = {kind.code: kind for kind in Kind}
"""Kinds of fault by their codes."""


class Fault(NamedTuple):
    """A fault, whose text is ``str(fault)``. Where there is none, there is None instead.

    Attributes
    ----------
    kind : Kind
        Kind of the fault.
    a, b : float
        Its two numbers, see :attr:`Kind.numbers`.
    """

    kind: Kind
    a: float
    b: float

    def __str__(self) -> str:
        p, q = (f'{1e-3 * each:.1f} kPa' for each in self[1:])
        return self.kind.template.format(a=self.a, b=self.b, p=p, q=q) or self.label

    @property
    def label(self) -> str:
        """The kind in a few words."""
        return doubts.kind(self.a) if self.kind is Kind.DOUBT else self.kind.label


def text(code: float, a: float, b: float) -> str:
    """Return the text of a fault in a record; empty for none, and for codes not known."""
    return str(KINDS.get(code, Kind.NONE)(a, b))


def joined(*faults: object) -> str:
    """Return texts of faults with semicolons between them, without those that are none."""
    return '; '.join(str(each) for each in faults if each)
