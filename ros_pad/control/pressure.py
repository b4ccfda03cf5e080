# SPDX-License-Identifier: Apache-2.0
"""Gauge pressure that a foot needs so that its domes carry its load."""

from __future__ import annotations

import math

from ros_pad.configuration import instance, number
from ros_pad.contact.limits import pressure_for
from ros_pad.contact.resistance import Foot
from ros_pad.errors import LimitError, NoEquilibrium

RESOLUTION = 10.0  # Pa; regulators resolve it, and adding an ambient pressure rounds nothing off


def dome_pressure(foot: Foot, load: float, margin: float) -> float:
    """Return the gauge pressure, Pa, at which the domes carry a load with a margin.

    Parameters
    ----------
    foot : Foot
        The foot.
    load : float
        Largest normal force expected on the foot, N, 0 or more.
    margin : float
        Factor on the load, above 0. At 75 kPa, 10 % less pressure lowers the force limit by a
        third.

    Returns
    -------
    float
        Gauge pressure, Pa, rounded up to a multiple of :data:`RESOLUTION`.

    Raises
    ------
    LimitError
        When the pressure would be above the foot's ceiling, or beyond the model of the pads.
    InvalidInput
        When the load is negative or not finite, or the margin is not finite and above 0.

    Examples
    --------
    >>> from ros_pad.contact import Foot
    >>> from ros_pad.control import dome_pressure
    >>> dome_pressure(Foot.load('large19'), load=5.0, margin=1.2)
    77600.0
    """
    instance('foot', foot, Foot)
    number('load', load, 'N')
    number('margin', margin, '(factor)', above=True)
    asked = f'{load:.3g} N with margin {margin:g} on {foot.pads} pads of {foot.source}'
    try:
        wanted = float(pressure_for(foot.pad, load / foot.pads, foot.limit, margin=margin))
    except NoEquilibrium as error:
        raise LimitError(
            f'{asked} is more than domes carry at any pressure up to the ceiling of'
            f' {foot.ceiling:.0f} Pa'
        ) from error
    # Rounding up keeps the margin. Rounding errors of `wanted` must not add a whole step.
    pressure = RESOLUTION * math.ceil(wanted / RESOLUTION - 1e-6)
    if pressure > foot.ceiling:
        above = f'{pressure:.0f} Pa, above the ceiling of {foot.ceiling:.0f} Pa'
        raise LimitError(f'{asked} needs {above}')
    return pressure
