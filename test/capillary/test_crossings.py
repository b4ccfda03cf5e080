# SPDX-License-Identifier: Apache-2.0
"""Bodies that overlap are refused wherever they do; bodies that only touch are accepted.

Geometry gives the expected results: convex bodies do not overlap if they are apart along one
direction; they overlap if circles inside them at one height do.
"""

import math
import re

import numpy as np
import pytest

from ros_pad.capillary import Mesh
from ros_pad.errors import MeshError

R, B = 1.55e-3, 0.6e-3
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 1e-3
CUBE_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def turned(points, turn):
    c, s = math.cos(turn), math.sin(turn)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def together(*bodies, kind=float):
    """Return one mesh of bodies (points, faces), with points rounded to numbers of a kind."""
    begin = np.cumsum([0] + [len(points) for points, _ in bodies])
    faces = [faces + first for (_, faces), first in zip(bodies, begin, strict=False)]
    points = np.concatenate([points for points, _ in bodies]).astype(kind).astype(float)
    return Mesh(points, np.concatenate(faces), 'pad.stl')


def refused(*bodies, kind=float):
    """Check that bodies are refused, and return the place in the message, m."""
    with pytest.raises(MeshError) as error:
        together(*bodies, kind=kind)
    said = re.fullmatch(
        r'pad\.stl: bodies overlap, .* at \((.*), (.*), (.*)\) m', str(error.value)
    )
    assert said, error.value
    return np.array([float(each) for each in said.groups()])


@pytest.mark.parametrize('seed', range(8))
def test_domes_overlap_or_not_at_any_azimuth(seed):
    rng = np.random.default_rng(seed)
    rings, sectors = rng.integers(3, 32, 2).tolist()
    dome, azimuth = Mesh.dome(R, B, 2.2e-3, rings, sectors), rng.uniform(0.0, 7.0)
    along = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    other = turned(dome.points, rng.uniform(0.0, 7.0))
    apart = (dome.points @ along).max() - (other @ along).min()
    one = dome.points, dome.faces
    together(one, (other + 1.0001 * apart * along, dome.faces))
    inner = np.hypot(*dome.points[:-2, :2].T).max() * math.cos(math.pi / sectors)
    second = other + (2.0 * inner - 0.1 * R) * along
    place = refused(one, (second, dome.faces))
    assert math.dist(place[:2], [0.0, 0.0]) < 1.001 * R
    assert math.dist(place[:2], second[-1, :2]) < 1.001 * R


@pytest.mark.parametrize(
    ('low', 'high'),
    [
        ((0.5e-3, 0.0, 0.0), (1.5e-3, 1e-3, 1e-3)),  # no edge crosses a face
        ((0.5e-3, 0.5e-3, 0.0), (1.5e-3, 1.5e-3, 1e-3)),
        ((0.0, 0.0, 0.0), (1e-3, 1e-3, 1e-3)),  # the same box twice
        ((0.25e-3, 0.25e-3, 0.0), (0.75e-3, 0.75e-3, 1e-3)),  # within, from floor to top
        ((0.25e-3, 0.25e-3, 0.25e-3), (0.75e-3, 0.75e-3, 0.75e-3)),  # within
        ((0.25e-3, -1e-3, 0.25e-3), (0.75e-3, 2e-3, 0.75e-3)),  # through the whole cube
        ((0.99e-3, 0.2e-3, 0.2e-3), (2e-3, 0.5e-3, 0.5e-3)),  # by a hundredth
    ],
)
@pytest.mark.parametrize('turn', [0.0, 1.0])
@pytest.mark.parametrize('kind', [float, np.float32])
def test_boxes_overlap(low, high, turn, kind):
    cube, box = turned(CUBE, turn), turned(np.where(CUBE > 0, high, low), turn)
    place = refused((cube, CUBE_FACES), (box, CUBE_FACES), kind=kind)
    back = turned(place, -turn)
    assert (back >= np.maximum(low, 0.0) - 1e-6).all()  # the message has four digits
    assert (back <= np.minimum(high, 1e-3) + 1e-6).all()


@pytest.mark.parametrize(
    ('low', 'high'),
    [
        ((1e-3, 0.0, 0.0), (2e-3, 1e-3, 1e-3)),  # a whole face
        ((0.0, 1e-3, 0.0), (1e-3, 2e-3, 1e-3)),
        ((1e-3, 0.3e-3, 0.2e-3), (2e-3, 0.7e-3, 5e-3)),  # part of a face
        ((1e-3, 1e-3, 0.0), (2e-3, 2e-3, 1e-3)),  # an edge
        ((0.2e-3, 0.3e-3, 1e-3), (0.5e-3, 5e-3, 2e-3)),  # on top, reaching beyond the edge
    ],
)
@pytest.mark.parametrize('kind', [float, np.float32])
def test_boxes_that_touch_do_not_overlap(low, high, kind):
    points = np.concatenate([CUBE, np.where(CUBE > 0, high, low)])
    for turn in (0.0, 0.27, math.pi / 2, 3.0):
        there = turned(points, turn) + np.array([0.3, -0.21, 0.0])
        both = together((there[:8], CUBE_FACES), (there[8:], CUBE_FACES), kind=kind)
        assert both.volume == pytest.approx(1e-9 + np.prod(np.subtract(high, low)), rel=1e-3)


@pytest.mark.parametrize(
    'mesh',
    [
        Mesh.dome(R, 0.0, 2.0 * R - 1e-6, rings=40, sectors=60),
        Mesh.cylinder(1e-3, 2e-3, sectors=1000),
        Mesh.cylinder(1e-4, 0.2, rings=1, sectors=7),
        Mesh.dome_pattern(19, 3.1001e-3, R, B, 2.8e-3, rings=10, sectors=24),
    ],
    ids=lambda mesh: mesh.source,
)
def test_rounding_in_a_file_is_no_overlap(mesh, tmp_path):
    pytest.importorskip('meshio')
    mesh = Mesh(turned(mesh.points, 0.4) + np.array([0.011, -0.007, 0.0]), mesh.faces)
    mesh.write(tmp_path / 'pad.stl')
    assert Mesh.read(tmp_path / 'pad.stl').volume == pytest.approx(mesh.volume, rel=2e-3)


def test_a_body_that_cuts_itself():
    # Two pyramids share a base; the tip of the lower one is moved up and out through a side of the
    # upper one.
    a, b, c, top, tip = range(5)
    faces = np.array(
        [[a, b, top], [b, c, top], [c, a, top], [b, a, tip], [c, b, tip], [a, c, tip]]
    )
    points = 1e-3 * np.array(
        [[0, 0, 0.2], [1, 0, 0.2], [0.5, 1, 0.2], [0.5, 0.3, 1.2], [0.5, 0.3, 0.0]]
    )
    together((points, faces))
    points[:4, 2] -= 0.2e-3
    points[tip] = 1e-3 * np.array([0.5, -0.5, 0.2])
    refused((points, faces))
    # A tip inside the upper pyramid cuts nothing.
    points[tip] = 1e-3 * np.array([0.5, 0.3, 0.6])
    together((points, faces))
