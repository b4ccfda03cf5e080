# SPDX-License-Identifier: Apache-2.0
"""Flat or dome: the choice for each foot's next step.

A foot never changes shape while it stands. It decides when it lifts off, so that the air has the
swing to move, and keeps the shape to the next lift-off. A foot whose air fails goes flat, or keeps
what it has, and the others go on.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass

from ros_pad.contact.pad import choice as one_of
from ros_pad.contact.pad import number
from ros_pad.contact.resistance import Foot
from ros_pad.control.footprints import Footprints
from ros_pad.control.pressure import dome_pressure
from ros_pad.control.probing import Plan
from ros_pad.control.probing import Planner
from ros_pad.control.probing import Stakes
from ros_pad.control.probing import Step
from ros_pad.control.watch import PadWatch
from ros_pad.control.watch import RunningMedian
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError

FLAT = 'flat'
DOME = 'dome'

LOWEST_DOME = 1000.0
"""Gauge pressure below which a pad is flat, Pa; who asks for less of a dome meant kilopascals."""

TOUCH_DOWN = 0.3
"""Of the expected load, above the gate, at which a foot stands again: noise makes no steps.

Nor does a foot that lands: it touches with up to 0.55 of its load (0.8 on rough ground), and is
light once more until the other tripod lifts off.
"""

UNFELT = 0.5
"""Without an estimate for so long a leg is flat, s: the regulators vent it then."""

FIRST_WAIT = 5
"""Steps for which a foot whose air failed is flat before a dome is tried again."""

LONGEST_WAIT = 40
"""The wait doubles with each try in vain, up to so many steps."""

FURTHEST_LEAD = 3
"""Steps that a foot with a slow hose looks further ahead at most."""


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
    wet_expected : float
        As ``wet_ahead``, but where nothing is known it is the share of wet ground on the way so
        far, not the prior.
    plan : Plan
        What the walk so far advises.
    lead : int
        Whole steps that the foot needs to fill beyond its swing; 0 where the swing is enough.
    wet_beyond : float
        Highest probability of wet ground in that many steps after the next one; 0 without such.
        A policy that fills a pad early heeds it. The adaptive one does not: measured, it does not
        pay.
    """

    leg: int
    morphology: str
    steps: float
    probing: bool
    wet_ahead: float
    next_position: tuple[float, float]
    others_probing: bool
    wet_expected: float
    plan: Plan
    lead: int = 0
    wet_beyond: float = 0.0


@dataclass(frozen=True)
class Choice:
    """A shape for the next step, and whether it is only a probe of the ground."""

    morphology: str
    probe: bool = False


Policy = Callable[[LiftOff], Choice]

PROBING = ('value', 'count', 'threshold')
"""Ways to plan the probes of :func:`adaptive`."""


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
    probing: str = 'value',
    probe_every: int = 20,
) -> Policy:
    """Return a policy that follows the belief, with hysteresis, dwell and probes.

    A dome feels wet and dry ground alike, so what is known only fades, and without probes feet
    that were once on wet ground would stay domed for ever: a probe is one flat step of a domed
    foot. One leg probes at a time.

    Parameters
    ----------
    wet_above, dry_below : float
        Probabilities of wet ground ahead beyond which a foot turns to dome, and back to flat.
    probe_below : float
        Probability below which a domed foot probes, if ``probing`` is ``threshold``.
    dwell : int
        Steps that a shape is kept at least; probes and trials are exempt.
    probing : str
        How probes are planned. ``value``: by what they have cost and may bring on this walk, see
        :class:`ros_pad.control.probing.Planner`; then feet also stay domes where flat ones do not
        pay. Baselines that do not learn are ``count``, every so many steps, and ``threshold``,
        when the belief has faded.
    probe_every : int
        Steps as a dome after which a foot probes, if ``probing`` is ``count``.

    Raises
    ------
    InvalidInput
        For what is no probability, ``dry_below`` above ``wet_above``, a dwell or a count below 1,
        or an unknown way of probing.
    """
    number('wet_above', wet_above, '(probability)', high=1.0)
    number('dry_below', dry_below, '(probability)', high=wet_above)
    number('probe_below', probe_below, '(probability)', high=1.0)
    number('dwell', dwell, 'steps', low=1.0)
    one_of('probing', probing, PROBING)
    number('probe_every', probe_every, 'steps', low=1.0)

    def choose(step: LiftOff) -> Choice:
        if probing == 'value':
            wet, plan, due = step.wet_expected, step.plan, step.plan.probe
        else:
            wet, plan = step.wet_ahead, Plan()
            due = step.steps >= probe_every if probing == 'count' else wet < probe_below
        settled = step.probing or step.steps >= dwell
        if step.morphology == FLAT:
            if settled and (wet > wet_above or not plan.flat_pays):
                return Choice(DOME)
            if settled and plan.trial and wet < dry_below:
                return Choice(DOME, probe=True)
            return Choice(FLAT)
        if settled and wet < dry_below and plan.flat_pays:
            return Choice(FLAT)
        if settled and due and not step.others_probing:
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


def first_shapes(policy: str, legs: Sequence[int]) -> dict[int, str]:
    """Return the shape that each leg starts with under a policy.

    Adaptive feet start as domes, but for the first and the last leg, one of each tripod, which
    feel the ground: with what is known of a floor, nothing, six flat feet lose more on wet ground
    than six domes on dry, and two flat feet are enough to tell.

    Parameters
    ----------
    policy : str
        Name of a policy, see :data:`POLICIES`.
    legs : sequence of int
        Numbers of the legs, in their order about the body.
    """
    if policy == 'adaptive':
        return {leg: FLAT if leg in (legs[0], legs[-1]) else DOME for leg in legs}
    return dict.fromkeys(legs, DOME if policy == 'dome' else FLAT)


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


@dataclass(frozen=True)
class FootFault:
    """What was wrong with a leg, and for how long.

    Attributes
    ----------
    leg : int
        Number of the leg.
    start, end : float
        When it was found and when it was found mended, s; the end is None while it lasts.
    reason : str
        In words, with numbers; what was known last.
    """

    leg: int
    start: float
    end: float | None
    reason: str


class _Leg:
    """Memory of the controller about one leg."""

    __slots__ = (
        'decided', 'doubt', 'footprint', 'landed', 'lifted', 'morphology', 'need', 'open',
        'patience', 'peak', 'probing', 'sent', 'setpoint', 'short', 'standing', 'steps', 'stood',
        'stride', 'swing', 'time', 'touched', 'trying', 'unfelt', 'unmoved', 'updated', 'wait',
        'watch',
    )  # fmt: skip

    def __init__(self, morphology: str, peak: float, ceiling: float) -> None:
        self.morphology = morphology
        self.steps = math.inf
        self.probing = False
        self.standing = False
        self.decided = 0
        self.peak = peak
        self.touched = 0.0
        self.setpoint = 0.0
        self.footprint: tuple[float, float] | None = None
        self.landed = self.stood = (0.0, 0.0)
        # Of its air.
        self.watch = PadWatch(ceiling)
        self.sent: float | None = None  # the set-point in force, if any
        self.need = 0.0  # Pa that carry the load without margin
        self.short = ''  # why the last touch-down lacked pressure
        self.wait = 0  # steps until a dome is tried again
        self.patience = FIRST_WAIT
        self.trying = False
        # Of its senses.
        self.doubt = ''
        self.unfelt = ''
        self.unmoved = ''
        self.open: dict[str, FootFault] = {}
        # Of its time, s.
        self.time = math.nan
        self.updated = math.nan
        self.lifted = math.nan
        self.swing = RunningMedian(math.inf)
        self.stride = RunningMedian(math.inf)


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
    start : str or mapping
        Shape before the first lift-off, of all legs or of each, see :func:`first_shapes`.
    margin : float
        Factor on the load, for the pressure of a dome, above 0.
    fixed_pressure : float or None
        Gauge pressure of every dome, Pa, from 1000 up to the foot's ceiling; None chooses it from
        the load.
    load_gate : float
        Share of the expected load below which a foot has lifted off, above 0 up to 0.6. It stands
        again with 0.3 of the expected load more.

    Attributes
    ----------
    faults : list of FootFault
        What was wrong with legs so far, by the time it was found.
    margin : float
        As given; another one counts from the next lift-off on.
    refusals : dict
        For each leg that wanted to be a dome and may not, why.
    switches : dict
        For each leg, how often its shape has changed.
    underpressure : dict
        For each leg, how often it came down as a dome with less pressure than its load needs.

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
        start: str | Mapping[int, str] = FLAT,
        margin: float = 1.2,
        fixed_pressure: float | None = None,
        load_gate: float = 0.3,
    ) -> None:
        number('expected_load', expected_load, 'N', above=True)
        shapes = dict.fromkeys(legs, start) if isinstance(start, str) else dict(start)
        for leg in legs:
            one_of('start', shapes.get(leg, f'no shape of leg {leg}'), (FLAT, DOME))
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
        self.margin = margin
        self._fixed_pressure = fixed_pressure
        self._gate = load_gate * expected_load
        self._stands = (load_gate + TOUCH_DOWN) * expected_load
        self._footprints = Footprints()
        self._planner = Planner(Stakes.expected(foot, expected_load), legs)
        self._decisions = 0
        self._legs = {leg: _Leg(shapes[leg], 1.5 * expected_load, foot.ceiling) for leg in legs}
        self.faults: list[FootFault] = []
        self.refusals: dict[int, str] = {}
        self.switches = dict.fromkeys(legs, 0)
        self.underpressure = dict.fromkeys(legs, 0)
        for leg in legs:
            self._apply(leg, Choice(shapes[leg]))

    def _state(self, leg: int) -> _Leg:
        state = self._legs.get(leg)
        if state is None:
            raise InvalidInput(
                f'leg = {leg!r}: one of {", ".join(map(str, self._legs))} is needed'
            )
        return state

    def morphology(self, leg: int) -> str:
        """Shape chosen for a leg's current or next step; of a faulty pad the shape it has."""
        state = self._legs[leg]
        if not state.watch.reason:
            return state.morphology
        return DOME if self._holds_air(state) else FLAT

    def setpoint(self, leg: int) -> float:
        """Gauge pressure wanted for a leg, Pa."""
        return self._legs[leg].setpoint

    def fault(self, leg: int) -> str:
        """Return what is wrong with a leg now, in words; empty when nothing is."""
        state = self._state(leg)
        reasons = (state.unfelt, state.unmoved, state.doubt, state.watch.reason)
        return '; '.join(filter(None, reasons))

    def remark(self, leg: int) -> str:
        """Return what is no fault and yet worth saying of a leg, as a slow hose; or nothing."""
        state = self._state(leg)
        slow = ''
        if self._lead(state):
            slow = (
                f'slow hose: a fill takes {state.watch.fill_time:.2f} s, a swing'
                f' {state.swing.value:.2f} s'
            )
        return '; '.join(filter(None, (self.refusals.get(leg), state.short, slow)))

    def lead(self, leg: int) -> int:
        """Return how many steps ahead a leg must decide for its pad to be full in time."""
        return self._lead(self._state(leg))

    def watch(self, leg: int) -> PadWatch:
        """Return what is known of a leg's air."""
        return self._state(leg).watch

    def doubt(self, leg: int, reason: str) -> None:
        """Take note why a foot's sensors are not believed; an empty reason ends it.

        Call it before :meth:`observe`. Such a foot leaves no footprints and does not probe; what
        other feet felt still counts for it.
        """
        self._state(leg).doubt = reason

    def observe(self, leg: int, time: float, pressure: float | None) -> None:
        """Take a reading of a pad before the leg's :meth:`update` of the same moment.

        Parameters
        ----------
        leg : int
            Number of the leg.
        time : float
            s; of all legs on one clock.
        pressure : float or None
            Gauge Pa; None where there was no reading. Without any nothing is watched.
        """
        state = self._state(leg)
        if not 0.0 <= time - state.time <= UNFELT:  # nobody looked
            state.updated = time
            state.lifted = math.nan
        state.time = time
        watch = state.watch
        faulty = watch.fault
        watch.update(time, state.sent, pressure)
        if faulty and not watch.fault:
            # What came back for one may have come back for all.
            state.patience = FIRST_WAIT
            for other in self._legs.values():
                other.wait = 0
        elif watch.fault and not faulty:
            state.wait = state.patience
        if time - state.updated <= UNFELT:
            state.unfelt = ''
        elif not state.unfelt:
            state.unfelt = f'no load, position or estimate for {time - state.updated:.1f} s'
            if state.morphology == DOME:
                self.switches[leg] += 1
            self._apply(leg, Choice(FLAT))
            state.steps = math.inf
            state.sent = None  # the regulator vents when it has waited long enough
        if self._decisions - state.decided <= 2 * len(self._legs):
            state.unmoved = ''
        elif not state.unmoved:
            state.unmoved = (
                f'no step felt while the others took {self._decisions - state.decided}:'
                ' its load is not measured, or it is held up'
            )
        self._note(leg, state)

    def _note(self, leg: int, state: _Leg) -> None:
        """Keep the list of faults: one entry for each time that something was wrong."""
        watch = state.watch
        for kind, reason in (
            ('fault', watch.fault), ('silence', watch.silence),
            ('unfelt', state.unfelt), ('unmoved', state.unmoved), ('doubt', state.doubt),
        ):  # fmt: skip
            known = state.open.get(kind)
            if known is None:
                if reason:
                    state.open[kind] = FootFault(leg, state.time, None, reason)
                    self.faults.append(state.open[kind])
            elif known.reason != reason:
                if reason:  # more is known of it
                    now = state.open[kind] = dataclasses.replace(known, reason=reason)
                else:
                    now = dataclasses.replace(known, end=state.time)
                    del state.open[kind]
                self.faults[self.faults.index(known)] = now

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
        state = self._state(leg)
        # A load that is no number is below no gate: it must not pass for a lift-off.
        if not (math.isfinite(load + position[0] + position[1]) and 0.0 <= wet_probability <= 1.0):
            raise InvalidInput(
                f'leg {leg}: load = {load!r} N, position = {tuple(position)!r} m: must be finite;'
                f' wet_probability = {wet_probability!r}: must be from 0 to 1'
            )
        state.updated = state.time
        if load >= self._gate:
            if load >= self._stands and not state.standing:
                state.landed = (position[0], position[1])
                state.standing = True
                self._touch_down(leg, state)
            state.touched = max(state.touched, load)
            state.stood = (position[0], position[1])
        elif state.standing:
            state.standing = False
            self._lift_off(leg, wet_probability, position)
        state.sent = state.setpoint
        return state.setpoint

    @staticmethod
    def _holds_air(state: _Leg) -> bool:
        # What the watch lets pass as vented is flat here, too: a sensor that reads a little too
        # much must not cost a foot all its footprints.
        return state.watch.pressure > max(LOWEST_DOME, state.watch.tolerance)

    def _touch_down(self, leg: int, state: _Leg) -> None:
        """Compare the pressure of a dome with what its load needs."""
        state.short = ''
        if state.footprint is None:
            return  # it has stood from the beginning
        if state.time > state.lifted:
            state.swing.add(state.time - state.lifted)
        pressure = state.watch.pressure
        if state.morphology == DOME and pressure < state.need:
            self.underpressure[leg] += 1
            state.short = (
                f'{1e-3 * pressure:.1f} kPa at touch-down, {1e-3 * state.need:.1f} needed'
            )

    def _lead(self, state: _Leg) -> int:
        late = state.watch.fill_time - state.swing.value
        if not late > 0.0:
            return 0
        return min(math.ceil(late / state.stride.value), FURTHEST_LEAD)

    def _permitted(self, leg: int, state: _Leg, choice: Choice) -> Choice:
        """Return what a leg is fit for: flat where its air failed, but for a try."""
        if state.doubt and choice.probe and choice.morphology == FLAT:
            choice = Choice(state.morphology)  # it would not learn anything
        if not state.watch.fault:
            state.trying = False
            # A device that is silent keeps what it has, and would change it when it hears again.
            return Choice(state.morphology) if state.watch.silence else choice
        if choice.morphology == FLAT or state.watch.silence:
            state.trying = False
            return Choice(FLAT)
        if state.trying:
            if not state.watch.stalled:
                return choice  # its hose may be slow
            state.trying = False
            state.patience = min(2 * state.patience, LONGEST_WAIT)
            state.wait = state.patience
        state.wait -= 1
        others = (other for name, other in self._legs.items() if name != leg)
        # One leg at a time, but for those that another's success, or a try put off, lets through.
        if state.wait > 0 or (state.wait == 0 and any(other.trying for other in others)):
            return Choice(FLAT)
        state.trying = True
        return choice

    def _lift_off(self, leg: int, wet_probability: float, position: Sequence[float]) -> None:
        state = self._legs[leg]
        state.steps += 1
        # Remember the heaviest step, but forget it over some tens of steps.
        state.peak = max(state.touched, state.peak + 0.1 * (state.touched - state.peak))
        state.touched = 0.0
        if state.time > state.lifted:
            state.stride.add(state.time - state.lifted)
        state.lifted = state.time
        x, y = position[0], position[1]
        if not (state.watch.silence or state.doubt):
            # A pad that holds air is no flat one, whatever was asked of it.
            flat = state.morphology == FLAT and not self._holds_air(state)
            made = Step(state.landed, state.stood, flat, state.probing, wet_probability)
            self._planner.step(leg, made, self._footprints)
        # The next step is taken to be as long as the last one.
        before_x, before_y = state.footprint or (x, y)
        state.footprint = (x, y)
        ahead = (2.0 * x - before_x, 2.0 * y - before_y)
        lead = self._lead(state)
        self._decisions += 1
        state.decided = self._decisions
        step = LiftOff(
            leg=leg,
            morphology=self.morphology(leg),
            steps=state.steps,
            probing=state.probing,
            wet_ahead=self._footprints.wet_probability(*ahead),
            next_position=ahead,
            others_probing=self._others_probing(leg),
            wet_expected=self._footprints.wet_expected(*ahead),
            plan=self._planner.plan(leg),
            lead=lead,
            wet_beyond=max(
                (
                    self._footprints.wet_probability(
                        (1 + far) * x - far * before_x, (1 + far) * y - far * before_y
                    )
                    for far in range(2, 2 + lead)
                ),
                default=0.0,
            ),
        )
        before = state.morphology
        self._apply(leg, self._permitted(leg, state, self._policy(step)))
        if state.morphology != before:
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
                    self._foot, state.peak, self.margin
                )
                # What a fixed pressure is worth is not for the controller to say.
                state.need = (
                    setpoint - state.watch.tolerance
                    if self._fixed_pressure
                    else dome_pressure(self._foot, state.peak, 1.0)
                )
            except LimitError as error:
                # Domes that cannot carry the foot are worse than none.
                self.refusals[leg] = str(error)
                morphology = FLAT
        state.morphology = morphology
        state.probing = choice.probe
        state.setpoint = setpoint
