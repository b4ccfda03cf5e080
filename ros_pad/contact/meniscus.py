# SPDX-License-Identifier: Apache-2.0
"""Liquid ring round a pressed dome, in closed form (thesis 3.65-3.82)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.contact.dome import Pressed
from ros_pad.contact.pad import Floats
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.contact.pad import quantity
from ros_pad.errors import InvalidInput

GRAVITY = 9.81  # m/s², as in the thesis' appendix


def contact_angle(solid_tension: npt.ArrayLike, surface_tension: npt.ArrayLike) -> Floats:
    """Return the contact angle of a liquid on a solid (thesis 3.81), rad, from 0 to pi/2.

    Parameters
    ----------
    solid_tension, surface_tension : float or array
        Of the solid and of the liquid, N/m. The solid's must be from a quarter of the liquid's
        (90 degrees) to all of it (complete wetting); elsewhere the formula means nothing.

    Raises
    ------
    InvalidInput
        For tensions that are not positive or finite, or outside that ratio.
    """
    solid = quantity('solid_tension', solid_tension, 'N/m', above=True)
    liquid = quantity('surface_tension', surface_tension, 'N/m', above=True)
    try:
        ratio = solid / liquid
    except ValueError as error:
        raise InvalidInput('solid_tension and surface_tension do not broadcast') from error
    ratio = quantity('solid_tension / surface_tension', ratio, '(ratio)', low=0.25, high=1.0)
    # acos(2 s - 1) with s = sqrt(ratio), in the form that keeps its digits at both ends.
    angle = 2.0 * np.arcsin(np.sqrt(1.0 - np.sqrt(ratio)))
    return float(angle) if np.ndim(angle) == 0 else angle


@dataclass(frozen=True)
class Liquid:
    """A liquid on silicone.

    Parameters
    ----------
    surface_tension : float
        Of the liquid, N/m, above 0.
    solid_tension : float
        Surface energy of the solid, N/m, above 0.
    density : float
        kg/m³, above 0.
    contact_angle : float, optional
        rad, from 0 to below pi. By default it follows from the two tensions (3.81).

    Raises
    ------
    InvalidInput
        When a value is out of range, or no contact angle is given and the tensions have none.
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
        """Contact angle in use, rad: the one given, else that of the tensions."""
        if self.contact_angle is None:
            return float(contact_angle(self.solid_tension, self.surface_tension))
        return self.contact_angle


WATER = Liquid(surface_tension=0.073, solid_tension=0.027)
# Both tensions of the thesis' appendix are ten times below those of water and silicone.
THESIS_LIQUID = Liquid(surface_tension=0.0073, solid_tension=0.0027, contact_angle=1.35)


@dataclass(frozen=True)
class Meniscus:
    """The ring of liquid round a contact. Floats for scalar input, arrays otherwise.

    Attributes
    ----------
    height : m, how far the liquid climbs the wall.
    ring_radius : m, of the ring where liquid, wall and air meet (r_i).
    tangential_force : N, Laplace pressure times the ring's section (F_cap). It is the bound that
        one side alone would feel: round a whole symmetric ring it cancels.
    status : that of the pressed dome; with ``no_contact`` there is no ring and all are 0.
    """

    height: Floats
    ring_radius: Floats
    tangential_force: Floats
    status: Floats


def meniscus(pressed: Pressed, liquid: Liquid, reading: str = 'corrected') -> Meniscus:
    """Return the liquid ring round a pressed dome.

    Parameters
    ----------
    pressed : Pressed
        What :func:`ros_pad.contact.press` returned.
    liquid : Liquid
        What wets the pad; its contact angle is ``liquid.angle``.
    reading : {'corrected', 'thesis'}
        ``thesis`` evaluates 3.80, 3.77 and 3.82 as printed. ``corrected`` solves the weight
        balance exactly, hangs the weight from the liquid's tension, and takes the ring's own
        curvature with its right sign in 3.70.

    Raises
    ------
    InvalidInput
        For an unknown reading, or where contact angle and wall angle together reach pi: there
        the liquid is pushed down and has no ring.

    Notes
    -----
    With wall angle α, ``C = cot α``, ring radius ``b + h C`` and tension γ the weight balance is
    ``ρ g C h² (3b + 2hC) = 6 γ sin(θ + α) (b + hC)``. In ``y = hC/b`` this is
    ``y² (3 + 2y) = m (1 + y)``; 3.80 is ``y² = m/2``.
    """
    choice('reading', reading, ('corrected', 'thesis'))
    if not isinstance(pressed, Pressed):
        raise InvalidInput(
            f'pressed = {pressed!r} is not allowed: the result of press() is needed'
        )
    if not isinstance(liquid, Liquid):
        raise InvalidInput(f'liquid = {liquid!r} is not allowed: a Liquid is needed')
    status = np.asarray(pressed.status)
    b, sphere = np.asarray(pressed.contact_radius), np.asarray(pressed.sphere_radius)
    touching = b > 0
    # Rows without a ring go through the formulas as a harmless one.
    b, sphere = np.where(touching, b, 1.0), np.where(touching, sphere, 2.0)
    across = np.sqrt((sphere - b) * (sphere + b))
    theta = liquid.angle
    rise = (math.sin(theta) * across + math.cos(theta) * b) / sphere  # sin(θ + α)
    if np.any(touching & (rise <= 0)):
        raise InvalidInput(
            f'contact_angle = {theta:g} rad is not allowed on this wall: '
            f'below {math.pi - float(np.max(np.arcsin(b / sphere))):g} rad is needed'
        )

    rise = np.where(touching, rise, 1.0)
    corrected = reading == 'corrected'
    tension = liquid.surface_tension if corrected else liquid.solid_tension
    m = 6.0 * tension * rise * across / (liquid.density * GRAVITY * b**3)
    y = np.sqrt(0.5 * m)
    if corrected:
        for _ in range(7):  # convex, and 3.80 is above the root: Newton falls on it
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
    shape_factor: npt.ArrayLike = 1.0,
) -> Floats:
    """Return the lateral force that pinning of a liquid ring can resist, N. Arrays broadcast.

    Parameters
    ----------
    contact_radius : float or array
        Of the wetted disc, m, from 0.
    surface_tension : float or array
        Of the liquid, N/m, above 0.
    advancing_angle, receding_angle : float or array
        Contact angles at which the line starts to move on and back, rad, from 0 to pi, the
        advancing one at least the receding one.
    shape_factor : float or array
        K, from pi/4 (the angle's cosine follows that of the azimuth) to 1 (it jumps between the
        two halves of the line), which bounds the force.

    Raises
    ------
    InvalidInput
        For values that are not finite, not in range or do not broadcast.

    Notes
    -----
    ``K γ w (cos θ_receding - cos θ_advancing)`` with w twice the contact radius. It is what a
    symmetric ring, whose net tangential force is zero, can resist at most; 3.82 without its second
    radius is this bound for angles of 180 and 0 degrees.

    Examples
    --------
    >>> round(1e6 * hysteresis_force(0.8e-3, 0.073, 2.0944, 1.5708), 1)
    58.4
    """
    r = quantity('contact_radius', contact_radius, 'm')
    tension = quantity('surface_tension', surface_tension, 'N/m', above=True)
    ahead = quantity('advancing_angle', advancing_angle, 'rad', high=math.pi)
    back = quantity('receding_angle', receding_angle, 'rad', high=math.pi)
    factor = quantity('shape_factor', shape_factor, '(factor)', low=0.25 * math.pi, high=1.0)
    try:
        quantity('advancing_angle - receding_angle', ahead - back, 'rad')
        # cos(back) - cos(ahead), without cancellation.
        drop = 2.0 * np.sin(0.5 * (ahead + back)) * np.sin(0.5 * (ahead - back))
        force = factor * tension * 2.0 * r * drop
    except InvalidInput:
        raise
    except ValueError as error:
        raise InvalidInput('radius, tension, angles and factor do not broadcast') from error
    return float(force) if np.ndim(force) == 0 else force
