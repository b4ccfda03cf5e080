# SPDX-License-Identifier: Apache-2.0
"""What is to be known of a replay, in words: what it had to assume, and what the bag lacks."""

from __future__ import annotations

import json
from collections.abc import Mapping
from collections.abc import Sequence

from ros_pad.trials.bag import BagReader
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.label import CHANGES
from ros_pad.trials.node_settings import Settings
from ros_pad.trials.replay_comparison import absent
from ros_pad.trials.replay_comparison import first_gap
from ros_pad.trials.replay_player import INPUTS
from ros_pad.trials.replay_player import TEXTS
from ros_pad.trials.replay_player import Player


def notes_on(
    bag: BagReader,
    player: Player,
    there: Mapping[tuple[int, str], str],
    settings: Settings,
    comparisons: Sequence[Comparison],
) -> list[str]:
    """Return what is to be known of the replay of a bag, a sentence each.

    Parameters
    ----------
    bag : BagReader
        What was played.
    player : Player
        After it.
    there : mapping
        Topic of the bag by leg and kind.
    settings : Settings
        That it was played with.
    comparisons : sequence of Comparison
        Of :func:`ros_pad.trials.replay_comparison.compare_topics`.
    """
    notes = list(settings.assumed)
    if bag.problem:
        notes.append(bag.problem)
    for time_ns, node, name, value in json.loads(bag.custom_data.get(CHANGES, '[]')):
        notes.append(
            f'{(time_ns - bag.start) * 1e-9:.2f} s: parameter {name} of {node} became {value!r};'
            ' the replay goes on with what it was'
        )
    missing = absent(player, there, settings)
    if missing:
        notes.append(
            f'leg {", ".join(map(str, missing))}: no wrench; what it would have told the others'
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
            if (gap := first_gap(each)) and gap[0] >= 0:
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


__all__ = ['notes_on']
