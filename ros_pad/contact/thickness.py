# SPDX-License-Identifier: Apache-2.0
"""What the thickness of a sheet changes in its free dome: a correction of the membrane.

A thick sheet bends, its outer face rises less than its inner one, and its edge may give way:

``bonded``
    The sheet goes on beyond the rim, and its inner face is bonded there.
``clamped``
    The cylinder at the rim is held over the whole thickness.

With ``t = h/r`` and ``P = p r/(μ h)``, in units of the radius, a state of the membrane with the
stretch λ at its apex becomes a state of the solid:

    height    H = H_m - t (1 - λ^-2)/2
    pressure  P = (P_m + 7 t² H) (1 + Σ a_k f_k)
    volume    V = V_m (1 + Σ b_k f_k)

The height is that of the outer face over its flat state, the volume that under the inner face.
The term with t² is the order of what bends a plate. The functions f are powers of t, H and
``u = t/(t + H)``, in which bending turns into stretching, also with C2/μ and C3/μ. All vanish
with t.
The coefficients are fitted to solid finite elements by ``python -m studies thickness --fit``, and
the errors are measured on solids that are not in the fit (docs/model/hyperelastic.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ros_pad.configuration import choice
from ros_pad.configuration import number
from ros_pad.errors import InvalidInput

if TYPE_CHECKING:
    import numpy.typing as npt

    from ros_pad.contact.material import Material

    Array = npt.NDArray[np.float64]

THICKEST = 0.4
"""Largest thickness over radius of the solids."""
LARGEST_C2, LARGEST_C3 = 0.08, 0.035
"""Largest C2/μ, and largest -C3/C2, of the solids."""
HIGHEST = {'bonded': 1.45, 'clamped': 1.0}
"""Height of the outer face over the radius up to which there are solids, by edge."""


def check_edge(
    edge: str | None, radius: float, thickness: float | None, material: Material | None
) -> None:
    """Raise `InvalidInput` where the correction is not known."""
    if edge is None:
        return
    choice('edge', edge, tuple(HIGHEST))
    if material is None or thickness is None:
        raise InvalidInput(f'edge = {edge} is not allowed: a pad of a material is needed')
    number('thickness', thickness, f'm with edge = {edge}', 0.0, THICKEST * radius, above=True)
    kind, (_, c2, c3, *_) = material.unit_law
    if kind != 'yeoh' or not (0.0 <= c2 <= LARGEST_C2 and -LARGEST_C3 * c2 <= c3 <= 0.0):
        raise InvalidInput(
            f'edge = {edge} is not allowed with the law {material}: the correction for thickness'
            f' is known for neo_hookean and yeoh with C2/mu from 0 to {LARGEST_C2:g} and C3/C2'
            f' from -{LARGEST_C3:g} to 0 (mu = 2 C1); without edge the pad is a membrane'
        )


BENDING = 7.0
"""Factor of t² H in the pressure."""

# Powers of t, H and u of the functions f; those with C2/μ, and with C3/μ.
_POWERS = (
    *((i, j, 0) for i in (1, 2, 3) for j in (0, 1, 2, 3)),
    *((0, 0, k) for k in (1, 2, 3, 4, 5, 6)),
    *((1, 0, k) for k in (1, 2, 3, 4)),
)
_WITH_C2 = (*((1, j, 0) for j in (0, 1, 2, 3)), (1, 0, 1))
_WITH_C3 = ((1, 1, 0), (1, 2, 0), (1, 3, 0))

# fmt: off
# Coefficients a and b by edge.
PRESSURE: dict[str, tuple[float, ...]] = {
    'bonded': (
        -0.23729, -1.7503, 2.4342, -0.94677, -9.794, 26.601, -31.69, 11.029, 15.864, -47.235,
        56.944, -20.305, 0.20616, 1.1638, -15.108, 67.529, -82.949, 30.835, 2.5125, -8.5889,
        -4.317, 8.6895, -5.2181, 18.994, -20.87, 8.181, 5.073, -15.735, 54.178, -22.749
    ),
    'clamped': (
        -0.20952, -0.90594, 1.9078, -0.9496, -25.094, 58.7, -58.251, 19.709, 29.687, -93.839,
        111.17, -44.333, 0.13117, 3.2364, -26.381, 90.532, -103.35, 37.683, 2.5458, 1.2446,
        -6.1607, 5.0615, -4.0856, 17.377, -24.924, 12.97, 3.7958, -9.3084, 43.685, -38.286
    ),
}
VOLUME: dict[str, tuple[float, ...]] = {
    'bonded': (
        0.58887, -0.49534, 0.60238, -0.45429, 0.76542, 4.7289, -8.4896, 4.4498, -0.14832, -8.0599,
        15.753, -8.4325, -0.57059, -0.98127, 0.30417, 7.2233, -11.138, 4.8284, 1.2979, -6.3355,
        9.5245, -4.5176, -0.92168, 1.9552, -3.1317, 2.4701, 0.9736, -9.9924, 35.996, -27.19
    ),
    'clamped': (
        0.01474, 0.80912, -1.3776, 0.51322, 3.0452, -5.9746, 6.5602, -3.1003, -3.7099, 7.3092,
        -9.7561, 5.5537, -0.56643, -0.92322, -0.015001, 7.739, -11.436, 4.8838, 0.61326, -3.9489,
        6.2479, -3.1388, -0.98916, 2.6985, -5.8321, 3.4806, 1.0127, -1.1601, 4.8331, -4.0953
    ),
}
# fmt: on


def functions(ratio: Array, height: Array, c2: Array, c3: Array) -> Array:
    """Return the functions f as columns, for t, H, C2/μ and C3/μ as one-dimensional arrays."""
    turn = ratio / (ratio + height)
    columns = []
    for factor, powers in ((1.0, _POWERS), (c2, _WITH_C2), (c3, _WITH_C3)):
        columns += [factor * ratio**i * height**j * turn**k for i, j, k in powers]
    return np.stack(columns, axis=1)


def outer_height(ratio: Array, height: Array, strain: Array) -> Array:
    """Return H from t, the height of the membrane, and λ - 1."""
    return height - 0.5 * ratio * (1.0 - (1.0 + strain) ** -2)


def thickened(
    edge: str, ratio: float, law: tuple[float, ...], strain: Array, membrane: tuple[Array, ...]
) -> tuple[Array, Array, Array]:
    """Return P, H and V of the solid.

    Parameters
    ----------
    edge : {'bonded', 'clamped'}
        How the sheet is held.
    ratio : float
        Thickness over radius.
    law : tuple
        C1, C2 and C3 over μ.
    strain : array
        λ - 1 of the membrane.
    membrane : tuple of array
        P, height and volume of the membrane.
    """
    pressure, height, volume = membrane
    t = np.full_like(height, ratio)
    outer = outer_height(t, height, strain)
    f = functions(t, outer, *(np.full_like(t, c) for c in law[1:]))
    push = (pressure + BENDING * ratio**2 * outer) * (1.0 + f @ PRESSURE[edge])
    return push, outer, volume * (1.0 + f @ VOLUME[edge])
