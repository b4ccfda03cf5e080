# SPDX-License-Identifier: Apache-2.0
"""Laws of a foot on a film, on plain numbers: load of its domes, drainage, tangential resistance.

:class:`ros_pad.contact.Foot` and :class:`ros_pad.contact.Film` use them, and the planar step of
the simulation, which numba can compile. So ``foot`` and ``film`` may be any object with the
attributes that are used, operations are those that plain and compiled code round in the same way,
and input is not checked.
"""

from __future__ import annotations

from math import exp, inf, log, pi, sqrt
from typing import Any

CELLS = 32  # of the area of a dome's contact

# Entries of the film under a foot. Thicknesses are in m; after the last one, the dry share of each
# cell of equal area of a dome's contact, from the middle outwards.
FILM = 5
(
    FRESH,  # thickness at touch-down
    SOLE,  # 1/h² under the flat sole, 1/m²
    AREA,  # contact area of one dome, m²
    RIM,  # width of the rim that has levelled, m
    CORE,  # thickness where that rim ends
) = range(FILM)  # fmt: skip

# Gauss' points of the rim, and their weights.
POINTS = (0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970262)
WEIGHTS = (0.17392742256872692, 0.32607257743127305, 0.32607257743127305, 0.17392742256872692)


def dome_load(foot: Any, load: float, pressure: float) -> float:
    """Return the part of a load, N, that domes carry at a gauge pressure, Pa."""
    if pressure <= 0.0:
        return 0.0
    limit = between(foot.limits, pressure / foot.limit_cell)
    return load if load < limit else limit


def spring(foot: Any, depth: float, pressure: float) -> tuple[float, float]:
    """Return force, N, and stiffness, N/m, of a foot at a depth below its first touch, m.

    Domes are springs to their force limit, from which on the sole carries.
    """
    force, stiffness, limit = 0.0, 0.0, 0.0
    if pressure > 0.0:
        place = pressure / foot.limit_cell
        stiffness, limit = between(foot.stiffnesses, place), between(foot.limits, place)
        force = stiffness * depth
    if force < limit:
        return force, stiffness
    flat = depth - limit / stiffness if stiffness > 0.0 else depth
    return limit + foot.sole_stiffness * flat, foot.sole_stiffness


def between(values: Any, place: float) -> float:
    """Return the value at a place in a table, from 0; after its end, the last one."""
    last = len(values) - 1
    if place >= last:
        return values[last]
    index = int(place)
    return values[index] + (place - index) * (values[index + 1] - values[index])


def touch_down(film: Any, thickness: float) -> None:
    """Start a stance on a film, m; 0 is dry ground."""
    film[FRESH], film[AREA] = thickness, 0.0
    film[SOLE] = 1.0 / (thickness * thickness) if thickness > 0.0 else inf


def drained(
    foot: Any, film: Any, on_domes: float, on_sole: float, pressure: float, time: float,
    slip: float,
) -> tuple[float, float]:  # fmt: skip
    """Drain a film for a time, s, under loads, N; return its thickness under domes and sole, m.

    ``slip`` is the speed at which the foot slips, m/s.

    The film under domes is not even: the thickness is that with the same dry share.
    """
    if film[FRESH] <= 0.0:
        return 0.0, 0.0
    if on_sole > 0.0:
        film[SOLE] += foot.sole_drain * on_sole / foot.sole_area * time
    share = 1.0
    if on_domes > 0.0:
        area = on_domes / (foot.pads * pressure)
        sphere = between(foot.spheres, pressure / foot.limit_cell)
        spread(foot, film, area, pressure, sphere, time)
        if slip > 0.0:
            drag(foot, film, pressure, sphere, slip, time)
        share = dry_share(foot, film, sphere)
    else:
        film[AREA] = 0.0
    thin = foot.critical_film * (-log(max(share, 1e-300))) ** (1.0 / foot.film_exponent)
    return min(thin, film[FRESH]) if share < 1.0 else 0.0, film[SOLE] ** -0.5


def spread(foot: Any, film: Any, area: float, pressure: float, sphere: float, time: float) -> None:
    """Change the contact area of a dome within a time, and let the rim of its film level.

    A rim that advances at a speed V lays a film of 0.3215 R (24 η V/(p R))^⅔, as Bretherton's
    bubbles do; at constant speed of the area that is proportional to the area to the power -⅓.
    When the rim stands or recedes, suction by its curvature levels the film inwards from there.
    """
    before = film[AREA]
    speed = abs(area - before) / (time * 2.0 * sqrt(pi * area)) if time > 0.0 else inf
    laid = 0.3215 * sphere * (24.0 * foot.viscosity * speed / (pressure * sphere)) ** (2.0 / 3.0)
    if area != before and before > 0.0:
        keep_rim(foot, film, sphere)
    film[AREA] = area
    if area > before:
        cell, at = int(before / foot.cell), before
        while at < area:
            end = min(area, (cell + 1) * foot.cell)
            thickness = laid * (2.0 * area / (at + end)) ** (1.0 / 3.0)
            mix(foot, film, cell, at, end, min(thickness, film[FRESH]))
            cell, at = cell + 1, end
        film[RIM], film[CORE] = 0.0, min(laid, film[FRESH])
        return
    if area < before:
        share = film[FILM + min(int(area / foot.cell), CELLS - 1)]
        share = min(max(share, 1e-300), 1.0 - 1e-12)
        core = foot.critical_film * (-log(share)) ** (1.0 / foot.film_exponent)
        film[RIM], film[CORE] = 0.0, min(core, film[FRESH])
        if laid > 0.5 * core:
            return
    level(foot, film, pressure, sphere, time)


def drag(foot: Any, film: Any, pressure: float, sphere: float, slip: float, time: float) -> None:
    """Replace the film by one that slip drags in, at half the speed of the foot.

    It is 0.643 R/2 (6 η U/T)^⅔ thick, as of a foil over a moving surface: the gap has twice the
    curvature 1/R of the free dome. Slow slip dries a dome.
    """
    keep_rim(foot, film, sphere)
    tension, radius = 0.5 * pressure * sphere, sqrt(film[AREA] / pi)
    thickness = 0.3215 * sphere * (6.0 * foot.viscosity * slip / tension) ** (2.0 / 3.0)
    film[RIM], film[CORE] = 0.0, min(thickness, film[FRESH])
    share, part = dry(foot, film[CORE]), min(1.0, slip * time / (4.0 * radius))
    for cell in range(min(int(film[AREA] / foot.cell) + 1, CELLS)):
        film[FILM + cell] += part * (share - film[FILM + cell])


def mix(foot: Any, film: Any, cell: int, start: float, end: float, thickness: float) -> None:
    """Give a part of a cell, between two areas, m², a film; what lies before it stays."""
    if cell < CELLS:
        first = cell * foot.cell
        kept = film[FILM + cell] * (start - first)
        film[FILM + cell] = (kept + dry(foot, thickness) * (end - start)) / (end - first)


def keep_rim(foot: Any, film: Any, sphere: float) -> None:
    """Write the film of the rim into its cells, before the rim moves."""
    if film[RIM] > 0.0:
        area = film[AREA]
        radius = sqrt(area / pi)
        at = pi * (radius - film[RIM]) * (radius - film[RIM])
        cell = int(at / foot.cell)
        while at < area:
            end = min(area, (cell + 1) * foot.cell)
            inwards = radius - sqrt(0.5 * (at + end) / pi)
            mix(foot, film, cell, at, end, rim_film(film, sphere, inwards))
            cell, at = cell + 1, end


def rim_film(film: Any, sphere: float, inwards: float) -> float:
    """Return the thickness at a distance inwards from the edge of the contact, m: a wedge."""
    slope = film[CORE] / film[RIM]
    return max(0.78 * slope * slope * sphere, slope * inwards)


def level(foot: Any, film: Any, pressure: float, sphere: float, time: float) -> None:
    """Let the rim grow inwards, and the paraboloid drain that is left when it has met itself.

    The pressure of the air drives the liquid through the thinnest place of the wedge.
    """
    core, rim, radius = film[CORE], film[RIM], sqrt(film[AREA] / pi)
    if core <= 0.0:
        return
    tension = 0.5 * pressure * sphere
    if rim < 0.5 * radius:
        cube, square = core * core * core, rim * rim
        fourth = square * square + tension * cube / (6.0 * foot.viscosity) * time
        sixth = (
            fourth * sqrt(fourth) + 0.605 * tension * sphere * cube * core / foot.viscosity * time
        )
        film[RIM] = min(0.5 * radius, sixth ** (1.0 / 6.0))
    else:
        cube, square = radius * radius * radius, core * core
        rate = 12.9 * pressure * sphere * sphere / (foot.viscosity * cube * cube)
        film[CORE] = 1.0 / sqrt(sqrt(1.0 / (square * square) + rate * time))


def dry_share(foot: Any, film: Any, sphere: float) -> float:
    """Return the share of dry contact under a dome."""
    area = film[AREA]
    radius, rim = sqrt(area / pi), film[RIM]
    inside = area if rim <= 0.0 else pi * (radius - rim) * (radius - rim)
    whole = min(int(inside / foot.cell), CELLS)
    total = 0.0
    for cell in range(whole):
        total += film[FILM + cell]
    total *= foot.cell
    if whole < CELLS:
        total += film[FILM + whole] * (inside - whole * foot.cell)
    if rim > 0.0:
        for index in range(len(POINTS)):
            inwards, weight = POINTS[index] * rim, WEIGHTS[index]
            share = dry(foot, rim_film(film, sphere, inwards))
            total += weight * rim * share * 2.0 * pi * (radius - inwards)
    return total / area


def dry(foot: Any, thickness: float) -> float:
    """Return the share of dry contact that a film leaves."""
    return exp(-((thickness / foot.critical_film) ** foot.film_exponent))


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


def on_film(foot: Any, whole: float, load: float, film: float) -> float:
    """Return the resistance of a contact on a film, N; ``whole`` is its resistance without one."""
    if film <= 0.0:
        return whole
    touching = dry(foot, film)
    return touching * whole + (1.0 - touching) * foot.boundary_friction * load
