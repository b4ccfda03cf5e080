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

from ros_pad.contact.dome import (
    BURST,
    FLATTENED,
    FOLD_ZONE,
    NO_CONTACT,
    NO_INFLATION,
    OK,
    Solved,
    deficit,
    free_height,
)
from ros_pad.contact.pad import Array, Pad
from ros_pad.contact.roots import rising_root

# Slightly below the cusp at P = 5.14267, b² = 0.71433, where the root cannot be resolved.
LARGEST_PRESSURE = 5.14
LARGEST_SHARE = 0.71


# Only domes lower than an atom overflow: they fail the certificate.
@np.errstate(divide='ignore', invalid='ignore', over='ignore')
def press_membrane(pad: Pad, pressure: Array, force: Array) -> Solved:
    """Compute the exact membrane of a pad pressed on a floor, without adhesion.

    Parameters
    ----------
    pad : Pad
        Its radius and stiffness.
    pressure, force : array
        Gauge pressures, Pa, and normal forces, N, one-dimensional.

    Returns
    -------
    tuple
        Height, depth, contact radius, sphere radius and gap over the radius as rows; status codes;
        and what is allowed at most, as in :mod:`ros_pad.contact.dome`. Gap and contact radius are
        those of the membrane. Its wall is not a sphere: the others are those of the spherical cap
        through rim and edge of contact, as the thesis derives them from measurements (section
        3.2.1).

    Notes
    -----
    The shape depends on ``P = p r/k`` and ``F/(p pi r²)`` only; lengths scale with the radius. The
    relative error of the gap is 1e-12, plus the rounding of the input: 1e-16/(1 - F/(p pi r²))
    near flattening and 1e-15/(6 - P) near bursting.
    """
    unit, area = pad.stiffness / pad.radius, math.pi * pad.stiffness * pad.radius
    p, f = pressure * (pad.radius / pad.stiffness), force / area
    left = deficit(pad, pressure)
    code = np.where(f > 0.0, OK, NO_CONTACT).astype(np.int8)
    code[np.maximum(f, 1e-300) >= p] = FLATTENED
    code[(p > LARGEST_PRESSURE) & (f > LARGEST_SHARE * p)] = FOLD_ZONE
    code[left <= 0.0] = NO_INFLATION
    most = {FLATTENED: float(p[0]) * area, FOLD_ZONE: LARGEST_PRESSURE * unit}
    lengths = np.full((5, code.size), np.nan)

    free = code == NO_CONTACT
    height = free_height(p[free], left[free])
    lengths[:, free] = height, 0.0 * height, 0.0 * height, 0.5 * (height + 1.0 / height), height

    rows = np.flatnonzero(code == OK)
    p, f = p[rows], f[rows]
    share, rest = f / p, (p - f) / p
    t, certain = _rim(p, share, rest, left[rows])
    code[rows[~certain]] = NO_INFLATION  # too close to P = 6 to resolve the balance
    gap = _wall(t, share, rest)[2]
    lengths[:, rows] = np.where(certain, cap_through(gap, share, rest), np.nan)
    return lengths, code, most | {NO_INFLATION: BURST * unit}


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


def _rim(
    pressure: Array, share: Array, rest: Array, left: Array
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return ``t = tan(psi/2)`` at the rim, and whether the residual changes its sign there.

    At the upper end of the bracket the tension is too high: either ``sin psi = P (1 - b²)``, as
    sigma > 1, or close to 180°, where Q is ``6 - 1/l``.
    """
    sine = np.minimum(pressure * rest, 1.0)
    high = np.where(sine < 1.0, sine / (1.0 + np.sqrt(1.0 - sine * sine)), 8.0 / (rest * left))
    high = high * (1.0 + 1e-9)  # stay above the root even where sigma rounds to 1
    given = pressure, share, rest
    rim = rising_root(lambda t: _residual(t, *given), 1e-9 * high, high)
    width = np.minimum(1e-10 + 4e-15 / left, 0.5)
    below, above = _residual(rim * (1.0 - width), *given), _residual(rim * (1.0 + width), *given)
    return rim, (below < 0.0) & (above > 0.0)
