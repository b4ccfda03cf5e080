# SPDX-License-Identifier: Apache-2.0
"""Doubts of the estimator: codes with two numbers, and their texts for people.

The kind of a doubt is the part of its text before the colon.
"""

from __future__ import annotations

from typing import NamedTuple

TURNS = (
    'the ordinary ones',
    'force axes turned by about 90° about z',
    'force axes turned by about -90° about z',
    'force axes, or those of the position, turned by about 180° about z',
    'left-handed, x of force or position has the wrong sign',
    'left-handed, y of force or position has the wrong sign',
    'left-handed, x and y of the force are exchanged',
    'left-handed, x and y of the force are exchanged with wrong signs',
)
"""Turned or mirrored axes; their matrices are in :mod:`ros_pad.estimation.axes`."""


class Doubt(NamedTuple):
    """A reason why the ground is unobservable: a code and two numbers.

    Attributes
    ----------
    code : int
        Place in :data:`TABLE`; 0: no doubt.
    a, b : float
        Details.
    """

    code: int = 0
    a: float = 0.0
    b: float = 0.0


class Row(NamedTuple):
    """What a code means: its kind, the template of its details, and whether sensors are faulty."""

    kind: str
    details: str = ''
    fault: bool = False


TABLE = (
    Row(''),
    Row('not yet', 'has not stood'),
    Row('not yet', 'has not stood since its sensors were in doubt'),
    Row('domed', 'wet and dry ground feel alike'),
    Row('half inflated', 'domes carry {a:.0f} % of the load'),
    Row('light', '{a:.2g} N of {b:.2g} N'),
    Row('turning', 'it takes up {a:.2f} of friction, pull {b:.2f}'),
    Row('not pulled', 'T/N up to {a:.2f}, and wet ground holds {b:.2f}'),
    Row('undecided', 'friction {a:.2f} ± {b:.2f} fits wet ground and dry'),
    Row('motion unknown', 'the body is in doubt'),
    Row('force stands still', '{a:.3g} N to the last digit', True),
    Row('force stands still', 'reads exactly nothing', True),
    Row('force out of range', '{axis} = {b:.3g} N', True),
    Row('force out of range', '{axis} stays at {b:.3g} N', True),
    Row('marker lost', 'last seen {a:.2g} s ago', True),
    Row('marker stands still', 'to the last digit', True),
    Row('marker leapt', '{a:.0f} mm', True),
    Row('axes', '{turn}', True),
    Row('axes', 'the normal force is along {sign}{axis} of the sensor, not z', True),
    Row('axes', 'the sign of the force is turned, it pulls the foot down', True),
    Row('axes', 'z of the position is turned, the foot swings below its stances', True),
    Row('no wrench', 'for {a:.1f} s', True),
    Row('no position', 'for {a:.1f} s', True),
    Row('sample refused', 'for {a:.1f} s', True),
    Row('no contact velocity', 'for {a:.1f} s', True),
)  # fmt: skip
"""What the codes mean; the last four come from :class:`ros_pad.estimation.stage.EstimationStage`.
"""

(
    NONE, NOT_YET, NOT_AGAIN, ALL_DOME, HALF, FAINT, TURNING, NOT_PULLED, UNDECIDED, MOTION,
    STILL, DEAD, RANGE, STUCK, LOST, MARKER_STILL, LEAPT,
    TURNED, NORMAL, UPSIDE_DOWN, BELOW,
    NO_WRENCH, NO_POSITION, REFUSED, NO_VELOCITY,
) = range(len(TABLE))  # fmt: skip

DOUBTS = tuple(dict.fromkeys(each.kind for each in TABLE))
SENSOR_FAULTS = tuple(dict.fromkeys(each.kind for each in TABLE if each.fault))


def _row(code: float) -> Row:
    """Return what a code means; a code of records of others may mean nothing."""
    return TABLE[int(code) if 0 <= code < len(TABLE) else NONE]


def kind(code: float) -> str:
    """Return the kind of a code; '' for codes not known."""
    return _row(code).kind


def is_fault(code: float) -> bool:
    """Return whether a code is a fault of the sensors."""
    return _row(code).fault


def text(code: float, a: float = 0.0, b: float = 0.0) -> str:
    """Return a doubt for people: its kind, a colon, and details; '' without one, or not known.

    Examples
    --------
    >>> from ros_pad.estimation import doubt
    >>> doubt.text(doubt.LOST, 0.2)
    'marker lost: last seen 0.2 s ago'
    """
    row = _row(code)
    if not row.kind:
        return ''
    place = int(a) if 0.0 <= a < len(TURNS) else 0
    details = row.details.format(
        a=a, b=b, axis='xyz'[place % 3], sign='-' if b < 0.0 else '', turn=TURNS[place]
    )
    return f'{row.kind}: {details}'
