# SPDX-License-Identifier: Apache-2.0
"""Replay: run the recorded inputs of feet through estimators and controller again.

The stages of the nodes receive the wrenches, positions and pressures of a bag in the order of
recording, and their output is compared with the recorded one. For a trial in simulated time, the
two are equal to the bit. The body estimator of a trial without markers is replayed beside them,
from IMU, joints and forces. With other parameters, a replay shows how estimates and decisions
would have changed; the motion of the robot stays as recorded.
"""

from __future__ import annotations

import math
import os
import pathlib
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.errors import BagError
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Track
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.recorded import wanted_topics
from ros_pad.trials.replay_body import compare_body
from ros_pad.trials.replay_comparison import compare_topics
from ros_pad.trials.replay_notes import notes_on
from ros_pad.trials.replay_player import DECISIONS
from ros_pad.trials.replay_player import ESTIMATES
from ros_pad.trials.replay_player import OF_MOTION
from ros_pad.trials.replay_player import Player
from ros_pad.trials.replay_player import Progress
from ros_pad.trials.replay_player import Tracks
from ros_pad.trials.replay_player import inputs_of
from ros_pad.trials.replay_player import play
from ros_pad.trials.trial import BOUNCE


@dataclass(frozen=True)
class Outcome:
    """Counts of a leg. Pairs are recorded (None if the topic was not recorded) and replayed.

    Attributes
    ----------
    leg : int
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
    settings : NodeSettings
        Settings with which the bag was replayed.
    legs : tuple of int
    start_ns : int
        Beginning of the bag, ns.
    duration_s : float
        Duration of the bag, s.
    samples : dict
        Number of samples that the estimator used, by leg.
    refused : dict
        Number of rejected samples, and the reason of the last one, by leg.
    recorded, replayed : dict
        A :class:`Track` by leg and kind.
    comparisons : list of Comparison
        One for each recorded topic of estimates and decisions.
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
    comparisons: list[Comparison]
    outcomes: list[Outcome]
    notes: list[str]

    @property
    def verdict(self) -> str:
        """The worst verdict of the comparisons, or ``nothing`` if there was nothing to compare.

        See :attr:`Comparison.verdict`.
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
                **settings.as_dict(),
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
    # JSON has no infinity.
    return {n: None if value == math.inf else value for n, value in values.items()}


def open_bag(path: str | os.PathLike[str], progress: Progress | None = None) -> BagReader:
    """Open a bag; for an SQLite bag, the error message has the command that converts it.

    Parameters are as for :class:`ros_pad.bags.BagReader`.

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

    Raises
    ------
    BagError
        When there is no wrench of any leg, a topic has another message type than in ros_pad, or
        the bag has several robots and no namespace is given.
    InvalidInput
        When a remap is not allowed, see :func:`ros_pad.trials.recorded.wanted_topics`.
    """
    settings = settings or NodeSettings.of(bag)
    kinds = (*inputs_of(settings), *ESTIMATES, *DECISIONS)
    if settings.tuning.source == 'joints':
        kinds += OF_MOTION
    wanted = {
        topic: key
        for topic, key in wanted_topics(bag, namespace, remaps).items()
        if key[1] in kinds
    }
    there = {key: topic for topic, key in wanted.items()}
    legs = tuple(sorted(leg for leg, kind in there if kind == 'wrench'))
    if not legs:
        raise BagError(
            f'{bag.path}: no wrench of a leg was recorded; the topics are'
            f' {", ".join(sorted(bag.topics))}. If one has wrenches, name it with a remap'
        )
    # Keep the order of the legs in the controller of the bag, around the body.
    legs = tuple(leg for leg in settings.legs if leg in legs) + tuple(
        leg for leg in legs if leg not in settings.legs
    )
    found = _once(bag, settings, wanted, legs, {}, progress)
    late = {leg: stamp_ns for leg in legs if (stamp_ns := _beginning(found, leg)) is not None}
    if late and found.verdict in ('different', 'gap'):
        # The first estimates are not in the bag, because the recorder lost them or because the
        # estimator started later than the recorder. Replay both ways, and take the better match.
        other = _once(bag, settings, wanted, legs, late, progress)
        if _agreeing(other) > _agreeing(found):
            other.notes.append(
                f'leg {", ".join(map(str, late))}: the estimator started later than the recorder,'
                ' so the replay leaves out the samples before its first recorded estimate'
            )
            found = other
    # The body estimator is replayed beside the feet, which take what it published.
    comparisons, note = compare_body(bag, wanted)
    found.comparisons += comparisons
    found.notes += [note] if note else []
    return found


def _beginning(found: Replay, leg: int) -> int | None:
    """Return the stamp of the first recorded estimate, ns, if the replay has earlier ones."""
    one, other = found.recorded[leg, 'slip'].keys, found.replayed[leg, 'slip'].keys
    return min(one) if len(one) and len(other) and min(one) > min(other) else None


def _agreeing(found: Replay) -> int:
    return sum(each.equal for each in found.comparisons)


def _once(
    bag: BagReader,
    settings: NodeSettings,
    wanted: Mapping[str, tuple[int, str]],
    legs: Sequence[int],
    beginnings: Mapping[int, int],
    progress: Progress | None,
) -> Replay:
    """Replay a bag once; ``beginnings``: stamp of the first sample to use, ns, of some legs."""
    there = {key: topic for topic, key in wanted.items()}
    player = play(bag, settings, wanted, legs, beginnings, progress)
    comparisons = compare_topics(bag, player, there, settings)
    return Replay(
        bag=str(bag.path),
        settings=settings,
        legs=tuple(legs),
        start_ns=bag.start,
        duration_s=(bag.end - bag.start) * 1e-9,
        samples={leg: each.estimation.samples for leg, each in player.legs.items()},
        refused={
            leg: (each.rejected, each.rejection)
            for leg, each in player.legs.items()
            if each.rejected
        },
        recorded=player.recorded,
        replayed=player.replayed,
        comparisons=comparisons,
        outcomes=[_outcome(player, leg, settings) for leg in player.legs],
        notes=notes_on(bag, player, there, settings, comparisons),
    )


def _outcome(player: Player, leg: int, settings: NodeSettings) -> Outcome:
    replayed = player.legs[leg]
    ends = [
        end
        for end, landing in _with_next(replayed.lift_offs, replayed.landings)
        if landing is None or landing - end >= BOUNCE * 1e9
    ]
    # After this delay the estimate of the stance is published; it is constant in the air.
    delay_ns = round(2e9 / settings.publish_rate)

    def pair(kind: str, count: Callable[[Track], int]) -> tuple[int | None, int]:
        track = player.recorded[leg, kind]
        return count(track) if len(track) else None, count(player.replayed[leg, kind])

    return Outcome(
        leg=leg,
        stance_ends=len(ends),
        wet_ends=pair(
            'wetness', lambda track: sum((track.at(end + delay_ns) or 0.0) > 0.5 for end in ends)
        ),
        slips=pair(
            'slipping', lambda track: int(np.sum(np.diff(track.values[:, 0], prepend=0) > 0))
        ),
        switches=pair('morphology', lambda track: max(0, len(track) - 1)),
    )


def _with_next(
    lift_offs: Sequence[int], landings: Sequence[int]
) -> Iterator[tuple[int, int | None]]:
    """Yield each lift-off with the landing after it, or None after the last landing."""
    for end in lift_offs:
        place = int(np.searchsorted(landings, end))
        yield end, landings[place] if place < len(landings) else None


__all__ = ['Outcome', 'Replay', 'open_bag', 'replay']
