# SPDX-License-Identifier: Apache-2.0
"""Rotation matrices, and 4 x 4 transforms from one frame to another."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# Tensor e with (a x b)_i = e_ijk a_j b_k.
LEVI_CIVITA: Array = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    LEVI_CIVITA[_i, _j, _k], LEVI_CIVITA[_i, _k, _j] = 1.0, -1.0

_CROSS = LEVI_CIVITA.transpose(1, 0, 2).reshape(3, 9)


def skew(vectors: Any) -> Array:
    """Return the matrices [a]x with [a]x b = a x b, (..., 3, 3), of vectors (..., 3)."""
    return (vectors @ _CROSS).reshape(*np.shape(vectors), 3)


def cross(a: Any, b: Any) -> Array:
    """Return a x b of vectors (..., 3), which broadcast; several times as fast as NumPy's."""
    return (skew(a) @ np.asarray(b)[..., None])[..., 0]


def rotation(vector: Any) -> Array:
    """Return the rotation matrix, (3, 3), of a rotation vector (3,), rad (Rodrigues)."""
    x, y, z = vector
    square = x * x + y * y + z * z
    if square > 1e-12:
        angle = math.sqrt(square)
        s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    else:
        s, c = 1.0 - square / 6.0, 0.5
    cx, cy, cz = c * x, c * y, c * z
    sx, sy, sz = s * x, s * y, s * z
    xy, xz, yz = cx * y, cx * z, cy * z
    return np.array(
        (
            (1.0 - cy * y - cz * z, xy - sz, xz + sy),
            (xy + sz, 1.0 - cx * x - cz * z, yz - sx),
            (xz - sy, yz + sx, 1.0 - cx * x - cy * y),
        )
    )


def from_rpy(angles: Any) -> Array:
    """Return the rotation matrix, (3, 3), of roll, pitch and yaw, rad, about fixed axes (URDF)."""
    roll, pitch, yaw = angles
    return rotation((0.0, 0.0, yaw)) @ rotation((0.0, pitch, 0.0)) @ rotation((roll, 0.0, 0.0))


def transform(place: Any, turn: Array) -> Array:
    """Return the transform, (4, 4), with a translation (3,), m, and a rotation (3, 3)."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turn, place
    return made


def quaternion(turn: Array) -> Array:
    """Return the quaternion x y z w, (4,), w >= 0, of a rotation matrix (Shepperd 1978)."""
    (a, b, c), (d, e, f), (g, h, i) = turn.tolist()
    squares = (1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i, 1.0 + a + e + i)
    rows = (
        (squares[0], b + d, c + g, h - f),
        (b + d, squares[1], f + h, c - g),
        (c + g, f + h, squares[2], d - b),
        (h - f, c - g, d - b, squares[3]),
    )
    largest = max(range(4), key=squares.__getitem__)
    # The row of the largest element is that element times the quaternion, without cancellation.
    sign = math.copysign(1.0, rows[largest][3])
    scale = 0.5 * sign / math.sqrt(squares[largest])
    return np.array(rows[largest]) * scale


def matrix(turn: Any) -> Array:
    """Return the rotation of a unit quaternion x y z w."""
    axis = skew(turn[:3])
    return np.eye(3) + 2.0 * turn[3] * axis + 2.0 * axis @ axis
