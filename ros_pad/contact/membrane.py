# SPDX-License-Identifier: Apache-2.0
"""Exact shape of an inflated pad pressed on a floor: a membrane of constant mean curvature.

The thesis assumes a spherical cap (:mod:`ros_pad.contact.dome`). Here the wall has the shape that
makes the energy of the thesis stationary, which shows the error of the spherical cap.

With radius and stiffness 1 the energy of the membrane is ``U = A (sigma - 1)`` (3.41), where
``A = pi sigma²`` is its whole area, side wall and contact disc. At pressure P under force F the
potential is ``U(A) - P V + F d``, with volume V and gap d between pad base and floor.

1. U depends only on the whole area, so ``dU = T dA`` with ``T = dU/dA = 1.5 sigma - 1``: the
   tension is the same everywhere, in the wall and in the disc.
2. Moving the wall by n along its normal gives ``dA = ∫ 2H n``, ``dV = ∫ n``: ``2 H T = P``, so the
   mean curvature is constant; its radius is ``l = T/P``.
3. Moving the edge of contact, radius b, along the floor gives ``T (1 - cos psi) = 0`` per length:
   the wall meets the floor at a tangent. There is **no adhesion**: it would open that angle.
4. Moving the floor with the disc gives ``F = pi b² P``: b follows from force and pressure alone,
   as in the thesis without adhesion (3.53).
5. The balance of the wall between b and r along the axis is ``sin psi = (r² - b²)/(2 l r)``.

The only unknown left is the angle psi at the rim, from 0 to pi; above 90° the wall extends
outwards beyond the rim. Along the wall ``r = l sin psi + W``, ``W² = b² + l² sin² psi``, which is
smooth at the widest place. With ``h = l sin psi = (1 - b²)/2`` at the rim

    d = l (1 - cos psi) + ∫ (l sin psi)²/W dpsi,    sigma² = b² + 2 l (2 d + b² ∫ dpsi/W),

where both integrals over the wall are elliptic. The solver uses ``t = tan(psi/2)``, which is the
height of the free dome for b = 0.

The number of roots follows from ``Q(psi) = T/l`` at fixed b, which must equal P. Up to 90° Q
rises, because sin psi and the area rise (a steeper wall is longer at every r). It keeps rising to
its limit 6 if ``b² <= 0.7143``. For larger contacts it has a maximum and then a minimum, and all
minima are above P = 5.1427, the cusp (both found in dense scans). So below either bound there is
**exactly one** shape: the one that is continuous with the free dome. A change of sign is enough to
certify it. Up to P = 5.14 (137 kPa for the large pad) the branch therefore ends only at the rim,
``F = p pi r²``. Where both bounds are exceeded there are up to three shapes, and the actual one
depends on the history of the load.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import quantity
from ros_pad.contact.dome import (
    BURST,
    FLATTENED,
    FOLD_ZONE,
    NO_CONTACT,
    NO_INFLATION,
    OK,
    STATUS,
    Pressed,
    free_height,
    words,
)
from ros_pad.contact.pad import Array, Pad, broadcast
from ros_pad.errors import NoEquilibrium

# Slightly below the cusp at P = 5.14267, b² = 0.71433, where the root cannot be resolved.
LARGEST_PRESSURE = 5.14
LARGEST_SHARE = 0.71

_WHY = {
    FLATTENED: (
        'the contact would cover the whole pad: a force below pressure * pi * radius² is needed'
    ),
    FOLD_ZONE: (
        'the shape depends on the history of the load: a pressure up to 5.14 stiffness/radius, or'
        ' a force up to 0.71 * pressure * pi * radius², is needed'
    ),
    NO_INFLATION: (
        'the dome would grow without limit: a pressure below 6 stiffness/radius is needed'
    ),
}


def press_membrane(pad: Pad, pressure: npt.ArrayLike, force: npt.ArrayLike) -> Pressed:
    """Compute the exact membrane of a pad pressed on a floor, without adhesion.

    Parameters
    ----------
    pad : Pad
        Size and material. Its ``adhesion_energy`` has no effect.
    pressure : float or array
        Gauge pressure, Pa, from 0 to below ``6 stiffness/radius``.
    force : float or array
        Normal force on this one pad, N, from 0 to ``pressure pi radius²``; above
        ``5.14 stiffness/radius`` only to 0.71 of that. Broadcasts with the pressure.

    Returns
    -------
    Pressed
        ``gap`` and ``contact_radius`` are those of the membrane. Its wall is not a sphere:
        ``height``, ``depth`` and ``sphere_radius`` are those of the spherical cap through rim and
        edge of contact, as the thesis derives them from measurements (section 3.2.1).

    Raises
    ------
    NoEquilibrium
        For scalar input, with status ``flattened`` (the contact would cover the pad),
        ``fold_zone`` (both bounds in the module's docstring are exceeded) or ``no_inflation``.
    InvalidInput
        When a value is negative or not finite, or shapes do not broadcast.

    Notes
    -----
    The shape depends on ``P = p r/k`` and ``F/(p pi r²)`` only; lengths scale with the radius. The
    relative error of the gap is 1e-12, plus the rounding of the input: 1e-16/(1 - F/(p pi r²))
    near flattening and 1e-15/(6 - P) near bursting.

    Examples
    --------
    >>> from ros_pad.contact import LARGE_PAD
    >>> round(press_membrane(LARGE_PAD, 75e3, 0.19).gap, 9)
    0.000755475
    """
    p, load = quantity('pressure', pressure, 'Pa'), quantity('force', force, 'N')
    p, load = broadcast('pressure and force', p, load)
    r, k = pad.radius, pad.stiffness
    rows, why = p.ravel(), _WHY
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import press_rubber, refusal

        lengths, code = press_rubber(pad, rows, load.ravel())
        why = _WHY | refusal(pad)
    else:
        deficit = (BURST * k / r - rows) * (r / k)
        lengths, code = _press(rows * (r / k), load.ravel() / (math.pi * k * r), deficit)
    lengths *= r
    if p.ndim == 0:
        status = str(STATUS[code[0]])
        if code[0] in why:
            what = f'pressure = {p:g} Pa, force = {load:g} N on {pad}'
            raise NoEquilibrium(f'{what}: {why[int(code[0])]}', status)
        height, depth, contact, sphere, gap = lengths[:, 0].tolist()
        return Pressed(height, depth, contact, sphere, gap, status)
    height, depth, contact, sphere, gap = lengths.reshape(5, *p.shape)
    return Pressed(height, depth, contact, sphere, gap, words(code.reshape(p.shape)))


# Only domes lower than an atom overflow: they fail the certificate.
@np.errstate(divide='ignore', invalid='ignore', over='ignore')
def _press(pressure: Array, force: Array, deficit: Array) -> tuple[Array, npt.NDArray[np.int8]]:
    """Return height, depth, contact radius, sphere radius and gap as rows, and the status codes.

    Parameters
    ----------
    pressure, force : array
        ``P = p r/k`` and ``f = F/(pi k r)``, one-dimensional.
    deficit : array
        ``6 - P``, given separately because ``6 - pressure`` loses digits near 6.
    """
    code = np.where(force > 0.0, OK, NO_CONTACT).astype(np.int8)
    code[force >= pressure] = FLATTENED
    code[(pressure > LARGEST_PRESSURE) & (force > LARGEST_SHARE * pressure)] = FOLD_ZONE
    code[deficit <= 0.0] = NO_INFLATION
    lengths = np.full((5, code.size), np.nan)

    free = code == NO_CONTACT
    height = free_height(pressure[free], deficit[free])
    lengths[:, free] = height, 0.0 * height, 0.0 * height, 0.5 * (height + 1.0 / height), height

    rows = np.flatnonzero(code == OK)
    p, f = pressure[rows], force[rows]
    share, rest = f / p, (p - f) / p
    t, certain = _rim(p, share, rest, deficit[rows])
    code[rows[~certain]] = NO_INFLATION  # too close to P = 6 to resolve the balance
    gap = _wall(t, share, rest)[2]
    lengths[:, rows] = np.where(certain, cap_through(gap, share, rest), np.nan)
    return lengths, code


def cap_through(gap: Array, share: Array, rest: Array) -> tuple[Array, ...]:
    """Return the five lengths of the cap through rim and edge of contact, from the gap.

    ``share`` is the contact radius squared, ``rest`` is 1 less that.
    """
    centre = 0.5 * (gap + rest / gap)  # from the floor to the centre of the sphere
    sphere = np.sqrt(centre * centre + share)
    depth = share / (sphere + centre)
    return gap + depth, depth, np.sqrt(share), sphere, gap


def _wall(t: Array, share: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Return radius of mean curvature l, stretch sigma and gap of the wall with rim angle t.

    The integrals are Carlson's R_F and R_D, valid up to psi = 90°. Above 90° the integral is twice
    the integral to 90° minus the integral to 180° - psi, because sin psi is symmetric.
    """
    from scipy.special import elliprd, elliprf

    b2 = np.maximum(share, 1e-90)  # a smaller contact is a point within rounding
    square = 1.0 + t * t
    sine, cosine = 2.0 * t / square, (1.0 - t) * (1.0 + t) / square
    curve = 0.5 * rest / sine
    side, width = 0.5 * rest, 0.5 * (1.0 + share)

    here = b2 * cosine * cosine, width * width, b2
    inverse = sine * elliprf(*here)
    rise = side * side * sine * b2 / 3.0 * elliprd(*here)
    over = t > 1.0
    if over.any():
        c, b2 = curve[over], b2[over]
        half = 0.0, b2 + c * c, b2
        inverse[over] = 2.0 * elliprf(*half) - inverse[over]
        rise[over] = 2.0 * c * c * b2 / 3.0 * elliprd(*half) - rise[over]
    gap = side * t + rise  # l (1 - cos psi) = l sin psi tan(psi/2)
    return curve, np.sqrt(share + 2.0 * curve * (2.0 * gap + share * inverse)), gap


def _residual(t: Array, pressure: Array, share: Array, rest: Array) -> Array:
    """Return ``T - P l``, times a factor that makes it nearly linear in t at both ends."""
    curve, sigma, _ = _wall(t, share, rest)
    return (1.5 * sigma - 1.0 - pressure * curve) * (t / (1.0 + t))


def _rim(pressure: Array, share: Array, rest: Array, deficit: Array) -> tuple[Array, npt.NDArray]:
    """Return ``t = tan(psi/2)`` at the rim, and whether the residual changes its sign there.

    Regula falsi with the weights of Anderson and Björck. At the lower end of the bracket, t = 0,
    the tension is too low. At the upper end it is too high: either ``sin psi = P (1 - b²)``, as
    sigma > 1, or close to 180°, where Q is ``6 - 1/l``.
    """
    sine = np.minimum(pressure * rest, 1.0)
    high = np.where(sine < 1.0, sine / (1.0 + np.sqrt(1.0 - sine * sine)), 8.0 / (rest * deficit))
    high = high * (1.0 + 1e-9)  # stay above the root even where sigma rounds to 1
    given = np.stack((pressure, share, rest))
    rim, active = high.copy(), np.arange(high.size)
    last, off_last = high, _residual(high, *given)
    across, off_across = np.zeros_like(high), -0.25 * pressure * rest
    for _ in range(100):  # about 12 steps are usual
        t = last - off_last * ((last - across) / (off_last - off_across))
        off = _residual(t, *given)
        rim[active] = t
        left = np.flatnonzero((np.abs(t - last) > 1e-14 * t) & (off != 0.0))
        if not left.size:
            break
        active, given = active[left], given[:, left]
        t, off, last, off_last = t[left], off[left], last[left], off_last[left]
        changed = (off < 0.0) != (off_last < 0.0)
        weight = 1.0 - off / off_last
        weight[weight <= 0.0] = 0.5
        across = np.where(changed, last, across[left])
        off_across = np.where(changed, off_last, weight * off_across[left])
        last, off_last = t, off
    width = np.minimum(1e-10 + 4e-15 / deficit, 0.5)
    below = _residual(rim * (1.0 - width), pressure, share, rest)
    above = _residual(rim * (1.0 + width), pressure, share, rest)
    return rim, (below < 0.0) & (above > 0.0)
