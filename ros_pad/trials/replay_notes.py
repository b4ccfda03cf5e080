# SPDX-License-Identifier: Apache-2.0
"""Notes on a replay as sentences: its assumptions, and what the bag lacks."""

from __future__ import annotations

import json
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.label import CHANGES
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay_inputs import Inputs


def notes_on(
    bag: BagReader,
    inputs: Inputs,
    settings: NodeSettings,
    refused: Mapping[int, tuple[int, str]],
    comparisons: Sequence[Comparison],
) -> list[str]:
    """Return the notes on the replay of a bag, one sentence each.

    Parameters
    ----------
    bag : BagReader
        Bag that was played.
    inputs : Inputs
        What was recorded.
    settings : NodeSettings
        Settings of the replay.
    refused : mapping
        Number of rejected samples, and the reason of the last one, by leg.
    comparisons : sequence of Comparison
        Those of estimates and commands.
    """
    notes = [*settings.assumed, *filter(None, [bag.problem])]
    for time_ns, node, name, value in json.loads(bag.custom_data.get(CHANGES, '[]')):
        notes.append(
            f'{(time_ns - bag.start) * 1e-9:.2f} s: parameter {name} of {node} became {value!r};'
            ' the replay keeps the first value'
        )
    notes += missing_inputs(inputs, settings)
    if any(each.verdict == 'gap' for each in comparisons):
        notes += [
            f'{gap.what}: {gap.places} gap{"s" if gap.places > 1 else ""}, the first'
            f' {(gap.time_ns - bag.start) * 1e-9:.3f} s after the beginning: what was not recorded'
            ' cannot be replayed'
            for gap in sorted(inputs.gaps)
        ]
    for leg, (count, reason) in refused.items():
        notes.append(f'leg {leg}: {count} samples rejected, the last one: {reason}')
    different = [each for each in comparisons if each.verdict == 'different']
    if different and not any(each.equal for each in different):
        notes.append(
            'the quantities that differ have no equal record: the nodes had other settings, or the'
            ' bag begins in the middle of a walk'
        )
    return notes


def missing_inputs(inputs: Inputs, settings: NodeSettings) -> list[str]:
    """Return notes on legs of which something was not recorded at all.

    Parameters
    ----------
    inputs : Inputs
        What was recorded.
    settings : NodeSettings
        Settings of the replay.
    """
    needed = [
        ('sample', 'position', 'no position was recorded, so there are no estimates'),
        ('pressure', 'pressure', 'no pressure was recorded, so its pads are assumed to be flat'),
    ]
    if settings.tuning.source == 'joints':
        text = (
            'no velocity of the contact was recorded, which source joints needs, so there are no'
            ' estimates'
        )
        needed.append(('sample', 'velocity', text))
    notes = []
    if inputs.absent:
        text = 'no wrench was recorded, so the decisions for other legs lack its footprints'
        notes.append(f'leg {_listed(inputs.absent)}: {text}')
    for kind, field, text in needed:
        values = inputs.streams[kind].block.rows[field]
        known = np.isfinite(values).reshape(*values.shape[:2], -1).any(axis=(0, 2))
        if not known.all():
            legs = [leg for leg, there in zip(inputs.legs, known, strict=True) if not there]
            notes.append(f'leg {_listed(legs)}: {text}')
    return notes


def _listed(legs: Iterable[int]) -> str:
    return ', '.join(map(str, legs))


__all__ = ['missing_inputs', 'notes_on']
