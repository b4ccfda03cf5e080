# SPDX-License-Identifier: Apache-2.0
"""Choose flat or dome for the next step of each foot.

A foot never changes its morphology while it stands. The choice is made at lift-off, so that the
pad can fill or vent during the swing, and is kept until the next lift-off. A foot whose air fails
becomes flat, or keeps its morphology; the other feet are not affected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ros_pad.configuration import Setting, choice, instance, number, quantity
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.contact.resistance import Foot
from ros_pad.control.faults import Fault, Kind, joined
from ros_pad.control.footprints import Footprints, FrictionFelt
from ros_pad.control.monitor import PadMonitor, Times, typical
from ros_pad.control.policies import DOME, FLAT, Choice, LiftOff, Policy
from ros_pad.control.pressure import dome_pressure
from ros_pad.errors import InvalidInput, LimitError

COMMAND_TIMEOUT = Setting(
    'command_timeout', 0.5, 'A pad is vented when it has received no set-point for this long.',
    's', 0.02, 60.0,
)  # fmt: skip
"""Time without a set-point after which a regulator vents its pad. The controller uses the same
time: a leg that has no estimates for longer counts as flat."""

MARGIN = Setting(
    'margin', 1.2, 'Pressure margin: factor on the load when the pressure of a dome is chosen.',
    '', 1.0, 5.0,
)  # fmt: skip

LIFT_OFF = Setting(
    'lift_off_share', 0.3, 'Share of the expected load below which a foot has lifted'
    ' off; it stands again at this share plus 0.3.', '', 0.01, 0.6,
)  # fmt: skip

FIRST_WAIT, LONGEST_WAIT = 5, 40
"""Flat steps after a fault of the air before a dome is tried again; the number doubles with each
failed try, up to the second one."""

LASTING = 3
"""Decisions, of 20 ms, for which a load lasts that a dome is to carry. The impact of landing, of
one foot or another, ends before: it presses domes flat, and they are up again."""

TOUCH_DOWN = 0.3
"""Additional share of the expected load from which on a foot stands again for the controller. So
noise does not count as steps. Nor does the bounce of a landing foot, which touches the ground with
up to 0.55 of its load (0.8 on rough ground) and has little load again until the other tripod lifts
off."""


@dataclass
class FootFault:
    """A fault of a leg, with its start and end.

    Attributes
    ----------
    leg : int
        Number of the leg.
    start : float
        Time at which the fault was found, s.
    end : float or None
        Time at which its end was found, s; None while the fault lasts.
    fault : Fault
        The fault, with the numbers found last.
    """

    leg: int
    start: float
    end: float | None
    fault: Fault

    @property
    def reason(self) -> str:
        """Text of the fault, with numbers."""
        return str(self.fault)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: leg, start, end, and the fault as kind and reason."""
        return {
            'leg': self.leg, 'start': self.start, 'end': self.end, 'kind': self.fault.label,
            'reason': self.reason,
        }  # fmt: skip


@dataclass(slots=True)
class _Ground:
    """Load, positions and times of a foot in this stance and in the one before."""

    lift_off: float  # load below which a standing foot has lifted off, N
    touch_down: float  # load from which on it stands again, N
    peak: float  # largest recent load that lasted, N, for which the pressure of domes is chosen
    stands: bool = False
    loads: Times = field(default_factory=lambda: Times(maxlen=LASTING))  # last ones, N
    largest: float = 0.0  # largest load of this stance that lasted, N
    stood: tuple[float, float] = (0.0, 0.0)  # last position in stance, m
    lifted: tuple[float, float] | None = None  # position at the last lift-off, m
    lifted_at: float = math.nan  # time of that, s
    swings: Times = field(default_factory=lambda: Times(maxlen=5))  # durations, s


@dataclass(slots=True)
class _Air:
    """Air of a foot, and the tries to fill it after a fault."""

    monitor: PadMonitor
    sent: float | None = None  # last set-point commanded; None before the first or after a timeout
    needed: float = 0.0  # least pressure that carries the load, without margin, Pa
    shortfall: str = ''  # warning, if the pressure was too low at the last touch-down
    wait: int = 0  # steps until a dome is tried again
    patience: int = FIRST_WAIT  # steps to wait after the next fault
    trying: bool = False  # whether a dome is being tried after a fault

    @property
    def holds(self) -> bool:
        """Whether the measured pressure (not the set-point) is that of a dome.

        A pressure that the monitor accepts as vented counts as flat here, too. Otherwise a small
        offset of the sensor would discard all footprints of the foot.
        """
        return self.monitor.pressure > max(DOME_PRESSURE, self.monitor.tolerance)


@dataclass(slots=True)
class _LegState:
    """Memory of the controller about one leg."""

    leg: int
    ground: _Ground
    air: _Air
    morphology: str
    setpoint: float = 0.0
    now: float = math.nan  # time of the last observation, s
    updated: float = math.nan  # and of the last estimate
    timeout: Fault | None = None
    no_step: Fault | None = None
    sensors: Fault | None = None
    lasting: dict[int, FootFault] = field(default_factory=dict)  # by place in `present`
    steps: float = math.inf  # steps since the morphology changed last
    probing: bool = False
    decided: int = 0  # number of this leg's last decision, counted over all legs

    @property
    def present(self) -> tuple[Fault | None, ...]:
        """Its faults of all sorts, each at its place; None for those that it does not have."""
        monitor = self.air.monitor
        return self.timeout, self.no_step, self.sensors, monitor.silence, monitor.fault


class MorphologyController:
    """Decide the morphology and the set-point of each foot.

    Parameters
    ----------
    foot : Foot
        All feet are of this kind.
    legs : sequence of int
        Numbers of the legs.
    policy : callable
        Policy that chooses at each lift-off, see :func:`ros_pad.control.adaptive`.
    expected_load : float
        Normal force in stance, N, above 0.
    start : str or mapping
        Morphology before the first lift-off, one for all legs or one for each, see
        :func:`ros_pad.control.first_morphologies`.
    margin : float
        Pressure margin: factor on the load when the pressure of a dome is chosen, above 0.
    fixed_pressure : float or None
        Gauge pressure of every dome, Pa, from 1000 up to the foot's ceiling; None chooses it from
        the load.
    lift_off_share : float
        Share of the expected load below which a foot has lifted off, 0.01 to 0.6. The foot stands
        again at this share plus 0.3.
    command_timeout : float
        Time without a set-point after which regulators vent, s, 0.02 to 60: a leg without an
        estimate for longer counts as flat.

    Attributes
    ----------
    faults : list of FootFault
        Faults of all legs so far, in the order in which they were found.
    footprints : Footprints
        Places where flat feet of all legs stood, with the probability of wet ground there.
    friction : FrictionFelt
        Friction of flat feet and of domes, which decides whether flat feet pay.
    margin : float
        Pressure margin as given, a factor; a new value applies from the next lift-off.
    policy : callable
        Policy as given; a new one applies from the next lift-off.
    command_timeout : float
        Timeout as given, s; a new value applies at once.
    refusals : dict
        For each leg for which a dome was chosen but would need more than the ceiling, the reason.
    switches : dict
        For each leg, how often its morphology has changed.
    underpressure : dict
        For each leg, number of touch-downs as a dome with less pressure than its load needs.

    Raises
    ------
    InvalidInput
        When a value is outside its range, a fixed pressure above the foot's ceiling, or foot or
        policy of another kind; the message names it.

    Examples
    --------
    A foot stands on ground that is probably wet, lifts off, and becomes a dome:

    >>> from ros_pad.contact import Foot
    >>> from ros_pad.control import MorphologyController, adaptive
    >>> foot = Foot.load('large19')
    >>> controller = MorphologyController(foot, [1], adaptive(), expected_load=5.0)
    >>> for step in range(6):
    ...     time, load = 0.1 * step, 5.0 if step < 4 else 0.0
    ...     controller.observe(1, time, pressure=0.0)
    ...     setpoint = controller.update(1, load, wet_probability=0.9, position=(0.0, 0.0))
    >>> controller.morphology(1), round(setpoint)  # Pa
    ('dome', 88970)
    """

    def __init__(
        self,
        foot: Foot,
        legs: Sequence[int],
        policy: Policy,
        expected_load: float,
        start: str | Mapping[int, str] = FLAT,
        margin: float = MARGIN.default,
        fixed_pressure: float | None = None,
        lift_off_share: float = LIFT_OFF.default,
        command_timeout: float = COMMAND_TIMEOUT.default,
    ) -> None:
        instance('foot', foot, Foot)
        instance('policy', policy, Callable)  # type: ignore[arg-type]
        number('expected_load', expected_load, 'N', above=True)
        first = dict.fromkeys(legs, start) if isinstance(start, str) else dict(start)
        for leg in legs:
            choice('start', first.get(leg, f'no morphology of leg {leg}'), (FLAT, DOME))
        number('margin', margin, '(factor)', above=True)
        lift_off = LIFT_OFF.accept(lift_off_share) * expected_load
        touch_down = (lift_off_share + TOUCH_DOWN) * expected_load
        if fixed_pressure is not None:
            unit = f'Pa, the ceiling of {foot.source},'
            number('fixed_pressure', fixed_pressure, unit, DOME_PRESSURE, foot.ceiling)
        self._foot, self._fixed_pressure = foot, fixed_pressure
        self.policy, self.margin = policy, margin
        self.command_timeout = COMMAND_TIMEOUT.accept(command_timeout)
        self.footprints, self.friction = Footprints(), FrictionFelt(foot, expected_load)
        self._decisions = 0
        self.faults: list[FootFault] = []
        self.refusals: dict[int, str] = {}
        self.switches = dict.fromkeys(legs, 0)
        self.underpressure = dict.fromkeys(legs, 0)
        self._legs: dict[int, _LegState] = {}
        for leg in legs:
            ground = _Ground(lift_off, touch_down, peak=1.5 * expected_load)
            air = _Air(PadMonitor(foot.ceiling))
            self._legs[leg] = _LegState(leg, ground, air, first[leg])
            self._apply(self._legs[leg], Choice(first[leg]))

    def _state(self, leg: int) -> _LegState:
        if leg not in self._legs:
            known = ', '.join(map(str, self._legs))
            raise InvalidInput(f'leg = {leg!r} is not allowed: one of {known} is needed')
        return self._legs[leg]

    def morphology(self, leg: int) -> str:
        """Return the morphology of a leg in the present step, or in swing in the next one.

        Parameters
        ----------
        leg : int
            Number of the leg.

        Returns
        -------
        str
            ``flat`` or ``dome``. If the pad has a fault or no readings, its measured morphology
            instead.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled.
        """
        state = self._state(leg)
        monitor = state.air.monitor
        if monitor.fault or monitor.silence:
            return DOME if state.air.holds else FLAT
        return state.morphology

    def setpoint(self, leg: int) -> float:
        """Return the set-point of a leg.

        Parameters
        ----------
        leg : int
            Number of the leg.

        Returns
        -------
        float
            Gauge pressure, Pa.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled.
        """
        return self._state(leg).setpoint

    def fault(self, leg: int) -> str:
        """Return the present faults of a leg.

        Parameters
        ----------
        leg : int
            Number of the leg.

        Returns
        -------
        str
            Faults as text; empty if there are none.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled.
        """
        return joined(*self._state(leg).present)

    def remark(self, leg: int) -> str:
        """Return warnings about a leg that are no faults, such as a slow hose.

        Parameters
        ----------
        leg : int
            Number of the leg.

        Returns
        -------
        str
            Warnings as text; empty if there are none.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled.
        """
        state, slow = self._state(leg), ''
        fill, swing = state.air.monitor.fill_time, typical(state.ground.swings, math.inf)
        if fill > swing:
            slow = f'slow hose: a fill takes {fill:.2f} s, a swing {swing:.2f} s'
        return joined(self.refusals.get(leg), state.air.shortfall, slow)

    def monitor(self, leg: int) -> PadMonitor:
        """Return the monitor of a leg's air.

        Parameters
        ----------
        leg : int
            Number of the leg.

        Returns
        -------
        PadMonitor
            The monitor.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled.
        """
        return self._state(leg).air.monitor

    def observe(self, leg: int, time: float, pressure: float | None, doubt: float = 0.0) -> None:
        """Process the measurements of a leg that can arrive without an estimate.

        Call it before the :meth:`update` of the same time.

        Parameters
        ----------
        leg : int
            Number of the leg.
        time : float
            Time of the measurements, s; the same clock for all legs.
        pressure : float or None
            Reading, gauge Pa; None without a reading. The air is monitored only after a first
            reading.
        doubt : float
            Code (no unit) of the doubt of the estimator if sensors of the foot cannot be used; 0
            if they can. A foot with such a fault adds no footprints and does not probe; it uses
            the footprints of the other feet.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled.
        """
        state = self._state(leg)
        air, monitor = state.air, state.air.monitor
        if doubt or state.sensors:
            state.sensors = Kind.DOUBT(doubt) if doubt else None
        if not 0.0 <= time - state.now <= self.command_timeout:  # the first time, after a pause
            state.updated, state.ground.lifted_at = time, math.nan
        state.now = time
        before = monitor.fault
        monitor.update(time, air.sent, pressure)
        if monitor.fault and not before:
            air.wait = air.patience
        elif before and not monitor.fault:
            air.patience = FIRST_WAIT
            # If the supply is back, the pads of the other legs can be filled again, too.
            for other in self._legs.values():
                other.air.wait = 0
        age = time - state.updated
        if age <= self.command_timeout:
            state.timeout = None
        elif not state.timeout:
            state.timeout = Kind.TIMEOUT(age)
            self.switches[leg] += state.morphology == DOME
            self._apply(state, Choice(FLAT))
            state.steps = math.inf
            air.sent = None  # the regulator vents after its own timeout
        missed = self._decisions - state.decided
        if missed <= 2 * len(self._legs):
            state.no_step = None
        elif not state.no_step:
            state.no_step = Kind.NO_STEP(missed)
        # One entry of the list lasts from the start of a fault to its end.
        for place, fault in enumerate(state.present):
            entry = state.lasting.get(place)
            if fault and entry:
                entry.fault = fault  # it may have new numbers
            elif fault:
                state.lasting[place] = FootFault(leg, time, None, fault)
                self.faults.append(state.lasting[place])
            elif entry:
                state.lasting.pop(place).end = time

    def update(
        self,
        leg: int,
        load: float,
        wet_probability: float,
        position: Sequence[float],
        friction: float = math.nan,
    ) -> float:
        """Process an estimate.

        Parameters
        ----------
        leg : int
            Number of the leg.
        load : float
            Largest normal force on the foot since the last call, N.
        wet_probability : float
            Probability of wet ground below the foot, 0 to 1.
        position : sequence of float
            Position of the foot, x and y, m.
        friction : float
            Coefficient of friction below the foot; NaN if it is not known.

        Returns
        -------
        float
            Set-point, gauge Pa.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled, a probability outside 0 to 1, or a value that is not
            finite. The state is then unchanged.
        """
        state = self._state(leg)
        number(f'leg {leg}: load', load, 'N', -math.inf)
        quantity(f'leg {leg}: position', position, 'm', -math.inf)
        number(f'leg {leg}: wet_probability', wet_probability, '', high=1.0)
        state.updated = state.now
        ground = state.ground
        ground.loads.append(load)
        stood = ground.stands
        ground.stands = load >= (ground.lift_off if stood else ground.touch_down)
        if ground.stands and not stood:
            self._touch_down(state)
        if load >= ground.lift_off:
            ground.largest = max(ground.largest, min(ground.loads))
            ground.stood = (position[0], position[1])
        elif stood:
            self._lift_off(state, wet_probability, position, friction)
        state.air.sent = state.setpoint
        return state.setpoint

    def _touch_down(self, state: _LegState) -> None:
        """Compare the pressure of a dome with what its load needs."""
        ground, air = state.ground, state.air
        air.shortfall = ''
        if ground.lifted is None:
            return  # the foot stood from the beginning: this is no step
        if state.now > ground.lifted_at:
            ground.swings.append(state.now - ground.lifted_at)
        pressure = air.monitor.pressure
        if state.morphology == DOME and pressure < air.needed:
            self.underpressure[state.leg] += 1
            air.shortfall = (
                f'{1e-3 * pressure:.1f} kPa at touch-down, {1e-3 * air.needed:.1f} kPa needed'
            )

    def _permitted(self, state: _LegState, wanted: Choice) -> Choice:
        """Return the choice, changed where faults of sensors or air do not permit it.

        After a fault of its air a leg is flat, except when a dome is tried.
        """
        air, monitor = state.air, state.air.monitor
        if state.sensors and wanted.probe and wanted.morphology == FLAT:
            wanted = Choice(state.morphology)  # a probe without sensors would measure nothing
        if not monitor.fault:
            air.trying = False
            # A silent device keeps its pressure; a new set-point would act when it answers again.
            return Choice(state.morphology) if monitor.silence else wanted
        if wanted.morphology == FLAT or monitor.silence:
            air.trying = False
            return Choice(FLAT)
        if air.trying:
            if not monitor.stalled:
                return wanted  # the pad may still be filling through a slow hose
            air.trying = False
            air.patience = min(2 * air.patience, LONGEST_WAIT)
            air.wait = air.patience
        air.wait -= 1
        others = (other.air for other in self._legs.values() if other is not state)
        # At 0 a leg waits once more while another leg tries. Below 0 it has done so, or another
        # pad has recovered (see `observe`).
        if air.wait > 0 or (air.wait == 0 and any(other.trying for other in others)):
            return Choice(FLAT)
        air.trying = True
        return wanted

    def _lift_off(
        self, state: _LegState, wet: float, position: Sequence[float], friction: float
    ) -> None:
        """Evaluate the step that ends, and choose the morphology of the next one."""
        ground, air = state.ground, state.air
        state.steps += 1
        # The largest recent load decays over some tens of steps.
        ground.peak = max(ground.largest, ground.peak + 0.1 * (ground.largest - ground.peak))
        ground.largest, ground.lifted_at = 0.0, state.now
        if not (air.monitor.silence or state.sensors):
            # A pad under pressure is not flat, even if its set-point is zero.
            flat = state.morphology == FLAT and not air.holds
            if flat:
                self.footprints.add(*ground.stood, wet)
            if flat or air.holds:
                self.friction.add(flat, wet, friction)
        # The foot will stand there if its steps are of equal length.
        x, y = position[0], position[1]
        before_x, before_y = ground.lifted or (x, y)
        ground.lifted, ahead = (x, y), (2.0 * x - before_x, 2.0 * y - before_y)
        self._decisions += 1
        state.decided = self._decisions
        # A probing leg that has stopped stepping must not delay the probes of the others.
        recent = self._decisions - 2 * len(self._legs)
        others = (other for other in self._legs.values() if other is not state)
        step = LiftOff(
            leg=state.leg,
            morphology=self.morphology(state.leg),
            steps=state.steps,
            probing=state.probing,
            wet_ahead=self.footprints.wet_probability(*ahead),
            next_position=ahead,
            others_probing=any(other.probing and other.decided > recent for other in others),
            flat_pays=self.friction.flat_pays,
            break_even=self.friction.break_even,
        )
        before = state.morphology
        self._apply(state, self._permitted(state, self.policy(step)))
        if state.morphology != before:
            self.switches[state.leg] += 1
            state.steps = 0

    def _apply(self, state: _LegState, wanted: Choice) -> None:
        """Apply a choice; make the leg flat if no pressure up to the ceiling carries the load."""
        air, peak = state.air, state.ground.peak
        state.morphology, state.setpoint, state.probing = wanted.morphology, 0.0, wanted.probe
        self.refusals.pop(state.leg, None)
        if wanted.morphology == FLAT:
            return
        try:
            if self._fixed_pressure:
                state.setpoint = self._fixed_pressure
                air.needed = self._fixed_pressure - air.monitor.tolerance
            else:
                state.setpoint = dome_pressure(self._foot, peak, self.margin)
                air.needed = dome_pressure(self._foot, peak, 1.0)
        except LimitError as error:
            # Overloaded domes have less capacity than a flat sole.
            self.refusals[state.leg], state.morphology = str(error), FLAT
