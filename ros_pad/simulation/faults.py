# SPDX-License-Identifier: Apache-2.0
"""Faults of regulators, of their air lines, and of the sensors of feet, on a schedule.

A fault is one line of a scene. The regulator node's parameter ``backend_options.faults`` has the
same lines as texts::

    faults:
      - {kind: leak, legs: [2], start: 5.0, end: 20.0, conductance: 1.0e-10}

A fault changes the physics only: no message announces it, and the device's own readings follow
from the changed physics.

``stuck_valve``
    The pilot valves stick closed. Pilot and outlet pressure stay constant for every set-point;
    air still flows through the main valve to hold these pressures.
``supply_loss``
    The supply falls from full scale to ``pressure`` with a ``time_constant``. The outlets of the
    fault's legs fall with the supply, because air flows back through open valves. At the end of
    the fault the supply is at full scale at once.
``leak``
    The pad has a hole of sonic conductance C (ISO 6358, b = 0.5). The leaking air flows
    through the line and lowers the pad's pressure, by more at a higher pressure.
``sensor_drift``
    The device's sensor reads ``offset`` too high, after a linear ``rise``. The device controls
    that reading, so reading and set-point agree and the pad's error is ``-offset``. A set-point of
    zero opens the exhaust at any reading. The pad can thus be ``-offset`` above the
    set-point, and above the ceiling of set-points, but never above full scale.
``silence``
    The device does not answer; it holds its last set-point.

Faults of the sensors of a foot:

``force_dead``
    The force sensor reads exactly zero.
``force_frozen``
    The force sensor repeats its last reading.
``force_offset``
    The force sensor reads the normal force ``load`` too high.
``force_range``
    The force sensor limits each component to ``load``.
``marker_frozen``
    The position repeats its last reading.

Faults of the sensors of a body with joints:

``imu_silent``, ``joints_silent``
    IMU or joints send nothing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from ros_pad.configuration import Setting, Table, choice, integer, number, shown
from ros_pad.errors import ConfigError, InvalidInput

LATEST = 1e9
"""Latest start or end of a fault, s."""

LEAK_CRITICAL_RATIO = 0.5
"""Critical pressure ratio b of a hole: that of a nozzle is 0.53, that of a knife edge lower."""

# Keys of each kind besides its time and legs.
_OWN: dict[str, tuple[Setting, ...]] = {
    'stuck_valve': (),
    'supply_loss': (
        Setting('pressure', 0.0, '', 'Pa', 0.0, 1e6),
        Setting('time_constant', 1.0, '', 's', 0.0, 3600.0),
    ),
    'leak': (Setting('conductance', float, '', 'm³/(s Pa)', 1e-14, 1e-6),),
    'sensor_drift': (
        Setting('offset', float, '', 'Pa', -1e5, 1e5),
        Setting('rise', 0.0, '', 's', 0.0, 1e6),
    ),
    'silence': (),
    'force_dead': (),
    'force_frozen': (),
    'force_offset': (Setting('load', float, '', 'N', -1e4, 1e4),),
    'force_range': (Setting('load', float, '', 'N', 1e-3, 1e5),),
    'marker_frozen': (),
    'imu_silent': (),
    'joints_silent': (),
}
_LEGS = Setting('legs', list, 'Legs that have the fault.', low=1, high=8)
KINDS = tuple(_OWN)
"""Kinds of fault."""

BODY_KINDS = ('imu_silent', 'joints_silent')
"""Kinds of fault of the sensors of a body with joints."""

FOOT_KINDS = tuple(kind for kind in KINDS if kind.startswith(('force', 'marker')))
"""Kinds of fault of the sensors of a foot."""

AIR_KINDS = ('stuck_valve', 'supply_loss', 'leak', 'sensor_drift', 'silence')
"""Kinds of fault of a regulator, its line and its pad."""


@dataclass(frozen=True)
class Fault:
    """One fault, from a start to an end.

    Parameters
    ----------
    kind : str
        One of ``KINDS``.
    start, end : float
        Simulated time, s, 0 <= start < end: the fault acts at times start <= t < end. ``end`` may
        be infinite.
    legs : tuple of int
        Legs whose regulators or sensors have the fault, 1 to 8; empty for all.
    pressure, time_constant : float
        Of a supply loss: remaining pressure, gauge Pa, 0 to 1e6, and time constant of the fall,
        s, 0 to 3600.
    conductance : float
        Of a leak: sonic conductance C, m³/(s Pa), 1e-14 to 1e-6. A hole of area A has about
        C = 1.6e-3 m/(s Pa) A: 1e-10 for a diameter of 0.3 mm.
    offset, rise : float
        Of a sensor drift: offset, Pa, -1e5 to 1e5, positive where the sensor reads too high; and
        the time until the offset is reached, s, 0 to 1e6.
    load : float
        Of a force sensor: for ``force_offset`` the offset of the normal force, N, -1e4 to 1e4; for
        ``force_range`` the limit of each component, N, 1e-3 to 1e5.

    Raises
    ------
    InvalidInput
        When a value is outside its range, or is given for a kind that does not have it.
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
            integer('legs', leg, 1, 8)
        if self.legs and self.kind in BODY_KINDS:
            raise InvalidInput(
                f'legs = {self.legs!r} is not allowed: a fault of kind {self.kind} is of the body'
            )
        own = {setting.name: setting for setting in _OWN[self.kind]}
        for name in ('pressure', 'time_constant', 'conductance', 'offset', 'rise', 'load'):
            value = getattr(self, name)
            if name in own:
                own[name].accept(value)
            elif value:
                raise InvalidInput(
                    f'{name} = {value!r} is not allowed: a fault of kind {self.kind} has none'
                )

    @classmethod
    def read(cls, table: Table) -> Fault:
        """Read a fault from a table.

        Raises
        ------
        ConfigError
            When a key is missing or unknown, or a value is not allowed.
        """
        kind = table.choice('kind', KINDS)
        values = table.values(_OWN[kind])
        values |= {name: table.number(name, 's') for name in ('start', 'end') if name in table}
        if 'legs' in table:
            values['legs'] = tuple(table.value(_LEGS))
        table.finish()
        try:
            return cls(kind, **values)
        except InvalidInput as error:
            raise ConfigError(f'{table.origin}: {error}') from None

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read a fault from YAML in a text, as in a ROS parameter.

        Raises
        ------
        ConfigError
            When the text is not valid YAML, a key is missing or unknown, or a value is not
            allowed.

        Examples
        --------
        >>> Fault.parse('{kind: silence, legs: [1, 4], start: 3.0}').legs
        (1, 4)
        """
        return cls.read(Table.parse(text, f'fault {shown(text)}'))

    def __str__(self) -> str:
        """Return the text from which :meth:`parse` makes the same fault."""
        values: dict[str, Any] = {'kind': self.kind, 'start': self.start}
        if self.end != math.inf:
            values['end'] = self.end
        if self.legs:
            values['legs'] = self.legs
        values |= {setting.name: getattr(self, setting.name) for setting in _OWN[self.kind]}
        return json.dumps(values)

    def acts_at(self, time: float) -> bool:
        """Return whether the fault acts at a time, s."""
        return self.start <= time < self.end


@dataclass(frozen=True)
class Condition:
    """The condition of regulator, air line and pad at one time.

    Attributes
    ----------
    stuck : bool
        Whether the outlet does not follow the set-point.
    supply : float
        Largest outlet pressure, gauge Pa; infinite for a supply without fault.
    leak : float
        Sonic conductance of holes at the pad, m³/(s Pa).
    offset : float
        Offset of the device's pressure sensor, Pa, positive where the sensor reads too high.
    """

    stuck: bool = False
    supply: float = math.inf
    leak: float = 0.0
    offset: float = 0.0

    @property
    def sound(self) -> bool:
        """Whether air and pressure sensor have no fault; a device that is only silent is sound."""
        return not (self.stuck or self.leak or self.offset) and self.supply == math.inf


SOUND = Condition()


def condition(acting: Iterable[Fault], time: float, full_scale: float) -> Condition:
    """Return the condition of a regulator with these faults.

    Parameters
    ----------
    acting : iterable of Fault
        Faults of this device that act now. Leaks and offsets add up; the lowest supply counts.
    time : float
        Simulated time, s.
    full_scale : float
        Pressure of the supply before a loss, gauge Pa.
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


def listed(table: Table) -> tuple[Fault, ...]:
    """Read the list ``faults`` of a scene; a scene without one has no faults.

    Raises
    ------
    ConfigError
        When ``faults`` is not a list, or one of them is not a valid fault.
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


def faults_of(
    leg: int, faults: Iterable[Fault], kinds: Sequence[str] = AIR_KINDS
) -> tuple[Fault, ...]:
    """Return those of the faults that a leg has, of the given kinds."""
    return tuple(
        fault for fault in faults if fault.kind in kinds and (not fault.legs or leg in fault.legs)
    )


def parsed(faults: Sequence[Fault | str]) -> tuple[Fault, ...]:
    """Return faults given as objects or as texts; see :meth:`Fault.parse`.

    Raises
    ------
    ConfigError
        When a text does not describe a fault.
    InvalidInput
        When ``faults`` is not a list, or one of them is a fault of sensors of foot or body.
    """
    if isinstance(faults, str) or not isinstance(faults, Sequence):
        raise InvalidInput(f'faults = {faults!r} is not allowed: a list of faults is needed')
    found = tuple(each if isinstance(each, Fault) else Fault.parse(each) for each in faults)
    for fault in found:
        choice('faults: kind', fault.kind, AIR_KINDS)
    return found
