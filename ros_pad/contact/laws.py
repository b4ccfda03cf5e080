# SPDX-License-Identifier: Apache-2.0
"""Laws of a foot on a film, on plain numbers: load of its domes, drainage, tangential resistance.

:class:`ros_pad.contact.Foot` and :class:`ros_pad.contact.Film` use them, and the planar step of
the simulation, which numba can compile. So ``foot`` and ``film`` may be any object with the
attributes that are used, operations are those that plain and compiled code round in the same way,
and input is not checked.
"""

from __future__ import annotations

from math import exp, inf
from typing import Any


def dome_load(foot: Any, load: float, pressure: float) -> float:
    """Return the part of a load, N, that domes carry at a gauge pressure, Pa."""
    if pressure <= 0.0:
        return 0.0
    place = pressure / foot.limit_cell
    limits, last = foot.limits, len(foot.limits) - 1
    if place >= last:
        limit = limits[last]
    else:
        index = int(place)
        limit = limits[index] + (place - index) * (limits[index + 1] - limits[index])
    return load if load < limit else limit


def drained(
    film: Any,
    fresh: float,
    state: tuple[float, float, float],
    on_domes: float,
    on_sole: float,
    pressure: float,
    time: float,
) -> tuple[float, float, float]:
    """Return the state of a film after a time, s, under loads, N, and a pressure, Pa.

    The state has the contact area of the domes, m², and 1/h² under domes and sole, 1/m², which was
    ``fresh`` at touch-down.
    """
    area, domes, sole = state
    if on_domes > 0.0:
        before, area = area, on_domes / pressure
        if area > before and fresh < inf:
            # Under the area that is new, the film has not drained yet.
            domes = fresh + before / area * (domes - fresh)
        domes += film.dome_drain * pressure / area * time
    else:
        area = 0.0
    if on_sole > 0.0:
        sole += film.sole_drain * on_sole / film.sole_area * time
    return area, domes, sole


def resistance(
    foot: Any, on_domes: float, on_sole: float, pressure: float, dome_film: float, sole_film: float
) -> float:
    """Return the tangential resistance of a foot, N."""
    total = under_domes = 0.0
    conforming = foot.conforming_pressure
    if on_domes > 0.0:
        # Below the conforming pressure, only a share of the dome's contact area touches.
        under_domes = on_domes / (pressure if pressure > conforming else conforming)
        dry = foot.friction * on_domes + foot.shear_strength * under_domes
        total += on_film(foot, dry, on_domes, dome_film)
        if dome_film > 0.0:
            total += foot.capillary
    if on_sole > 0.0:
        free, touched = foot.sole_area - under_domes, on_sole / conforming
        dry = foot.friction * on_sole + foot.shear_strength * (touched if touched < free else free)
        total += on_film(foot, dry, on_sole, sole_film)
    return total


def on_film(foot: Any, dry: float, load: float, film: float) -> float:
    """Return the resistance of a contact on a film, N; ``dry`` is its resistance without one."""
    if film <= 0.0:
        return dry
    touching = exp(-((film / foot.critical_film) ** foot.film_exponent))
    return touching * dry + (1.0 - touching) * foot.boundary_friction * load
