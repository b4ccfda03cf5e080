# SPDX-License-Identifier: Apache-2.0
"""Replay: what was recorded of feet, through estimators and controller once more.

Wrenches, positions and pressures of a bag go through the objects that the nodes are made of, in
the order in which they were recorded, and what comes out is compared with what was recorded. The
bag of a trial in simulated time gives the same to the bit. Other parameters show what they would
have changed in what was estimated and decided; the robot walks as it walked.
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

from ros_pad.errors import BagError
from ros_pad.trials.bag import BagReader
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Track
from ros_pad.trials.node_settings import ESTIMATOR
from ros_pad.trials.node_settings import POLICY
from ros_pad.trials.node_settings import SETTABLE
from ros_pad.trials.node_settings import Settings
from ros_pad.trials.recorded import wanted_topics
from ros_pad.trials.replay_comparison import compare_topics
from ros_pad.trials.replay_notes import notes_on
from ros_pad.trials.replay_player import DECISIONS
from ros_pad.trials.replay_player import ESTIMATES
from ros_pad.trials.replay_player import INPUTS
from ros_pad.trials.replay_player import Player
from ros_pad.trials.replay_player import Progress
from ros_pad.trials.replay_player import Tracks
from ros_pad.trials.replay_player import play
from ros_pad.trials.trial import BOUNCE


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
    player = play(bag, settings, wanted, legs, beginnings, progress)
    comparisons = compare_topics(bag, player, there, settings)
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
        recorded=player.recorded,
        replayed=player.replayed,
        comparisons=comparisons,
        outcomes=[_outcome(player, leg, settings) for leg in player.legs],
        notes=notes_on(bag, player, there, settings, comparisons),
    )


def _outcome(player: Player, leg: int, settings: Settings) -> Outcome:
    felt = player.legs[leg]
    ends = [
        end
        for end, landing in _with_next(felt.lift_offs, felt.landings)
        if landing is None or landing - end >= BOUNCE * 1e9
    ]
    # What is believed of the last stance has been told by then, and does not change in the air.
    told_ns = round(2e9 / settings.publish_rate)

    def pair(kind: str, count: Callable[[Track], int]) -> tuple[int | None, int]:
        track = player.recorded[leg, kind]
        return count(track) if len(track) else None, count(player.replayed[leg, kind])

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


__all__ = ['Outcome', 'Replay', 'open_bag', 'replay']
