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

The height is that of the outer face over its flat state, the volume that under the inner face. What
bends is in t² H. The functions f are powers of t and H, also with
C2/μ and C3/μ, and of ``u = t/(t + H)``, in which bending turns into stretching. All vanish with t.
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
HIGHEST = {'bonded': 1.5, 'clamped': 1.1}
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
    *((i, j, 0) for i in (1, 2, 3) for j in (0, 1, 2)),
    *((i, 0, k) for i in (0, 1) for k in (1, 2, 3, 4)),
)
_WITH_C2 = (*((1, j, 0) for j in (0, 1, 2, 3)), (1, 0, 1), (0, 0, 2))
_WITH_C3 = ((1, 1, 0), (1, 2, 0), (1, 3, 0))

# fmt: off
# Coefficients a and b by edge.
PRESSURE: dict[str, tuple[float, ...]] = {
    'bonded': (
        -2.9777, 2.1041, -0.61973, -7.374, 1.3145, -1.6442, 11.585, -7.8723, 4.554, 1.3068,
        -9.6394, 28.391, -18.869, 15.365, -35.342, 20.794, 0.48297, -7.3958, 25.856, -28.578,
        11.048, 4.8919, 0.9227, -37.37, 116.44, -63.271
    ),
    'clamped': (
        -4.035, 3.7675, -1.2989, -23.396, 24.605, -12.739, 23.616, -31.115, 15.862, 1.6367,
        -11.185, 30.069, -19.617, 22.267, -40.691, 37.181, -10.608, -7.703, 30.323, -42.272,
        20.748, 3.7312, 1.3282, -19.179, 76.743, -63.579
    ),
}
VOLUME: dict[str, tuple[float, ...]] = {
    'bonded': (
        0.51954, 0.42852, -0.65252, 7.7902, -9.394, 5.2384, -8.7792, 15.535, -9.1409, -0.59262,
        -0.92566, 3.4779, -2.2972, -1.7302, -4.7228, 7.9451, -2.9956, -0.85789, 1.1379, -1.49,
        1.5972, 1.0174, 0.0077288, -8.3348, 30.367, -22.949
    ),
    'clamped': (
        -0.0041152, 0.91249, -0.92044, 9.6251, -14.285, 7.4145, -10.975, 18.887, -10.072,
        -0.55843, -0.98751, 3.3026, -1.986, -2.3338, -2.3625, 4.6672, -1.9873, -1.2915, 3.3599,
        -6.2203, 3.4513, 1.0741, 0.11063, 0.046836, 0.93954, -1.2737
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
