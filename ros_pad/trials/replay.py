# SPDX-License-Identifier: Apache-2.0
"""Replay: run the recorded inputs of feet through estimators and controller again.

The stages of the nodes receive the samples and pressures of a bag in the order of recording, and
their estimates and commands are compared with the recorded ones. For a trial in simulated time,
the two are equal to the bit. The body estimator of a trial without markers is replayed beside
them, from IMU, joints and forces. With other parameters, a replay shows how estimates and
decisions would have changed; the motion of the robot stays as recorded.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import BagError, InvalidInput
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.track import LOAD_GATE
from ros_pad.pace import TICK_PERIOD_NS, Pace, Progress, part
from ros_pad.pipeline import Pipeline
from ros_pad.records import COMMAND, ESTIMATE, PRESSURE, SAMPLE, Block, Kind
from ros_pad.trials.bag_notes import CHANGES
from ros_pad.trials.comparison import Comparison, Stream, Track, compare
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.recorded import Recording, read
from ros_pad.trials.replay_body import compare_body
from ros_pad.trials.trial import standing

LONGER = 1.6
"""A time between two messages that is longer than their median time by this factor is a gap."""

Tracks = dict[tuple[int, str], Track]


@dataclass(frozen=True)
class Outcome:
    """Counts of a leg. Pairs are recorded (None if nothing was recorded) and replayed.

    Attributes
    ----------
    leg : int
        Number of the leg.
    stance_ends : int
        Number of stances that ended in the replay.
    wet_ends : tuple
        Number of stance ends at which P(wet) was above one half.
    slips : tuple
        Number of slip alarms.
    switches : tuple
        Number of changes of morphology.
    """

    leg: int
    stance_ends: int
    wet_ends: tuple[int | None, int]
    slips: tuple[int | None, int]
    switches: tuple[int | None, int]


@dataclass
class Replay:
    """Result of a replay.

    Attributes
    ----------
    bag : str
        Path of the bag.
    settings : NodeSettings
        Settings with which the bag was replayed.
    legs : tuple of int
        Numbers of the legs.
    start_ns : int
        Beginning of the bag, ns.
    duration_s : float
        Duration of the bag, s.
    samples : dict
        Number of samples that the estimator used, by leg.
    refused : dict
        Number of rejected samples, and the reason of the last one, by leg.
    recorded : dict
        A :class:`Track` by leg and quantity, such as ``wetness`` or ``setpoint``, as recorded; the
        quantities are the fields of :data:`ros_pad.records.ESTIMATE` and
        :data:`ros_pad.records.COMMAND`.
    replayed : dict
        The same, as replayed.
    streams : dict of Stream
        Replayed records by name of their kind, ``estimate`` and ``command``.
    comparisons : list of Comparison
        One for each leg and quantity of recorded estimates and commands.
    outcomes : list of Outcome
        One for each leg.
    notes : list of str
        Assumptions, gaps and other remarks, one sentence each.
    """

    bag: str
    settings: NodeSettings
    legs: tuple[int, ...]
    start_ns: int
    duration_s: float
    samples: dict[int, int]
    refused: dict[int, tuple[int, str]]
    recorded: Tracks
    replayed: Tracks
    streams: dict[str, Stream]
    comparisons: list[Comparison]
    outcomes: list[Outcome]
    notes: list[str]

    @property
    def verdict(self) -> str:
        """The worst verdict of the comparisons, or ``nothing`` if there was nothing to compare.

        See :attr:`Comparison.verdict`.
        """
        verdicts = {each.verdict for each in self.comparisons if each.compared + each.missing}
        worst = ('different', 'gap', 'rounding', 'equal')
        return next((each for each in worst if each in verdicts), 'nothing')

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, without the tracks.

        Returns
        -------
        dict
            Verdict, settings, counts and comparisons, by name.
        """
        foot, policy = self.settings.foot.source, self.settings.policy
        comparisons = [asdict(each) for each in self.comparisons]
        for each in comparisons:
            if each['largest_difference'] == math.inf:  # JSON has no infinity
                each['largest_difference'] = None
        return {
            'bag': self.bag,
            'verdict': self.verdict,
            'legs': list(self.legs),
            'duration_s': self.duration_s,
            'settings': {'foot': foot, 'policy': policy, **self.settings.as_dict()},
            'samples': self.samples,
            'refused': {leg: count for leg, (count, _) in self.refused.items()},
            'comparisons': comparisons,
            'outcomes': [asdict(each) for each in self.outcomes],
            'notes': self.notes,
        }


def replay(
    bag: BagReader,
    settings: NodeSettings | None = None,
    namespace: str | None = None,
    remaps: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Replay a bag.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    settings : NodeSettings or None
        Settings of estimators and controller; None takes those of the bag:
        ``NodeSettings.of(bag)``.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    remaps : mapping or None
        Topic of the bag, by its name in ros_pad: ``{'leg_{leg}/wrench': '/foot_{leg}/ft'}``.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Returns
    -------
    Replay
        What estimators and controller make of the samples, beside what was recorded.

    Raises
    ------
    BagError
        When there is no wrench of any leg, a topic has another message type than in ros_pad, or
        the bag has several robots and no namespace is given.
    InvalidInput
        When a remap is not allowed, see :func:`ros_pad.trials.recorded.read`.
    """
    settings = settings or NodeSettings.of(bag)
    recording = read(
        bag, settings.values['ambient_pressure'], namespace, remaps, part(progress, 0.0, 0.2)
    )
    inputs = _inputs(bag, recording, settings)
    player = _Player(settings, inputs.streams)
    made = player.play(part(progress, 0.2, 0.9))
    comparisons = [
        found
        for kind in made
        if kind in recording.topics
        for found in compare(
            recording.topics[kind], inputs.streams[kind], made[kind], bag.start, inputs.gap_ns
        )
    ]
    # The body estimator is replayed beside the feet, which take what it published.
    of_body, note = compare_body(bag, recording)
    recorded, replayed = (
        {key: track for kind in made for key, track in streams[kind].tracks().items()}
        for streams in (inputs.streams, made)
    )
    if progress:
        progress(1.0)
    rejected = [
        f'leg {leg}: {count} samples rejected, the last one: {reason}'
        for leg, (count, reason) in player.refused.items()
    ]
    notes = [*settings.assumed, *_changes(bag), *inputs.notes, *rejected, bag.problem, note]
    legs = made[ESTIMATE.name].legs
    return Replay(
        bag=str(bag.path),
        settings=settings,
        legs=legs,
        start_ns=bag.start,
        duration_s=(bag.end - bag.start) * 1e-9,
        samples=dict(zip(legs, player.stages.estimation.used, strict=True)),
        refused=player.refused,
        recorded=recorded,
        replayed=replayed,
        streams=made,
        comparisons=comparisons + of_body,
        outcomes=list(_outcomes(inputs.streams[SAMPLE.name], settings, recorded, replayed)),
        notes=[each for each in notes if each],
    )


def _changes(bag: BagReader) -> Iterator[str]:
    """Yield notes on parameters that were changed while recording."""
    for time_ns, node, name, value in json.loads(bag.custom_data.get(CHANGES, '[]')):
        yield (
            f'{(time_ns - bag.start) * 1e-9:.2f} s: parameter {name} of {node} became {value!r};'
            ' the replay keeps the first value'
        )


def _outcomes(
    samples: Stream, settings: NodeSettings, recorded: Tracks, replayed: Tracks
) -> Iterator[Outcome]:
    gate = LOAD_GATE * settings.values['expected_load']
    delay_ns = round(2e9 / settings.values['publish_rate'])  # until a stance's estimate is there
    for place, leg in enumerate(samples.legs):
        load = samples.block.rows['force'][:, place, 2]
        stamps, load = samples.block.stamps[np.isfinite(load)], load[np.isfinite(load)]
        stands = standing(stamps * 1e-9, load[:, None], gate)[:, 0]
        ends = (stamps[1:][stands[:-1] & ~stands[1:]] + delay_ns).tolist()
        counts = []
        for tracks in (recorded, replayed):
            wetness, slipping, dome = (tracks[leg, n] for n in ('wetness', 'slipping', 'dome'))
            wet = slips = switches = None
            if len(wetness.times):
                wet = sum(wetness.at(end) > 0.5 for end in ends)
                slips = int(np.sum(np.diff(slipping.values[:, 0] == 1.0, prepend=0) > 0))
            if len(dome.times):
                switches = int(np.sum(np.diff(dome.values[:, 0]) != 0.0))
            counts.append((wet, slips, switches))
        yield Outcome(leg, len(ends), *zip(*counts, strict=True))


# --- what was recorded --------------------------------------------------------------------------


class _Inputs(NamedTuple):
    """What is replayed.

    Attributes
    ----------
    streams : dict of Stream
        Records of the legs that can be replayed, by name of their kind.
    gap_ns : float
        Log time of the first gap, ns, from which on differences are excused.
    notes : list of str
        What was not recorded, and what is left out.
    """

    streams: dict[str, Stream]
    gap_ns: float
    notes: list[str]


def _inputs(bag: BagReader, recording: Recording, settings: NodeSettings) -> _Inputs:
    """Return what is replayed."""
    samples = recording.streams[SAMPLE.name]
    loaded = np.isfinite(samples.block.rows['force'][..., 2]).any(axis=0)
    there = {leg for leg, own in zip(samples.legs, loaded, strict=True) if own}
    if SAMPLE.name in recording.topics:
        there = {*samples.legs}
    if not there or not len(samples.times):
        raise BagError(
            f'{bag.path}: no wrench of a leg was recorded; the topics are'
            f' {", ".join(sorted(bag.topics))}. If one has wrenches, name it with a remap'
        )
    # Keep the order of the legs in the controller of the bag, around the body.
    legs = (*(leg for leg in settings.legs if leg in there), *sorted(there - {*settings.legs}))
    streams = {name: each.of_legs(legs) for name, each in recording.streams.items()}
    needed = ['force', 'position']
    needed += ['velocity'] if settings.tuning.source == 'joints' else []
    lacks, gaps = [], []
    for kind, names in ((SAMPLE.name, needed), (PRESSURE.name, ['pressure'])):
        stream = streams[kind]
        for name in names:
            known = np.isfinite(stream.values(name)).any(axis=2)
            lacks += [f'{name} of leg {leg}' for leg in np.array(legs)[~known.any(axis=0)]]
            if kind not in recording.topics:
                gaps += [_gap(stream, f'{name} of leg {leg}', own)
                         for leg, own in zip(legs, known.T, strict=True)]  # fmt: skip
        if kind in recording.topics:
            gaps.append(_gap(stream, kind, np.full(len(stream.times), True)))
    lacks += [f'force of leg {leg}' for leg in sorted({*recording.legs, *settings.legs} - there)]
    late = _leave_out(streams)
    begin = streams[SAMPLE.name].times[0]
    found = sorted(gap for gap in gaps if gap and gap[0] >= begin)
    notes = [f'not recorded, so differences are excused: {", ".join(lacks)}'] if lacks else []
    notes += [
        f'{what}: {count} gap{"s" if count > 1 else ""}, the first'
        f' {(time_ns - bag.start) * 1e-9:.3f} s after the beginning: what was not recorded cannot'
        ' be replayed'
        for time_ns, what, count in found
    ]
    # What was lost may have changed all legs: they share what feet learn, and one controller.
    gap_ns = -math.inf if lacks else min((float(gap[0]) for gap in found), default=math.inf)
    return _Inputs(streams, gap_ns, [*notes, late])


def _gap(stream: Stream, what: str, there: np.ndarray) -> tuple[int, str, int] | None:
    """Return log time of the first gap in some records, ns, what has gaps, and their number."""
    wide = _wide(stream.block.stamps[there])
    return (int(stream.times[there][wide[0]]), what, len(wide)) if len(wide) else None


def _wide(stamps: np.ndarray) -> np.ndarray:
    """Return the places of the records after which there is a gap."""
    steps = np.diff(stamps)
    return np.flatnonzero(steps > LONGER * max(np.median(steps), 0.0)) if len(steps) else steps


def _leave_out(streams: dict[str, Stream]) -> str:
    """Leave out what no replay can have; return a note on samples among it."""
    samples = streams['sample']
    stamps, (made, rows) = samples.block.stamps, streams['estimate'].block
    wide = _wide(stamps)
    for name in ('estimate', 'command'):
        # Between samples, nodes tell of silent feet, with stamps that no replay has.
        own = streams[name].block.stamps
        there = np.isin(np.searchsorted(stamps, own) - 1, wide) | np.isin(own, stamps)
        streams[name] = streams[name].where(there)
    # An estimator makes its first estimate of its first sample.
    begun = np.isin(made, stamps) | np.isfinite(rows['load']).any(axis=1)
    kept = stamps >= made[begun].min(initial=np.iinfo(np.int64).max)
    if kept.all() or not kept.any():  # none, where there are no estimates
        return ''
    streams['sample'] = samples.where(kept)
    return (
        'the estimator started later than the recorder, so the replay leaves out the'
        f' {int(np.sum(~kept))} samples before its first recorded estimate'
    )


# --- passing it on ------------------------------------------------------------------------------


class _Player:
    """Pass the inputs of a robot to the stages of estimation and decision, once.

    Nodes process the samples up to a moment together, and then receive the pressures of this
    moment. Both stages look for missing inputs before that.

    Attributes
    ----------
    stages : Pipeline
    refused : dict
        Number of rejected samples and estimates, and the reason of the last one, by leg.
    """

    def __init__(self, settings: NodeSettings, streams: Mapping[str, Stream]) -> None:
        self._streams, legs = streams, streams[SAMPLE.name].legs
        self.refused: dict[int, tuple[int, str]] = {}
        period_ns = round(1e9 / settings.values['publish_rate'])
        self.stages = Pipeline(
            EstimationStage(
                settings.foot, settings.values['expected_load'], settings.tuning, legs, period_ns,
                self._reject,
            ),
            DecisionStage(settings.controller(legs), legs),
        )  # fmt: skip
        stamps, rows = streams[COMMAND.name].block
        self._setpoints = dict(zip(stamps.tolist(), rows['setpoint'], strict=True))  # recorded
        # Whether the set-point of each leg differs from the recorded one.
        self._apart = np.full(len(legs), not self._setpoints)
        self._pace = Pace(TICK_PERIOD_NS)

    def play(self, progress: Progress | None) -> dict[str, Stream]:
        """Play everything; return estimates and commands by name of their kind."""
        made: dict[Kind, list[tuple[int, Block]]] = {ESTIMATE: [], COMMAND: []}
        samples, pressures = (self._streams[name] for name in ('sample', 'pressure'))
        stamps, rows = samples.block
        done = 0
        for start, end, until in _blocks(samples.times, pressures.times):
            for at_ns, each in zip(*(each[done:until] for each in pressures.block), strict=True):
                self._press(int(at_ns), each)
            done = until
            self._tick(int(stamps[end - 1]))
            time_ns = int(samples.times[end - 1])
            block = Block(stamps[start:end], rows[start:end])
            for estimate, command in self.stages.process(block):
                made[ESTIMATE].append((time_ns, estimate))
                made[COMMAND].append((time_ns, command))
                self._follow(command)
            if progress:
                progress(end / len(stamps))
        return {kind.name: Stream.of(kind, samples.legs, each) for kind, each in made.items()}

    def _press(self, stamp_ns: int, rows: np.ndarray) -> None:
        """Process a pressure record."""
        self._tick(stamp_ns)
        self.stages.estimation.pressure(Block.of(stamp_ns, rows))
        own = rows.copy()
        own['pressure'][self._apart] = math.nan
        self.stages.decision.pressure(Block.of(stamp_ns, own))

    def _tick(self, now_ns: int) -> None:
        if self._pace.due(now_ns):
            self.stages.tick(now_ns)

    def _follow(self, command: Block) -> None:
        """Let the pressure be the set-point while the set-point differs from the recorded one.

        The recorded pressure follows the recorded set-points: with this pressure, the controller
        would report the pad as stuck.
        """
        setpoints = command.rows[-1]['setpoint']
        recorded = self._setpoints.get(command.last_ns)
        if recorded is not None:
            same = (setpoints == recorded) | (np.isnan(setpoints) & np.isnan(recorded))
            self._apart = ~same
        if self._apart.any():
            rows = PRESSURE.rows(len(setpoints))
            rows['pressure'] = np.where(self._apart, setpoints, math.nan)
            self.stages.decision.pressure(Block.of(command.last_ns, rows))

    def _reject(self, leg: int, error: InvalidInput) -> None:
        self.refused[leg] = self.refused.get(leg, (0, ''))[0] + 1, str(error)


def _blocks(samples: np.ndarray, pressures: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Yield the samples between two pressures: first, end, and the number of pressures before.

    Pressures count for samples with later log times, ns. Samples of more than a tick are divided.
    """
    # Records are in the order of their stamps, even if their log times are not.
    samples, pressures = np.maximum.accumulate(samples), np.maximum.accumulate(pressures)
    before = np.searchsorted(pressures, samples, side='left')
    ticks = (samples - samples[np.searchsorted(before, before)]) // TICK_PERIOD_NS
    cuts = np.flatnonzero(np.diff(before) | np.diff(ticks)) + 1
    for start, end in pairwise([0, *cuts.tolist(), len(samples)]):
        yield start, end, int(before[start])


__all__ = ['Outcome', 'Replay', 'replay']
