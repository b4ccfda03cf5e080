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

from ros_pad.configuration import choice, number
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
        -0.11929, -2.0272, 2.5548, -0.88542, -9.7518, 26.97, -31.292, 10.207, 15.656, -46.752,
        55.278, -18.826, 0.20096, 1.155, -15.084, 67.741, -83.433, 31.091, 2.5526, -9.6823,
        -2.5624, 7.8982, -6.3819, 21.352, -23.641, 9.5549, 6.3007, -37.941, 123.8, -71.849
    ),
    'clamped': (
        -0.22023, -0.88849, 1.849, -0.89571, -25.137, 58.703, -57.944, 19.341, 29.651, -93.164,
        109.26, -42.856, 0.1345, 3.1989, -26.248, 90.323, -103.19, 37.621, 2.6474, 0.96537,
        -5.8706, 4.9999, -4.0162, 17.007, -24.109, 12.44, 3.7446, -8.4666, 40.527, -35.598
    ),
}
VOLUME: dict[str, tuple[float, ...]] = {
    'bonded': (
        0.53441, -0.29955, 0.32691, -0.33443, 0.77473, 3.9414, -6.9871, 3.7061, -0.19652, -6.6265,
        12.694, -6.7778, -0.5652, -1.0247, 0.47196, 6.887, -10.806, 4.6995, 1.3863, -6.3051,
        9.3496, -4.3973, -0.58082, 0.75568, -1.0875, 1.3767, 0.65066, -7.5748, 27.483, -20.699
    ),
    'clamped': (
        0.013764, 0.81077, -1.3816, 0.51682, 3.0442, -5.9815, 6.5875, -3.1271, -3.7113, 7.3485,
        -9.873, 5.6477, -0.56617, -0.92574, -0.006102, 7.7239, -11.423, 4.879, 0.61954, -3.9631,
        6.2598, -3.1407, -0.98494, 2.6767, -5.7805, 3.4447, 1.0091, -1.11, 4.6256, -3.9082
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
