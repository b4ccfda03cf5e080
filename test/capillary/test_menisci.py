# SPDX-License-Identifier: Apache-2.0
import math
import types

import numpy as np
import pytest

from ros_pad.capillary.bath import Wall, bath_meniscus
from ros_pad.capillary.faces import Face
from ros_pad.capillary.menisci import bath_surface, pattern_surface
from ros_pad.contact.meniscus import Liquid
from ros_pad.errors import InvalidInput, MeshError, NoSurface

# The quick tests of liquid are those of surfaces and meshes.
pytestmark = pytest.mark.slow

SPHERE, REST = 1.55e-3, 0.583e-3
START = math.asin(REST / SPHERE)
DOME = Face.of_wall(Wall.dome(SPHERE, REST))


def water(degrees):
    return Liquid(0.073, 0.027, contact_angle=math.radians(degrees))


def line_heights(found):
    return found.vertices[found.lines[0].vertices, 2]


def dome_mesh(layers, slices, oval=1.0, lid=False):
    """Return vertices, m, and triangles of the dome as a mesh, open at bottom and top.

    ``oval`` stretches it along x and shrinks it along y; ``lid`` closes bottom and top.
    """
    phi = np.linspace(START, 2.6, layers)
    turn = np.linspace(0.0, 2.0 * math.pi, slices, endpoint=False)
    r, z = SPHERE * np.sin(phi), SPHERE * (math.cos(START) - np.cos(phi))
    x, y = (oval * np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn)) / oval)
    vertices = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1).reshape(-1, 3)
    i, j = np.divmod(np.arange((layers - 1) * slices), slices)
    a, b = i * slices + j, i * slices + (j + 1) % slices
    walls = [np.stack([a, b, b + slices], 1), np.stack([a, b + slices, a + slices], 1)]
    if lid:
        vertices = np.vstack([vertices, [0.0, 0.0, 0.0], [0.0, 0.0, z[-1]]])
        ring, n = np.arange(slices), len(vertices)
        top = (layers - 1) * slices + ring
        walls.append(np.column_stack([np.roll(ring, -1), ring, np.full(slices, n - 2)]))
        walls.append(np.column_stack([top, np.roll(top, -1), np.full(slices, n - 1)]))
    return vertices, np.concatenate(walls)


@pytest.mark.slow
@pytest.mark.parametrize('degrees', [20, 110])
def test_bath_round_a_dome_is_the_exact_one_to_second_order(degrees):
    exact = bath_meniscus(SPHERE, REST, liquid=water(degrees))
    errors = []
    for refinements in (0, 1, 2):
        found = bath_surface(DOME, water(degrees), refinements=refinements)
        errors.append(abs(line_heights(found).mean() / exact.height - 1.0))
    assert errors[2] < 1e-3
    assert errors[0] / errors[1] > 3.0 and errors[1] / errors[2] > 3.0
    assert -found.forces[0, 2] == pytest.approx(exact.force, rel=1e-3)
    assert found.forces[0, :2] == pytest.approx([0.0, 0.0], abs=1e-6 * exact.force)
    assert found.pressure == 0.0


@pytest.mark.parametrize('reach', [2.0, 4.0])
def test_what_a_bath_beyond_reach_would_change(reach):
    exact = bath_meniscus(SPHERE, REST, liquid=water(50))
    found = bath_surface(DOME, water(50), reach=reach, sectors=16)
    most = 2.1 * math.exp(-2.0 * reach) + 5e-3  # of reach, and of the mesh
    assert found.volume == pytest.approx(exact.volume, rel=most)
    assert line_heights(found).mean() == pytest.approx(exact.height, rel=most)
    assert -found.forces[0, 2] == pytest.approx(exact.force, rel=most)


def test_bath_round_a_meshed_dome():
    exact = bath_meniscus(SPHERE, REST, liquid=water(50))
    face = Face.of_mesh(dome_mesh(40, 80))
    heights = line_heights(bath_surface(face, water(50), refinements=1))
    assert heights.mean() == pytest.approx(exact.height, rel=3e-3)
    assert np.ptp(heights) < 2e-3 * exact.height
    azimuths = np.linspace(0.0, 6.0, 7)
    closed = dome_mesh(40, 80, lid=True)  # bottom and top are no wall
    mesh = types.SimpleNamespace(points=closed[0], faces=closed[1])
    assert np.array_equal(Face.of_mesh(mesh).rails(azimuths), face.rails(azimuths))


def test_radii_of_a_meshed_dome_are_second_order():
    errors = []
    for layers in (20, 40, 80):
        rails = Face.of_mesh(dome_mesh(layers, 2 * layers)).rails(np.linspace(0.0, 6.0, 7))
        phi = np.arccos(math.cos(START) - rails[..., 1] / SPHERE)
        errors.append(np.max(abs(rails[..., 0] / (SPHERE * np.sin(phi)) - 1.0)))
    assert errors[2] < 1e-3
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]


def test_bath_round_an_oval_pad():
    """The pad carries the weight of the liquid above the floor, and no side force by symmetry."""
    found = bath_surface(Face.of_mesh(dome_mesh(40, 80, oval=1.25)), water(50), refinements=1)
    assert -found.forces[0, 2] == pytest.approx(9810.0 * found.volume, rel=3e-3)
    assert found.forces[0, :2] == pytest.approx([0.0, 0.0], abs=1e-5 * abs(found.forces[0, 2]))
    heights, x = line_heights(found), abs(found.vertices[found.lines[0].vertices, 0])
    # The liquid stands lower at the sharp ends.
    assert heights[np.argmax(x)] < 0.98 * heights.max()
    assert heights[np.argmax(x)] == pytest.approx(heights.min(), rel=1e-6)


@pytest.mark.parametrize(('pitch', 'sides'), [(3.4e-3, 4), (3.4e-3, 6), (6e-3, 6)])
@pytest.mark.slow
def test_without_weight_the_film_between_domes_is_level(pitch, sides):
    """The film meets the spheres at the contact angle where cos φ = -cos θ, at any pitch."""
    found = pattern_surface(
        DOME, water(50), pitch, sides, pressure=0.0, gravity=0.0, refinements=2
    )
    level = SPHERE * (math.cos(START) + math.cos(math.radians(50)))
    assert found.vertices[:, 2] == pytest.approx(level, rel=1e-3)
    cell = pitch**2 if sides == 4 else 0.5 * math.sqrt(3.0) * pitch**2
    cap = math.cos(START) - level / SPHERE
    sunk = math.pi * SPHERE**3 * (math.cos(START) - cap - (math.cos(START) ** 3 - cap**3) / 3.0)
    assert found.volume == pytest.approx(cell * level - sunk, rel=3e-3)
    again = pattern_surface(
        DOME, water(50), pitch, sides, volume=found.volume, gravity=0.0, refinements=2
    )
    assert again.pressure == pytest.approx(0.0, abs=2e-3 * 0.073 / SPHERE)
    assert line_heights(again) == pytest.approx(level, rel=2e-3)
    wetted = 2.0 * math.pi * SPHERE * level
    line = math.pi * SPHERE**2 * math.sin(math.radians(50)) ** 2
    energy = 0.073 * (cell - line - math.cos(math.radians(50)) * wetted)
    assert (found.energy, again.energy) == pytest.approx((energy, energy), rel=1e-6)


def test_liquid_rises_higher_between_close_domes_and_their_pads_carry_it():
    wide = bath_meniscus(SPHERE, REST, liquid=water(50)).height
    heights = []
    for pitch in (8e-3, 4e-3, 3.4e-3):
        found = pattern_surface(DOME, water(50), pitch, pressure=0.0)
        heights.append(line_heights(found).mean())
        assert -found.forces[0, 2] == pytest.approx(9810.0 * found.volume, rel=5e-3)
    assert wide < heights[0] < heights[1] < heights[2]


def test_meshes_that_are_no_wall():
    vertices, triangles = dome_mesh(20, 40)
    for wrong in (triangles[3:], triangles[::2], triangles[triangles.max(axis=1) < 400][5:]):
        with pytest.raises(MeshError, match='wall of the mesh'):
            Face.of_mesh((vertices, wrong))
    with pytest.raises(MeshError, match=r'0\.003, 0 m'):
        Face.of_mesh((vertices, triangles), centre=(3e-3, 0.0))
    flipped = np.concatenate([triangles[:1, ::-1], triangles[1:]])
    with pytest.raises(MeshError, match='leans over itself'):
        Face.of_mesh((vertices, flipped))


@pytest.mark.slow
@pytest.mark.parametrize('degrees', [10, 80])
@pytest.mark.parametrize(
    'wall',
    [
        Wall.dome(0.05e-3, 0.01e-3),
        Wall.dome(20e-3, 2e-3, 5e-3),
        Wall.cone(1e-3, 1.0, 4e-3),
        Wall.cylinder(0.2e-3, 10e-3, 0.0),
    ],
    ids=['tiny', 'wide', 'cone', 'cylinder'],
)
def test_pads_of_other_shapes_and_sizes(wall, degrees):
    """Coarse meshes describe a curved surface with an error that falls on finer meshes."""
    exact = bath_meniscus(wall=wall, liquid=water(degrees))
    found = bath_surface(Face.of_wall(wall), water(degrees), refinements=0)
    finer = bath_surface(Face.of_wall(wall), water(degrees), sectors=36, refinements=0)
    errors = [abs(line_heights(it).mean() / exact.height - 1.0) for it in (found, finer)]
    assert errors[0] < 0.08 and errors[1] < errors[0] / 1.5


@pytest.mark.parametrize(
    ('wall', 'degrees', 'word'),
    [
        (Wall.cone(2e-3, 2.1, 2e-3), 80, 'below the floor'),
        (Wall.cylinder(1e-3, 1e-3, 0.0), 0, 'top'),
    ],
)
def test_liquid_that_leaves_the_wall_is_refused(wall, degrees, word):
    with pytest.raises(NoSurface, match=word) as refusal:
        bath_surface(Face.of_wall(wall), water(degrees))
    assert refusal.value.status == 'rim'


@pytest.mark.parametrize(
    ('call', 'name'),
    [
        (lambda: pattern_surface(DOME, water(50), 3e-3, pressure=0.0), 'pitch'),
        (lambda: pattern_surface(DOME, water(50), 4e-3, 5, pressure=0.0), 'sides'),
        (lambda: pattern_surface(DOME, water(50), 4e-3, pressure=0.0, sectors=16), 'sectors'),
        (lambda: pattern_surface(DOME, water(50), 4e-3), 'pressure and volume'),
        (lambda: bath_surface(DOME, water(50), gravity=0.0), 'gravity'),
        (lambda: bath_surface(DOME, water(50), reach=0.0), 'reach'),
        (lambda: bath_surface(DOME, water(50), sectors=3), 'sectors'),
    ],
)
def test_bad_input(call, name):
    with pytest.raises(InvalidInput, match=name):
        call()
