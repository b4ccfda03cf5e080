# SPDX-License-Identifier: Apache-2.0
"""Shape of an inflated pad, free (thesis 3.34-3.41, 3.60) and pressed on a floor (3.44-3.61).

Units inside this module: lengths are divided by the pad radius, pressure is ``P = p r/k``, force
is ``f = F/(pi k r)`` and adhesion is ``a = sign * adhesion_energy/k``. In these units all pads are
the same, and pi appears only in the force.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, instance, number, quantity
from ros_pad.contact.pad import Array, Floats, Pad, broadcast
from ros_pad.errors import NoEquilibrium

# Sign of the adhesion term: the program in the appendix of the thesis adds this term.
ADHESION_SIGNS = {'matlab': 1.0, 'none': 0.0}
MODELS = ('thesis', 'membrane')

# Pressure ``P`` from which on the free dome grows without limit and has no equilibrium.
BURST = 6.0

Codes: TypeAlias = npt.NDArray[np.int8]
STATUS = np.array(['ok', 'no_contact', 'flattened', 'fold_zone', 'no_inflation', 'out_of_range'])
OK, NO_CONTACT, FLATTENED, FOLD_ZONE, NO_INFLATION, OUT_OF_RANGE = range(6)

# Lengths, status codes, and by code the most that is allowed: a force, N, or a pressure, Pa.
Solved: TypeAlias = tuple[Array, Codes, dict[int, float]]

_WHY = {
    FLATTENED: 'the contact would cover the whole pad: a force below {:.6g} N is needed',
    FOLD_ZONE: 'the shape depends on the history of the load: at most {:.6g} Pa is allowed',
    NO_INFLATION: 'it would balloon: the pressure has its maximum at {:.6g} Pa',
    OUT_OF_RANGE: 'it would leave the range of its material: at most {:.6g} Pa is allowed',
}


class Inflated(NamedTuple):
    """A free dome. Floats for scalar input, arrays of the input's shape otherwise.

    Attributes
    ----------
    height : float or array
        Height of the dome, m.
    sphere_radius : float or array
        Radius of its sphere, m; infinite for a flat pad.
    volume : float or array
        Volume under the dome, m³.
    status : str or array of str
        ``ok``; or ``no_inflation``, or with a material ``out_of_range``, where the numbers are
        NaN.
    """

    height: Floats
    sphere_radius: Floats
    volume: Floats
    status: Floats


class Pressed(NamedTuple):
    """A dome pressed on a floor. Floats for scalar input, arrays of the broadcast shape otherwise.

    Attributes
    ----------
    height : float or array
        Height of the complete spherical cap, m (c2 in the thesis).
    depth : float or array
        Depth that the floor cuts off the cap, m (a).
    contact_radius : float or array
        Radius of the contact with the floor, m (b).
    sphere_radius : float or array
        Radius of the sphere, m (R2).
    gap : float or array
        Distance from pad base to floor, m: ``height - depth``, computed without cancellation.
    status : str or array of str
        ``ok``; ``no_contact`` (the free dome, contact radius 0); or ``flattened``, ``fold_zone``,
        ``no_inflation``, ``out_of_range``, where the numbers are NaN.
    """

    height: Floats
    depth: Floats
    contact_radius: Floats
    sphere_radius: Floats
    gap: Floats
    status: Floats


def inflate(pad: Pad, pressure: npt.ArrayLike) -> Inflated:
    """Compute the free dome of a pad.

    Parameters
    ----------
    pad : Pad
        Size and material.
    pressure : float or array
        Gauge pressure, Pa, from 0; below ``6 stiffness/radius`` there is exactly one dome. A pad
        of a material ends at its maximum pressure, or at the end of the material's range
        (:mod:`ros_pad.contact.hyperelastic`).

    Returns
    -------
    Inflated
        Height, m, sphere radius, m, volume, m³, and status, each a float or an array of the shape
        of the pressure.

    Raises
    ------
    NoEquilibrium
        For a scalar pressure at or above that bound, status ``no_inflation``, or
        ``out_of_range`` where the material's range ends first.
    InvalidInput
        When a pressure is negative or not finite.

    Notes
    -----
    Thesis 3.60 with F = 0, that is ``P = 6 sin t - 2 sin 2t`` and ``height = radius tan t``. The
    heights measured there are 1.25, 1.6, 2.0 and 2.4 mm at 55, 65, 75 and 85 kPa.

    Examples
    --------
    >>> from ros_pad.contact import LARGE_PAD, inflate
    >>> round(1e3 * inflate(LARGE_PAD, 75e3).height, 6)  # mm
    1.941268
    >>> domes = inflate(LARGE_PAD, [55e3, 85e3, 200e3])
    >>> (1e3 * domes.height).round(2).tolist(), domes.status.tolist()
    ([1.38, 2.29, nan], ['ok', 'ok', 'no_inflation'])
    """
    instance('pad', pad, Pad)
    p = quantity('pressure', pressure, 'Pa')
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import inflate_rubber

        solved = inflate_rubber(pad, np.ravel(p))
    else:
        solved = _inflate_caps(pad, np.ravel(p))
    return Inflated(*_told(solved, np.shape(p), lambda: f'pressure = {p:g} Pa on {pad}'))


def press(
    pad: Pad,
    pressure: npt.ArrayLike,
    force: npt.ArrayLike,
    adhesion: str = 'matlab',
    model: str = 'thesis',
) -> Pressed:
    """Compute the dome of a pad pressed on a floor, on the branch of the free dome.

    Parameters
    ----------
    pad : Pad
        Size and material.
    pressure : float or array
        Gauge pressure, Pa, from 0. The thesis' model ends at ``P = p r/k`` of about 3.425
        (91.3 kPa for the large pad): above, the same force has several equilibria. The membrane
        has one equilibrium up to P = 5.14, and up to bursting if the force is at most 0.71 of
        ``pressure pi radius²``.
    force : float or array
        Normal force on this one pad, N, from 0. Broadcasts with the pressure.
    adhesion : {'matlab', 'none'}
        Adhesion that attracts, as in the thesis' program (default), or none. The membrane has
        none: it meets the floor at a tangent.
    model : {'thesis', 'membrane'}
        The spherical dome of thesis 3.44-3.61, or the exact membrane of the same energy
        (:mod:`ros_pad.contact.membrane`). A pad of a material is an exact membrane in both cases
        (:mod:`ros_pad.contact.hyperelastic`).

    Returns
    -------
    Pressed
        Height, depth, contact radius, sphere radius and gap, m, and status, each a float or an
        array of the broadcast shape.

    Raises
    ------
    NoEquilibrium
        For scalar input without an equilibrium in the model. Its status is ``flattened`` (the
        contact would cover the whole pad), ``fold_zone`` (pressure above the end of the model),
        ``no_inflation`` (pressure at which even the free dome has no equilibrium) or
        ``out_of_range`` (pressure at which the free dome is outside the material's range).
    InvalidInput
        When a value is negative or not finite, shapes do not broadcast, ``adhesion`` or ``model``
        is unknown, or ``adhesion_energy`` is above 0.01 ``stiffness``.

    Notes
    -----
    Force balances of thesis 3.53 and 3.58 with the cap geometry of 3.48, reduced to one equation
    in the height. A root is returned only if it passes the certificate: the depth at this height
    is continuous with the free dome, the floor is above the pad base and the contact is inside the
    rim.

    Examples
    --------
    The measured contact radius at 0.19 N, as the thesis' program has it, is 0.98 mm:

    >>> from ros_pad.contact import LARGE_PAD, press
    >>> dome = press(LARGE_PAD, 75e3, 0.19)
    >>> round(1e3 * dome.contact_radius, 3), round(1e3 * dome.gap, 3), dome.status  # mm
    (0.898, 0.974, 'ok')
    >>> press(LARGE_PAD, 75e3, [0.0, 0.6]).status.tolist()
    ['ok', 'flattened']
    """
    instance('pad', pad, Pad)
    choice('model', model, MODELS)
    choice('adhesion', adhesion, tuple(ADHESION_SIGNS))
    p, load = quantity('pressure', pressure, 'Pa'), quantity('force', force, 'N')
    p, load = broadcast('pressure and force', p, load)
    rows = pad, np.ravel(p), np.ravel(load)
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import press_rubber

        lengths, code, most = press_rubber(*rows)
    elif model == 'membrane':
        from ros_pad.contact.membrane import press_membrane

        lengths, code, most = press_membrane(*rows)
    else:
        lengths, code, most = _press_caps(*rows, signed_adhesion(pad, adhesion))
    return Pressed(
        *_told(
            (lengths * pad.radius, code, most),
            p.shape,
            lambda: f'pressure = {p:g} Pa, force = {load:g} N on {pad}',
        )
    )


def _told(solved: Solved, shape: tuple[int, ...], given: Callable[[], str]) -> tuple[Any, ...]:
    """Return values and status; for a scalar floats, or raise `NoEquilibrium` with the reason."""
    values, code, most = solved
    if shape:
        return *values.reshape(-1, *shape), STATUS[code].reshape(shape)
    status = int(code[0])
    if status in _WHY:
        why = _WHY[status].format(most[status])
        if status == FLATTENED and most[status] <= 0.0:
            why = 'where adhesion alone holds the pad flat, more pressure is needed'
        raise NoEquilibrium(f'{given()}: {why}', str(STATUS[status]))
    return *values[:, 0].tolist(), str(STATUS[status])


# --- the free dome -------------------------------------------------------------------------------


def free_height(tension: Array, deficit: Array) -> Array:
    """Return height over radius of the free dome, to rounding error.

    Parameters
    ----------
    tension : array
        ``P = p r/k``, from 0 to 6.
    deficit : array
        ``6 - P``, given separately because ``6 - tension`` loses digits near 6.

    Notes
    -----
    With ``w = tan(t/2)`` the pressure is rational, ``P = 4 w (1 + 5 w²)/(1 + w²)²``, and the
    height is ``2 w/(1 - w²)``, without trigonometric functions.
    """
    w = tension / 6.0
    for _ in range(6):
        square = w * w
        pull = tension * (1.0 + square)
        misfit = w * (4.0 + 20.0 * square) - pull * (1.0 + square)
        w = w - misfit / (4.0 + 60.0 * square - 4.0 * w * pull)
    # Near the bursting pressure the digits are in v = 1 - w.
    v = 1.0 - w
    for _ in range(2):
        square = 2.0 + v * (v - 2.0)
        residual = v * (16.0 + v * (-12.0 + v * (-4.0 + 6.0 * v))) - deficit * square * square
        slope = 16.0 + v * (-24.0 + v * (-12.0 + 24.0 * v))
        v = v - residual / (slope - 4.0 * deficit * square * (v - 1.0))
    tall = 2.0 * (1.0 - v) / (v * (2.0 - v))
    return np.where(tension > 5.0, tall, 2.0 * w / ((1.0 - w) * (1.0 + w)))


def deficit(pad: Pad, pressure: Array) -> Array:
    """Return ``6 - P``."""
    return (BURST * pad.stiffness / pad.radius - pressure) * (pad.radius / pad.stiffness)


@np.errstate(divide='ignore', over='ignore')  # a flat pad has an infinite radius
def _inflate_caps(pad: Pad, p: Array) -> Solved:
    """Return height, m, sphere radius, m, and volume, m³."""
    r, left = pad.radius, deficit(pad, p)
    code = np.where(left <= 0.0, NO_INFLATION, OK).astype(np.int8)
    x = free_height(np.where(code, np.nan, p * (r / pad.stiffness)), left)
    volume = math.pi / 6.0 * r**3 * x * (3.0 + x * x)
    most = {NO_INFLATION: BURST * pad.stiffness / r}
    return np.stack([r * x, 0.5 * r * (x + 1.0 / x), volume]), code, most


# --- the pressed dome ----------------------------------------------------------------------------


def signed_adhesion(pad: Pad, adhesion: str) -> float:
    """Return the relative adhesion ``a`` of a pad; raise `InvalidInput` above 0.01."""
    most = 0.01 * pad.stiffness  # up to there the branch structure was checked
    number('adhesion_energy', pad.adhesion_energy, 'J/m²', high=most)
    return ADHESION_SIGNS[adhesion] * pad.adhesion_energy / pad.stiffness


def largest_tension(a: float) -> float:
    """Return the pressure ``P`` up to which every force has one equilibrium on the branch.

    Above P = 3.4263 - 4.1 a (91.368 kPa for the large pad without adhesion) the curve of force
    over height is S-shaped; the returned bound is slightly lower.
    """
    return 3.426 - 4.5 * a


def flattening_force(tension: Floats, a: float) -> Floats:
    """Return the force ``f`` at which the contact reaches the rim.

    At this force height x equals depth, and 3.53 and 3.58 reduce to
    ``P x³ - (2 - a) x² + a = 0`` with ``f = P (1 + x²) - 2x``. To first order
    ``f = P - sqrt(2a)``. It is negative where adhesion alone holds the pad flat.
    """
    if a == 0.0:
        return tension
    x = math.sqrt(a / (2.0 - a))
    for _ in range(6):
        x = x - ((tension * x - (2.0 - a)) * x * x + a) / (
            (3.0 * tension * x - 2.0 * (2.0 - a)) * x
        )
    return tension * (1.0 + x * x) - 2.0 * x


# Only domes lower than an atom overflow or underflow; these fail the certificate.
@np.errstate(divide='ignore', invalid='ignore', over='ignore')
def _press_caps(pad: Pad, p: Array, load: Array, a: float) -> Solved:
    """Return height, depth, contact radius, sphere radius and gap over the radius."""
    unit, area = pad.stiffness / pad.radius, math.pi * pad.stiffness * pad.radius
    tension, f = p * (pad.radius / pad.stiffness), load / area
    flat = flattening_force(tension, a)
    # Domes lower than an atom would overflow: they count as flat.
    code = np.where(np.maximum(f, 1e-300) >= flat, FLATTENED, OK).astype(np.int8)
    code[tension > largest_tension(a)] = FOLD_ZONE
    left = deficit(pad, p)
    code[left <= 0.0] = NO_INFLATION
    if a == 0.0:
        code[(code == OK) & (f == 0.0)] = NO_CONTACT
    most = {FOLD_ZONE: largest_tension(a) * unit, NO_INFLATION: BURST * unit}
    most[FLATTENED] = float(flat[0]) * area
    lengths = np.full((5, p.size), np.nan)
    free = code == NO_CONTACT
    x = free_height(tension[free], left[free])
    lengths[:, free] = x, 0.0 * x, 0.0 * x, 0.5 * (x + 1.0 / x), x
    rows = code == OK
    tension, f = tension[rows], f[rows]
    x = _heights(tension, f, a)
    code[rows] = np.where(np.isnan(x), FLATTENED, OK)
    *_, rho, spread, depth = _balance(x, tension, f, a)
    # gap = (1 - b²)/(1/c2 - depth), without cancellation where the dome is nearly flat.
    gap = ((tension - f) - 2.0 * a * rho) / tension / (1.0 / x - depth)
    lengths[:, rows] = x, depth, np.sqrt(spread), rho, gap
    return lengths, code, most


def _heights(tension: Array, f: Array, a: float) -> Array:
    """Return the heights in equilibrium; NaN where no root passes the certificate.

    Newton's method inside a bracket. A trial height is too small where the residual is positive
    and the certificate holds; elsewhere, also where no sphere of this height has this contact, it
    is too large. So the bracket closes on the physical root only: between the unphysical roots
    near flattening the certificate fails.
    """
    found, active = np.full_like(tension, np.nan), np.arange(tension.size)
    low, high = (tension - f) / 8.0, 0.6 * tension
    x, last = np.minimum(0.45 * (tension - f), high), high
    for _ in range(200):
        residual, slope, certificate, _, spread, depth = _balance(x, tension, f, a)
        newton = x - residual / slope
        # The step is so short that the next one would be a rounding error, and that the
        # certificate cannot change its sign over the step.
        settled = (abs(newton - x) <= 1e-7 * x) & (slope < 0.0) & (certificate > 1e-5)
        settled &= (spread <= 1.0 + 1e-9) & (depth <= x * (1.0 + 1e-6))
        found[active[settled]] = newton[settled]
        small = (certificate > 0.0) & (residual > 0.0)
        low, high = np.where(small, x, low), np.where(small, high, x)
        # Take Newton's step if it stays inside and is at most half of the last; else bisect ln x.
        good = (slope < 0.0) & (low <= newton) & (newton <= high)
        good &= abs(newton - x) <= 0.5 * last
        new: Array = np.where(good, newton, np.sqrt(low * high))
        go = ~settled & (high - low > 2e-16 * high)
        if not go.any():
            break
        active, last = active[go], abs(new - x)[go]
        x, low, high, tension, f = (each[go] for each in (new, low, high, tension, f))
    return found


def _balance(x: Array, tension: Array, f: Array, a: float) -> tuple[Array, ...]:
    """Evaluate the equilibrium at a trial height x.

    Terms of order P are subtracted once, as ``P - f``, so that the residual keeps its digits near
    flattening.

    Returns
    -------
    residual : array
        Residual of 3.58. At the equilibrium it changes from positive to negative.
    slope : array
        Derivative of the residual over the height.
    certificate : array
        Positive where the depth at this height is continuous with the free dome.
    rho : array
        Radius of the sphere.
    spread : array
        Squared contact radius (3.53).
    depth : array
        Depth that the floor cuts off (3.48).
    """
    inverse = 1.0 / x
    rho = 0.5 * (x + inverse)
    rho_slope = 0.5 - 0.5 * inverse * inverse
    spread = (f + 2.0 * a * rho) / tension
    wall = np.sqrt(rho * rho - spread)
    depth = spread / (rho + wall)
    depth_slope = rho_slope * (a / tension - depth) / wall
    lift = x + depth
    sigma = np.sqrt(1.0 + (x - depth) * lift)
    pull = 3.0 * sigma - 2.0
    stretch = 3.0 * lift / sigma
    residual = 0.5 * ((tension - f) + tension * (x * x + depth * depth)) + a * rho - lift * pull
    slope = (
        tension * (x + depth * depth_slope)
        + a * rho_slope
        - (1.0 + depth_slope) * pull
        - stretch * (x - depth * depth_slope)
    )
    certificate = tension * (wall - depth) + pull - depth * stretch
    return residual, slope, certificate, rho, spread, depth
