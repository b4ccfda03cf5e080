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
FILM = 6
(
    FRESH,  # thickness at touch-down
    SOLE,  # 1/h² under the flat sole, 1/m²
    AREA,  # contact area of one dome, m²
    EDGE,  # area within the edge of what landed fast, m²: its film levels
    RIM,  # width of the rim that has levelled there, m
    CORE,  # thickness where that rim ends
) = range(FILM)  # fmt: skip

LEAST = 1e-9  # N; below it a dome has no contact
LONGEST, MOST = 2e-3, 1000  # s, step of a film under domes; longer ones are divided, in so many
SLOW = 0.05  # A contact grows or shrinks slowly that lays less than this share of the film inside.

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
    if on_domes > LEAST:
        area = on_domes / (foot.pads * pressure)
        sphere = between(foot.spheres, pressure / foot.limit_cell)
        before, parts = film[AREA], min(int(time / LONGEST - 1e-9) + 1, MOST)
        for part in range(1, parts + 1):
            then = before + (area - before) * part / parts
            spread(foot, film, then, pressure, sphere, time / parts)
            if slip > 0.0:
                drag(foot, film, pressure, sphere, slip, time / parts)
        share = dry_share(foot, film, sphere)
    else:
        film[AREA] = 0.0
    thin = 0.0
    if share < 1.0:
        thin = foot.critical_film * (-log(max(share, 1e-300))) ** (1.0 / foot.film_exponent)
    return min(thin, film[FRESH]), film[SOLE] ** -0.5


def spread(foot: Any, film: Any, area: float, pressure: float, sphere: float, time: float) -> None:
    """Change the contact area of a dome within a time, and let its film level.

    A contact that grows at a speed V lays a film of 0.3215 R (24 η V/(p R))^⅔, as Bretherton's
    bubbles do; at constant speed of the area that is proportional to the area to the power -⅓.
    What landed fast levels from its edge inwards, by suction of the curved rim, when the contact
    stands or changes slowly.
    """
    before, edge, core = film[AREA], film[EDGE], film[CORE]
    speed = abs(area - before) / (time * 2.0 * sqrt(pi * area)) if time > 0.0 else inf
    laid = 0.3215 * sphere * (24.0 * foot.viscosity * speed / (pressure * sphere)) ** (2.0 / 3.0)
    if area > before:
        fast = before <= 0.0 or laid >= SLOW * core
        if fast:
            keep_rim(foot, film, sphere)
            film[EDGE], film[RIM], film[CORE] = area, 0.0, min(laid, film[FRESH])
        lay(foot, film, area, laid)
        if fast:
            return
    elif area < edge:
        moved = sqrt(edge / pi) - sqrt(area / pi)
        if laid < SLOW * core and moved < film[RIM]:
            film[EDGE], film[RIM] = area, film[RIM] - moved
        else:
            keep_rim(foot, film, sphere)
            share = film[FILM + min(int(area / foot.cell), CELLS - 1)]
            share = min(max(share, 1e-300), 1.0 - 1e-12)
            core = foot.critical_film * (-log(share)) ** (1.0 / foot.film_exponent)
            film[EDGE], film[RIM], film[CORE] = area, 0.0, min(core, film[FRESH])
            if laid > 0.5 * core:
                film[AREA] = area
                return
    film[AREA] = area
    level(foot, film, pressure, sphere, time)


def lay(foot: Any, film: Any, area: float, thickness: float) -> None:
    """Let the contact grow to an area, m², and lay a film, as thick at its end."""
    cell, at = int(film[AREA] / foot.cell), film[AREA]
    while at < area and cell < CELLS:
        first, end = cell * foot.cell, min(area, (cell + 1) * foot.cell)
        laid = thickness * (2.0 * area / (at + end)) ** (1.0 / 3.0)
        share, kept = dry(foot, min(laid, film[FRESH])), film[FILM + cell] * (at - first)
        film[FILM + cell] = (kept + share * (end - at)) / (end - first)
        cell, at = cell + 1, end
    film[AREA] = area


def drag(foot: Any, film: Any, pressure: float, sphere: float, slip: float, time: float) -> None:
    """Replace the film by one that slip drags in, at half the speed of the foot.

    It is 0.643 R/2 (6 η U/T)^⅔ thick, as of a foil over a moving surface: the gap has twice the
    curvature 1/R of the free dome. Slow slip dries a dome.
    """
    tension, radius = 0.5 * pressure * sphere, sqrt(film[AREA] / pi)
    thickness = 0.3215 * sphere * (6.0 * foot.viscosity * slip / tension) ** (2.0 / 3.0)
    thickness, part = min(thickness, film[FRESH]), min(1.0, slip * time / (4.0 * radius))
    share, film[CORE] = dry(foot, thickness), film[CORE] + part * (thickness - film[CORE])
    for cell in range(FILM, FILM + min(int(film[AREA] / foot.cell) + 1, CELLS)):
        film[cell] += part * (share - film[cell])


def keep_rim(foot: Any, film: Any, sphere: float) -> None:
    """Write the film of the rim into its cells, before its edge moves."""
    if film[RIM] > 0.0 and film[AREA] > 0.0:
        area, edge = film[AREA], film[EDGE]
        radius = sqrt(edge / pi)
        at = pi * (radius - film[RIM]) * (radius - film[RIM])
        cell = int(at / foot.cell)
        while at < edge and cell < CELLS:
            first, full = cell * foot.cell, (cell + 1) * foot.cell
            end = min(edge, full)
            inwards = radius - sqrt(0.5 * (at + end) / pi)
            share = dry(foot, rim_film(film, sphere, inwards))
            part = (end - at) / (min(area, full) - first)
            film[FILM + cell] += part * (share - film[FILM + cell])
            cell, at = cell + 1, end


def rim_film(film: Any, sphere: float, inwards: float) -> float:
    """Return the thickness at a distance inwards from the edge of the contact, m: a wedge."""
    slope = film[CORE] / film[RIM]
    return max(0.78 * slope * slope * sphere, slope * inwards)


def level(foot: Any, film: Any, pressure: float, sphere: float, time: float) -> None:
    """Let the rim grow inwards, and the paraboloid drain that is left when it has met itself.

    The pressure of the air drives the liquid through the thinnest place of the wedge.
    """
    core, rim, radius = film[CORE], film[RIM], sqrt(film[EDGE] / pi)
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
    area, rim = film[AREA], film[RIM]
    if rim <= 0.0:
        return between_areas(foot, film, 0.0, area) / area
    edge, slope = film[EDGE], film[CORE] / rim
    radius, least = sqrt(edge / pi), rim_film(film, sphere, 0.0)
    total = between_areas(foot, film, 0.0, pi * (radius - rim) * (radius - rim))
    if edge < area:
        total += between_areas(foot, film, edge, area)
    for index in range(len(POINTS)):  # not by calls of `rim_film`, which take longer
        inwards = POINTS[index] * rim
        thickness = slope * inwards
        share = dry(foot, thickness if thickness > least else least)
        total += WEIGHTS[index] * rim * share * 2.0 * pi * (radius - inwards)
    return total / area


def between_areas(foot: Any, film: Any, start: float, end: float) -> float:
    """Return the dry area of cells between two areas, m²."""
    size = foot.cell
    first, last = int(start / size), int(end / size)
    if last > CELLS:
        last = CELLS
    if first >= last:
        return film[FILM + first] * (end - start) if first < CELLS else 0.0
    whole = 0.0
    for cell in range(FILM + first + 1, FILM + last):
        whole += film[cell]
    whole = whole * size + film[FILM + first] * ((first + 1) * size - start)
    return whole + film[FILM + last] * (end - last * size) if last < CELLS else whole


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
