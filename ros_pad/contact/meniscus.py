# SPDX-License-Identifier: Apache-2.0
"""Ring of liquid around a pressed dome, in closed form (thesis 3.65-3.82)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, instance, number, quantity
from ros_pad.contact.dome import Pressed
from ros_pad.contact.pad import Floats, broadcast, plain
from ros_pad.errors import InvalidInput

GRAVITY = 9.81  # m/s², as in the thesis' appendix


def contact_angle(solid_tension: npt.ArrayLike, surface_tension: npt.ArrayLike) -> Floats:
    """Return the contact angle of a liquid on a solid (thesis 3.81), rad, from 0 to pi/2.

    Parameters
    ----------
    solid_tension, surface_tension : float or array
        Surface energy of the solid and surface tension of the liquid, N/m, above 0. Their ratio
        must be from 0.25 (angle of 90 degrees) to 1 (complete wetting).

    Returns
    -------
    float or array
        Contact angle, rad: ``acos(2 √(solid_tension/surface_tension) - 1)``.

    Raises
    ------
    InvalidInput
        When a tension is not finite or not above 0, the ratio is out of range, or shapes do not
        broadcast.

    Examples
    --------
    >>> from ros_pad.contact import contact_angle
    >>> round(contact_angle(0.027, 0.073), 4)  # water on silicone; the appendix has 1.35
    1.3527
    """
    solid = quantity('solid_tension', solid_tension, 'N/m', above=True)
    liquid = quantity('surface_tension', surface_tension, 'N/m', above=True)
    solid, liquid = broadcast('solid_tension and surface_tension', solid, liquid)
    name = 'solid_tension / surface_tension'
    ratio = quantity(name, solid / liquid, '(ratio)', low=0.25, high=1.0)
    # acos(2 s - 1) with s = sqrt(ratio), in a form without cancellation at both ends.
    return plain(2.0 * np.arcsin(np.sqrt(1.0 - np.sqrt(ratio))))


@dataclass(frozen=True)
class Liquid:
    """A liquid on silicone.

    Parameters
    ----------
    surface_tension : float
        Surface tension of the liquid, N/m, above 0.
    solid_tension : float
        Surface energy of the solid, N/m, above 0.
    density : float
        Density, kg/m³, above 0.
    contact_angle : float, optional
        Contact angle, rad, from 0 to below pi. By default computed from the tensions (3.81).

    Raises
    ------
    InvalidInput
        When a value is out of range; without a contact angle also when the ratio of the tensions
        is out of the range of :func:`contact_angle`.
    """

    surface_tension: float
    solid_tension: float
    density: float = 1000.0
    contact_angle: float | None = None

    def __post_init__(self) -> None:
        number('surface_tension', self.surface_tension, 'N/m', above=True)
        number('solid_tension', self.solid_tension, 'N/m', above=True)
        number('density', self.density, 'kg/m³', above=True)
        if self.contact_angle is None:
            contact_angle(self.solid_tension, self.surface_tension)
        else:
            number('contact_angle', self.contact_angle, 'rad', high=math.nextafter(math.pi, 0))

    @property
    def angle(self) -> float:
        """Contact angle, rad: the given one, else the one computed from the tensions."""
        if self.contact_angle is None:
            return float(contact_angle(self.solid_tension, self.surface_tension))
        return self.contact_angle

    @property
    def weight(self) -> float:
        """Specific weight, N/m³."""
        return self.density * GRAVITY

    @property
    def capillary_length(self) -> float:
        """Height, m, at which weight and surface tension are about equal."""
        return math.sqrt(self.surface_tension / self.weight)


WATER = Liquid(surface_tension=0.073, solid_tension=0.027)
"""Water at 20 °C on silicone: tensions 0.073 and 0.027 N/m, contact angle 77.5 degrees."""

THESIS_LIQUID = Liquid(surface_tension=0.0073, solid_tension=0.0027, contact_angle=1.35)
"""The liquid of the thesis' appendix; its tensions are a tenth of those of water and silicone."""


@dataclass(frozen=True)
class Meniscus:
    """The ring of liquid around a contact. Floats for scalar input, arrays otherwise.

    Attributes
    ----------
    height : float or array
        Height to which the liquid climbs the wall, m.
    ring_radius : float or array
        Radius of the line where liquid, wall and air meet, m (r_i).
    tangential_force : float or array
        Laplace pressure times the section of the ring, N (F_cap). This is an upper bound for one
        side of the ring; over a whole symmetric ring the force cancels.
    status : str or array of str
        Status of the pressed dome; with ``no_contact`` there is no ring and the numbers are 0.
    """

    height: Floats
    ring_radius: Floats
    tangential_force: Floats
    status: Floats


def meniscus(pressed: Pressed, liquid: Liquid, reading: str = 'corrected') -> Meniscus:
    """Compute the ring of liquid around a pressed dome.

    Parameters
    ----------
    pressed : Pressed
        Result of :func:`ros_pad.contact.press`.
    liquid : Liquid
        Liquid on the pad; its contact angle is ``liquid.angle``.
    reading : {'corrected', 'thesis'}
        ``thesis`` evaluates 3.80, 3.77 and 3.82 as printed. ``corrected`` solves the weight
        balance exactly, with the tension of the liquid (not of the solid), and uses the correct
        sign of the curvature around the ring in 3.70.

    Returns
    -------
    Meniscus
        Height and ring radius, m, tangential force, N, and status, floats or arrays as in
        ``pressed``.

    Raises
    ------
    InvalidInput
        When an argument has the wrong type, the reading is unknown, or contact angle plus wall
        angle reach pi: then the liquid is pushed down and forms no ring.

    Notes
    -----
    With wall angle α, ``C = cot α``, ring radius ``b + h C`` and tension γ the weight balance is
    ``ρ g C h² (3b + 2hC) = 6 γ sin(θ + α) (b + hC)``. In ``y = hC/b`` this is
    ``y² (3 + 2y) = m (1 + y)``; 3.80 is ``y² = m/2``.

    Examples
    --------
    The thesis' program has 0.0667953 mN with pi = 3.1415:

    >>> from ros_pad.contact import LARGE_PAD, THESIS_LIQUID, meniscus, press
    >>> ring = meniscus(press(LARGE_PAD, 75e3, 0.19), THESIS_LIQUID, reading='thesis')
    >>> round(1e3 * ring.tangential_force, 4)  # mN
    0.0668
    """
    choice('reading', reading, ('corrected', 'thesis'))
    instance('pressed', pressed, Pressed)
    instance('liquid', liquid, Liquid)
    status = np.asarray(pressed.status)
    b, sphere = np.asarray(pressed.contact_radius), np.asarray(pressed.sphere_radius)
    touching = b > 0
    # Rows without a ring are computed with harmless values and replaced at the end.
    b, sphere = np.where(touching, b, 1.0), np.where(touching, sphere, 2.0)
    across = np.sqrt((sphere - b) * (sphere + b))
    theta = liquid.angle
    rise = (math.sin(theta) * across + math.cos(theta) * b) / sphere  # sin(θ + α)
    if np.any(touching & (rise <= 0)):
        steepest = float(np.max(np.where(touching, np.arcsin(b / sphere), 0.0)))
        raise InvalidInput(
            f'contact_angle = {theta:g} rad is not allowed on this wall: '
            f'below {math.pi - steepest:g} rad is needed'
        )

    rise = np.where(touching, rise, 1.0)
    corrected = reading == 'corrected'
    tension = liquid.surface_tension if corrected else liquid.solid_tension
    m = 6.0 * tension * rise * across / (liquid.weight * b**3)
    y = np.sqrt(0.5 * m)
    if corrected:
        for _ in range(7):  # convex, and 3.80 is above the root: Newton's method converges
            y = y - (((2.0 * y + 3.0) * y - m) * y - m) / ((6.0 * y + 6.0) * y - m)
    height = y * b * b / across
    ring = b * (1.0 + y)
    section = 2.0 * ring - height if corrected else 2.0 * ring + height
    force = 2.0 * liquid.surface_tension * section

    nothing = np.where(status == 'no_contact', 0.0, np.nan)
    height, ring, force = (np.where(touching, v, nothing) for v in (height, ring, force))
    if status.ndim == 0:
        return Meniscus(float(height), float(ring), float(force), str(status))
    return Meniscus(height, ring, force, status)


def hysteresis_force(
    contact_radius: npt.ArrayLike,
    surface_tension: npt.ArrayLike,
    advancing_angle: npt.ArrayLike,
    receding_angle: npt.ArrayLike,
) -> Floats:
    """Return the largest lateral force of a pinned contact line, N. Arrays broadcast.

    Parameters
    ----------
    contact_radius : float or array
        Radius of the wetted disc, m, from 0.
    surface_tension : float or array
        Surface tension of the liquid, N/m, above 0.
    advancing_angle, receding_angle : float or array
        Contact angles at which the line starts to move forwards and backwards, rad, from 0 to pi;
        advancing >= receding.

    Returns
    -------
    float or array
        Force, N.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range, or shapes do not broadcast.

    Notes
    -----
    ``γ w (cos θ_receding - cos θ_advancing)`` with w twice the contact radius, which is the upper
    bound: two constant angles, one for each half of the line. A cosine of the contact angle in
    proportion to the cosine of the azimuth has pi/4 of it. The tangential
    force of a symmetric ring is zero, so a ring can resist motion by this hysteresis only. 3.82
    without its second radius is this bound for angles of 180 and 0 degrees.

    Examples
    --------
    >>> round(1e6 * hysteresis_force(0.8e-3, 0.073, 2.0944, 1.5708), 1)
    58.4
    """
    r = quantity('contact_radius', contact_radius, 'm')
    tension = quantity('surface_tension', surface_tension, 'N/m', above=True)
    ahead = quantity('advancing_angle', advancing_angle, 'rad', high=math.pi)
    back = quantity('receding_angle', receding_angle, 'rad', high=math.pi)
    names = 'contact_radius, surface_tension and angles'
    r, tension, ahead, back = broadcast(names, r, tension, ahead, back)
    quantity('advancing_angle - receding_angle', ahead - back, 'rad')
    # cos(back) - cos(ahead), without cancellation.
    drop = 2.0 * np.sin(0.5 * (ahead + back)) * np.sin(0.5 * (ahead - back))
    return plain(tension * 2.0 * r * drop)


def capillary_pull(
    radius: npt.ArrayLike, film: npt.ArrayLike, liquid: Liquid, gravity: float = GRAVITY
) -> Floats:
    """Return an upper bound of the force with which liquid pulls a pad to the floor, N.

    It holds for round pads of any form, any contact angles and any amount of liquid, at rest.

    Parameters
    ----------
    radius : float or array
        Radius of the largest disc of the pad that is wetted, m, from 0: of a dome that of its rim,
        of a flat sole that of the sole.
    film : float or array
        Least height of the contact line on the pad above the floor, m, above 0 and at most two
        capillary lengths: the film on ground that stays wet.
    liquid : Liquid
        Its contact angle is not used.
    gravity : float
        Gravity, m/s², from 0.

    Returns
    -------
    float or array
        Force, N, broadcast over radius and film.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range, or shapes do not broadcast.

    Notes
    -----
    ``2π γ r + π r² (2γ/h + ρ g h/2)``: tension along the line, and suction on the whole disc,
    contact included. Along a meridian from the floor to the line, at height H, Young and Laplace
    give ``∫ p dz = γ (cos φ_floor - cos φ_line + ∫ sin φ/r dz) >= -2γ``, so that suction at the
    line is at most ``2γ/H + ρ g H/2``. For H from h to ``4γ/(ρ g h)`` this is largest at h, and
    liquid rises by two capillary lengths at most.

    Examples
    --------
    >>> from ros_pad.contact import WATER
    >>> round(1e3 * capillary_pull(1.5e-3, 3e-4, WATER), 2)
    4.14
    """
    instance('liquid', liquid, Liquid)
    weight, tension = liquid.density * number('gravity', gravity, 'm/s²'), liquid.surface_tension
    most = 2.0 * math.sqrt(tension / weight) if weight else math.inf
    r, h = quantity('radius', radius, 'm'), quantity('film', film, 'm', high=most, above=True)
    r, h = broadcast('radius and film', r, h)
    suction = 2.0 * tension / h + 0.5 * weight * h
    return plain(math.pi * r * (2.0 * tension + r * suction))
