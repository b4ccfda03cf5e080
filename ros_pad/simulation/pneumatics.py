# SPDX-License-Identifier: Apache-2.0
"""A pressure regulator, the hose behind it, and the pad at the end of the hose.

Pressures are gauge Pa unless marked as absolute. Steps are plain Python on floats, which is faster
than NumPy for single values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from ros_pad.configuration import instance, number
from ros_pad.errors import InvalidInput
from ros_pad.simulation.faults import LEAK_CRITICAL_RATIO, SOUND, Condition, Fault, condition

ATMOSPHERE = 101325.0
"""Ambient pressure, absolute Pa."""

REFERENCE_PRESSURE = 100e3
"""Pressure of the reference air (ANR) of ISO 6358, absolute Pa."""

REFERENCE_DENSITY = 1.185
"""Density of the reference air (ANR) of ISO 6358, at 20 °C and 65 % humidity, kg/m³."""

LINEAR_RATIO = 0.999
"""Pressure ratio above which the flow is linear in the pressure difference (ISO 6358)."""

AIR_VISCOSITY = 1.82e-5
"""Dynamic viscosity of air at 20 °C, Pa s."""

MAX_STEP = 0.005
"""Longest internal step, s. After a full step of the set-point, the error of the pad's pressure is
then below 1 % of that step at every time."""

_SETTLED = 0.1  # Pa from the target at which a pad has settled: 1/100 of the sensor's resolution
_INSTANT = 1e-9  # s: shorter times are rounding errors of the caller's clock


@dataclass(frozen=True)
class RegulatorModel:
    """An electro-pneumatic regulator, modelled by the pressure at its outlet.

    A set-point is rounded to the quantum, ignored when it is within the dead band of the last
    accepted one (except zero, which opens the exhaust), delayed by the dead time, and followed as
    a second-order system. The outlet stays between zero and full scale.

    Parameters
    ----------
    natural_frequency : float
        Natural frequency of the second-order system, rad/s, 1 to 1000.
    damping : float
        Damping ratio of that system, 0.1 to 10.
    dead_time : float
        Delay, s, 0 to 1.
    dead_band : float
        Smallest change that is followed, as a share of full scale, 0 to 0.1.
    full_scale : float
        Highest outlet pressure, Pa, 1e3 to 1e6.
    quantum : float
        Resolution of the set-point, Pa, 0 (none) to 1e4.

    Raises
    ------
    InvalidInput
        When a value is outside its range.
    """

    natural_frequency: float = 45.0
    damping: float = 0.9
    dead_time: float = 0.010
    dead_band: float = 0.005
    full_scale: float = 100e3
    quantum: float = 100.0

    def __post_init__(self) -> None:
        number('natural_frequency', self.natural_frequency, 'rad/s', 1.0, 1000.0)
        number('damping', self.damping, '(ratio)', 0.1, 10.0)
        number('dead_time', self.dead_time, 's', 0.0, 1.0)
        number('dead_band', self.dead_band, 'of full scale', 0.0, 0.1)
        number('full_scale', self.full_scale, 'Pa', 1e3, 1e6)
        number('quantum', self.quantum, 'Pa', 0.0, 1e4)

    def transition(self, time: float) -> tuple[float, float, float, float]:
        """Return the exact transition matrix of (error, error rate) over a time.

        Parameters
        ----------
        time : float
            Time, s, from 0.

        Returns
        -------
        tuple of float
            Its four entries by rows: no unit, s, 1/s, no unit.
        """
        w, z = self.natural_frequency, self.damping
        decay = math.exp(-z * w * time)
        if z < 1.0:
            beat = w * math.sqrt(1.0 - z * z)
            c, s = math.cos(beat * time), math.sin(beat * time) / beat
        elif z > 1.0:
            beat = w * math.sqrt(z * z - 1.0)
            c, s = math.cosh(beat * time), math.sinh(beat * time) / beat
        else:
            c, s = 1.0, time
        return decay * (c + z * w * s), decay * s, -decay * w * w * s, decay * (c - z * w * s)


def conductance(sonic: float, critical_ratio: float, first: float, second: float) -> float:
    """Return mass flow over pressure difference of an ISO 6358 restriction, kg/(s Pa).

    Parameters
    ----------
    sonic : float
        Sonic conductance C, m³/(s Pa).
    critical_ratio : float
        b, the pressure ratio below which the flow is choked.
    first, second : float
        Pressures before and behind the restriction, absolute Pa, in any order.

    Returns
    -------
    float
        Finite and positive also where the pressures are equal: above ``LINEAR_RATIO`` a straight
        line replaces the square root of the law, whose slope is infinite at equal pressures.
    """
    up, down = (first, second) if first > second else (second, first)
    b = critical_ratio
    ratio = down / up
    if ratio <= b:
        return sonic * REFERENCE_DENSITY * up / (up - down)
    if ratio > LINEAR_RATIO:
        x = (LINEAR_RATIO - b) / (1.0 - b)
        return sonic * REFERENCE_DENSITY * math.sqrt(1.0 - x * x) / (1.0 - LINEAR_RATIO)
    x = (ratio - b) / (1.0 - b)
    return sonic * REFERENCE_DENSITY * up * math.sqrt(1.0 - x * x) / (up - down)


@dataclass(frozen=True)
class Hose:
    """A hose: ISO 6358 where its flow is turbulent or choked, Poiseuille where it is laminar.

    Parameters
    ----------
    inner_diameter : float
        D, m, 0.5e-3 to 20e-3.
    length : float
        L, m, 0 to 50.
    measured_conductance : float, optional
        C of the whole line, m³/(s Pa), in place of the formula: for instance when a fitting or the
        regulator's valve is narrower than the hose. All of the hose is then behind the resistance.
        1e-8 m³/(s Pa) = 1 dm³/(s bar).

    Raises
    ------
    InvalidInput
        When a value is outside its range.

    Notes
    -----
    ``C = 0.029 D²/√(L/D^1.25 + 510)`` and ``b = 474 C/D²`` hold for D and L in **metres** and
    give C in **m³/(s Pa)**. With millimetres C would be about sixty times too small.

    They are fitted to turbulent flow. In bores of 1 mm and less the flow is laminar for most of
    the time in which a pad fills, and ISO 6358 gives a flow several times too large; therefore the
    flow is limited to isothermal Poiseuille flow, ``π D⁴ (p₁² - p₂²)/(256 η L R T)``. Compared
    with pipe flow by Churchill's friction factor, for bores of 0.5 to 6 mm, lengths of 0.1 to
    10 m and 0.1 to 75 kPa, the mass flow has an error of -7 % to +50 %, largest below 2 kPa in
    thick hoses.
    """

    inner_diameter: float
    length: float
    measured_conductance: float | None = None

    def __post_init__(self) -> None:
        number('hose_diameter', self.inner_diameter, 'm', 0.5e-3, 20e-3)
        number('hose_length', self.length, 'm', 0.0, 50.0)
        if self.measured_conductance is not None:
            number('hose_conductance', self.measured_conductance, 'm³/(s Pa)', 1e-12, 1e-5)

    @cached_property
    def _laminar(self) -> float:
        """Laminar flow over the difference of p², kg/(s Pa²)."""
        drag = 256.0 * AIR_VISCOSITY * self.length * (REFERENCE_PRESSURE / REFERENCE_DENSITY)
        return math.pi * self.inner_diameter**4 / drag if drag else math.inf

    @property
    def volume(self) -> float:
        """Volume of the bore, m³."""
        return math.pi / 4.0 * self.inner_diameter**2 * self.length

    @property
    def volume_behind(self) -> float:
        """Part of the bore behind the resistance, m³."""
        return self.volume if self.measured_conductance is not None else 0.5 * self.volume

    @cached_property
    def sonic_conductance(self) -> float:
        """Sonic conductance C, m³/(s Pa)."""
        if self.measured_conductance is not None:
            return self.measured_conductance
        d = self.inner_diameter
        return 0.029 * d * d / math.sqrt(self.length / d**1.25 + 510.0)

    @cached_property
    def critical_ratio(self) -> float:
        """b, the ratio of absolute pressures, downstream over upstream, where choking begins."""
        return 474.0 * self.sonic_conductance / self.inner_diameter**2

    def conductance(self, first: float, second: float) -> float:
        """Return mass flow over pressure difference between two absolute pressures.

        Parameters
        ----------
        first, second : float
            Absolute pressures at the two ends, Pa, above 0.

        Returns
        -------
        float
            Conductance, kg/(s Pa), finite and positive also where the pressures are equal.
        """
        turbulent = conductance(self.sonic_conductance, self.critical_ratio, first, second)
        laminar = self._laminar * (first + second)
        return laminar if laminar < turbulent else turbulent


def pad_stiffness(
    pad_volume: float | Callable[[float], float], hose: Hose, full_scale: float
) -> tuple[float, list[float]]:
    """Return the rise of the pressure with the mass of air behind the hose's resistance, Pa/kg.

    Parameters
    ----------
    pad_volume : float or callable
        As for :class:`PneumaticChannel`.
    hose : Hose
        The hose behind the regulator.
    full_scale : float
        Highest pressure, gauge Pa.

    Returns
    -------
    tuple
        Width of a cell of pressure, Pa, and the stiffness in cells from 0 to beyond full scale.
    """
    count = 100 if callable(pad_volume) else 1
    cell = full_scale / count
    contents = []  # pressure times volume, Pa m³
    for place in range(count + 1):
        pressure = place * cell
        volume = pad_volume(pressure) if callable(pad_volume) else pad_volume
        number(f'pad_volume at {pressure:g} Pa', volume, 'm³', 1e-9, 1e-2)
        contents.append((pressure + ATMOSPHERE) * (float(volume) + hose.volume_behind))
    capacities = [(high - low) / cell for low, high in pairwise(contents)]
    if min(capacities) <= 0.0:
        raise InvalidInput(
            'pad_volume falls too fast with the pressure: pressure (absolute) times volume'
            ' must grow with the pressure'
        )
    stiffness = [REFERENCE_PRESSURE / (REFERENCE_DENSITY * each) for each in capacities]
    return cell, [*stiffness, stiffness[-1]]


class PneumaticChannel:
    """Regulator, hose and pad of one foot, over time.

    Parameters
    ----------
    regulator : RegulatorModel
        The regulator.
    hose : Hose
        The hose behind it.
    pad_volume : float or callable
        Air volume of all pads of the foot and their chamber, m³, 1e-9 to 1e-2: a constant, or a
        function of gauge pressure in Pa. A function is tabulated once, from 0 to full scale.
    faults : sequence of Fault
        Faults of this channel, see :mod:`ros_pad.simulation.faults`.

    Attributes
    ----------
    pad_pressure : float
        Pressure in the pad, gauge Pa, in [0, full scale], also with faults.
    outlet : float
        Pressure at the outlet of the regulator, gauge Pa.
    setpoint : float
        The last set-point commanded, gauge Pa.
    time : float
        Time on the schedule of the faults, s.
    settled : bool
        Whether the pressures are constant, so that further steps with the same set-point return at
        once; False while a fault acts on the air.

    Raises
    ------
    InvalidInput
        When a value is outside its range, or the volume falls so fast that the gas content does
        not grow with pressure.

    Notes
    -----
    Air is an isothermal ideal gas. Half of the hose's volume is behind the whole resistance, with
    the pad, and half before it, as in a π-section of a line. Compared with a hose of many cells
    with Churchill's friction, for bores of 0.5 to 4 mm and lengths of 0.5 to 10 m, the time to
    90 % of a step is between 8 % too long (1 mm x 10 m) and 18 % too short (4 mm x 10 m, 0.14 s
    instead of 0.17). The delay of sound, 3 ms per metre, is left out.

    Over a step the regulator is solved exactly; conductances have their values at mid-step, and
    the pad relaxes exactly towards an outlet that moves linearly. So the pad never overshoots the
    outlet, however small the volume or steep the law of the flow, and the error falls with the
    square of the step. Steps end where a fault starts or ends.

    Examples
    --------
    Time to fill pads and chamber of 5 cm³ through 1 m of hose to 90 % of 75 kPa:

    >>> from ros_pad.simulation import Hose, PneumaticChannel, RegulatorModel
    >>> for bore in (4e-3, 1e-3):
    ...     channel = PneumaticChannel(RegulatorModel(), Hose(bore, 1.0), pad_volume=5e-6)
    ...     while channel.step(75e3, 1e-3) < 0.9 * 75e3:
    ...         pass
    ...     f'{1e3 * bore:.0f} mm: {channel.time:.2f} s'
    '4 mm: 0.09 s'
    '1 mm: 0.14 s'
    """

    def __init__(
        self,
        regulator: RegulatorModel,
        hose: Hose,
        pad_volume: float | Callable[[float], float],
        faults: Sequence[Fault] = (),
    ) -> None:
        instance('regulator', regulator, RegulatorModel)
        instance('hose', hose, Hose)
        self.regulator, self.hose = regulator, hose
        self.pad_pressure = self.outlet = self.setpoint = self.time = 0.0
        self.settled = not faults  # a fault may act from the beginning
        self._faults = tuple(faults)
        self._stiffness = pad_stiffness(pad_volume, hose, regulator.full_scale)
        self._rate = 0.0  # of the outlet, Pa/s
        self._accepted = 0.0  # the set-point that the dead band compares with
        self._target = 0.0  # the set-point that is followed, after dead band and dead time
        self._pending: tuple[tuple[float, float], ...] = ()  # targets: when they are due, and Pa
        self._transition = (0.0, regulator.transition(0.0))

    def start(self, time: float) -> None:
        """Go on at another time, in the same state.

        Parameters
        ----------
        time : float
            Time on the schedule of the faults, s.
        """
        shift, self.time = time - self.time, time
        self._pending = tuple((due + shift, target) for due, target in self._pending)
        self.settled = self.settled and not self._faults

    @property
    def quiet_time(self) -> float:
        """Time until the next fault starts or ends, s; infinite if none does."""
        edges = (edge for each in self._faults for edge in (each.start, each.end))
        later = (edge for edge in edges if edge > self.time + _INSTANT)
        return min(later, default=math.inf) - self.time

    def step(self, setpoint: float, dt: float) -> float:
        """Hold a set-point for a time and return the pad's pressure at its end.

        Parameters
        ----------
        setpoint : float
            Gauge Pa, 0 to full scale.
        dt : float
            Time, s, finite and not negative. Longer times than ``MAX_STEP`` are divided.

        Returns
        -------
        float
            ``pad_pressure``, gauge Pa.

        Raises
        ------
        InvalidInput
            When the set-point or the time is outside its range; the state is then unchanged.
        """
        if not 0.0 <= dt < math.inf:
            raise InvalidInput(f'dt = {dt!r} s is not allowed: it must be finite and not negative')
        if setpoint != self.setpoint:
            self._command(setpoint)
        while dt > _INSTANT:
            quiet = self.quiet_time if self._faults else math.inf
            if self.settled:
                h = min(dt, quiet)
                self.time += h
                dt -= h
                self.settled = quiet - h > _INSTANT
                continue
            h = dt if dt <= MAX_STEP else dt / math.ceil(dt / MAX_STEP)
            h = min(h, quiet)
            if self._pending:
                due, target = self._pending[0]
                if due - self.time <= _INSTANT:
                    self._target, self._pending = target, self._pending[1:]
                    continue
                h = min(h, due - self.time)
            self._advance(h)
            dt -= h
        return self.pad_pressure

    def _command(self, setpoint: float) -> None:
        """Round a new set-point and, outside the dead band, queue it for the dead time."""
        model = self.regulator
        self.setpoint = number('setpoint', setpoint, 'Pa', 0.0, model.full_scale)
        target = model.quantum * round(setpoint / model.quantum) if model.quantum else setpoint
        target = min(target, model.full_scale)  # full scale need not be a multiple of the quantum
        moved = abs(target - self._accepted)
        if moved > model.dead_band * model.full_scale or (target == 0.0 and moved > 0.0):
            self._accepted = target
            self._pending = (*self._pending, (self.time + model.dead_time, target))
            self.settled = False

    def _advance(self, h: float) -> None:
        """Move regulator and pad by a time h, s."""
        start, now = self.outlet, self.time
        # Steps end where a fault starts or ends: one at mid-step acts during the whole step.
        hardware = self._hardware(now + 0.5 * h, now + h)
        self._move_outlet(h, hardware)
        self._move_pad(h, start, hardware.leak)
        self.time += h
        soon = self.time + 2.0 * _INSTANT  # within the rounding of the clock
        self.settled = (
            abs(self.pad_pressure - self._target) < _SETTLED
            and abs(self.outlet - self._target) < _SETTLED
            and abs(self._rate) < _SETTLED * self.regulator.natural_frequency
            and not self._pending
            and self._hardware(soon, soon).sound
        )
        if self.settled:
            self.pad_pressure = self.outlet = self._target
            self._rate = 0.0

    def _move_outlet(self, h: float, hardware: Condition) -> None:
        """Move the outlet by the regulator's exact response over a time h, s, in its limits."""
        if h != self._transition[0]:
            self._transition = h, self.regulator.transition(h)
        ff, fr, rf, rr = self._transition[1]
        outlet = self.outlet
        if hardware.stuck:
            self._rate = 0.0
        else:
            # The regulator controls the reading of its sensor, except with an open exhaust.
            aim = self._target - hardware.offset if self._target else 0.0
            error = outlet - aim
            outlet = aim + ff * error + fr * self._rate
            self._rate = rf * error + rr * self._rate
        highest = min(self.regulator.full_scale, hardware.supply)
        if not 0.0 <= outlet <= highest:
            # Neither the exhaust nor the supply can move the outlet pressure further.
            outlet = 0.0 if outlet < 0.0 else highest
            self._rate = 0.0
        self.outlet = outlet

    def _move_pad(self, h: float, start: float, leak: float) -> None:
        """Move the pad by a time h, s, in which the outlet moved linearly from ``start``, Pa.

        The hose draws the pad's pressure to that of the outlet, and a leak draws it to ambient.
        Together they draw it to a share of the outlet's pressure. gap = pad - share outlet obeys
        gap' = -relaxation gap - ramp.
        """
        outlet, before = self.outlet, self.pad_pressure
        middle = 0.5 * (start + outlet)
        drawn, pad = start, before
        for time, target in ((0.5 * h, middle), (h, outlet)):
            relaxation, share = self._relaxation(drawn, pad, leak)
            gap = before - share * start
            ramp = share * (outlet - start) / h
            done = -math.expm1(-relaxation * time)
            pad = share * target + gap - (gap + ramp / relaxation) * done
            drawn = middle
        self.pad_pressure = pad

    def _hardware(self, during: float, time: float) -> Condition:
        """Return the condition at a time, s, by the faults that act at the time ``during``, s."""
        if not self._faults:
            return SOUND
        acting = [each for each in self._faults if each.acts_at(during)]
        return condition(acting, time, self.regulator.full_scale)

    def _relaxation(self, outlet: float, pad: float, leak: float) -> tuple[float, float]:
        """Return the rate, 1/s, at which the pad approaches a share of the outlet's pressure.

        Return this share, too.
        """
        cell, values = self._stiffness
        stiffness = values[int(pad / cell)]
        inflow = self.hose.conductance(outlet + ATMOSPHERE, pad + ATMOSPHERE)
        if not leak:
            return inflow * stiffness, 1.0
        total = inflow + conductance(leak, LEAK_CRITICAL_RATIO, pad + ATMOSPHERE, ATMOSPHERE)
        return total * stiffness, inflow / total


def time_to(
    channel: PneumaticChannel,
    setpoint: float,
    pressure: float,
    tick: float = 5e-4,
    longest: float = 60.0,
) -> float:
    """Hold a set-point and return the time until the pad has passed a pressure, s.

    Parameters
    ----------
    channel : PneumaticChannel
        The channel in the state from which the time counts; it is moved to the end of that time.
    setpoint : float
        Gauge Pa, 0 to full scale.
    pressure : float
        Gauge Pa, between that of the pad and the set-point.
    tick, longest : float
        Time between two looks at the pad, between which its pressure is taken to move linearly,
        and after which there are no more, s.

    Returns
    -------
    float
        Infinite if the pad has not passed the pressure after the longest time.
    """
    time, now = 0.0, channel.pad_pressure
    rising = now < pressure
    while (now < pressure) is rising:
        if time > longest:
            return math.inf
        before, now = now, channel.step(setpoint, tick)
        time += tick
    return time - tick * (now - pressure) / (now - before)
