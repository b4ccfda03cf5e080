# SPDX-License-Identifier: Apache-2.0
"""Compare all topics of a replay with the recorded ones, and find gaps of the recording.

:mod:`ros_pad.trials.comparison` compares one topic; this module chooses the keys by which its
messages are matched. In a gap, the nodes may have received messages that the bag lacks, so that
differences after the first gap are excused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.topics import OF_BODY
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Track
from ros_pad.trials.comparison import compare
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay_player import DECISIONS
from ros_pad.trials.replay_player import ESTIMATES
from ros_pad.trials.replay_player import TEXTS
from ros_pad.trials.replay_player import Player
from ros_pad.trials.replay_player import ReplayedLeg

LONGER = 1.6
"""A time between two messages that is longer than their median time by this factor is a gap."""

EARLY_NS = 20_000_000
"""Longest time by which a text may be recorded before the estimate of the same sample, ns."""


def compare_topics(
    bag: BagReader,
    player: Player,
    there: Mapping[tuple[int, str], str],
    settings: NodeSettings,
) -> list[Comparison]:
    """Compare every recorded topic of estimates and decisions of the replayed legs.

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
    """
    # Feet learn friction together and doubt their axes together, and the controller decides for
    # all of them: each topic depends on the inputs of all legs.
    gap_ns = min(
        (gap[0] for each in player.legs.values() if (gap := first_gap(each))), default=None
    )
    if absent(player, there, settings):
        gap_ns = -1
    period_ns = round(1e9 / settings.publish_rate)
    found = []
    for leg in player.legs:
        for kind in ESTIMATES + DECISIONS:
            if (leg, kind) not in there:
                continue
            one, other = _matched(player, leg, kind)
            found.append(
                compare(
                    there[leg, kind], leg, kind, one, other, bag.start, period_ns, gap_ns,
                    0 if player.clocked else 2 * TICK_PERIOD_NS,
                )
            )  # fmt: skip
    return found


def absent(
    player: Player, there: Mapping[tuple[int, str], str], settings: NodeSettings
) -> list[int]:
    """Return the legs of the robot that cannot be replayed."""
    recorded = {leg for leg, kind in there if kind not in OF_BODY}
    return sorted(({*settings.legs} | recorded) - set(player.legs))


def first_gap(leg: ReplayedLeg) -> tuple[int, str] | None:
    """Return the log time of the first gap in the inputs of a leg, ns, and a text that names it.

    The time is -1 if positions or pressures are missing altogether. None without a gap.
    """
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


def _matched(player: Player, leg: int, kind: str) -> tuple[Track, Track]:
    """Return the recorded and the replayed track of a topic, with keys that match their messages.

    The topics of one estimate are published together, and only slip has a stamp. A topic with as
    many messages as slip takes the stamps of slip as keys; otherwise the keys are log times.
    """
    recorded, replayed = player.recorded, player.replayed
    one, other, stamped = recorded[leg, kind], replayed[leg, kind], recorded[leg, 'slip']
    if kind == 'slip':
        return one, other
    if kind in TEXTS:
        # Without /clock the bag does not show how long the nodes waited for the first sample:
        # leave out the texts before the first estimate.
        if player.clocked or not len(stamped):
            return one, other
        times = replayed[leg, 'slip'].times
        return one.since(stamped.times[0] - EARLY_NS), other.since(times[0] if len(times) else 0)
    if len(one) == len(stamped) and len(other) == len(replayed[leg, 'slip']):
        return replace(one, keys=stamped.keys), other
    return one, replace(other, keys=other.times)


__all__ = ['absent', 'compare_topics', 'first_gap']
