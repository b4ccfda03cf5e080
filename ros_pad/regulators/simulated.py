# SPDX-License-Identifier: Apache-2.0
"""A regulator that is not there: the simulated pneumatics behind the regulator protocol."""

from __future__ import annotations

import copy
import math
import random
import time
from collections.abc import Callable
from collections.abc import Sequence
from numbers import Real

from ros_pad.errors import InvalidInput
from ros_pad.errors import TransportError
from ros_pad.regulators.protocol import Reading
from ros_pad.regulators.protocol import permitted
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.faults import condition
from ros_pad.simulation.faults import parsed
from ros_pad.simulation.pneumatics import Hose
from ros_pad.simulation.pneumatics import PneumaticChannel
from ros_pad.simulation.pneumatics import RegulatorModel

STEP = 0.004
"""Internal step, s."""

_ROUNDING = 1e-6  # of a step: a clock that counts in steps is a hair early or late


class SimulatedRegulator:
    """Regulator, hose and pad, advanced to the present whenever they are spoken to.

    Parameters
    ----------
    clock : callable
        Returns the time in s: ``time.monotonic``, or the clock of a simulation.
    ceiling : float
        Highest set-point, gauge Pa, above 0 up to ``full_scale``.
    hose_diameter, hose_length : float
        m; see :class:`~ros_pad.simulation.pneumatics.Hose`.
    hose_conductance : float, optional
        Measured sonic conductance of the whole line, m³/(s Pa), in place of the hose formula.
    pad_volume : float or callable
        Air volume of the pads and the chamber that feeds them, m³, or a function that gives it
        for a gauge pressure in Pa.
    natural_frequency, damping, dead_time, dead_band, full_scale, quantum, slew_limit : float
        See :class:`~ros_pad.simulation.pneumatics.RegulatorModel`.
    sensor_resolution : float
        Pa, 0.1 to 1000. With whole Pa an ambient pressure of 101325 Pa can be added to a
        reading and subtracted again without a rounding error.
    sensor_noise : float
        Standard deviation of a reading, Pa, 0 to 1e4. It never acts on the pneumatics.
    seed : int
        Of the noise.
    faults : sequence of Fault or str
        What this device suffers, whatever legs are named: faults, or texts as
        :meth:`~ros_pad.simulation.faults.Fault.parse` reads them. Their times are those of the
        clock, and are kept exactly.

    Raises
    ------
    InvalidInput
        When a value is outside its range, or the clock goes back while the regulator is open.
    ConfigError
        When a text is no fault.
    TransportError
        From every method but ``close`` while a fault of kind ``silence`` acts, as from a real
        device that does not answer in time. The set-point stays then.

    Notes
    -----
    The pressure is measured at the pad. Time is divided into internal steps of ``STEP`` that
    start anew at every change of the set-point, so what the pad does depends on the commands
    and their times alone. A reading between two internal steps runs a copy up to its moment and
    drops it: how often and when one reads changes nothing. Noise is drawn once for each instant
    that is read. Once nothing moves, a step costs nothing, so long gaps are quick.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        ceiling: float = 90e3,
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
        slew_limit: float = math.inf,
        sensor_resolution: float = 10.0,
        sensor_noise: float = 0.0,
        seed: int = 0,
        faults: Sequence[Fault | str] = (),
    ) -> None:
        model = RegulatorModel(
            natural_frequency, damping, dead_time, dead_band, full_scale, quantum, slew_limit
        )
        for name, value, low, high in [
            ('ceiling', ceiling, 1.0, full_scale),
            ('sensor_resolution', sensor_resolution, 0.1, 1000.0),
            ('sensor_noise', sensor_noise, 0.0, 1e4),
        ]:
            if not isinstance(value, Real) or isinstance(value, bool) or not low <= value <= high:
                raise InvalidInput(
                    f'{name} = {value!r} is not allowed: '
                    f'a number from {low:g} to {high:g} Pa is needed'
                )
        if not isinstance(seed, int) or isinstance(seed, bool):
            raise InvalidInput(f'seed = {seed!r} is not allowed: a whole number is needed')
        if not callable(clock):
            raise InvalidInput(f'clock = {clock!r} is not allowed: a function is needed')
        self._clock = clock
        self._ceiling = float(ceiling)
        hose = Hose(hose_diameter, hose_length, hose_conductance)
        self._faults = parsed(faults)
        self._channel = PneumaticChannel(model, hose, pad_volume, faults=self._faults)
        self._resolution = sensor_resolution
        self._noise = sensor_noise
        self._random = random.Random(seed)
        self._disturbance = 0.0
        self._disturbance_time = -math.inf
        self._is_open = False
        self._now = 0.0  # the latest moment seen
        self._epoch = 0.0  # the last change of the set-point, where the internal steps start
        self._steps = 0  # internal steps done since

    @property
    def ceiling(self) -> float:
        """The highest set-point that is accepted, gauge Pa."""
        return self._ceiling

    @property
    def air_used(self) -> float:
        """Air drawn since the start, kg, up to the last internal step."""
        return self._channel.air_used

    @property
    def pad_pressure(self) -> float:
        """True pressure in the pad now, gauge Pa, in steps of the sensor's resolution.

        It is what a robot stands on, also where the device is silent or its sensor has drifted;
        for a sound device without noise it is what :meth:`read` says.
        """
        return self._shown(self._present().pad_pressure)

    def open(self) -> None:
        """Start the clock. After ``close`` the air is found as it was left."""
        if not self._is_open:
            now = self._clock()
            self._listen(now)
            self._is_open = True
            self._now = self._epoch = self._channel.time = now
            self._steps = 0

    def set_pressure(self, gauge_pa: float) -> None:
        """Command a pressure in [0, ceiling], gauge Pa; see ``Regulator.set_pressure``."""
        setpoint = permitted(gauge_pa, self._ceiling)
        rest = self._advance()
        self._listen(self._now)
        if setpoint != self._channel.setpoint:
            self._channel.step(self._channel.setpoint, rest)
            self._channel.step(setpoint, 0.0)
            self._epoch = self._now
            self._steps = 0

    def read(self) -> Reading:
        """Return pad pressure and set-point at the present moment of the clock."""
        channel = self._present()
        self._listen(self._now)
        pressure = channel.pad_pressure + self._drift()
        if self._noise:
            if self._now != self._disturbance_time:
                self._disturbance_time = self._now
                self._disturbance = self._random.gauss(0.0, self._noise)
            pressure += self._disturbance
        return Reading(self._shown(pressure), channel.setpoint, (), self._now)

    def vent(self) -> None:
        """Command zero gauge pressure."""
        self.set_pressure(0.0)

    def close(self) -> None:
        """Stop the clock. The pad keeps what it holds: ``vent`` first."""
        if self._is_open:
            self._channel.step(self._channel.setpoint, self._advance())
            self._is_open = False

    def _shown(self, pressure: float) -> float:
        return round(pressure / self._resolution) * self._resolution

    def _drift(self) -> float:
        """Return what the device's sensor reads too much now, Pa."""
        acting = [each for each in self._faults if each.acts_at(self._now)]
        return condition(acting, self._now, self._channel.regulator.full_scale).offset

    def _listen(self, now: float) -> None:
        """Raise what a driver raises when its device does not answer."""
        for fault in self._faults:
            if fault.kind == 'silence' and fault.acts_at(now):
                raise TransportError(
                    f'the simulated regulator does not answer (silence from {fault.start:g} s'
                    f' to {fault.end:g} s)'
                )

    def _present(self) -> PneumaticChannel:
        """Return the channel at the present moment of the clock: a copy between two steps."""
        rest = self._advance()
        if not rest:
            return self._channel
        channel = copy.copy(self._channel)
        channel.step(channel.setpoint, rest)
        return channel

    def _advance(self) -> float:
        """Do the internal steps up to now, and return the rest of time in s, below ``STEP``."""
        if not self._is_open:
            raise TransportError('the simulated regulator is not open: call open() first')
        now = self._clock()
        if not self._now <= now < math.inf:
            raise InvalidInput(
                f'the clock went from {self._now!r} s to {now!r} s: it must not go back; '
                'close() and open() again to start another time'
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
        return rest if rest > _ROUNDING * STEP else 0.0
