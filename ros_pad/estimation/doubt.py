# SPDX-License-Identifier: Apache-2.0
"""Reason why the ground is unobservable in a stance, as text: a kind, a colon, and details."""

from __future__ import annotations

from typing import NamedTuple

from ros_pad.estimation.scales import FrictionPrior

CONCLUSIVE = 1.0
"""Change of the log odds of wet ground, up or down, above which a stance is conclusive."""

SURE = 0.9
"""Probability of wet or of dry ground above which a stance with enough pull leaves no doubt, even
if it is not conclusive."""

DOMED = 0.1
"""Share of the load on domes above which wet and dry ground cannot be distinguished."""

ALL_DOMED = 0.9
"""Share of the load on domes above which a foot is a dome, and not half inflated."""

PULLED = 1.5
"""Ratio of T/N to the expected friction of wet ground up to which a foot was not pulled enough:
the true friction of wet ground may be 1.5 times the expected one."""

LIGHT = 0.3
"""Share of the expected load below which sensor noise hides the friction."""

MOTION = 'motion unknown'
"""Kind of doubt of a foot whose body estimate is in doubt; the doubt of the body follows."""

OF_THE_GROUND = (
    'not yet', 'domed', 'half inflated', 'light', 'turning', 'not pulled', 'undecided',
)  # fmt: skip
"""Kinds of doubt about the ground; kinds of doubt about sensors are in
:data:`ros_pad.estimation.sensing.SENSOR_FAULTS`."""


class StanceEvidence(NamedTuple):
    """Evidence of a stance so far.

    Attributes
    ----------
    dome_share : float
        Share of the expected load that domes carry, 0 to 1.
    log_odds : float
        Change of the log odds of wet ground by this stance.
    peak_load : float
        Largest normal force, N.
    peak_ratio : float
        Largest T/N of a window.
    turning_ratio : float
        Largest part of the friction that turning about the vertical has used, as T/N; 0 where the
        yaw moment is not measured.
    wet_probability, friction_mean, friction_sd : float
        Present estimate: probability of wet ground, 0 to 1, mean and standard deviation of μ.
    """

    dome_share: float
    log_odds: float
    peak_load: float
    peak_ratio: float
    turning_ratio: float
    wet_probability: float
    friction_mean: float
    friction_sd: float


def doubt(stance: StanceEvidence, prior: FrictionPrior, expected_load: float) -> str:
    """Return why the ground is unobservable in a stance; '' if it is observable.

    The expected load is in N; the friction is what feet expect of new ground.
    """
    if stance.dome_share > ALL_DOMED:
        return 'domed: wet and dry ground feel alike'
    if stance.dome_share > DOMED:
        return f'half inflated: domes carry {100 * stance.dome_share:.0f} % of the load'
    if abs(stance.log_odds) >= CONCLUSIVE:
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


def text(code, a, b):
    from ros_pad.estimation import DOUBTS

    return DOUBTS[int(code)]


def of_sensors(code):
    from ros_pad.estimation import DOUBTS
    from ros_pad.estimation import sensor_fault

    return bool(sensor_fault(DOUBTS[int(code)]))


def place(code):
    return -1 if code != code else int(code)
