# SPDX-License-Identifier: Apache-2.0
"""Bodies that overlap are found wherever they do; bodies that only touch are accepted.

Geometry gives the expected results: convex bodies do not overlap if they are apart along one
direction; they overlap if circles inside them at one height do, or if a ball fits into both.
"""

import math
import pathlib
import re

import numpy as np
import pytest

from ros_pad.capillary import Mesh
from ros_pad.errors import MeshError

# The quick tests of liquid are those of surfaces and meshes.
pytestmark = pytest.mark.slow

R, B = 1.55e-3, 0.6e-3
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 1e-3
CUBE_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def box(low, high) -> Mesh:
    return Mesh(np.where(CUBE > 0, high, low), CUBE_FACES, 'box')


def moved(mesh: Mesh, x: float = 0.0, y: float = 0.0, turn: float = 0.0, kind=float) -> Mesh:
    """Turn a mesh about the z axis, shift it, and round its points to numbers of type ``kind``."""
    c, s = math.cos(turn), math.sin(turn)
    points = mesh.points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [x, y, 0.0]
    return Mesh(points.astype(kind).astype(float), mesh.faces, mesh.source)


def arrays(*meshes: Mesh) -> tuple[np.ndarray, np.ndarray]:
    begin = np.cumsum([0] + [len(mesh.points) for mesh in meshes])
    faces = [mesh.faces + first for mesh, first in zip(meshes, begin, strict=False)]
    return np.concatenate([mesh.points for mesh in meshes]), np.concatenate(faces)


def together(*meshes: Mesh) -> Mesh:
    return Mesh(*arrays(*meshes), 'together')


def refusal(points: np.ndarray, faces: np.ndarray) -> tuple[str, np.ndarray]:
    """Check that a mesh is refused, and return the reason and the place, m, in the message."""
    with pytest.raises(MeshError) as refused:
        Mesh(points, faces, 'pad.stl')
    said = re.fullmatch(r'pad\.stl: (.*) at \((.*), (.*), (.*)\) m', str(refused.value))
    assert said, refused.value
    return said[1], np.array([float(each) for each in said.groups()[1:]])


def overlap(*meshes: Mesh) -> np.ndarray:
    what, place = refusal(*arrays(*meshes))
    assert what == 'bodies overlap'
    return place


def outer(mesh: Mesh, azimuth: float) -> float:
    """Return how far a body reaches along an azimuth, m."""
    return float((mesh.points[:, :2] @ [math.cos(azimuth), math.sin(azimuth)]).max())


def inner(mesh: Mesh, sectors: int, heights: np.ndarray) -> np.ndarray:
    """Return the radii of circles that fit into a body of revolution at some heights, m."""
    r, z = np.hypot(*mesh.points[:-2, :2].T), mesh.points[:-2, 2]
    order = np.argsort(z, kind='stable')
    return np.interp(heights, z[order], r[order]) * math.cos(math.pi / sectors)


# --- Bodies that overlap, and bodies that do not -----------------------------------------------


@pytest.mark.parametrize('seed', range(12))
def test_domes_overlap_or_not_at_any_azimuth(seed: int):
    rng = np.random.default_rng(seed)
    rings, sectors = rng.integers([3, 3], [32, 64], (2, 2)).T.tolist()
    one = Mesh.dome(R, B, 2.2e-3, rings[0], sectors[0])
    if seed % 3 == 0:  # the same dome twice, which may be exact mirror images
        rings[1], sectors[1] = rings[0], sectors[0]
        other = one
    else:
        other = Mesh.dome(rng.uniform(0.3, 1.2) * R, 0.1e-3, None, rings[1], sectors[1])
    turn = rng.uniform(0.0, 7.0) if seed % 2 else 0.0
    other = moved(other, turn=turn)
    whole = 2.0 * math.pi / sectors[0] * float(rng.integers(sectors[0]))
    azimuth = whole if seed % 4 < 2 else rng.uniform(0.0, 7.0)
    share = R * 10.0 ** rng.uniform(-3.0, math.log10(0.3))

    def beside(distance: float) -> Mesh:
        return moved(other, distance * math.cos(azimuth), distance * math.sin(azimuth))

    apart = outer(one, azimuth) + outer(other, azimuth + math.pi)
    together(one, beside(apart + 1e-3 * share))
    heights = np.linspace(0.0, min(one.height, other.height), 300)
    fit = inner(one, sectors[0], heights) + inner(other, sectors[1], heights)
    second = beside(float(fit.max()) - share)
    place = overlap(one, second)
    for body, middle in ((one, [0.0, 0.0]), (second, second.points[-1, :2])):
        widest = np.hypot(*(body.points[:, :2] - middle).T).max()
        assert math.dist(place[:2], middle) < 1.001 * widest
        assert -1e-9 <= place[2] <= 1.001 * body.height


def test_small_bodies_between_large_triangles_are_found():
    plate = box([0.0, 0.0, 0.0], [10e-3, 10e-3, 1e-3])
    dome = Mesh.dome(0.2e-3, 0.05e-3, None, 12, 24)
    # The domes stand beside the plate; one reaches into it by a hundredth of the dome's radius.
    ring = [
        moved(dome, x, y)
        for k in range(20)
        for x, y in [(10.3e-3, 0.5e-3 * k), (-0.3e-3, 0.5e-3 * k)]
    ]
    together(plate, *ring)
    late = moved(dome, 5e-3, 10e-3 + 0.198e-3)
    place = overlap(plate, *ring, late)
    assert np.allclose(place, [5e-3, 10e-3, 0.2e-3], rtol=0.0, atol=0.08e-3)


@pytest.mark.parametrize(
    ('low', 'high'),
    [
        (
            (0.5e-3, 0.0, 0.0),
            (1.5e-3, 1e-3, 1e-3),
        ),  # side by side: edges lie in faces, and none crosses a face
        ((0.5e-3, 0.5e-3, 0.0), (1.5e-3, 1.5e-3, 1e-3)),
        ((0.0, 0.0, 0.0), (1e-3, 1e-3, 1e-3)),  # the same box twice
        ((0.0, 0.0, 0.0), (0.5e-3, 0.5e-3, 0.5e-3)),  # a small box in a corner
        ((0.25e-3, 0.25e-3, 0.0), (0.75e-3, 0.75e-3, 1e-3)),  # within, from floor to top
        ((0.25e-3, -1e-3, 0.25e-3), (0.75e-3, 2e-3, 0.75e-3)),  # through the whole cube
        ((0.999e-3, 0.2e-3, 0.2e-3), (2e-3, 0.3e-3, 0.3e-3)),  # an overlap of a thousandth
    ],
)
@pytest.mark.parametrize('turn', [0.0, 1.0])
@pytest.mark.parametrize('kind', [float, np.float32])
def test_boxes_with_faces_in_common_planes_overlap(low, high, turn: float, kind):
    points = np.concatenate([CUBE, np.where(CUBE > 0, high, low)])
    c, s = math.cos(turn), math.sin(turn)
    turned = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    what, place = refusal(
        turned.astype(kind).astype(float), np.concatenate([CUBE_FACES, CUBE_FACES + 8])
    )
    assert what == 'bodies overlap'
    back = place @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    # The message has four digits.
    assert (back >= np.maximum(low, 0.0) - 1e-6).all()
    assert (back <= np.minimum(high, 1e-3) + 1e-6).all()


TOUCHING = [
    ((1e-3, 0.0, 0.0), (2e-3, 1e-3, 1e-3)),  # a whole face
    ((1e-3, 0.3e-3, 0.2e-3), (2e-3, 0.7e-3, 5e-3)),  # part of a face
    ((1e-3, 1e-3, 0.0), (2e-3, 2e-3, 1e-3)),  # an edge
    ((0.2e-3, 0.3e-3, 1e-3), (0.5e-3, 5e-3, 2e-3)),  # on top, reaching beyond the edge
    ((1e-3, 1e-3, 1e-3), (2e-3, 2e-3, 2e-3)),  # a point
    ((2e-3, 0.0, 0.0), (3e-3, 1e-3, 1e-3)),  # nothing; both stand on the floor
]


@pytest.mark.parametrize(('low', 'high'), TOUCHING)
@pytest.mark.parametrize('kind', [float, np.float32])
def test_boxes_that_touch_do_not_overlap(low, high, kind):
    faces = np.concatenate([CUBE_FACES, CUBE_FACES + 8])
    points = np.concatenate([CUBE, np.where(CUBE > 0, high, low)])
    for turn in np.linspace(0.0, 3.0, 12):
        for shift in (0.0, 0.013, 0.3):
            c, s = math.cos(turn), math.sin(turn)
            there = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            there[:, :2] += [shift, -0.7 * shift]
            both = Mesh(there.astype(kind).astype(float), faces)
            assert both.volume == pytest.approx(1e-9 + np.prod(np.subtract(high, low)), rel=1e-3)


SHAPES = [
    Mesh.dome(R, B, rings=24, sectors=36),
    Mesh.dome(R, 0.0, 2.0 * R - 1e-6, rings=40, sectors=60),
    Mesh.cone(2e-3, 0.0, 1e-4, 8, sectors=240),
    Mesh.cylinder(1e-3, 2e-3, sectors=1000),
    Mesh.cylinder(1e-4, 0.2, rings=1, sectors=7),
    Mesh.dome_pattern(19, 3.1001e-3, R, B, 2.8e-3, rings=10, sectors=24),
]


@pytest.mark.parametrize('k', range(len(SHAPES)))
def test_no_rounding_makes_an_overlap(k: int, tmp_path: pathlib.Path):
    pytest.importorskip('meshio')
    for j, (shift, turn) in enumerate([(0.0, 0.0), (0.011, 0.4), (0.3, 2.0), (-2e-3, 0.785)]):
        there = moved(SHAPES[k], shift, -0.6 * shift, turn)
        for suffix in ('.stl', '.ply'):
            path = tmp_path / f'{j}{suffix}'
            there.write(path)
            assert Mesh.read(path).volume == pytest.approx(there.volume, rel=2e-3)


# --- Single bodies that cut themselves ----------------------------------------------------------


def test_a_body_that_cuts_itself_in_triangles_with_a_corner_in_common():
    # Two pyramids share a base; the tip of the lower one is moved up and out through a side of the
    # upper one.
    a, b, c, top, tip = range(5)
    faces = [[a, b, top], [b, c, top], [c, a, top], [b, a, tip], [c, b, tip], [a, c, tip]]
    points = 1e-3 * np.array(
        [[0, 0, 0.2], [1, 0, 0.2], [0.5, 1, 0.2], [0.5, 0.3, 1.2], [0.5, 0.3, 0.0]]
    )
    Mesh(points, np.array(faces))
    points[:4, 2] -= 0.2e-3
    points[tip] = 1e-3 * np.array([0.5, -0.5, 0.2])
    what, place = refusal(points, np.array(faces))
    assert what == 'the mesh cuts itself'
    # Here the edge from c to the tip pierces the side y = 0.3 z.
    pierced = points[c] + (points[tip] - points[c]) / 1.56
    assert math.dist(place, pierced) < 1e-6
    # A tip inside the upper pyramid cuts nothing.
    points[tip] = 1e-3 * np.array([0.5, 0.3, 0.6])
    Mesh(points, np.array(faces))


# --- Bodies within bodies -----------------------------------------------------------------------


@pytest.mark.parametrize('z', [0.0, 0.3e-3])
@pytest.mark.parametrize('size', [1e-5, 5e-4])
def test_a_body_within_another_is_found(z: float, size: float):
    big, small = Mesh.dome(R, 0.9e-3, rings=12, sectors=24), Mesh.cylinder(size, size, 1, 12)
    points, faces = arrays(big, small)
    for first in (True, False):
        if not first:  # the same bodies in the other order
            points, faces = arrays(small, big)
        inside = slice(len(big.points), None) if first else slice(len(small.points))
        there = points.copy()
        there[inside] += [0.2e-3, 0.1e-3, z]
        what, place = refusal(there, faces)
        assert what == 'bodies overlap'
        assert math.dist(place[:2], [0.2e-3, 0.1e-3]) <= 1.5 * size
        assert z - 1e-9 <= place[2] <= z + size
