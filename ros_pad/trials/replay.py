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
import os
import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.errors import BagError
from ros_pad.estimation.load_gate import CONTACT_SHARE
from ros_pad.pace import Progress, part
from ros_pad.trials.comparison import Comparison, Stream, Track, compare
from ros_pad.trials.label import CHANGES
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.recorded import wanted_topics
from ros_pad.trials.replay_body import compare_body
from ros_pad.trials.replay_inputs import Inputs, read
from ros_pad.trials.replay_player import Player
from ros_pad.trials.trial import BOUNCE

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
        quantities are the fields of :data:`ros_pad.records.ESTIMATE` and, of the command,
        ``setpoint`` and ``morphology`` (1 dome, 0 flat).
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
        for worst in ('different', 'gap', 'rounding', 'equal'):
            if worst in verdicts:
                return worst
        return 'nothing'

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, without the tracks.

        Returns
        -------
        dict
            Verdict, settings, counts and comparisons, by name.
        """
        settings = self.settings
        return {
            'bag': self.bag,
            'verdict': self.verdict,
            'legs': list(self.legs),
            'duration_s': self.duration_s,
            'settings': {
                'foot': settings.foot.source,
                'policy': settings.policy,
                **settings.as_dict(),
            },
            'samples': self.samples,
            'refused': {leg: count for leg, (count, _) in self.refused.items()},
            'comparisons': [_plain(asdict(each)) for each in self.comparisons],
            'outcomes': [asdict(each) for each in self.outcomes],
            'notes': self.notes,
        }


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    # JSON has no infinity.
    return {n: None if value == math.inf else value for n, value in values.items()}


def open_bag(path: str | os.PathLike[str], progress: Progress | None = None) -> BagReader:
    """Open a bag; for an SQLite bag, the error message has the command that converts it.

    Parameters
    ----------
    path : str or path
        Folder of a bag, or one of its files.
    progress : callable, optional
        Called with the share of the bag that is read, 0 to 1.

    Returns
    -------
    BagReader
        The open bag.

    Raises
    ------
    BagError
        When :class:`ros_pad.bags.BagReader` raises it, and for an SQLite bag (``.db3``).
    """
    path = pathlib.Path(path)
    if path.suffix == '.db3' or (path.is_dir() and list(path.glob('*.db3*'))):
        bag = path.parent if path.suffix == '.db3' else path
        raise BagError(
            f'{path} is an SQLite bag (.db3), and only MCAP can be read. Convert it:'
            f' ros2 bag convert -i {bag} -o mcap.yaml, where mcap.yaml has'
            f" 'output_bags: [{{uri: {bag}_mcap, storage_id: mcap, all: true}}]'"
        )
    return BagReader(path, progress)


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
        When a remap is not allowed, see :func:`ros_pad.trials.recorded.wanted_topics`.
    """
    settings = settings or NodeSettings.of(bag)
    wanted = wanted_topics(bag, namespace, remaps)
    inputs = read(bag, wanted, settings, part(progress, 0.0, 0.2))
    player = Player(settings, inputs)
    made = player.play(part(progress, 0.2, 0.9))
    comparisons = _compared(bag, inputs, made)
    # The body estimator is replayed beside the feet, which take what it published.
    of_body, note = compare_body(bag, wanted)
    tracks = [
        {key: track for kind in made for key, track in streams[kind].tracks().items()}
        for streams in (inputs.streams, made)
    ]
    if progress:
        progress(1.0)
    return Replay(
        bag=str(bag.path),
        settings=settings,
        legs=inputs.legs,
        start_ns=bag.start,
        duration_s=(bag.end - bag.start) * 1e-9,
        samples=dict(zip(inputs.legs, player.stages.estimation.used.tolist(), strict=True)),
        refused=player.refused,
        recorded=tracks[0],
        replayed=tracks[1],
        streams=made,
        comparisons=comparisons + of_body,
        outcomes=[_outcome(inputs, settings, leg, *tracks) for leg in inputs.legs],
        notes=[
            *settings.assumed,
            *_notes(bag, inputs, player.refused, comparisons),
            *([note] if note else []),
        ],
    )


def _compared(bag: BagReader, inputs: Inputs, made: Mapping[str, Stream]) -> list[Comparison]:
    """Compare what was recorded as records with what was made again."""
    # What was lost may have changed all legs: they share what feet learn, and one controller.
    gap_ns = min((gap.time_ns for gap in inputs.gaps), default=math.inf)
    if inputs.lacks:
        gap_ns = -math.inf
    there = [kind for kind in made if kind in inputs.topics]
    return [
        found
        for kind in there
        for found in compare(
            inputs.topics[kind], inputs.streams[kind], made[kind], bag.start, gap_ns
        )
    ]


def _notes(
    bag: BagReader,
    inputs: Inputs,
    refused: Mapping[int, tuple[int, str]],
    comparisons: Sequence[Comparison],
) -> Iterator[str]:
    """Yield notes on a replay, one sentence each."""
    if bag.problem:
        yield bag.problem
    for time_ns, node, name, value in json.loads(bag.custom_data.get(CHANGES, '[]')):
        yield (
            f'{(time_ns - bag.start) * 1e-9:.2f} s: parameter {name} of {node} became {value!r};'
            ' the replay keeps the first value'
        )
    yield from inputs.lacks
    for gap in sorted(inputs.gaps) if any(each.verdict == 'gap' for each in comparisons) else ():
        yield (
            f'{gap.what}: {gap.places} gap{"s" if gap.places > 1 else ""}, the first'
            f' {(gap.time_ns - bag.start) * 1e-9:.3f} s after the beginning: what was not recorded'
            ' cannot be replayed'
        )
    for leg, (count, reason) in refused.items():
        yield f'leg {leg}: {count} samples rejected, the last one: {reason}'
    different = [each for each in comparisons if each.verdict == 'different']
    if different and not any(each.equal for each in different):
        yield (
            'the quantities that differ have no equal record: the nodes had other settings, or the'
            ' bag begins in the middle of a walk'
        )
    if inputs.late:
        yield inputs.late


def _outcome(
    inputs: Inputs, settings: NodeSettings, leg: int, recorded: Tracks, replayed: Tracks
) -> Outcome:
    ends = _stance_ends(inputs, leg, CONTACT_SHARE * settings.expected_load)
    # After this delay the estimate of the stance is there; it is constant in the air.
    delay_ns = round(2e9 / settings.publish_rate)

    def pair(name: str, count: Callable[[Track], int]) -> tuple[int | None, int]:
        track = recorded[leg, name]
        return count(track) if len(track.times) else None, count(replayed[leg, name])

    return Outcome(
        leg=leg,
        stance_ends=len(ends),
        wet_ends=pair(
            'wetness', lambda track: sum(track.at(end + delay_ns) > 0.5 for end in ends.tolist())
        ),
        slips=pair(
            'slipping',
            lambda track: int(np.sum(np.diff(track.values[:, 0] == 1.0, prepend=0) > 0)),
        ),
        switches=pair('morphology', lambda track: int(np.sum(np.diff(track.values[:, 0]) != 0.0))),
    )


def _stance_ends(inputs: Inputs, leg: int, load: float) -> np.ndarray:
    """Return the stamps at which a leg lifts off, ns; a bounce is no lift-off."""
    stamps, rows = inputs.streams['sample'].block
    force = rows['force'][:, inputs.legs.index(leg), 2]
    stamps, force = stamps[np.isfinite(force)], force[np.isfinite(force)]
    step = np.diff((force >= load).astype(int))
    ends, landings = stamps[1:][step < 0], stamps[1:][step > 0]
    last = np.append(landings, np.iinfo(np.int64).max)
    return ends[last[np.searchsorted(landings, ends)] - ends >= BOUNCE * 1e9]


__all__ = ['Outcome', 'Replay', 'open_bag', 'replay']
