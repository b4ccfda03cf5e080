# SPDX-License-Identifier: Apache-2.0
"""Which pressure a foot needs so that its domes carry its load."""

from __future__ import annotations

import math

from ros_pad.contact.limits import pressure_for
from ros_pad.contact.resistance import Foot
from ros_pad.errors import LimitError
from ros_pad.errors import NoEquilibrium

RESOLUTION = 10.0  # Pa: what the regulators take, and exact when an ambient pressure is added


def dome_pressure(foot: Foot, load: float, margin: float) -> float:
    """Gauge pressure, Pa, at which the domes carry a load with a margin.

    Parameters
    ----------
    foot : Foot
        The foot.
    load : float
        Largest normal force expected on the foot, N, 0 or more.
    margin : float
        Factor on the load, above 0: 10 % of missing pressure costs a third of the limit at 75 kPa.

    Returns
    -------
    float
        Rounded up to :data:`RESOLUTION`.

    Raises
    ------
    LimitError
        When the pressure would be above the foot's ceiling, or past the end of the pads' model.
    InvalidInput
        When load or margin are not finite, negative, or (the margin) zero.
    """
    try:
        wanted = float(pressure_for(foot.pad, load / foot.pads, foot.limit, margin=margin))
    except NoEquilibrium as error:
        raise LimitError(
            f'{load:.3g} N with margin {margin:g} on {foot.pads} pads of {foot.source} is more'
            f' than domes carry at any pressure up to the ceiling of {foot.ceiling:.0f} Pa'
        ) from error
    # Rounded up, or the margin would not be kept; the last digits of the inverse are no reason to.
    pressure = RESOLUTION * math.ceil(wanted / RESOLUTION - 1e-6)
    if pressure > foot.ceiling:
        raise LimitError(
            f'{load:.3g} N with margin {margin:g} on {foot.pads} pads of {foot.source} needs'
            f' {pressure:.0f} Pa, above the ceiling of {foot.ceiling:.0f} Pa'
        )
    return pressure
