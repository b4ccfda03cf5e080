# SPDX-License-Identifier: Apache-2.0
"""Shape of an inflated pad, free (thesis 3.34-3.41, 3.60) and pressed on a floor (3.44-3.61).

Inside this module lengths are in units of the pad radius, pressure is ``P = p r/k``, force is
``f = F/(pi k r)`` and adhesion is ``a = sign * adhesion_energy/k``. Then one pad is every pad,
and pi appears only in the force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from ros_pad.contact.pad import Array
from ros_pad.contact.pad import Floats
from ros_pad.contact.pad import Pad
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import quantity
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoEquilibrium

# Sign of the adhesion term: the appendix' program adds it, the text (3.43) subtracts it.
ADHESION_SIGNS = {'matlab': 1.0, 'text': -1.0, 'none': 0.0}

# Pressure ``P`` from which the free dome has no equilibrium: it grows without end.
BURST = 6.0
# Largest relative adhesion ``a`` for which the branch structure below was checked.
LARGEST_ADHESION = 0.01

_STATUS = np.array(['ok', 'no_contact', 'flattened', 'fold_zone', 'no_inflation'])
_OK, _NO_CONTACT, _FLATTENED, _FOLD_ZONE, _NO_INFLATION = range(5)
_WHY = {
    _FLATTENED: 'is more than the dome can carry: the contact spans the whole pad',
    _FOLD_ZONE: 'has an answer that depends on the history of the load: too high a pressure',
    _NO_INFLATION: 'has no inflated shape: the dome would grow without end',
}


@dataclass(frozen=True)
class Inflated:
    """A free dome. Floats for scalar input, arrays of the input's shape otherwise.

    Attributes
    ----------
    height : m
    sphere_radius : m; infinite for a flat pad.
    volume : m³ under the dome.
    status : ``ok`` or ``no_inflation`` (the numbers are then NaN).
    """

    height: Floats
    sphere_radius: Floats
    volume: Floats
    status: Floats


@dataclass(frozen=True)
class Pressed:
    """A dome pressed on a floor. Floats for scalar input, arrays of the broadcast shape otherwise.

    Attributes
    ----------
    height : m, of the uncut spherical cap (c2).
    depth : m, how much of the cap the floor cuts off (a).
    contact_radius : m (b).
    sphere_radius : m, of the wall (R2).
    gap : m, from pad base to floor, ``height - depth`` without its cancellation.
    status : ``ok``; ``no_contact`` (the free dome, contact radius 0); or ``flattened``,
        ``fold_zone``, ``no_inflation`` (the numbers are then NaN).
    """

    height: Floats
    depth: Floats
    contact_radius: Floats
    sphere_radius: Floats
    gap: Floats
    status: Floats


def inflate(pad: Pad, pressure: npt.ArrayLike) -> Inflated:
    """Return the free dome of a pad.

    Parameters
    ----------
    pad : Pad
        What the pad is made of.
    pressure : float or array
        Gauge pressure, Pa, from 0; below ``6 stiffness/radius`` there is exactly one dome.

    Raises
    ------
    NoEquilibrium
        For a scalar pressure at or above that bound, status ``no_inflation``.
    InvalidInput
        For a pressure that is negative or not finite.

    Notes
    -----
    Thesis 3.60 with F = 0, that is ``P = 6 sin t - 2 sin 2t`` and ``height = radius tan t``.

    Examples
    --------
    >>> round(inflate(Pad(radius=1.5e-3, stiffness=40.0), 75e3).height, 9)
    0.001941268
    """
    p = quantity('pressure', pressure, 'Pa')
    deficit = _deficit(pad, p)
    code = _where(deficit > 0, _OK, _NO_INFLATION)
    if np.ndim(code) == 0 and code != _OK:
        _refuse(code, pad, p)
    good = code == _OK
    height = free_height(
        _where(good, p * (pad.radius / pad.stiffness), 1.0), _where(good, deficit, BURST - 1.0)
    )
    height = _where(good, height, np.nan)
    with np.errstate(divide='ignore', over='ignore'):  # a flat pad has an infinite radius
        sphere = 0.5 * (height + 1.0 / height)
        volume = math.pi / 6.0 * height * (3.0 + height * height)
    r = pad.radius
    return Inflated(_plain(r * height), _plain(r * sphere), _plain(r**3 * volume), _words(code))


# Only domes far lower than an atom overflow or underflow: they fail the certificate.
@np.errstate(divide='ignore', invalid='ignore', over='ignore')
def press(
    pad: Pad,
    pressure: npt.ArrayLike,
    force: npt.ArrayLike,
    adhesion: str = 'matlab',
    model: str = 'thesis',
) -> Pressed:
    """Return the dome of a pad pressed on a floor, always on the branch of the free dome.

    Parameters
    ----------
    pad : Pad
        What the pad is made of.
    pressure : float or array
        Gauge pressure, Pa, from 0. The model ends at ``P = p r/k`` of about 3.425 (91.3 kPa for
        the large pad): beyond, the same force has several equilibria.
    force : float or array
        Normal force on this one pad, N, from 0. Broadcasts with the pressure.
    adhesion : {'matlab', 'text', 'none'}
        Sign of the adhesion term: attractive (default), as the thesis' text has it, or left out.
    model : {'thesis'}
        The spherical dome of thesis 3.44-3.61.

    Raises
    ------
    NoEquilibrium
        For scalar input without an equilibrium in the model. Its status is ``flattened`` (the
        contact would span the pad), ``fold_zone`` (pressure above the model's end) or
        ``no_inflation`` (pressure above that of the free dome).
    InvalidInput
        For values that are negative, not finite, do not broadcast, or an unknown word; and for
        ``adhesion_energy`` above 0.01 ``stiffness``.

    Notes
    -----
    Force balances of thesis 3.53 and 3.58 with the cap geometry of 3.48, reduced to one equation
    in the height. A root is returned only with its certificate: at this height the depth is the
    one that grows out of the free dome, the floor is above the pad base and the contact inside
    the rim.
    """
    a = signed_adhesion(pad, adhesion)
    choice('model', model, ('thesis',))
    p, load = _broadcast(quantity('pressure', pressure, 'Pa'), quantity('force', force, 'N'))
    tension = p * (pad.radius / pad.stiffness)
    f = load / (math.pi * pad.stiffness * pad.radius)

    flat_at = flattening_force(tension, a) if a > 0 else tension
    code = _where(f >= flat_at, _FLATTENED, _OK)
    code = _where(tension > largest_tension(a), _FOLD_ZONE, code)
    code = _where(_deficit(pad, p) <= 0, _NO_INFLATION, code)
    if np.ndim(code) == 0 and code != _OK:
        _refuse(code, pad, p, load)
    # Rows without an answer go through the solver as a harmless one.
    good = code == _OK
    tension, f = _where(good, tension, 1.0), _where(good, f, 0.5)

    free = free_height(tension, BURST - tension)
    height, certified = _pressed_height(tension, f, a, free)
    rho, spread, depth = _cap(height, tension, f, a)
    # Without a certified root the force is past the fold, where the text's sign ends the branch.
    code = _where(good & ~certified, _FLATTENED, code)
    if np.ndim(code) == 0 and code != _OK:
        _refuse(code, pad, p, load)
    code = _where((code == _OK) & (spread <= 0), _NO_CONTACT, code)

    apart = code == _NO_CONTACT
    height = _where(apart, free, height)
    depth = _where(apart, 0.0, depth)
    rho = 0.5 * (height + 1.0 / height)
    # (1 - b²) = (c - a)(1/c - a) has no cancellation where the dome is nearly flat.
    unspread = ((tension - f) - 2.0 * a * rho) / tension
    gap = _where(apart, free, unspread / (1.0 / height - depth))
    contact = np.sqrt(_where(apart, 0.0, abs(spread)))
    r = _where(code <= _NO_CONTACT, pad.radius, np.nan)
    return Pressed(
        height=_plain(r * height),
        depth=_plain(r * depth),
        contact_radius=_plain(r * contact),
        sphere_radius=_plain(r * rho),
        gap=_plain(r * gap),
        status=_words(code),
    )


def free_height(tension: Array, deficit: Array) -> Array:
    """Return height over radius of the free dome, to the last digits.

    Parameters
    ----------
    tension : array
        ``P = p r/k``, from 0 to 6.
    deficit : array
        ``6 - P``, given apart because near 6 it carries all the digits.
    """
    # Newton from the only inflection of P(t) = 2 sin t (3 - 2 cos t) never overshoots.
    t = np.arccos(0.375) + 0.0 * tension
    for _ in range(7):
        sine, cosine = np.sin(t), np.cos(t)
        t = t + (tension - 2.0 * sine * (3.0 - 2.0 * cosine)) / (
            6.0 * cosine - 8.0 * cosine * cosine + 4.0
        )
    x = np.tan(np.minimum(t, 0.5 * math.pi))
    # One step more in the height itself, with the residual that keeps its digits.
    sigma = np.sqrt(1.0 + x * x)
    shallow = tension - 2.0 * x * (3.0 * sigma - 2.0) / (sigma * sigma)
    tall = 6.0 / (sigma * (sigma + x)) + 4.0 * x / (sigma * sigma) - deficit
    cosine = 1.0 / sigma
    slope = (6.0 * cosine - 8.0 * cosine * cosine + 4.0) * cosine * cosine
    return x + _where(x < 1.0, shallow, tall) / slope


def largest_tension(a: float) -> float:
    """Return the pressure ``P`` up to which every force has one equilibrium on the branch.

    Above it force against height is S-shaped. The cusp is at 3.4263 - 4.1 a (91.368 kPa for the
    large pad without adhesion); the bound stays a little below.
    """
    return 3.426 - 4.5 * max(a, 0.0)


def flattening_force(tension: Array, a: float) -> Array:
    """Return the force ``f`` at which the contact reaches the rim, for attraction ``a >= 0``.

    There height equals depth and 3.53 and 3.58 leave ``P x³ - (2 - a) x² + a = 0`` with
    ``f = P (1 + x²) - 2x``. To first order this is the closed form ``P - sqrt(2a)``. Negative
    where the pad is flat without any force.
    """
    if a == 0:
        return tension
    x = math.sqrt(a / (2.0 - a)) + 0.0 * tension
    for _ in range(6):
        x = x - ((tension * x - (2.0 - a)) * x * x + a) / (
            (3.0 * tension * x - 2.0 * (2.0 - a)) * x
        )
    return tension * (1.0 + x * x) - 2.0 * x


def _cap(x: Array, tension: Array, f: Array, a: float) -> tuple[Array, Array, Array]:
    """Return sphere radius, squared contact radius (3.53) and depth (3.48) at height x."""
    rho = 0.5 * (x + 1.0 / x)
    spread = (f + 2.0 * a * rho) / tension
    return rho, spread, spread / (rho + np.sqrt(rho * rho - spread))


def _balance(x: Array, tension: Array, f: Array, a: float) -> tuple[Array, Array, Array]:
    """Return residual of 3.58 at height x, its slope in x, and the certificate of the branch.

    The residual falls through zero at the equilibrium. Terms of order P are subtracted once, as
    ``P - f``, so that it keeps its digits near flattening. The certificate is positive where the
    depth that balances the height is continuous with the free dome.
    """
    rho, _, depth = _cap(x, tension, f, a)
    wall = rho - depth
    sigma = np.sqrt(1.0 + (x - depth) * (x + depth))
    pull = 3.0 * sigma - 2.0
    lift = x + depth
    residual = 0.5 * ((tension - f) + tension * (x * x + depth * depth)) + a * rho - lift * pull
    rho_slope = 0.5 - 0.5 / (x * x)
    depth_slope = rho_slope * (a / tension - depth) / wall
    slope = (
        tension * (x + depth * depth_slope)
        + a * rho_slope
        - (1.0 + depth_slope) * pull
        - 3.0 * lift * (x - depth * depth_slope) / sigma
    )
    certificate = tension * (wall - depth) + pull - 3.0 * depth * lift / sigma
    return residual, slope, certificate


def _pressed_height(
    tension: Array, f: Array, a: float, free: Array
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return the height in equilibrium and whether it is certified.

    Safeguarded Newton. A trial height is too small where the residual is positive and the
    certificate holds; elsewhere it is too large. That splits the bracket at the physical root
    alone: between the unphysical roots near flattening the certificate fails.
    """
    share = f / tension
    low = (tension - f) / (8.0 if a >= 0 else 16.0)
    high = 1.1 * free
    x = np.maximum(low, free * (1.0 - share) / (1.0 + share * (1.0 - tension / 3.0)))
    last = high
    settled = x < 0
    for _ in range(100):
        residual, slope, certificate = _balance(x, tension, f, a)
        positive = residual > 0
        if a < 0:  # left of the fold lies a second root, where the residual still rises
            positive = positive | ((slope > 0) & (x * x < -a))
        small = positive & (certificate > 0)
        low = _where(small, x, low)
        high = _where(small, high, x)
        step = -residual / slope
        newton = x + step
        # Newton where it stays inside and at least halves; else halve the decades.
        use = (newton >= low) & (newton <= high) & (abs(step) <= 0.5 * abs(last))
        new = _where(use, newton, np.sqrt(low * high))
        # A row that has settled stays, whatever the others still need.
        last = _where(settled, 0.0, new - x)
        x = _where(settled, x, new)
        settled = settled | (abs(last) <= 1e-10 * x)  # Newton squares what is left
        if settled.all():
            break
    residual, slope, certificate = _balance(x, tension, f, a)
    _, spread, depth = _cap(x, tension, f, a)
    # The tolerances are rounding errors of quantities of order P and 1.
    certified: npt.NDArray[np.bool_] = (
        (abs(residual) <= 1e-12 * tension)
        & (certificate > 0)
        & (spread <= 1.0 + 1e-9)
        & (depth <= x * (1.0 + 1e-9))
    )
    return x, certified


def signed_adhesion(pad: Pad, adhesion: str) -> float:
    """Return the relative adhesion ``a`` of a pad; InvalidInput beyond what was checked."""
    choice('adhesion', adhesion, tuple(ADHESION_SIGNS))
    a = ADHESION_SIGNS[adhesion] * pad.adhesion_energy / pad.stiffness
    if abs(a) > LARGEST_ADHESION:
        raise InvalidInput(
            f'adhesion_energy = {pad.adhesion_energy:g} J/m² is not allowed here: from 0 to '
            f'{LARGEST_ADHESION:g} of the stiffness, {LARGEST_ADHESION * pad.stiffness:g} J/m²'
        )
    return a


def _deficit(pad: Pad, p: Array) -> Array:
    return (BURST * pad.stiffness / pad.radius - p) * (pad.radius / pad.stiffness)


def _broadcast(p: Array, load: Array) -> tuple[Array, Array]:
    if np.ndim(p) == np.ndim(load) == 0:
        return p, load
    try:
        first, second = np.broadcast_arrays(p, load)
    except ValueError as error:
        raise InvalidInput(
            f'pressure of shape {np.shape(p)} and force of shape {np.shape(load)} do not broadcast'
        ) from error
    return first, second


def _refuse(code: Array, pad: Pad, p: Array, load: Array | None = None) -> NoReturn:
    what = f'pressure {p:g} Pa' + ('' if load is None else f' with force {load:g} N')
    raise NoEquilibrium(f'{what} on {pad} {_WHY[int(code)]}', str(_STATUS[code]))


def _where(condition: Floats, yes: Floats, no: Floats) -> Floats:
    # np.where takes 2 us for scalars, which is most of what press() would cost.
    if isinstance(condition, (bool, np.bool_)):
        return yes if condition else no
    return np.where(condition, yes, no)


def _plain(value: Array) -> Floats:
    return float(value) if np.ndim(value) == 0 else value


def _words(code: Array) -> Floats:
    return str(_STATUS[code]) if np.ndim(code) == 0 else _STATUS[code]
