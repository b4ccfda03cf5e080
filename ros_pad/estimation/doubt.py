# SPDX-License-Identifier: Apache-2.0
"""Why a stance says nothing about the ground, in words: what it is, a colon, and details."""

from __future__ import annotations

from typing import NamedTuple

from ros_pad.estimation.friction import FrictionPrior

TELLING = 1.0
"""What a stance must add to the log odds of wet ground, or take from them, to have told."""

SURE = 0.9
"""Probability of wet or dry ground from which a stance that fits it need not tell more."""

DOMED = 0.1
"""Part of the load on domes from which a foot no longer tells wet from dry."""

ALL_DOMED = 0.9
"""Part of the load on domes from which a foot is a dome, and not half inflated."""

PULLED = 1.5
"""T/N that tells wet ground from dry, over what wet ground is expected to hold: it may hold half
as much again."""

LIGHT = 0.3
"""Share of the expected load below which sensor noise hides what a foot feels."""

OF_THE_GROUND = (
    'not yet', 'domed', 'half inflated', 'light', 'turning', 'not pulled', 'undecided',
)  # fmt: skip
"""How doubts begin that are of the ground; for the others see :data:`sensing.TROUBLES`."""


class Stance(NamedTuple):
    """What a stance has felt so far.

    Attributes
    ----------
    dome_share : float
        Part of the expected load that domes carry, 0 to 1.
    told : float
        What it has added to the log odds of wet ground.
    peak_load : float
        Largest normal force, N.
    peak_ratio : float
        Largest T/N of a window.
    turning_ratio : float
        Largest share of friction that turning about the vertical has taken up, as a T/N; 0 where
        nobody measures it.
    wet_probability, friction_mean, friction_sd : float
        What is believed now.
    """

    dome_share: float
    told: float
    peak_load: float
    peak_ratio: float
    turning_ratio: float
    wet_probability: float
    friction_mean: float
    friction_sd: float


def doubt(stance: Stance, prior: FrictionPrior, expected_load: float) -> str:
    """Return why a stance has told nothing of the ground, or '' where it has."""
    if stance.dome_share > ALL_DOMED:
        return 'domed: wet and dry ground feel alike'
    if stance.dome_share > DOMED:
        return f'half inflated: domes carry {100 * stance.dome_share:.0f} % of the load'
    if abs(stance.told) >= TELLING:
        return ''
    if stance.peak_load < LIGHT * expected_load:
        return f'light: {stance.peak_load:.2g} N of {expected_load:.2g} N'
    if stance.turning_ratio > stance.peak_ratio:
        return (
            f'turning: it takes up {stance.turning_ratio:.2f} of friction, pull'
            f' {stance.peak_ratio:.2f}'
        )
    if stance.peak_ratio < PULLED * prior.flat_wet:
        return (
            f'not pulled: T/N up to {stance.peak_ratio:.2f}, and wet ground holds'
            f' {prior.flat_wet:.2f}'
        )
    if not 1.0 - SURE < stance.wet_probability < SURE:
        return ''
    return (
        f'undecided: friction {stance.friction_mean:.2f} ± {stance.friction_sd:.2f} fits wet'
        f' ground ({prior.flat_wet:.2f}) and dry ({prior.flat_dry:.2f})'
    )
