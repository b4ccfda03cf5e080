# SPDX-License-Identifier: Apache-2.0
"""Shape of an inflated pad, free (thesis 3.34-3.41, 3.60) and pressed on a floor (3.44-3.61).

Units inside this module: lengths are divided by the pad radius, pressure is ``P = p r/k``, force
is ``f = F/(pi k r)`` and adhesion is ``a = sign * adhesion_energy/k``. In these units all pads are
the same, and pi appears only in the force.

The formulas work on floats and on arrays; the matching square root is passed in. A single dome is
found by Newton's method inside a bracket. A batch takes three or four plain Newton steps from a
polynomial start value. Rows that fail the certificate of the branch go to the solver for one dome.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, instance, quantity
from ros_pad.contact.pad import Array, Floats, Pad, broadcast
from ros_pad.errors import InvalidInput, NoEquilibrium

# Sign of the adhesion term: the program in the appendix of the thesis adds this term, the text
# (3.43) subtracts it.
ADHESION_SIGNS = {'matlab': 1.0, 'text': -1.0, 'none': 0.0}
MODELS = ('thesis', 'membrane')

# Pressure ``P`` from which on the free dome grows without limit and has no equilibrium.
BURST = 6.0
# Largest relative adhesion ``a`` for which the branch structure below was checked.
LARGEST_ADHESION = 0.01

Codes: TypeAlias = npt.NDArray[np.int8]
STATUS = np.array(['ok', 'no_contact', 'flattened', 'fold_zone', 'no_inflation', 'out_of_range'])
OK, NO_CONTACT, FLATTENED, FOLD_ZONE, NO_INFLATION, OUT_OF_RANGE = range(6)
# Least-squares fits for start values of Newton's method; they affect time, not results.
# tan of half the edge angle of the free dome, over P, by falling powers of P up to 6: error 4e-4.
_FREE_SEED = (
    *(1.50052e-07, -6.18748e-06, 1.0885e-04, -1.0662e-03, 6.39084e-03),
    *(-2.41485e-02, 5.63496e-02, -7.00170e-02, 3.55966e-03, 2.49909e-01),
)
# Pressed height over ``P (1 - f/P)``: rows by falling powers of P, columns by those of f/P. The
# error is below 4e-3 in half of the domain, up to 0.4 at high pressure and large force.
_PRESSED_SEED = (
    (-0.0081003, 0.030039, -0.019133, 0.0054206),
    (-0.16593, 0.12952, 0.013939, -0.0083308),
    (0.38013, -0.5985, 0.27807, -0.034428),
    (-0.15422, 0.3986, -0.50011, 0.50239),
)

# Rows of a batch computed at a time, so that temporary arrays fit the processor's cache.
_CHUNK = 16384


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
        (:mod:`ros_pad.contact.hyperelastic`) or, with an edge, of the correction for thickness.

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

        return inflate_rubber(pad, p)
    if isinstance(p, float):
        p = float(p)
        deficit = _deficit(pad, p)
        if deficit <= 0.0:
            _refuse(NO_INFLATION, pad, p)
        height = free_height(p * (pad.radius / pad.stiffness), deficit)
        height, sphere, volume = _free_cap(pad.radius, height, height > 0.0)
        return Inflated(height, sphere, volume, 'ok')
    rows = p.ravel()
    free = np.empty((3, rows.size))
    code = np.zeros(rows.size, dtype=np.int8)
    for start in range(0, rows.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        free[:, part], code[part] = _inflate_rows(pad, rows[part])
    height, sphere, volume = free.reshape(3, *p.shape)
    return Inflated(height, sphere, volume, words(code.reshape(p.shape)))


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
    adhesion : {'matlab', 'text', 'none'}
        Sign of the adhesion term: attractive (default, as in the thesis' program), repulsive (as
        in the thesis' text), or no adhesion. The membrane has no adhesion: it meets the floor at a
        tangent.
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
        is unknown, ``adhesion_energy`` is above 0.01 ``stiffness``, or a force is above 0 on a pad
        with an edge, whose pressed shapes are not known.

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
    if model != 'thesis' or pad.material is not None:
        choice('model', model, MODELS)
        choice('adhesion', adhesion, tuple(ADHESION_SIGNS))
        from ros_pad.contact.membrane import press_membrane

        return press_membrane(pad, pressure, force)
    a = signed_adhesion(pad, adhesion)
    p, load = quantity('pressure', pressure, 'Pa'), quantity('force', force, 'N')
    if isinstance(p, float) and isinstance(load, float):
        return _press_one(pad, float(p), float(load), a)
    p, load = broadcast('pressure and force', p, load)
    rows, loads = p.ravel(), load.ravel()
    pressed = np.empty((5, rows.size))
    code = np.zeros(rows.size, dtype=np.int8)
    for start in range(0, rows.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        code[part] = _press_rows(pad, rows[part], loads[part], a, pressed[:, part])
    height, depth, contact, sphere, gap = pressed.reshape(5, *p.shape)
    return Pressed(height, depth, contact, sphere, gap, words(code.reshape(p.shape)))


# --- the free dome -------------------------------------------------------------------------------


def free_height(tension: Floats, deficit: Floats) -> Floats:
    """Return height over radius of the free dome, to rounding error.

    Parameters
    ----------
    tension : float or array
        ``P = p r/k``, from 0 to 6.
    deficit : float or array
        ``6 - P``, given separately because ``6 - tension`` loses digits near 6.

    Notes
    -----
    With ``w = tan(t/2)`` the pressure is rational, ``P = 4 w (1 + 5 w²)/(1 + w²)²``, and the
    height is ``2 w/(1 - w²)``, without trigonometric functions.
    """
    w = _FREE_SEED[0] * tension + _FREE_SEED[1]
    for coefficient in _FREE_SEED[2:]:
        w = w * tension + coefficient
    w = w * tension
    for _ in range(2):  # errors after 0, 1 and 2 steps: 4e-4, 1e-7, rounding
        square = w * w
        sum_ = 1.0 + square
        pull = tension * sum_
        w = w - (w * (4.0 + 20.0 * square) - pull * sum_) / (4.0 + 60.0 * square - 4.0 * w * pull)
    tall = tension > 5.0
    if isinstance(tall, bool):
        return _tall_height(w, deficit) if tall else 2.0 * w / ((1.0 - w) * (1.0 + w))
    height = 2.0 * w / ((1.0 - w) * (1.0 + w))
    if tall.any():
        height[tall] = _tall_height(w[tall], deficit[tall])
    return height


def _tall_height(w: Floats, deficit: Floats) -> Floats:
    """Return the height near the bursting pressure, computed from ``v = 1 - w`` and ``6 - P``."""
    v = 1.0 - w
    for _ in range(2):
        square = 2.0 + v * (v - 2.0)
        residual = v * (16.0 + v * (-12.0 + v * (-4.0 + 6.0 * v))) - deficit * square * square
        slope = 16.0 + v * (-24.0 + v * (-12.0 + 24.0 * v))
        v = v - residual / (slope - 4.0 * deficit * square * (v - 1.0))
    return 2.0 * (1.0 - v) / (v * (2.0 - v))


def _free_cap(r: float, height: Floats, inflated: bool) -> tuple[Floats, Floats, Floats]:
    """Return height, m, sphere radius, m, and volume, m³, of a free dome."""
    sphere = 0.5 * r * (height + 1.0 / height) if inflated else math.inf
    return r * height, sphere, math.pi / 6.0 * r * r * r * height * (3.0 + height * height)


def _inflate_rows(pad: Pad, p: Array) -> tuple[tuple[Array, ...], Codes]:
    deficit = _deficit(pad, p)
    code = np.zeros(p.size, dtype=np.int8)
    burst = deficit <= 0.0
    if burst.any():
        code[burst] = NO_INFLATION
        p, deficit = np.where(burst, np.nan, p), np.where(burst, np.nan, deficit)
    with np.errstate(divide='ignore', over='ignore'):  # a flat pad has an infinite radius
        cap = _free_cap(pad.radius, free_height(p * (pad.radius / pad.stiffness), deficit), True)
    return cap, code


def _deficit(pad: Pad, p: Floats) -> Floats:
    return (BURST * pad.stiffness / pad.radius - p) * (pad.radius / pad.stiffness)


# --- the pressed dome ----------------------------------------------------------------------------


def largest_tension(a: float) -> float:
    """Return the pressure ``P`` up to which every force has one equilibrium on the branch.

    Above P = 3.4263 - 4.1 a (91.368 kPa for the large pad without adhesion) the curve of force
    over height is S-shaped; the returned bound is slightly lower.
    """
    return 3.426 - 4.5 * max(a, 0.0)


def flattening_force(tension: Floats, a: float) -> Floats:
    """Return the force ``f`` at which the contact reaches the rim, for attraction ``a >= 0``.

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


def _balance(
    x: Floats, tension: Floats, f: Floats, a: float, sqrt: Callable[[Floats], Floats]
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Evaluate the equilibrium at a trial height x.

    Terms of order P are subtracted once, as ``P - f``, so that the residual keeps its digits near
    flattening.

    Returns
    -------
    residual : float or array
        Residual of 3.58. At the equilibrium it changes from positive to negative.
    slope : float or array
        Derivative of the residual over the height.
    certificate : float or array
        Positive where the depth at this height is continuous with the free dome.
    spread : float or array
        Squared contact radius (3.53).
    depth : float or array
        Depth that the floor cuts off (3.48).
    """
    inverse = 1.0 / x
    rho = 0.5 * (x + inverse)
    rho_slope = 0.5 - 0.5 * inverse * inverse
    spread = (f + 2.0 * a * rho) / tension
    wall = sqrt(rho * rho - spread)
    depth = spread / (rho + wall)
    depth_slope = rho_slope * (a / tension - depth) / wall
    lift = x + depth
    sigma = sqrt(1.0 + (x - depth) * lift)
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
    return residual, slope, certificate, spread, depth


def _settled(
    x: Floats, step: Floats, slope: Floats, certificate: Floats, spread: Floats, depth: Floats
) -> Floats:
    """Return whether a Newton step from x ends at the physical root, to rounding error.

    The step is so short that the next one would be a rounding error, and that the certificate
    cannot change its sign over the step.
    """
    return (
        (abs(step) <= 1e-7 * x)
        & (slope < 0.0)
        & (certificate > 1e-5)
        & (spread <= 1.0 + 1e-9)
        & (depth <= x * (1.0 + 1e-6))
    )


def _seed(tension: Floats, f: Floats) -> Floats:
    """Return the start value of the height."""
    share = f / tension
    height = 0.0
    for row in _PRESSED_SEED:
        inner = row[0] * share + row[1]
        for coefficient in row[2:]:
            inner = inner * share + coefficient
        height = height * tension + inner
    return height * (tension - f)


def _height_of_one(tension: float, f: float, a: float) -> float:
    """Return the height in equilibrium; NaN where no root passes the certificate."""
    x = _seed(tension, f)
    try:
        for _ in range(4):  # nearly all converge in three
            residual, slope, certificate, spread, depth = _balance(x, tension, f, a, math.sqrt)
            step = -residual / slope
            if _settled(x, step, slope, certificate, spread, depth):
                return x + step
            x += step
    except (ValueError, ZeroDivisionError):
        pass  # no sphere of this height has this contact
    return _bracketed_height(tension, f, a)


def _bracketed_height(tension: float, f: float, a: float) -> float:
    """Return the height in equilibrium; NaN where no root passes the certificate.

    Newton's method inside a bracket. A trial height is too small where the residual is positive
    and the certificate holds; elsewhere it is too large. So the bracket closes on the physical
    root only: between the unphysical roots near flattening the certificate fails.
    """
    low, high = (tension - f) / (8.0 if a >= 0.0 else 16.0), 0.6 * tension
    x = min(max(low, _seed(tension, f)), high)
    last = high
    for _ in range(200):
        small, newton = False, math.nan
        try:
            residual, slope, certificate, spread, depth = _balance(x, tension, f, a, math.sqrt)
            # With repulsion ('text') there is a second, smaller root where the residual rises.
            small = certificate > 0.0 and (
                residual > 0.0 or (a < 0.0 and slope > 0.0 and x * x < -a)
            )
            if slope < 0.0:
                newton = x - residual / slope
                if _settled(x, newton - x, slope, certificate, spread, depth):
                    return newton
        except (ValueError, ZeroDivisionError):
            pass  # no sphere of this height has this contact: too large
        low, high = (x, high) if small else (low, x)
        # Take Newton's step if it stays inside and is at most half of the last; else bisect ln x.
        if not (low <= newton <= high and abs(newton - x) <= 0.5 * last):
            newton = math.sqrt(low * high)
        last = abs(newton - x)
        x = newton
        if high - low <= 2e-16 * high:
            break
    return math.nan


def _heights_of_rows(tension: Array, f: Array, a: float) -> Array:
    """Return the heights in equilibrium; NaN where no root passes the certificate.

    Nine of ten rows converge in three steps; only the others take further steps.
    """
    height, active = _seed(tension, f), np.arange(tension.size)
    x, p, load = height, tension, f
    for steps in (3, 1, 1, 1):
        for _ in range(steps):
            before = x
            residual, slope, *rest = _balance(x, p, load, a, np.sqrt)
            step = -residual / slope
            x = x + step
        settled = _settled(before, step, slope, *rest)
        height[active] = x
        left = np.flatnonzero(~settled)
        if not left.size:
            return height
        active, x, p, load = active[left], x[left], p[left], load[left]
    for row in active.tolist():
        height[row] = _bracketed_height(float(tension[row]), float(f[row]), a)
    return height


def _flattens(tension: Floats, f: Floats, a: float) -> Floats:
    """Return where the force extends the contact to the rim."""
    if a <= 0.0:
        return f >= tension
    # The limit is between P - 1.25 sqrt(2a) and P: most forces are below this range.
    near = f > tension - 1.25 * math.sqrt(2.0 * a)
    if isinstance(near, bool):
        return near and f >= flattening_force(tension, a)
    if near.any():
        near[near] = f[near] >= flattening_force(tension[near], a)
    return near


def _hovers(x: Floats, f: Floats, a: float) -> Floats:
    """Return where the repulsion of the floor carries the whole force, so that nothing touches.

    If this holds for the free dome of height x, it holds for every lower (more curved) dome.
    """
    return f <= -a * (x + 1.0 / x)


def _shape(
    x: Floats, tension: Floats, f: Floats, a: float, sqrt: Callable[[Floats], Floats]
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return height, depth, contact radius, sphere radius and gap at the height x."""
    rho = 0.5 * (x + 1.0 / x)
    spread = (f + 2.0 * a * rho) / tension
    depth = spread / (rho + sqrt(rho * rho - spread))
    # gap = (1 - b²)/(1/c2 - depth), without cancellation where the dome is nearly flat.
    unspread = ((tension - f) - 2.0 * a * rho) / tension
    return x, depth, sqrt(spread), rho, unspread / (1.0 / x - depth)


def _press_one(pad: Pad, p: float, load: float, a: float) -> Pressed:
    """Return one pressed dome; raise `NoEquilibrium` where there is none."""
    r = pad.radius
    tension, f = p * (r / pad.stiffness), load / (math.pi * pad.stiffness * r)
    deficit = _deficit(pad, p)
    if deficit <= 0.0:
        _refuse(NO_INFLATION, pad, p, load, a)
    if tension > largest_tension(a):
        _refuse(FOLD_ZONE, pad, p, load, a)
    if _flattens(tension, f, a):
        _refuse(FLATTENED, pad, p, load, a)
    free = free_height(tension, deficit) if a <= 0.0 else math.nan
    x = free if _hovers(free, f, a) else _height_of_one(tension, f, a)
    if math.isnan(x):  # only with repulsion ('text'): beyond the fold that ends the branch
        _refuse(FLATTENED, pad, p, load, a)
    if _hovers(x, f, a):
        return Pressed(r * free, 0.0, 0.0, r * 0.5 * (free + 1.0 / free), r * free, 'no_contact')
    height, depth, contact, rho, gap = _shape(x, tension, f, a, math.sqrt)
    return Pressed(r * height, r * depth, r * contact, r * rho, r * gap, 'ok')


# Only domes lower than an atom overflow or underflow; these fail the certificate.
@np.errstate(divide='ignore', invalid='ignore', over='ignore')
def _press_rows(pad: Pad, p: Array, load: Array, a: float, lengths: Array) -> Codes:
    """Write the five lengths of each row into ``lengths``; return the status codes."""
    r = pad.radius
    tension, f = p * (r / pad.stiffness), load / (math.pi * pad.stiffness * r)
    code = np.zeros(p.size, dtype=np.int8)
    flat = _flattens(tension, f, a)
    if flat.any():
        code[flat] = FLATTENED
    if tension.max() > largest_tension(a):
        code[tension > largest_tension(a)] = FOLD_ZONE
        code[_deficit(pad, p) <= 0.0] = NO_INFLATION
    free = free_height(tension, BURST - tension) if a <= 0.0 else tension
    if a <= 0.0:
        code[(code == OK) & _hovers(free, f, a)] = NO_CONTACT
    rows: Any = slice(None)
    if code.any():
        lengths.fill(np.nan)
        rows = code == OK
    tension, f = tension[rows], f[rows]
    x = _heights_of_rows(tension, f, a)
    # No certified root, only with repulsion ('text'): beyond the fold that ends the branch.
    code[rows] = np.isnan(x) * np.int8(FLATTENED)
    for row, length in zip(lengths, _shape(x, tension, f, a, np.sqrt), strict=True):
        row[rows] = r * length
    if a <= 0.0:
        code[rows] |= _hovers(x, f, a) * np.int8(NO_CONTACT)
        apart = code == NO_CONTACT
        x = free[apart]
        for row, length in zip(lengths, (x, 0.0, 0.0, 0.5 * (x + 1.0 / x), x), strict=True):
            row[apart] = r * length
    return code


def signed_adhesion(pad: Pad, adhesion: str) -> float:
    """Return the relative adhesion ``a`` of a pad; raise `InvalidInput` above 0.01."""
    if adhesion not in ADHESION_SIGNS:
        choice('adhesion', adhesion, tuple(ADHESION_SIGNS))
    a = ADHESION_SIGNS[adhesion] * pad.adhesion_energy / pad.stiffness
    if abs(a) > LARGEST_ADHESION:
        most = LARGEST_ADHESION * pad.stiffness
        raise InvalidInput(
            f'adhesion_energy = {pad.adhesion_energy:g} J/m² is not allowed here: from 0 to'
            f' {most:g} J/m² ({LARGEST_ADHESION:g} of the stiffness) is needed'
        )
    return a


def _refuse(code: int, pad: Pad, p: float, load: float | None = None, a: float = 0.0) -> NoReturn:
    """Raise `NoEquilibrium` with the status of a code, and what pressure or force is needed."""
    unit = pad.stiffness / pad.radius
    if code == NO_INFLATION:
        why = (
            f'the dome would grow without limit: a pressure below {BURST * unit:.6g} Pa is needed'
        )
    elif code == FOLD_ZONE:
        most = largest_tension(a) * unit
        why = f'the shape depends on the history of the load: at most {most:.6g} Pa is allowed'
    elif p == 0.0:
        why = 'a pad without pressure is flat, so the contact covers it: more pressure is needed'
    else:
        most = flattening_force(p / unit, max(a, 0.0)) * math.pi * pad.stiffness * pad.radius
        if most <= 0.0:
            why = 'adhesion alone holds the pad flat: more pressure is needed'
            why += ' (in Pa: 75 kPa is 75e3)' if p < 1e3 else ''
        else:
            why = f'the contact would cover the whole pad: a force below {most:.6g} N is needed'
            why += " (with adhesion='text' an even smaller force)" if a < 0.0 else ''
    given = f'pressure = {p:g} Pa' + ('' if load is None else f', force = {load:g} N')
    raise NoEquilibrium(f'{given} on {pad}: {why}', str(STATUS[code]))


def words(code: Codes) -> npt.NDArray[np.str_]:
    """Return the status words for an array of codes."""
    if not code.any():
        return np.full(code.shape, 'ok', dtype=STATUS.dtype)
    return STATUS[code]
