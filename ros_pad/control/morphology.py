# SPDX-License-Identifier: Apache-2.0
"""Flat or dome: the choice for each foot's next step.

A foot never changes shape while it stands. It decides when it lifts off, so that the air has the
swing to move, and keeps the shape to the next lift-off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass

from ros_pad.contact.pad import choice as one_of
from ros_pad.contact.pad import number
from ros_pad.contact.resistance import Foot
from ros_pad.control.footprints import Footprints
from ros_pad.control.pressure import dome_pressure
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError

FLAT = 'flat'
DOME = 'dome'

LOWEST_DOME = 1000.0
"""Gauge pressure below which a pad is flat, Pa; who asks for less of a dome meant kilopascals."""

TOUCH_DOWN = 1.5
"""Load at which a foot stands again, over that at which it lifts off: noise makes no steps."""


@dataclass(frozen=True)
class LiftOff:
    """What a policy knows when a foot lifts off.

    Attributes
    ----------
    leg : int
        Number of the leg.
    morphology : str
        Shape of the step that ends, ``flat`` or ``dome``.
    steps : float
        Steps taken since that shape was chosen, this one counted; infinite for the shape that the
        foot started with, which nobody chose of late.
    probing : bool
        Whether that step was a probe.
    wet_ahead : float
        Probability that the ground is wet where the foot will stand next.
    next_position : tuple of float
        Where that is, m.
    others_probing : bool
        Whether another leg is probing now.
    """

    leg: int
    morphology: str
    steps: float
    probing: bool
    wet_ahead: float
    next_position: tuple[float, float]
    others_probing: bool


@dataclass(frozen=True)
class Choice:
    """A shape for the next step, and whether it is only a probe of the ground."""

    morphology: str
    probe: bool = False


Policy = Callable[[LiftOff], Choice]


def flat(step: LiftOff) -> Choice:
    """Stay flat."""
    return Choice(FLAT)


def dome(step: LiftOff) -> Choice:
    """Stay domed."""
    return Choice(DOME)


def adaptive(
    wet_above: float = 0.65,
    dry_below: float = 0.35,
    probe_below: float = 0.75,
    dwell: int = 2,
) -> Policy:
    """Return a policy that follows the belief, with hysteresis, dwell and probes.

    Parameters
    ----------
    wet_above, dry_below : float
        Probabilities of wet ground ahead beyond which a foot turns to dome, and back to flat.
    probe_below : float
        Probability below which a domed foot asks the ground with one flat step. A dome feels wet
        and dry ground alike, so what is known only fades, and without probes feet that were once
        on wet ground would stay domed for ever. One leg probes at a time.
    dwell : int
        Steps that a shape is kept at least; a probe is exempt.

    Raises
    ------
    InvalidInput
        For what is no probability, ``dry_below`` above ``wet_above``, or a dwell below 1.
    """
    number('wet_above', wet_above, '(probability)', high=1.0)
    number('dry_below', dry_below, '(probability)', high=wet_above)
    number('probe_below', probe_below, '(probability)', high=1.0)
    number('dwell', dwell, 'steps', low=1.0)

    def choose(step: LiftOff) -> Choice:
        if step.morphology == FLAT:
            settled = step.probing or step.steps >= dwell
            return Choice(DOME) if settled and step.wet_ahead > wet_above else Choice(FLAT)
        if step.steps < dwell:
            return Choice(DOME)
        if step.wet_ahead < dry_below:
            return Choice(FLAT)
        if step.wet_ahead < probe_below and not step.others_probing:
            return Choice(FLAT, probe=True)
        return Choice(DOME)

    return choose


def oracle(is_wet: Callable[[float, float], bool]) -> Policy:
    """Return a policy that sees the ground where the foot will stand next.

    Parameters
    ----------
    is_wet : callable
        ``is_wet(x, y)`` tells whether the ground is wet at a position, m.
    """

    def choose(step: LiftOff) -> Choice:
        return Choice(DOME if is_wet(*step.next_position) else FLAT)

    return choose


POLICIES = ('flat', 'dome', 'adaptive', 'oracle')


def policy_named(name: str, is_wet: Callable[[float, float], bool] | None = None) -> Policy:
    """Return a policy by its name; ``oracle`` needs the ground.

    Raises
    ------
    InvalidInput
        For an unknown name, or an oracle without ground to look at.
    """
    if name == 'oracle':
        if is_wet is None:
            raise InvalidInput("policy = 'oracle': needs a floor that is known")
        return oracle(is_wet)
    policies = {'flat': flat, 'dome': dome, 'adaptive': adaptive()}
    if name not in policies:
        raise InvalidInput(f'policy = {name!r}: one of {", ".join(POLICIES)} is needed')
    return policies[name]


class _Leg:
    """Memory of the controller about one leg."""

    __slots__ = (
        'decided', 'footprint', 'morphology', 'peak', 'probing', 'setpoint', 'standing', 'steps',
        'touched',
    )  # fmt: skip

    def __init__(self, morphology: str, peak: float) -> None:
        self.morphology = morphology
        self.steps = math.inf
        self.probing = False
        self.standing = False
        self.decided = 0
        self.peak = peak
        self.touched = 0.0
        self.setpoint = 0.0
        self.footprint: tuple[float, float] | None = None


class MorphologyController:
    """Turns each foot's load and belief into a shape and a set-point.

    Parameters
    ----------
    foot : Foot
        All feet are of this kind.
    legs : sequence of int
        Numbers of the legs.
    policy : callable
        Chooses at each lift-off, see :func:`adaptive`.
    expected_load : float
        Normal force in stance, N, above 0.
    start : str
        Shape before the first lift-off.
    margin : float
        Factor on the load, for the pressure of a dome, above 0.
    fixed_pressure : float or None
        Gauge pressure of every dome, Pa, from 1000 up to the foot's ceiling; None chooses it from
        the load.
    load_gate : float
        Share of the expected load below which a foot has lifted off, above 0 up to 0.6. It stands
        again at 1.5 times that.

    Attributes
    ----------
    refusals : dict
        For each leg that wanted to be a dome and may not, why.
    switches : dict
        For each leg, how often its shape has changed.

    Raises
    ------
    InvalidInput
        Naming the value that is outside its range.
    LimitError
        When the fixed pressure is above the foot's ceiling.
    """

    def __init__(
        self,
        foot: Foot,
        legs: Sequence[int],
        policy: Policy,
        expected_load: float,
        start: str = FLAT,
        margin: float = 1.2,
        fixed_pressure: float | None = None,
        load_gate: float = 0.3,
    ) -> None:
        number('expected_load', expected_load, 'N', above=True)
        one_of('start', start, (FLAT, DOME))
        number('margin', margin, '(factor)', above=True)
        number('load_gate', load_gate, '(share)', high=0.6, above=True)
        if fixed_pressure is not None:
            number('fixed_pressure', fixed_pressure, 'Pa', low=LOWEST_DOME)
            if fixed_pressure > foot.ceiling:
                raise LimitError(
                    f'fixed_pressure = {fixed_pressure:g} Pa is above the ceiling of'
                    f' {foot.ceiling:g} Pa of {foot.source}'
                )
        self._foot = foot
        self._policy = policy
        self._margin = margin
        self._fixed_pressure = fixed_pressure
        self._gate = load_gate * expected_load
        self._footprints = Footprints()
        self._decisions = 0
        self._legs = {leg: _Leg(start, 1.5 * expected_load) for leg in legs}
        self.refusals: dict[int, str] = {}
        self.switches = dict.fromkeys(legs, 0)
        for leg in legs:
            self._apply(leg, Choice(start))

    def morphology(self, leg: int) -> str:
        """Shape chosen for a leg's current or next step."""
        return self._legs[leg].morphology

    def setpoint(self, leg: int) -> float:
        """Gauge pressure wanted for a leg, Pa."""
        return self._legs[leg].setpoint

    def update(
        self, leg: int, load: float, wet_probability: float, position: Sequence[float]
    ) -> float:
        """Take an estimate and return the gauge pressure wanted, Pa.

        Parameters
        ----------
        leg : int
            Number of the leg.
        load : float
            Normal force now, N.
        wet_probability : float
            Belief about the ground below it, 0 to 1.
        position : sequence of float
            Of the foot, x and y, m.

        Raises
        ------
        InvalidInput
            For a leg that is not controlled, a probability outside 0 to 1, or a value that is not
            finite. Nothing has changed then.
        """
        state = self._legs.get(leg)
        if state is None:
            raise InvalidInput(
                f'leg = {leg!r}: one of {", ".join(map(str, self._legs))} is needed'
            )
        # A load that is no number is below no gate: it must not pass for a lift-off.
        if not (math.isfinite(load + position[0] + position[1]) and 0.0 <= wet_probability <= 1.0):
            raise InvalidInput(
                f'leg {leg}: load = {load!r} N, position = {tuple(position)!r} m: must be finite;'
                f' wet_probability = {wet_probability!r}: must be from 0 to 1'
            )
        if load >= self._gate:
            if load >= TOUCH_DOWN * self._gate:
                state.standing = True
            state.touched = max(state.touched, load)
        elif state.standing:
            state.standing = False
            self._lift_off(leg, wet_probability, position)
        return state.setpoint

    def _lift_off(self, leg: int, wet_probability: float, position: Sequence[float]) -> None:
        state = self._legs[leg]
        state.steps += 1
        # Remember the heaviest step, but forget it over some tens of steps.
        state.peak = max(state.touched, state.peak + 0.1 * (state.touched - state.peak))
        state.touched = 0.0
        x, y = position[0], position[1]
        if state.morphology == FLAT:
            self._footprints.add(x, y, wet_probability)
        # The next step is taken to be as long as the last one.
        before_x, before_y = state.footprint or (x, y)
        state.footprint = (x, y)
        ahead = (2.0 * x - before_x, 2.0 * y - before_y)
        self._decisions += 1
        state.decided = self._decisions
        step = LiftOff(
            leg=leg,
            morphology=state.morphology,
            steps=state.steps,
            probing=state.probing,
            wet_ahead=self._footprints.wet_probability(*ahead),
            next_position=ahead,
            others_probing=self._others_probing(leg),
        )
        self._apply(leg, self._policy(step))
        if state.morphology != step.morphology:
            self.switches[leg] += 1
            state.steps = 0

    def _others_probing(self, leg: int) -> bool:
        # A leg that is held up since the others have long stepped again keeps nobody waiting.
        recent = self._decisions - 2 * len(self._legs)
        return any(
            other.probing and other.decided > recent
            for name, other in self._legs.items()
            if name != leg
        )

    def _apply(self, leg: int, choice: Choice) -> None:
        state = self._legs[leg]
        morphology = choice.morphology
        setpoint = 0.0
        self.refusals.pop(leg, None)
        if morphology == DOME:
            try:
                setpoint = self._fixed_pressure or dome_pressure(
                    self._foot, state.peak, self._margin
                )
            except LimitError as error:
                # Domes that cannot carry the foot are worse than none.
                self.refusals[leg] = str(error)
                morphology = FLAT
        state.morphology = morphology
        state.probing = choice.probe
        state.setpoint = setpoint
