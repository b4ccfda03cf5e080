# SPDX-License-Identifier: Apache-2.0
"""A simulated regulator: the pneumatics of the simulation with the interface of a regulator."""

from __future__ import annotations

import copy
import math
import random
import time
from collections.abc import Callable, Sequence

from ros_pad.configuration import integer, number
from ros_pad.errors import InvalidInput, TransportError
from ros_pad.regulators.protocol import CEILING, Reading, permitted
from ros_pad.simulation.faults import Fault, condition, parsed
from ros_pad.simulation.pneumatics import Hose, PneumaticChannel, RegulatorModel

STEP = 0.004
"""Internal time step, s."""

_ROUNDING = 1e-6  # share of a step: largest rounding error of a clock that advances by steps


class SimulatedRegulator:
    """Simulate regulator, hose and pad, advanced to the present time at each call.

    Parameters
    ----------
    clock : callable
        Function that returns the time, s: ``time.monotonic``, or the clock of a simulation.
    ceiling : float
        Highest set-point, gauge Pa, 1 to ``full_scale``.
    hose_diameter, hose_length : float
        Inner diameter and length of the hose, m, in the ranges of
        :class:`ros_pad.simulation.Hose`.
    hose_conductance : float, optional
        Measured sonic conductance of the whole line, m³/(s Pa), instead of the hose formula.
    pad_volume : float or callable
        Air volume of the pads and their chamber, m³, or a function of the gauge pressure, Pa.
    natural_frequency, damping, dead_time, dead_band, full_scale, quantum : float
        As for :class:`ros_pad.simulation.RegulatorModel`.
    sensor_resolution : float
        Smallest step of readings, Pa, 0.1 to 1000. With whole Pa an ambient pressure of
        101325 Pa can be added to a reading and subtracted again without a rounding error.
    sensor_noise : float
        Standard deviation of a reading, Pa, 0 to 1e4. It does not change the pneumatics.
    seed : int
        Seed of the noise.
    faults : sequence of Fault or str
        Faults of this device, or texts for :meth:`~ros_pad.simulation.faults.Fault.parse`. Their
        times are those of the clock; their legs are ignored.

    Raises
    ------
    InvalidInput
        When a value is outside its range, or the clock goes back or is not finite while the
        regulator is open.
    ConfigError
        When a text is not a fault.
    TransportError
        From every method but ``close`` during a fault of kind ``silence``, as from a real device
        that does not answer in time. The set-point does not change then.

    Notes
    -----
    The pressure is measured at the pad. Internal steps of ``STEP`` restart at every change of
    the set-point, so the pressure depends only on the commands and their times. A reading
    between two internal steps is computed on a copy, so readings do not change the result. Long
    times at rest are computed in one step.

    Examples
    --------
    The clock is that of the example, so the pad fills at once:

    >>> from ros_pad.regulators import create
    >>> time = 0.0
    >>> regulator = create('simulated', clock=lambda: time, hose_diameter=0.002)
    >>> regulator.open()
    >>> regulator.set_pressure(75e3)
    >>> readings = []
    >>> for time in (0.0, 0.1, 0.2, 0.5):
    ...     readings.append(round(regulator.read().pressure, -3))
    >>> readings
    [0.0, 71000.0, 75000.0, 75000.0]
    >>> regulator.close()
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        ceiling: float = CEILING,
        hose_diameter: float = 0.004,
        hose_length: float = 1.0,
        hose_conductance: float | None = None,
        pad_volume: float | Callable[[float], float] = 5e-6,
        natural_frequency: float = 45.0,
        damping: float = 0.9,
        dead_time: float = 0.010,
        dead_band: float = 0.005,
        full_scale: float = 100e3,
        quantum: float = 100.0,
        sensor_resolution: float = 10.0,
        sensor_noise: float = 0.0,
        seed: int = 0,
        faults: Sequence[Fault | str] = (),
    ) -> None:
        model = RegulatorModel(
            natural_frequency, damping, dead_time, dead_band, full_scale, quantum
        )
        self._ceiling = number('ceiling', ceiling, 'Pa', 1.0, full_scale)
        self._resolution = number('sensor_resolution', sensor_resolution, 'Pa', 0.1, 1000.0)
        self._noise = number('sensor_noise', sensor_noise, 'Pa', 0.0, 1e4)
        self._random = random.Random(integer('seed', seed, -math.inf))
        if not callable(clock):
            raise InvalidInput(f'clock = {clock!r} is not allowed: a function is needed')
        self._clock = clock
        hose = Hose(hose_diameter, hose_length, hose_conductance)
        self._faults = parsed(faults)
        self._channel = PneumaticChannel(model, hose, pad_volume, faults=self._faults)
        self._is_open = False
        self._now = 0.0  # time of the last call
        self._rest = 0.0  # time since the last internal step, s
        self._epoch = 0.0  # time of the last change of the set-point
        self._steps = 0  # internal steps since that change

    @property
    def ceiling(self) -> float:
        """Highest accepted set-point, gauge Pa."""
        return self._ceiling

    @property
    def pad_pressure(self) -> float:
        """True pressure in the pad now, gauge Pa, in steps of the sensor's resolution.

        This pressure acts on the robot, also while the device is silent or its sensor drifts;
        :meth:`read` returns the same for a device without faults and noise.
        """
        return self._shown(self._present().pad_pressure)

    def open(self) -> None:
        """Follow the clock from now on. After ``close``, the pressures are as it left them."""
        if not self._is_open:
            now = self._clock()
            self._check_answer(now)
            self._is_open = True
            self._now = self._epoch = now
            self._channel.start(now)
            self._rest, self._steps = 0.0, 0

    def set_pressure(self, gauge_pa: float) -> None:
        """Command a pressure.

        Parameters
        ----------
        gauge_pa : float
            Set-point, gauge Pa, 0 to ``ceiling``.

        Raises
        ------
        InvalidInput
            When it is negative or not finite.
        LimitError
            When it is above the ceiling.
        TransportError
            While the regulator is closed, or silent by a fault.
        """
        setpoint = permitted(gauge_pa, self._ceiling)
        rest = self._advance()
        if self._faults:
            self._check_answer(self._now)
        if setpoint != self._channel.setpoint:
            self._channel.step(self._channel.setpoint, rest)
            self._channel.step(setpoint, 0.0)
            self._epoch = self._now
            self._rest, self._steps = 0.0, 0

    def read(self) -> Reading:
        """Return pad pressure and set-point at the present time of the clock."""
        channel = self._present()
        pressure = channel.pad_pressure
        if self._faults:
            self._check_answer(self._now)
            acting = [each for each in self._faults if each.acts_at(self._now)]
            pressure += condition(acting, self._now, channel.regulator.full_scale).offset
        if self._noise:
            pressure += self._random.gauss(0.0, self._noise)
        return Reading(self._shown(pressure), channel.setpoint, (), self._now)

    def vent(self) -> None:
        """Command zero gauge pressure."""
        self.set_pressure(0.0)

    def close(self) -> None:
        """Stop following the clock. The pad keeps its pressure: call ``vent`` before."""
        if self._is_open:
            self._channel.step(self._channel.setpoint, self._advance())
            self._is_open = False

    def _shown(self, pressure: float) -> float:
        return round(pressure / self._resolution) * self._resolution

    def _check_answer(self, now: float) -> None:
        """Raise the error of a device that does not answer, during such a fault."""
        for fault in self._faults:
            if fault.kind == 'silence' and fault.acts_at(now):
                raise TransportError(
                    f'the simulated regulator does not answer (silence from {fault.start:g} s'
                    f' to {fault.end:g} s)'
                )

    def _present(self) -> PneumaticChannel:
        """Return the channel at the present time of the clock; between two steps, a copy."""
        rest = self._advance()
        if not rest:
            return self._channel
        channel = copy.copy(self._channel)
        channel.step(channel.setpoint, rest)
        return channel

    def _advance(self) -> float:
        """Advance by whole internal steps; return the remaining time, s, below ``STEP``."""
        if not self._is_open:
            raise TransportError('the simulated regulator is not open: call open() first')
        now = self._clock()
        if now == self._now:
            return self._rest
        if not self._now <= now < math.inf:
            raise InvalidInput(
                f'the clock went from {self._now!r} s to {now!r} s: it must be finite and must not'
                ' go back; call close() and open() to start at another time'
            )
        self._now = now
        elapsed = now - self._epoch
        steps = int(elapsed / STEP + _ROUNDING)
        channel = self._channel
        while self._steps < steps:
            count = 1
            if channel.settled:
                count = max(1, int(min(steps - self._steps, channel.quiet_time / STEP)))
            channel.step(channel.setpoint, count * STEP)
            self._steps += count
        rest = elapsed - steps * STEP
        self._rest = rest if rest > _ROUNDING * STEP else 0.0
        return self._rest
