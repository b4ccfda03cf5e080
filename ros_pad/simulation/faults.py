# SPDX-License-Identifier: Apache-2.0
"""Faults of regulators, their lines, and the sensors of feet, on a schedule.

A fault is one line of a scene, or one text of the regulator node's parameter
``backend_options.faults``, in the same words::

    faults:
      - {kind: leak, legs: [2], start: 5.0, end: 20.0, conductance: 1.0e-10}

What each kind does is physics, and no more than that: nothing announces a fault, and what a
device reads is what a sound device would read in its place.

``stuck_valve``
    The pilot valves stick closed. The pilot pressure stays, and with it the outlet's, whatever the
    set-point; air still flows through the main valve to hold it.
``supply_loss``
    The supply falls from full scale to ``pressure`` with a ``time_constant``, and the outlets of
    all its feet with it: an open valve lets air back. At the end it is there again at once.
``leak``
    A hole at the pad, by its sonic conductance C (ISO 6358, b = 0.5). What the line cannot supply
    is missing at the pad, the more the higher the pressure.
``sensor_drift``
    The device's sensor reads ``offset`` too much, after a linear ``rise``. The device closes its
    loop on that, so reading and set-point agree and the pad is off by ``-offset``. A set-point of
    zero opens the exhaust whatever the sensor says. The pad can thus be ``-offset`` above the
    set-point, and above the ceiling of set-points, but never above full scale.
``silence``
    The device does not answer; it holds what it was told last.

Those of sensors are of the foot, not of its regulator:

``force_dead``
    The force sensor reads exactly zero.
``force_frozen``
    It repeats what it read last.
``force_offset``
    It reads ``load`` too much of the normal force.
``force_range``
    It shows no component beyond ``load``.
``marker_frozen``
    The position repeats what it was last.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ros_pad.configuration import Table
from ros_pad.configuration import shown
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput

LATEST = 1e9
"""Latest start or end of a fault, s."""

LEAK_CRITICAL_RATIO = 0.5
"""Critical pressure ratio b of a hole: a nozzle has 0.53, a knife edge less."""

# What each kind takes besides its time: unit, lowest, highest, default (None: must be given).
_QUANTITIES: dict[str, dict[str, tuple[str, float, float, float | None]]] = {
    'stuck_valve': {},
    'supply_loss': {
        'pressure': ('Pa', 0.0, 1e6, 0.0),
        'time_constant': ('s', 0.0, 3600.0, 1.0),
    },
    'leak': {'conductance': ('m³/(s Pa)', 1e-14, 1e-6, None)},
    'sensor_drift': {
        'offset': ('Pa', -1e5, 1e5, None),
        'rise': ('s', 0.0, 1e6, 0.0),
    },
    'silence': {},
    'force_dead': {},
    'force_frozen': {},
    'force_offset': {'load': ('N', -1e4, 1e4, None)},
    'force_range': {'load': ('N', 1e-3, 1e5, None)},
    'marker_frozen': {},
}
KINDS = tuple(_QUANTITIES)
"""Kinds of fault."""

SENSOR_KINDS = tuple(kind for kind in KINDS if kind.startswith(('force', 'marker')))
"""Those of a foot's sensors."""


@dataclass(frozen=True)
class Fault:
    """One fault, from a start to an end.

    Parameters
    ----------
    kind : str
        One of ``KINDS``.
    start, end : float
        Simulated time, s, 0 <= start < end; it acts at times start <= t < end. ``end`` may be
        infinite.
    legs : tuple of int
        Whose regulators have it, 1 to 6; empty for all.
    pressure, time_constant : float
        Of a supply loss: gauge Pa that remain, 0 to 1e6, and s, 0 to 3600.
    conductance : float
        Of a leak: sonic conductance C, m³/(s Pa), 1e-14 to 1e-6. A hole of area A has about
        C = 1.6e-3 m/(s Pa) A: 1e-10 for 0.3 mm.
    offset, rise : float
        Of a sensor drift: Pa, -1e5 to 1e5, positive where the sensor reads too much; and the time
        it takes to get there, s, 0 to 1e6.
    load : float
        Of a force sensor, N: what it reads too much of the normal force, -1e4 to 1e4, or the
        largest component that it shows, 1e-3 to 1e5.

    Raises
    ------
    InvalidInput
        When a value is outside its range, or is given to a kind that has no use for it.
    """

    kind: str
    start: float = 0.0
    end: float = math.inf
    legs: tuple[int, ...] = ()
    pressure: float = 0.0
    time_constant: float = 0.0
    conductance: float = 0.0
    offset: float = 0.0
    rise: float = 0.0
    load: float = 0.0

    def __post_init__(self) -> None:
        choice('kind', self.kind, KINDS)
        number('start', self.start, 's', high=LATEST)
        if self.end != math.inf:
            number('end', self.end, 's', self.start, LATEST, above=True)
        for leg in self.legs:
            if not isinstance(leg, int) or isinstance(leg, bool) or not 1 <= leg <= 6:
                raise InvalidInput(
                    f'legs = {self.legs!r} is not allowed: whole numbers from 1 to 6 are needed'
                )
        own = _QUANTITIES[self.kind]
        for quantities in _QUANTITIES.values():
            for name in quantities:
                value = getattr(self, name)
                if name in own:
                    unit, low, high, _ = own[name]
                    number(name, value, unit, low, high)
                elif value:
                    raise InvalidInput(
                        f'{name} = {value!r} is not allowed: a fault of kind {self.kind} has none'
                    )

    @classmethod
    def read(cls, table: Table) -> Fault:
        """Read a fault from a table; the whole table must be used up.

        Raises
        ------
        ConfigError
            Naming file, key, value and allowed range.
        """
        kind = table.choice('kind', KINDS)
        start = table.number('start', 's', 0.0, LATEST, default=0.0)
        end = math.inf
        if 'end' in table:
            end = table.number('end', 's', math.nextafter(start, math.inf), LATEST)
        fault = cls(
            kind=kind,
            start=start,
            end=end,
            legs=_legs(table),
            **{
                name: table.number(
                    name, unit, low, high, **({} if default is None else {'default': default})
                )
                for name, (unit, low, high, default) in _QUANTITIES[kind].items()
            },
        )
        table.finish()
        return fault

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read a fault from YAML in a text, as a parameter of ROS has it.

        Raises
        ------
        ConfigError
            Naming the text, key, value and allowed range.

        Examples
        --------
        >>> Fault.parse('{kind: silence, legs: [1, 4], start: 3.0}').legs
        (1, 4)
        """
        return cls.read(Table.parse(text, f'fault {shown(text)}'))

    def __str__(self) -> str:
        """Return the text that :meth:`parse` makes the same fault of."""
        said: dict[str, Any] = {'kind': self.kind, 'start': self.start}
        if self.end != math.inf:
            said['end'] = self.end
        if self.legs:
            said['legs'] = self.legs
        return json.dumps(said | {name: getattr(self, name) for name in _QUANTITIES[self.kind]})

    def acts_at(self, time: float) -> bool:
        """Whether the fault is there at a time, s."""
        return self.start <= time < self.end


@dataclass(frozen=True)
class Condition:
    """The state of regulator and line at a moment.

    Attributes
    ----------
    stuck : bool
        The outlet does not follow.
    supply : float
        Gauge Pa above which the outlet cannot be; infinite while the supply is there.
    leak : float
        Sonic conductance of holes at the pad, m³/(s Pa).
    offset : float
        What the device's sensor reads too much, Pa.
    """

    stuck: bool = False
    supply: float = math.inf
    leak: float = 0.0
    offset: float = 0.0

    @property
    def sound(self) -> bool:
        """Whether air and sensor are as they should be; those of a silent device are."""
        return not (self.stuck or self.leak or self.offset) and self.supply == math.inf


SOUND = Condition()


def condition(acting: Iterable[Fault], time: float, full_scale: float) -> Condition:
    """Return what faults make of a regulator.

    Parameters
    ----------
    acting : iterable of Fault
        Those of this device that are there. Leaks and offsets add up; of supplies the lowest
        counts.
    time : float
        s.
    full_scale : float
        From which a supply begins to fall, gauge Pa.
    """
    stuck = False
    supply, leak, offset = math.inf, 0.0, 0.0
    for fault in acting:
        since = time - fault.start
        if fault.kind == 'stuck_valve':
            stuck = True
        elif fault.kind == 'supply_loss':
            gone = -math.expm1(-since / fault.time_constant) if fault.time_constant else 1.0
            supply = min(supply, full_scale - gone * (full_scale - fault.pressure))
        elif fault.kind == 'leak':
            leak += fault.conductance
        elif fault.kind == 'sensor_drift':
            offset += fault.offset * (min(1.0, since / fault.rise) if fault.rise else 1.0)
    return Condition(stuck, supply, leak, offset)


def _legs(table: Table) -> tuple[int, ...]:
    legs = table._take('legs', [])
    whole = isinstance(legs, list) and all(type(leg) is int and 1 <= leg <= 6 for leg in legs)
    if not whole or len(set(legs)) < len(legs) or ('legs' in table and not legs):
        raise ConfigError(
            f'{table.origin}: legs = {shown(legs)} is not allowed: '
            'a list of different whole numbers from 1 to 6 is needed'
        )
    return tuple(legs)


def listed(table: Table) -> tuple[Fault, ...]:
    """Take the list ``faults`` of a scene; it may be missing.

    Raises
    ------
    ConfigError
        Naming file, fault, key, value and allowed range.
    """
    entries = table._take('faults', [])
    if not isinstance(entries, list):
        raise ConfigError(
            f'{table.origin}: faults = {shown(entries)} is not allowed: a list is needed'
        )
    return tuple(
        Fault.read(Table(entry, f'{table.origin}: fault {place}'))
        for place, entry in enumerate(entries, start=1)
    )


def faults_of(leg: int, faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return the faults that the regulator of a leg has."""
    return tuple(
        fault
        for fault in faults
        if fault.kind not in SENSOR_KINDS and (not fault.legs or leg in fault.legs)
    )


def sensor_faults_of(leg: int, faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return the faults that the sensors of a leg's foot have."""
    return tuple(
        fault
        for fault in faults
        if fault.kind in SENSOR_KINDS and (not fault.legs or leg in fault.legs)
    )


def parsed(faults: Sequence[Fault | str]) -> tuple[Fault, ...]:
    """Return faults that were given as such or as text; see :meth:`Fault.parse`.

    Raises
    ------
    ConfigError
        When a text is no fault.
    InvalidInput
        When this is no list of faults, or one is not a regulator's.
    """
    if isinstance(faults, str) or not isinstance(faults, Sequence):
        raise InvalidInput(f'faults = {faults!r} is not allowed: a list of faults is needed')
    found = tuple(each if isinstance(each, Fault) else Fault.parse(each) for each in faults)
    for fault in found:
        if fault.kind in SENSOR_KINDS:
            raise InvalidInput(
                f'faults: kind = {fault.kind!r} is not allowed: a regulator has no such sensor'
            )
    return found
