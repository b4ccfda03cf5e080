# SPDX-License-Identifier: Apache-2.0
"""Play a bag to the stages of estimation and decision.

The stages receive the recorded messages in the same order and at the same times as the nodes did.
The player keeps their output beside the recorded output of the nodes.
"""

from __future__ import annotations

import bisect
import math
from array import array
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from functools import partial
from typing import Any
from typing import TypeAlias

from ros_pad.bags import BagReader
from ros_pad.bags.topics import BODY_DOUBT
from ros_pad.bags.topics import CLOCK
from ros_pad.bags.topics import STAMP
from ros_pad.bags.topics import TRIAL
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.estimation import DOUBTS
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import estimators_of
from ros_pad.estimation.stage import Emission
from ros_pad.estimation.stage import EstimationStage
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.pace import Pace
from ros_pad.pace import Progress
from ros_pad.records import ESTIMATE
from ros_pad.records import PRESSURE
from ros_pad.records import Block
from ros_pad.trials.comparison import Track
from ros_pad.trials.node_settings import NodeSettings

OF_MOTION = ('contact_velocity', BODY_DOUBT.kind)
"""Further inputs of estimators with ``source: joints``."""
TEXTS = tuple(kind for kind, topic in TRIAL.items() if topic.text)
ESTIMATES = ('slip', 'slipping', 'friction', 'friction_margin', 'wetness', 'doubt')
DECISIONS = ('morphology', 'pressure_setpoint')
CLOCK_TYPE = 'rosgraph_msgs/msg/Clock'

LONGEST_SILENCE_NS = 10_000_000_000
"""Without /clock, the stages tick only in the last part of a pause; this is its length, ns."""

_REPORT_EVERY = 5_000  # messages


def inputs_of(settings: NodeSettings) -> tuple[str, ...]:
    """Return the kinds of input of each leg."""
    joints = settings.tuning.source == 'joints'
    return ('wrench', 'position', 'pressure', *(OF_MOTION[:1] if joints else ()))


Take: TypeAlias = Callable[[Any, int], None]
"""Function of the values of a message and its log time, ns."""

Tracks: TypeAlias = 'dict[tuple[int, str], Track]'


def _tracks(legs: Sequence[int]) -> Tracks:
    return {
        (leg, kind): Track(0 if kind in TEXTS else len(TRIAL[kind].values))
        for leg in legs
        for kind in ESTIMATES + DECISIONS
    }


class ReplayedLeg:
    """The stages of one leg, and their output.

    Attributes
    ----------
    estimation : EstimationStage
    decision : DecisionStage
    first_stamp_ns : int
        Stamp of the first sample for the estimator, ns; samples before it are left out.
    inputs : dict
        Stamps and log times of the messages, ns, by kind of input.
    landings, lift_offs : array of int
        Log times at which stances began and ended, ns.
    rejected, rejection : int, str
        Number of samples that the estimation rejected, and the reason of the last one.
    """

    def __init__(
        self, player: Player, leg: int, settings: NodeSettings, estimator: FootEstimator
    ) -> None:
        self._player, self._leg = player, leg
        self._ambient = settings.ambient_pressure
        self._output = {kind: player.replayed[leg, kind] for kind in ESTIMATES + DECISIONS}
        self._period_ns = round(1e9 / settings.publish_rate)
        self.estimation = EstimationStage(
            estimator,
            self._period_ns,
            self._take_estimate,
            self._take_doubt,
            self._reject,
        )
        self.decision = DecisionStage(player.controller, [leg])
        self._doubt, self._morphology = math.nan, ''
        self._recorded_setpoints = player.recorded[leg, 'pressure_setpoint']
        self._diverged = False  # whether the set-point differs from the recorded one
        self.first_stamp_ns = -1
        self.rejected, self.rejection = 0, ''
        self.inputs: dict[str, tuple[array[int], array[int]]] = {
            kind: (array('q'), array('q')) for kind in inputs_of(settings)
        }
        self._standing = False
        self.landings, self.lift_offs = array('q'), array('q')

    def _note(self, kind: str, stamp: tuple[int, int], log_ns: int) -> int:
        """Store stamp and log time of an input; return the stamp, ns."""
        seconds, nanoseconds = stamp
        # A driver that sets no stamp leaves 0: use the log time.
        stamp_ns = seconds * 1_000_000_000 + nanoseconds or log_ns
        stamps, times = self.inputs[kind]
        stamps.append(stamp_ns)
        times.append(log_ns)
        return stamp_ns

    def wrench(self, values: tuple[Any, ...], log_ns: int) -> None:
        """Process a message of the foot's wrench."""
        stamp_ns = self._note('wrench', values[:2], log_ns)
        if stamp_ns >= self.first_stamp_ns:
            self.estimation.wrench(stamp_ns, values[2:5], values[5])
        self._follow_stance(log_ns)

    def position(self, values: tuple[Any, ...], log_ns: int) -> None:
        """Process a message of the foot's position."""
        stamp_ns = self._note('position', values[:2], log_ns)
        if stamp_ns >= self.first_stamp_ns:
            self.estimation.position(stamp_ns, values[2:])
        self._follow_stance(log_ns)

    def contact_velocity(self, values: tuple[Any, ...], log_ns: int) -> None:
        """Process a message of the velocity of the contact."""
        stamp_ns = self._note('contact_velocity', values[:2], log_ns)
        if stamp_ns >= self.first_stamp_ns:
            self.estimation.contact_velocity(stamp_ns, *values[2:])
        self._follow_stance(log_ns)

    def pressure(self, values: tuple[Any, ...], log_ns: int) -> None:
        """Process a message of the pressure in the pads."""
        self._note('pressure', values[:2], log_ns)
        gauge = values[2] - self._ambient
        self.estimation.pressure(gauge)
        if not self._diverged:
            self._press(gauge)

    def tick(self, now_ns: int) -> None:
        """Detect missing inputs at a time, ns."""
        self.estimation.tick(now_ns)
        if self.decision.tick(now_ns):
            self._take_morphology()

    def _press(self, gauge: float) -> None:
        rows = PRESSURE.rows(1)
        rows['pressure'] = gauge
        self.decision.pressure(Block.of(self._player.now_ns, rows))

    def _follow_stance(self, log_ns: int) -> None:
        standing = self.estimation.estimator.estimate.standing
        if standing != self._standing:
            self._standing = standing
            (self.landings if standing else self.lift_offs).append(log_ns)

    def _take_estimate(self, emission: Emission) -> None:
        output, log_ns = self._output, self._player.log_ns
        stamp_ns, estimate = emission.stamp_ns, emission.estimate
        variance = estimate.slip_speed_sd**2
        output['slip'].add(log_ns, (*estimate.slip_velocity, variance, variance), stamp_ns)
        output['slipping'].add(log_ns, (estimate.slipping,), stamp_ns)
        output['friction'].add(log_ns, (estimate.friction_mean,), stamp_ns)
        output['friction_margin'].add(log_ns, (estimate.margin,), stamp_ns)
        output['wetness'].add(log_ns, (estimate.wet_probability,), stamp_ns)
        self._player.later.append(partial(self._decide, log_ns, emission))

    def _take_doubt(self, doubt: str) -> None:
        self._output['doubt'].add_text(self._player.log_ns, doubt)
        self._player.later.append(partial(self._take_code, DOUBTS.index(doubt.partition(':')[0])))

    def _take_code(self, code: float) -> None:
        self._doubt = code

    def _decide(self, log_ns: int, emission: Emission) -> None:
        self._substitute_pressure()
        rows = ESTIMATE.rows(1)
        rows['load'], rows['wetness'] = emission.load, emission.estimate.wet_probability
        rows['friction'], rows['doubt'] = emission.estimate.friction_mean, self._doubt
        if emission.position is not None:
            rows['position'] = emission.position
        command = self.decision.decide(Block.of(self._player.now_ns, rows))
        self._take_morphology(log_ns)
        setpoint = command.rows[0, 0]['setpoint'].item()
        if not math.isnan(setpoint):
            setpoint += self._ambient
            self._output['pressure_setpoint'].add(log_ns, (setpoint,), emission.stamp_ns)

    def _substitute_pressure(self) -> None:
        """Replace the pressure by the set-point while the set-point differs from the recorded one.

        The recorded pressure follows the recorded set-points: with this pressure, the controller
        would report the pad as stuck.
        """
        replayed, recorded = self._output['pressure_setpoint'], self._recorded_setpoints
        if not len(replayed):
            return
        until_ns = replayed.times[-1] + self._period_ns // 2
        place = bisect.bisect_right(recorded.times, until_ns)
        if not len(recorded):
            self._diverged = True
        elif place and recorded.times[place - 1] > until_ns - self._period_ns:
            self._diverged = recorded.numbers[place - 1] != replayed.numbers[-1]
        if self._diverged:
            self._press(replayed.numbers[-1] - self._ambient)

    def _take_morphology(self, log_ns: int | None = None) -> None:
        morphology = self._player.controller.morphology(self._leg)
        if morphology != self._morphology:
            self._morphology = morphology
            log_ns = self._player.log_ns if log_ns is None else log_ns
            self._output['morphology'].add_text(log_ns, morphology)

    def _reject(self, error: InvalidInput) -> None:
        self.rejected += 1
        self.rejection = str(error)


class Player:
    """Pass messages to the stages in the order in which the nodes received them.

    All messages between two ticks of ``/clock`` are processed before their outputs reach another
    stage; without ``/clock``, all messages with the same log time are.

    Attributes
    ----------
    legs : dict
        A :class:`ReplayedLeg` by the number of the leg.
    recorded, replayed : dict
        A :class:`Track` by leg and kind.
    clocked : bool
        Whether ``/clock`` was recorded.
    """

    def __init__(self, settings: NodeSettings, legs: Sequence[int], clocked: bool) -> None:
        self.controller = settings.controller(legs)
        self.recorded, self.replayed = _tracks(legs), _tracks(legs)
        self.now_ns = self.log_ns = 0
        self.later: list[Callable[[], None]] = []
        estimators, _ = estimators_of(
            len(legs), settings.foot, settings.expected_load, settings.tuning
        )
        self.legs = {
            leg: ReplayedLeg(self, leg, settings, estimator)
            for leg, estimator in zip(legs, estimators, strict=True)
        }
        self._tick_pace = Pace(TICK_PERIOD_NS)
        self.clocked = clocked
        self._next_tick_ns: int | None = None

    def clock(self, values: tuple[int, int], log_ns: int) -> None:
        """Process a message of ``/clock`` with its log time, ns."""
        self.flush()
        self.log_ns = log_ns
        seconds, nanoseconds = values
        self.now_ns = seconds * 1_000_000_000 + nanoseconds
        self._tick()

    def play(self, take: Take, values: tuple[Any, ...], log_ns: int) -> None:
        """Process a message of a leg with its log time, ns, by the function ``take``."""
        if not self.clocked and log_ns != self.log_ns:
            self.flush()
            self._pass_time(log_ns)
        self.log_ns = log_ns
        take(values, log_ns)

    def _pass_time(self, until_ns: int) -> None:
        """Tick the stages up to a log time, ns, as the timers of the nodes do."""
        if self._next_tick_ns is None or until_ns < self._next_tick_ns - 2 * TICK_PERIOD_NS:
            self._next_tick_ns = until_ns  # first message, or the computer's clock was set back
        # Leave out ticks of a long pause that would change nothing.
        self._next_tick_ns = max(self._next_tick_ns, until_ns - LONGEST_SILENCE_NS)
        while self._next_tick_ns <= until_ns:
            self.now_ns = self.log_ns = self._next_tick_ns
            self._tick()
            self.flush()
            self._next_tick_ns += TICK_PERIOD_NS
        self.now_ns = until_ns

    def _tick(self) -> None:
        if self._tick_pace.due(self.now_ns):
            for leg in self.legs.values():
                leg.tick(self.now_ns)

    def body_doubt(self, values: tuple[Any, ...], log_ns: int) -> None:
        """Process a doubt of the body estimator."""
        for leg in self.legs.values():
            leg.estimation.body_doubt(*values)

    def flush(self) -> None:
        """Pass the stored outputs of estimation to decision."""
        for call in self.later:
            call()
        self.later.clear()


def _keeper(track: Track, kind: str) -> Take:
    """Return a function that adds a recorded message to its track."""
    if kind in TEXTS:
        return lambda values, log_ns: track.add_text(log_ns, *values)
    if kind != 'slip':
        return lambda values, log_ns: track.add(log_ns, values)

    def keep(values: tuple[Any, ...], log_ns: int) -> None:
        seconds, nanoseconds, *numbers = values
        track.add(log_ns, tuple(numbers), seconds * 1_000_000_000 + nanoseconds)

    return keep


def _clock(bag: BagReader) -> str | None:
    if not bag.counts.get('/clock'):
        return None
    if bag.topics['/clock'] != CLOCK_TYPE:
        raise BagError(f'{bag.path}: /clock is a {bag.topics["/clock"]}: {CLOCK_TYPE} is needed')
    return '/clock'


def play(
    bag: BagReader,
    settings: NodeSettings,
    wanted: Mapping[str, tuple[int, str]],
    legs: Sequence[int],
    beginnings: Mapping[int, int],
    progress: Progress | None = None,
) -> Player:
    """Play the messages of some legs once.

    Parameters
    ----------
    bag : BagReader
        Bag to play.
    settings : NodeSettings
        Settings of the estimators and the controller.
    wanted : mapping
        Leg and kind of each topic, as :func:`ros_pad.trials.recorded.wanted_topics` returns them.
    legs : sequence of int
        Legs to play.
    beginnings : mapping
        Stamp of the first sample that the estimator uses, ns, by leg; a leg that is not in it
        uses all samples.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Returns
    -------
    Player
        Player with the recorded and the replayed messages.

    Raises
    ------
    BagError
        When ``/clock`` has another message type than in ROS, or the bag is damaged.
    """
    clock = _clock(bag)
    player = Player(settings, legs, clock is not None)
    for leg, beginning_ns in beginnings.items():
        player.legs[leg].first_stamp_ns = beginning_ns
    takers: dict[str, Take] = {}
    paths: dict[str, tuple[str, ...]] = {}
    inputs = inputs_of(settings)
    for topic, (leg, kind) in wanted.items():
        if kind == BODY_DOUBT.kind:
            takers[topic] = partial(player.play, player.body_doubt)
            paths[topic] = BODY_DOUBT.values
        if leg not in player.legs:
            continue
        paths[topic] = TRIAL[kind].values
        if kind in inputs:
            takers[topic] = partial(player.play, getattr(player.legs[leg], kind))
        else:
            takers[topic] = _keeper(player.recorded[leg, kind], kind)
        if kind in (*inputs, 'slip'):
            paths[topic] = STAMP + paths[topic]
        if kind == 'wrench':
            paths[topic] += ('wrench.torque.z',)
    if clock:
        takers[clock], paths[clock] = player.clock, CLOCK.values
    total = sum(bag.counts[topic] for topic in paths)
    for count, (topic, values, log_ns) in enumerate(bag.values(paths)):
        takers[topic](values, log_ns)
        if progress and count % _REPORT_EVERY == 0:
            progress(count / total)
    player.flush()
    if progress:
        progress(1.0)
    return player


__all__ = ['Player', 'ReplayedLeg', 'play']
