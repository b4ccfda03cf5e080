# SPDX-License-Identifier: Apache-2.0
"""All topics of a replay against what was recorded, and since when more may have been heard.

:mod:`ros_pad.trials.comparison` compares one topic; here its messages are matched, and said from
where on the nodes may have heard what the bag lacks, so that what differs then is no surprise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ros_pad.estimation.listening import LISTEN_PERIOD_NS
from ros_pad.trials.bag import BagReader
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Track
from ros_pad.trials.comparison import compare
from ros_pad.trials.node_settings import Settings
from ros_pad.trials.replay_player import DECISIONS
from ros_pad.trials.replay_player import ESTIMATES
from ros_pad.trials.replay_player import TEXTS
from ros_pad.trials.replay_player import Leg
from ros_pad.trials.replay_player import Player

LONGER = 1.6
"""Times the usual one, a time between two messages is a gap: one may be lost."""

EARLY_NS = 20_000_000
"""By which a text may be in a bag before the estimate that it was told with, ns."""


def compare_topics(
    bag: BagReader,
    player: Player,
    there: Mapping[tuple[int, str], str],
    settings: Settings,
) -> list[Comparison]:
    """Compare every topic of the replayed legs that was recorded.

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
    """
    gaps = {leg: gap[0] for leg, each in player.legs.items() if (gap := first_gap(each))}
    # Legs know of one another by what the controller decides.
    of_all = min(gaps.values(), default=None)
    if absent(player, there, settings):
        of_all = -1
    period_ns = round(1e9 / settings.publish_rate)
    found = []
    for leg in player.legs:
        for kind in ESTIMATES + DECISIONS:
            if (leg, kind) not in there:
                continue
            gap_ns = of_all if kind in DECISIONS else gaps.get(leg)
            one, other = _matched(player, leg, kind)
            found.append(
                compare(
                    there[leg, kind], leg, kind, one, other, bag.start, period_ns, gap_ns,
                    0 if player.clocked else 2 * LISTEN_PERIOD_NS,
                )
            )  # fmt: skip
    return found


def absent(player: Player, there: Mapping[tuple[int, str], str], settings: Settings) -> list[int]:
    """Return the legs that the robot had, and that cannot be replayed."""
    return sorted(({*settings.legs} | {leg for leg, _ in there}) - set(player.legs))


def first_gap(leg: Leg) -> tuple[int, str] | None:
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


def _matched(player: Player, leg: int, kind: str) -> tuple[Track, Track]:
    """Return the tracks of a topic with keys by which their messages find one another.

    All that an estimator says of a moment is sent together, and only slip has a stamp. Where
    as many messages of another kind were recorded, they belong together one by one; otherwise
    the times have to do.
    """
    recorded, replayed = player.recorded, player.replayed
    one, other, stamped = recorded[leg, kind], replayed[leg, kind], recorded[leg, 'slip']
    if kind == 'slip':
        return one, other
    if kind in TEXTS:
        # How long nodes had been waiting for the first sample, their clock alone says.
        if player.clocked or not len(stamped):
            return one, other
        told = replayed[leg, 'slip'].times
        return one.since(stamped.times[0] - EARLY_NS), other.since(told[0] if len(told) else 0)
    if len(one) == len(stamped) and len(other) == len(replayed[leg, 'slip']):
        return replace(one, keys=stamped.keys), other
    return one, replace(other, keys=other.times)


__all__ = ['absent', 'compare_topics', 'first_gap']
