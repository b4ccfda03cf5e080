# SPDX-License-Identifier: Apache-2.0
"""Replay: what was recorded of feet, through estimators and controller once more.

Wrenches, positions and pressures of a bag go through the objects that the nodes are made of, in
the order in which they were recorded, and what comes out is compared with what was recorded. The
bag of a trial in simulated time gives the same to the bit. Other parameters show what they would
have changed in what was estimated and decided; the robot walks as it walked.
"""

from __future__ import annotations

import bisect
import json
import math
import os
import pathlib
from array import array
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import replace
from typing import Any
from typing import TypeAlias

import numpy as np

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
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Track
from ros_pad.trials.comparison import compare
from ros_pad.trials.label import CHANGES
from ros_pad.trials.node_settings import ESTIMATOR
from ros_pad.trials.node_settings import POLICY
from ros_pad.trials.node_settings import SETTABLE
from ros_pad.trials.node_settings import Settings
from ros_pad.trials.recorded import wanted_topics
from ros_pad.trials.trial import BOUNCE

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
LONGER = 1.6
"""Times the usual one, a time between two messages is a gap: one may be lost."""

EARLY_NS = 20_000_000
"""By which a text may be in a bag before the estimate that it was told with, ns."""

LONGEST_SILENCE_NS = 10_000_000_000
"""Of a bag, through which the nodes are taken to have looked whether feet are heard, ns."""

Progress: TypeAlias = Callable[[float], None]

_REPORT_EVERY = 5_000  # messages

Tracks: TypeAlias = 'dict[tuple[int, str], Track]'


def _tracks(legs: Sequence[int]) -> Tracks:
    return {
        (leg, kind): Track(WIDTHS.get(kind, 0)) for leg in legs for kind in ESTIMATES + DECISIONS
    }


@dataclass(frozen=True)
class Outcome:
    """What became of a leg; of each pair the first is as recorded, None where nobody recorded it.

    Attributes
    ----------
    leg : int
    stance_ends : int
        Stances that ended.
    wet_ends : tuple
        Stance ends at which P(wet) was above one half.
    slips : tuple
        Alarms.
    switches : tuple
        Changes of shape.
    """

    leg: int
    stance_ends: int
    wet_ends: tuple[int | None, int]
    slips: tuple[int | None, int]
    switches: tuple[int | None, int]


@dataclass
class Replay:
    """What a replay found.

    Attributes
    ----------
    bag : str
    settings : Settings
        That it was done with.
    legs : tuple of int
    start_ns : int
        When the bag begins.
    duration_s : float
    samples : dict
        Samples that each leg's estimator took.
    refused : dict
        Samples of each leg that it refused, and why the last one.
    recorded, replayed : dict
        A :class:`Track` by leg and kind.
    comparisons : list of Comparison
        Of the topics that were recorded.
    outcomes : list of Outcome
        Of the legs.
    notes : list of str
        What is to be known of the bag, in words.
    """

    bag: str
    settings: Settings
    legs: tuple[int, ...]
    start_ns: int
    duration_s: float
    samples: dict[int, int]
    refused: dict[int, tuple[int, str]]
    recorded: Tracks
    replayed: Tracks
    comparisons: list[Comparison]
    outcomes: list[Outcome]
    notes: list[str]

    @property
    def verdict(self) -> str:
        """The worst of its comparisons, or ``nothing`` where nothing was recorded to compare.

        See :class:`Comparison`.
        """
        verdicts = {each.verdict for each in self.comparisons if each.recorded}
        for worst in ('different', 'gap', 'rounding', 'equal'):
            if worst in verdicts:
                return worst
        return 'nothing'

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, without the tracks."""
        settings = self.settings
        return {
            'bag': self.bag,
            'verdict': self.verdict,
            'legs': list(self.legs),
            'duration_s': self.duration_s,
            'settings': {
                'foot': settings.foot.source,
                'policy': settings.policy,
                **{name: getattr(settings, name) for name in SETTABLE},
                **{
                    ESTIMATOR + name: value if math.isfinite(value) else None
                    for name, value in asdict(settings.tuning).items()
                },
                **{POLICY + name: each for name, each in settings.policy_parameters.items()},
            },
            'samples': self.samples,
            'refused': {leg: count for leg, (count, _) in self.refused.items()},
            'topics': [
                _plain(asdict(each) | {'verdict': each.verdict}) for each in self.comparisons
            ],
            'outcomes': [asdict(each) for each in self.outcomes],
            'notes': self.notes,
        }


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    # JSON knows no infinity.
    return {n: None if value == math.inf else value for n, value in values.items()}


# --- playing ------------------------------------------------------------------------------------


class _Leg:
    """Listeners of one leg, and what they say."""

    def __init__(self, player: _Player, leg: int, settings: Settings) -> None:
        self._player = player
        self._leg = leg
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
        self.beginning_ns = -1  # stamp from which on the estimator hears of it
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
        stamp_ns = self._note('wrench', message, log_ns)
        force = message.wrench.force
        if stamp_ns >= self.beginning_ns:
            self.foot.wrench(stamp_ns, (force.x, force.y, force.z), message.wrench.torque.z)
        self.heard.wrench(force.z)
        self._follow_stance(log_ns)

    def position(self, message: Any, log_ns: int) -> None:
        stamp_ns = self._note('position', message, log_ns)
        point = message.point
        if stamp_ns >= self.beginning_ns:
            self.foot.position(stamp_ns, (point.x, point.y, point.z))
        self.heard.position((point.x, point.y))
        self._follow_stance(log_ns)

    def pressure(self, message: Any, log_ns: int) -> None:
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
        shape = self.heard.new_shape()
        if shape is not None:
            self._told['morphology'].say(log_ns, shape)

    def _refuse(self, error: InvalidInput) -> None:
        self.refused += 1
        self.refusal = str(error)


class _Player:
    """Hands messages to the listeners as the nodes would get them.

    All that was recorded between two ticks of ``/clock`` or, without one, at one time, was there
    before the nodes' answers to it came to one another.
    """

    def __init__(self, settings: Settings, legs: Sequence[int], clocked: bool) -> None:
        self.controller = settings.controller(legs)
        self.recorded, self.replayed = _tracks(legs), _tracks(legs)
        self.now_ns = self.log_ns = 0
        self.later: list[Callable[[], None]] = []
        self.legs = {leg: _Leg(self, leg, settings) for leg in legs}
        self._listen, self._look = Pace(LISTEN_PERIOD_NS), Pace(LOOK_PERIOD_NS)
        self.clocked = clocked
        self._next_tick_ns: int | None = None

    def clock(self, message: Any, log_ns: int) -> None:
        """Take a message of ``/clock``."""
        self.flush()
        self.log_ns = log_ns
        self.now_ns = message.clock.sec * 1_000_000_000 + message.clock.nanosec
        self._tick()

    def play(self, take: Callable[[Any, int], None], message: Any, log_ns: int) -> None:
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


def _keeper(track: Track, kind: str) -> Callable[[Any, int], None]:
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


def open_bag(path: str | os.PathLike[str]) -> BagReader:
    """Open a bag; one in SQLite is refused with the way to convert it.

    Raises
    ------
    BagError
        As :class:`ros_pad.trials.bag.BagReader`, and for ``.db3``.
    """
    path = pathlib.Path(path)
    if path.suffix == '.db3' or (path.is_dir() and list(path.glob('*.db3*'))):
        bag = path.parent if path.suffix == '.db3' else path
        raise BagError(
            f'{path}: is an SQLite bag (.db3), and only MCAP is read. Convert it:'
            f' ros2 bag convert -i {bag} -o mcap.yaml, where mcap.yaml says'
            f" 'output_bags: [{{uri: {bag}_mcap, storage_id: mcap, all: true}}]'"
        )
    return BagReader(path)


def replay(
    bag: BagReader,
    settings: Settings | None = None,
    namespace: str | None = None,
    remaps: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Replay a bag.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    settings : Settings or None
        None is what the bag says: ``Settings.of(bag)``.
    namespace : str or None
        Of the robot, such as ``/robot_1``; None takes the only one.
    remaps : mapping or None
        Topic of the bag by its name in ros_pad, as ``{'leg_{leg}/wrench': '/foot_{leg}/ft'}``.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Raises
    ------
    BagError
        When there is no wrench of any leg, or a topic has another message type.
    InvalidInput
        For a remap that fits nothing.
    """
    settings = settings or Settings.of(bag)
    wanted = {
        topic: key
        for topic, key in wanted_topics(bag, namespace, remaps).items()
        if key[1] in INPUTS + ESTIMATES + DECISIONS
    }
    there = {key: topic for topic, key in wanted.items()}
    legs = tuple(sorted(leg for leg, kind in there if kind == 'wrench'))
    if not legs:
        raise BagError(
            f'{bag.path}: has no wrench of a leg to replay, its topics are'
            f' {", ".join(sorted(bag.topics))}: name the wrenches with a remap'
        )
    # The order of the legs about the body, as the controller of the bag had it.
    legs = tuple(leg for leg in settings.legs if leg in legs) + tuple(
        leg for leg in legs if leg not in settings.legs
    )
    found = _once(bag, settings, wanted, legs, {}, progress)
    late = {leg: stamp_ns for leg in legs if (stamp_ns := _beginning(found, leg)) is not None}
    if late and found.verdict in ('different', 'gap'):
        # The recorder may have lost the first estimates, or heard of the feet before the
        # estimator did: what it says then tells.
        other = _once(bag, settings, wanted, legs, late, progress)
        if _agreeing(other) > _agreeing(found):
            other.notes.append(
                f'leg {", ".join(map(str, late))}: the estimator heard of it later than the'
                ' recorder, and so does the replay'
            )
            return other
    return found


def _beginning(found: Replay, leg: int) -> int | None:
    """Return the stamp of the first recorded estimate, ns, if the replay has earlier ones."""
    one, other = found.recorded[leg, 'slip'].keys, found.replayed[leg, 'slip'].keys
    return min(one) if len(one) and len(other) and min(one) > min(other) else None


def _agreeing(found: Replay) -> int:
    return sum(each.equal for each in found.comparisons)


def _once(
    bag: BagReader,
    settings: Settings,
    wanted: Mapping[str, tuple[int, str]],
    legs: Sequence[int],
    beginnings: Mapping[int, int],
    progress: Progress | None,
) -> Replay:
    """Replay a bag whose estimators hear of some legs from a time stamp on, ns."""
    there = {key: topic for topic, key in wanted.items()}
    clock = _clock(bag)
    player = _Player(settings, legs, clock is not None)
    for leg, beginning_ns in beginnings.items():
        player.legs[leg].beginning_ns = beginning_ns
    recorded = player.recorded
    takers: dict[str, Callable[[Any, int], None]] = {}
    for topic, (leg, kind) in wanted.items():
        if leg in player.legs and kind in INPUTS:
            takers[topic] = getattr(player.legs[leg], kind)
    keepers = {
        topic: _keeper(recorded[leg, kind], kind)
        for topic, (leg, kind) in wanted.items()
        if leg in player.legs and kind not in INPUTS
    }
    _play(bag, player, takers, keepers, clock, progress)
    comparisons = _compared(bag, player, recorded, there, settings)
    return Replay(
        bag=str(bag.path),
        settings=settings,
        legs=tuple(legs),
        start_ns=bag.start,
        duration_s=(bag.end - bag.start) * 1e-9,
        samples={leg: each.foot.samples for leg, each in player.legs.items()},
        refused={
            leg: (each.refused, each.refusal) for leg, each in player.legs.items() if each.refused
        },
        recorded=recorded,
        replayed=player.replayed,
        comparisons=comparisons,
        outcomes=[
            _outcome(leg, each, recorded, player.replayed, settings)
            for leg, each in player.legs.items()
        ],
        notes=_notes(bag, player, there, settings, comparisons),
    )


def _clock(bag: BagReader) -> str | None:
    if not bag.counts.get('/clock'):
        return None
    if bag.topics['/clock'] != CLOCK_TYPE:
        raise BagError(f'{bag.path}: /clock is a {bag.topics["/clock"]}: {CLOCK_TYPE} is needed')
    return '/clock'


def _play(
    bag: BagReader,
    player: _Player,
    takers: Mapping[str, Callable[[Any, int], None]],
    keepers: Mapping[str, Callable[[Any, int], None]],
    clock: str | None,
    progress: Progress | None,
) -> None:
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


# --- comparing ----------------------------------------------------------------------------------


def _gap(leg: _Leg) -> tuple[int, str] | None:
    """Return since when, ns, nodes may have heard more of a leg than was recorded, and of what."""
    found = []
    for kind, (stamps, times) in leg.inputs.items():
        if not len(stamps):
            if kind != 'wrench':
                found.append((-1, f'no {kind}'))
            continue
        steps = np.diff(np.array(stamps))
        usual = np.median(steps) if len(steps) else 0.0
        wide = np.flatnonzero(steps > LONGER * usual)
        if usual > 0.0 and len(wide):
            words = f'{kind}, {len(wide)} gap{"s" if len(wide) > 1 else ""}'
            found.append((times[int(wide[0])], words))
    return min(found, default=None)


def _compared(
    bag: BagReader,
    player: _Player,
    recorded: Tracks,
    there: Mapping[tuple[int, str], str],
    settings: Settings,
) -> list[Comparison]:
    gaps = {leg: gap[0] for leg, each in player.legs.items() if (gap := _gap(each))}
    # Legs know of one another by what the controller decides.
    of_all = min(gaps.values(), default=None)
    if _absent(player, there, settings):
        of_all = -1
    period_ns = round(1e9 / settings.publish_rate)
    found = []
    for leg in player.legs:
        for kind in ESTIMATES + DECISIONS:
            if (leg, kind) not in there:
                continue
            gap_ns = of_all if kind in DECISIONS else gaps.get(leg)
            one, other = _matched(recorded, player.replayed, leg, kind, player.clocked)
            found.append(
                compare(
                    there[leg, kind], leg, kind, one, other, bag.start, period_ns, gap_ns,
                    0 if player.clocked else 2 * LISTEN_PERIOD_NS,
                )
            )  # fmt: skip
    return found


def _absent(
    player: _Player, there: Mapping[tuple[int, str], str], settings: Settings
) -> list[int]:
    """Return the legs that the robot had, and that cannot be replayed."""
    return sorted(({*settings.legs} | {leg for leg, _ in there}) - set(player.legs))


def _matched(
    recorded: Tracks, replayed: Tracks, leg: int, kind: str, clocked: bool
) -> tuple[Track, Track]:
    """Return the tracks of a topic with keys by which their messages find one another.

    All that an estimator says of a moment is sent together, and only slip has a stamp. Where
    as many messages of another kind were recorded, they belong together one by one; otherwise
    the times have to do.
    """
    one, other, stamped = recorded[leg, kind], replayed[leg, kind], recorded[leg, 'slip']
    if kind == 'slip':
        return one, other
    if kind in TEXTS:
        # How long nodes had been waiting for the first sample, their clock alone says.
        if clocked or not len(stamped):
            return one, other
        told = replayed[leg, 'slip'].times
        return one.since(stamped.times[0] - EARLY_NS), other.since(told[0] if len(told) else 0)
    if len(one) == len(stamped) and len(other) == len(replayed[leg, 'slip']):
        return replace(one, keys=stamped.keys), other
    return one, replace(other, keys=other.times)


def _outcome(
    leg: int, felt: _Leg, recorded: Tracks, replayed: Tracks, settings: Settings
) -> Outcome:
    ends = [
        end
        for end, landing in _with_next(felt.lift_offs, felt.landings)
        if landing is None or landing - end >= BOUNCE * 1e9
    ]
    # What is believed of the last stance has been told by then, and does not change in the air.
    told_ns = round(2e9 / settings.publish_rate)

    def pair(kind: str, count: Callable[[Track], int]) -> tuple[int | None, int]:
        track = recorded[leg, kind]
        return count(track) if len(track) else None, count(replayed[leg, kind])

    return Outcome(
        leg=leg,
        stance_ends=len(ends),
        wet_ends=pair(
            'wetness', lambda track: sum((track.at(end + told_ns) or 0.0) > 0.5 for end in ends)
        ),
        slips=pair(
            'slipping', lambda track: int(np.sum(np.diff(track.values[:, 0], prepend=0) > 0))
        ),
        switches=pair('morphology', lambda track: max(0, len(track) - 1)),
    )


def _with_next(
    lift_offs: Sequence[int], landings: Sequence[int]
) -> Iterator[tuple[int, int | None]]:
    """Yield each lift-off with the landing after it."""
    for end in lift_offs:
        place = int(np.searchsorted(landings, end))
        yield end, landings[place] if place < len(landings) else None


def _notes(
    bag: BagReader,
    player: _Player,
    there: Mapping[tuple[int, str], str],
    settings: Settings,
    comparisons: Sequence[Comparison],
) -> list[str]:
    notes = list(settings.assumed)
    if bag.problem:
        notes.append(bag.problem)
    for time_ns, node, name, value in json.loads(bag.custom_data.get(CHANGES, '[]')):
        notes.append(
            f'{(time_ns - bag.start) * 1e-9:.2f} s: parameter {name} of {node} became {value!r};'
            ' the replay goes on with what it was'
        )
    absent = _absent(player, there, settings)
    if absent:
        notes.append(
            f'leg {", ".join(map(str, absent))}: no wrench; what it would have told the others'
            ' is missing'
        )
    without = {
        kind: [str(leg) for leg in player.legs if (leg, kind) not in there] for kind in INPUTS
    }
    if without['position']:
        notes.append(
            f'leg {", ".join(without["position"])}: no position, and without it no estimates'
        )
    if without['pressure']:
        notes.append(
            f'leg {", ".join(without["pressure"])}: no pressure, its pads are taken to be flat'
        )
    if any(each.verdict == 'gap' for each in comparisons):
        alike: dict[str, list[tuple[int, int]]] = {}
        for leg, each in player.legs.items():
            if (gap := _gap(each)) and gap[0] >= 0:
                alike.setdefault(gap[1], []).append((gap[0], leg))
        for words, found in alike.items():
            notes.append(
                f'leg {", ".join(str(leg) for _, leg in found)}: {words}, the first'
                f' {(min(found)[0] - bag.start) * 1e-9:.3f} s after the beginning: what was not'
                ' recorded cannot be replayed'
            )
    for leg, each in player.legs.items():
        if each.refused:
            notes.append(
                f'leg {leg}: {each.refused} samples refused, the last one: {each.refusal}'
            )
    different = [
        each for each in comparisons if each.verdict == 'different' and each.kind not in TEXTS
    ]
    if different and not any(each.equal for each in different):
        notes.append(
            'nothing of what differs is ever equal: the nodes were told something else, or it was'
            ' recorded from the middle of a walk'
        )
    return notes


__all__ = ['Outcome', 'Replay', 'open_bag', 'replay']
