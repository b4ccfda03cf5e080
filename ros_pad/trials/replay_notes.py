# SPDX-License-Identifier: Apache-2.0
"""Notes on a replay as sentences: its assumptions, and what the bag lacks."""

from __future__ import annotations

import json
from collections.abc import Mapping
from collections.abc import Sequence

from ros_pad.bags import BagReader
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.label import CHANGES
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay_comparison import absent
from ros_pad.trials.replay_comparison import first_gap
from ros_pad.trials.replay_player import TEXTS
from ros_pad.trials.replay_player import Player
from ros_pad.trials.replay_player import inputs_of


def notes_on(
    bag: BagReader,
    player: Player,
    there: Mapping[tuple[int, str], str],
    settings: NodeSettings,
    comparisons: Sequence[Comparison],
) -> list[str]:
    """Return the notes on the replay of a bag, one sentence each.

    Parameters
    ----------
    bag : BagReader
        Bag that was played.
    player : Player
        Player that has played the bag.
    there : mapping
        Topic of the bag by leg and kind.
    settings : NodeSettings
        Settings of the replay.
    comparisons : sequence of Comparison
        Result of :func:`ros_pad.trials.replay_comparison.compare_topics`.
    """
    notes = list(settings.assumed)
    if bag.problem:
        notes.append(bag.problem)
    for time_ns, node, name, value in json.loads(bag.custom_data.get(CHANGES, '[]')):
        notes.append(
            f'{(time_ns - bag.start) * 1e-9:.2f} s: parameter {name} of {node} became {value!r};'
            ' the replay keeps the first value'
        )
    notes += _missing_inputs(player, there, settings)
    if any(each.verdict == 'gap' for each in comparisons):
        notes += _gaps(player, bag.start)
    for leg, each in player.legs.items():
        if each.rejected:
            notes.append(
                f'leg {leg}: {each.rejected} samples rejected, the last one: {each.rejection}'
            )
    different = [
        each for each in comparisons if each.verdict == 'different' and each.kind not in TEXTS
    ]
    if different and not any(each.equal for each in different):
        notes.append(
            'the topics that differ have no equal message: the nodes had other settings, or the'
            ' bag begins in the middle of a walk'
        )
    return notes


def _missing_inputs(
    player: Player, there: Mapping[tuple[int, str], str], settings: NodeSettings
) -> list[str]:
    """Return notes on legs of which wrench, position or pressure was not recorded."""
    notes = []
    missing = absent(player, there, settings)
    if missing:
        notes.append(
            f'leg {", ".join(map(str, missing))}: no wrench was recorded, so the decisions for'
            ' other legs lack its footprints'
        )
    without = {
        kind: [str(leg) for leg in player.legs if (leg, kind) not in there]
        for kind in inputs_of(settings)
    }
    if without['position']:
        notes.append(
            f'leg {", ".join(without["position"])}: no position was recorded, so there are no'
            ' estimates'
        )
    if without.get('contact_velocity'):
        notes.append(
            f'leg {", ".join(without["contact_velocity"])}: no velocity of the contact was'
            ' recorded, which source joints needs, so there are no estimates'
        )
    if without['pressure']:
        notes.append(
            f'leg {", ".join(without["pressure"])}: no pressure was recorded, so its pads are'
            ' assumed to be flat'
        )
    return notes


def _gaps(player: Player, start_ns: int) -> list[str]:
    """Return notes on the first gap of each leg; legs with the same kind of gap share one note."""
    alike: dict[str, list[tuple[int, int]]] = {}
    for leg, each in player.legs.items():
        if (gap := first_gap(each)) and gap[0] >= 0:
            alike.setdefault(gap[1], []).append((gap[0], leg))
    return [
        f'leg {", ".join(str(leg) for _, leg in found)}: {words}, the first'
        f' {(min(found)[0] - start_ns) * 1e-9:.3f} s after the beginning: what was not'
        ' recorded cannot be replayed'
        for words, found in alike.items()
    ]


__all__ = ['notes_on']
