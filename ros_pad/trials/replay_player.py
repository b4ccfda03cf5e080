# SPDX-License-Identifier: Apache-2.0
"""Plays what a bag recorded of feet to the listeners that the nodes are made of.

Recorded messages come to them in the order, and at the times, at which the nodes got them; what
estimators and controller answer is kept beside what was recorded of their answers.
"""

from __future__ import annotations

import bisect
from array import array
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import TypeAlias

from ros_pad.control.listening import LOOK_PERIOD_NS
from ros_pad.control.listening import LegListener
from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.estimation import Estimate
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import trouble_in
from ros_pad.estimation.listening import LISTEN_PERIOD_NS
from ros_pad.estimation.listening import FootListener
from ros_pad.pace import Pace
from ros_pad.trials.bag import BagReader
from ros_pad.trials.comparison import Track
from ros_pad.trials.node_settings import Settings

INPUTS = ('wrench', 'position', 'pressure')
WIDTHS = {
    'slip': 4,
    'slipping': 1,
    'friction': 1,
    'friction_margin': 1,
    'wetness': 1,
    'pressure_setpoint': 1,
}
TEXTS = ('doubt', 'morphology')
ESTIMATES = ('slip', 'slipping', 'friction', 'friction_margin', 'wetness', 'doubt')
DECISIONS = ('morphology', 'pressure_setpoint')
CLOCK_TYPE = 'rosgraph_msgs/msg/Clock'

LONGEST_SILENCE_NS = 10_000_000_000
"""Of a bag, through which the nodes are taken to have looked whether feet are heard, ns."""

_REPORT_EVERY = 5_000  # messages

Progress: TypeAlias = Callable[[float], None]
Take: TypeAlias = Callable[[Any, int], None]
"""Takes a message, and when it was recorded, ns."""

Tracks: TypeAlias = 'dict[tuple[int, str], Track]'


def _tracks(legs: Sequence[int]) -> Tracks:
    return {
        (leg, kind): Track(WIDTHS.get(kind, 0)) for leg in legs for kind in ESTIMATES + DECISIONS
    }


class Leg:
    """Listeners of one leg, and what they say.

    Attributes
    ----------
    estimator : FootEstimator
    foot, heard : FootListener, LegListener
        What the nodes of estimator and controller hear with.
    beginning_ns : int
        Stamp from which on the estimator hears of the leg, ns.
    inputs : dict
        Of each kind of input the stamps, and when they were recorded, ns.
    landings, lift_offs : array of int
        When stances began and ended, ns.
    refused, refusal : int, str
        Samples that the estimator refused, and why the last one.
    """

    def __init__(self, player: Player, leg: int, settings: Settings) -> None:
        self._player = player
        self._ambient = settings.ambient_pressure
        self._told = {kind: player.replayed[leg, kind] for kind in ESTIMATES + DECISIONS}
        self.estimator = FootEstimator(settings.foot, settings.expected_load, settings.tuning)
        self.foot = FootListener(
            self.estimator,
            round(1e9 / settings.publish_rate),
            settings.tuning.moment_noise > 0.0,
            self._tell,
            self._tell_doubt,
            self._refuse,
        )
        self.heard = LegListener(player.controller, leg, lambda place: place)
        self._obeyed = player.recorded[leg, 'pressure_setpoint']
        self._period_ns = round(1e9 / settings.publish_rate)
        self.beginning_ns = -1
        self._parted = False  # whether the set-point is another than was recorded
        self.refused, self.refusal = 0, ''
        self.inputs: dict[str, tuple[array[int], array[int]]] = {
            kind: (array('q'), array('q')) for kind in INPUTS
        }
        self._standing = False
        self.landings, self.lift_offs = array('q'), array('q')

    def _note(self, kind: str, message: Any, log_ns: int) -> int:
        stamp = message.header.stamp
        # What its driver did not stamp came when it was recorded.
        stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec or log_ns
        stamps, times = self.inputs[kind]
        stamps.append(stamp_ns)
        times.append(log_ns)
        return stamp_ns

    def wrench(self, message: Any, log_ns: int) -> None:
        """Take a message of the foot's wrench."""
        stamp_ns = self._note('wrench', message, log_ns)
        force = message.wrench.force
        if stamp_ns >= self.beginning_ns:
            self.foot.wrench(stamp_ns, (force.x, force.y, force.z), message.wrench.torque.z)
        self.heard.wrench(force.z)
        self._follow_stance(log_ns)

    def position(self, message: Any, log_ns: int) -> None:
        """Take a message of the foot's position."""
        stamp_ns = self._note('position', message, log_ns)
        point = message.point
        if stamp_ns >= self.beginning_ns:
            self.foot.position(stamp_ns, (point.x, point.y, point.z))
        self.heard.position((point.x, point.y))
        self._follow_stance(log_ns)

    def pressure(self, message: Any, log_ns: int) -> None:
        """Take a message of the pressure in the pads."""
        self._note('pressure', message, log_ns)
        gauge = message.fluid_pressure - self._ambient
        self.foot.pressure(gauge)
        if not self._parted:
            self.heard.pressure(gauge)

    def _follow_stance(self, log_ns: int) -> None:
        standing = self.estimator.estimate.standing
        if standing != self._standing:
            self._standing = standing
            (self.landings if standing else self.lift_offs).append(log_ns)

    def _tell(self, stamp_ns: int, estimate: Estimate) -> None:
        told, log_ns = self._told, self._player.log_ns
        variance = estimate.slip_speed_sd**2
        told['slip'].add(log_ns, (*estimate.slip_velocity, variance, variance), stamp_ns)
        told['slipping'].add(log_ns, (estimate.slipping,), stamp_ns)
        told['friction'].add(log_ns, (estimate.friction_mean,), stamp_ns)
        told['friction_margin'].add(log_ns, (estimate.margin,), stamp_ns)
        wet = estimate.wet_probability
        told['wetness'].add(log_ns, (wet,), stamp_ns)
        self._player.later.append(lambda: self._decide(log_ns, stamp_ns, wet))

    def _tell_doubt(self, doubt: str) -> None:
        self._told['doubt'].say(self._player.log_ns, doubt)
        self._player.later.append(lambda: setattr(self.heard, 'trouble', trouble_in(doubt)))

    def _decide(self, log_ns: int, stamp_ns: int, wet: float) -> None:
        self._part()
        gauge = self.heard.estimate(self._player.now_ns * 1e-9, wet)
        self.tell_shape(log_ns)
        if gauge is not None:
            self._told['pressure_setpoint'].add(log_ns, (gauge + self._ambient,), stamp_ns)

    def _part(self) -> None:
        """Let a pad that was told something else then have what it is told now.

        What its pressure was says nothing of the set-points of a replay that went another way:
        the controller would call the pad stuck.
        """
        told, obeyed = self._told['pressure_setpoint'], self._obeyed
        if not len(told):
            return
        until_ns = told.times[-1] + self._period_ns // 2
        place = bisect.bisect_right(obeyed.times, until_ns)
        if not len(obeyed):
            self._parted = True  # nobody told it anything
        elif place and obeyed.times[place - 1] > until_ns - self._period_ns:
            self._parted = obeyed.numbers[place - 1] != told.numbers[-1]
        if self._parted:
            self.heard.pressure(told.numbers[-1] - self._ambient)

    def tell_shape(self, log_ns: int) -> None:
        """Keep the shape that the controller says, if it is another one."""
        shape = self.heard.new_shape()
        if shape is not None:
            self._told['morphology'].say(log_ns, shape)

    def _refuse(self, error: InvalidInput) -> None:
        self.refused += 1
        self.refusal = str(error)


class Player:
    """Hands messages to the listeners as the nodes would get them.

    All that was recorded between two ticks of ``/clock`` or, without one, at one time, was there
    before the nodes' answers to it came to one another.

    Attributes
    ----------
    legs : dict
        A :class:`Leg` by its number.
    recorded, replayed : dict
        A :class:`Track` by leg and kind.
    clocked : bool
        Whether ``/clock`` was recorded.
    """

    def __init__(self, settings: Settings, legs: Sequence[int], clocked: bool) -> None:
        self.controller = settings.controller(legs)
        self.recorded, self.replayed = _tracks(legs), _tracks(legs)
        self.now_ns = self.log_ns = 0
        self.later: list[Callable[[], None]] = []
        self.legs = {leg: Leg(self, leg, settings) for leg in legs}
        self._listen, self._look = Pace(LISTEN_PERIOD_NS), Pace(LOOK_PERIOD_NS)
        self.clocked = clocked
        self._next_tick_ns: int | None = None

    def clock(self, message: Any, log_ns: int) -> None:
        """Take a message of ``/clock``."""
        self.flush()
        self.log_ns = log_ns
        self.now_ns = message.clock.sec * 1_000_000_000 + message.clock.nanosec
        self._tick()

    def play(self, take: Take, message: Any, log_ns: int) -> None:
        """Take a message of a leg."""
        if not self.clocked and log_ns != self.log_ns:
            self.flush()
            self._pass_time(log_ns)
        self.log_ns = log_ns
        take(message, log_ns)

    def _pass_time(self, until_ns: int) -> None:
        """Tick as the timers of the nodes do."""
        if self._next_tick_ns is None or until_ns < self._next_tick_ns - 2 * LISTEN_PERIOD_NS:
            self._next_tick_ns = until_ns  # or the clock was set back
        # Silence that lasts has no more to tell.
        self._next_tick_ns = max(self._next_tick_ns, until_ns - LONGEST_SILENCE_NS)
        while self._next_tick_ns <= until_ns:
            self.now_ns = self.log_ns = self._next_tick_ns
            self._tick()
            self.flush()
            self._next_tick_ns += LISTEN_PERIOD_NS
        self.now_ns = until_ns

    def _tick(self) -> None:
        legs = self.legs.values()
        if self._listen.due(self.now_ns):
            for leg in legs:
                leg.foot.listen(self.now_ns)
        if self._look.due(self.now_ns):
            for leg in legs:
                if leg.heard.look(self.now_ns * 1e-9):
                    leg.tell_shape(self.log_ns)

    def flush(self) -> None:
        """Let the controller hear what the estimators said."""
        for call in self.later:
            call()
        self.later.clear()


def _slip(message: Any) -> tuple[float, ...]:
    linear, covariance = message.twist.twist.linear, message.twist.covariance
    return linear.x, linear.y, covariance[0], covariance[7]


def _keeper(track: Track, kind: str) -> Take:
    """Return what keeps a recorded message."""
    if kind == 'slip':

        def keep(message: Any, log_ns: int) -> None:
            stamp = message.header.stamp
            track.add(log_ns, _slip(message), stamp.sec * 1_000_000_000 + stamp.nanosec)

    elif kind == 'pressure_setpoint':

        def keep(message: Any, log_ns: int) -> None:
            track.add(log_ns, (message.fluid_pressure,))

    elif kind in TEXTS:

        def keep(message: Any, log_ns: int) -> None:
            track.say(log_ns, message.data)

    else:

        def keep(message: Any, log_ns: int) -> None:
            track.add(log_ns, (message.data,))

    return keep


def _clock(bag: BagReader) -> str | None:
    if not bag.counts.get('/clock'):
        return None
    if bag.topics['/clock'] != CLOCK_TYPE:
        raise BagError(f'{bag.path}: /clock is a {bag.topics["/clock"]}: {CLOCK_TYPE} is needed')
    return '/clock'


def play(
    bag: BagReader,
    settings: Settings,
    wanted: Mapping[str, tuple[int, str]],
    legs: Sequence[int],
    beginnings: Mapping[int, int],
    progress: Progress | None = None,
) -> Player:
    """Play the messages of some legs once.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    settings : Settings
        Of the estimators and the controller.
    wanted : mapping
        Leg and kind of each topic: :func:`ros_pad.trials.recorded.wanted_topics`.
    legs : sequence of int
        Those that are played.
    beginnings : mapping
        Stamp from which on the estimator of a leg hears of it, ns; others hear all.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Returns
    -------
    Player
        With what was recorded, and what was replayed.

    Raises
    ------
    BagError
        When ``/clock`` has another message type.
    """
    clock = _clock(bag)
    player = Player(settings, legs, clock is not None)
    for leg, beginning_ns in beginnings.items():
        player.legs[leg].beginning_ns = beginning_ns
    takers: dict[str, Take] = {}
    keepers: dict[str, Take] = {}
    for topic, (leg, kind) in wanted.items():
        if leg in player.legs and kind in INPUTS:
            takers[topic] = getattr(player.legs[leg], kind)
        elif leg in player.legs:
            keepers[topic] = _keeper(player.recorded[leg, kind], kind)
    topics = {*takers, *keepers, *([clock] if clock else [])}
    total = sum(bag.counts[topic] for topic in topics)
    for count, (topic, message, log_ns) in enumerate(bag.messages(topics)):
        if topic in takers:
            player.play(takers[topic], message, log_ns)
        elif topic == clock:
            player.clock(message, log_ns)
        else:
            keepers[topic](message, log_ns)
        if progress and count % _REPORT_EVERY == 0:
            progress(count / total)
    player.flush()
    if progress:
        progress(1.0)
    return player


__all__ = ['Leg', 'Player', 'play']
