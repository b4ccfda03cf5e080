# SPDX-License-Identifier: Apache-2.0
"""Surfaces of least energy, compared with exact menisci, level films and balances of forces."""

import math

import numpy as np
import pytest

from ros_pad.capillary import Mesh, Wall, bath_meniscus, wet_surface
from ros_pad.contact import Liquid
from ros_pad.errors import MeshError, NoSurface

SPHERE, REST = 1.55e-3, 0.583e-3
START = math.asin(REST / SPHERE)
WALL = Wall.dome(SPHERE, REST, 2.9e-3)
HEXAGON = math.sqrt(0.75)


def water(degrees, density=1000.0):
    return Liquid(0.073, 0.027, density, math.radians(degrees))


def shaped(change, shift=(0.0, 0.0)):
    """Return a dome with x and y multiplied by functions of azimuth."""
    dome = Mesh.dome(SPHERE, REST, 2.8e-3, 40, 80)
    x, y, z = dome.points.T
    across, along = change(np.arctan2(y, x))
    return Mesh(np.column_stack([x * across + shift[0], y * along + shift[1], z]), dome.faces)


@pytest.mark.slow
@pytest.mark.parametrize('degrees', [20, 110])
def test_bath_round_a_dome_is_the_exact_one_to_second_order(degrees):
    exact = bath_meniscus(WALL, water(degrees))
    errors = []
    for refinements in (0, 1, 2):
        found = wet_surface(WALL, water(degrees), refinements=refinements)
        errors.append(abs(found.mean_height / exact.height - 1.0))
    assert errors[2] < 1e-3
    assert errors[0] / errors[1] > 3.0 and errors[1] / errors[2] > 3.0
    assert -found.force[2] == pytest.approx(exact.force, rel=1e-3)
    assert found.force[:2] == pytest.approx([0.0, 0.0], abs=1e-6 * exact.force)


@pytest.mark.parametrize('degrees', [3, 80])
def test_the_error_holds_the_exact_height(degrees):
    mesh, liquid = Mesh.cylinder(0.5e-3, 6e-3), water(degrees)
    exact = bath_meniscus(Wall.cylinder(0.5e-3, 6e-3, 0.0), liquid)
    found = wet_surface(mesh, liquid)
    assert abs(found.mean_height / exact.height - 1.0) < found.error < 0.04
    assert -found.force[2] == pytest.approx(exact.force, rel=2e-3)


def test_the_minimum_is_found_to_its_last_digits():
    found = wet_surface(Wall.cylinder(0.2e-3, 10e-3, 0.0), water(10), sectors=12)
    # That with a hundredth of the tolerance.
    assert found.mean_height == pytest.approx(0.632198397726e-3, rel=1e-7)


@pytest.mark.parametrize('degrees', [10, 80])
@pytest.mark.parametrize(
    'wall',
    [Wall.dome(0.05e-3, 0.01e-3), Wall.dome(20e-3, 2e-3, 5e-3), Wall.cone(1e-3, 1.0, 4e-3)],
    ids=['tiny', 'wide', 'cone'],
)
def test_pads_of_other_shapes_and_sizes(wall, degrees):
    """Coarse meshes describe a curved surface with an error that falls on finer meshes."""
    exact = bath_meniscus(wall, water(degrees))
    errors = [
        abs(wet_surface(wall, water(degrees), None, n, 0).mean_height / exact.height - 1.0)
        for n in (24, 36)
    ]
    assert errors[0] < 0.08 and errors[1] < errors[0] / 1.5


def test_bath_round_a_meshed_dome():
    exact = bath_meniscus(WALL, water(50))
    found = wet_surface(Mesh.dome(SPHERE, REST, 2.8e-3, 40, 80), water(50))
    assert found.mean_height == pytest.approx(exact.height, rel=3e-3)
    assert np.ptp(found.line[:, 2]) < 2e-3 * exact.height


def test_bath_round_an_oval_pad_off_the_origin():
    """The pad carries the weight of the liquid above the floor, and no side force by symmetry."""
    oval = shaped(lambda azimuth: (1.25, 1.0 / 1.25), shift=(3e-3, -1e-3))
    found = wet_surface(oval, water(50))
    assert found.axis == pytest.approx((3e-3, -1e-3), abs=1e-7)
    assert found.line[:, :2].mean(axis=0) == pytest.approx(found.axis, abs=1e-6)
    assert -found.force[2] == pytest.approx(9810.0 * found.volume, rel=3e-3)
    assert found.force[:2] == pytest.approx([0.0, 0.0], abs=1e-5 * abs(found.force[2]))
    heights, x = found.line[:, 2], abs(found.line[:, 0] - 3e-3)
    # The liquid stands lower at the sharp ends.
    assert heights[np.argmax(x)] < 0.98 * heights.max()
    assert heights[np.argmax(x)] == pytest.approx(heights.min(), rel=1e-6)


def test_without_weight_the_film_between_domes_is_level():
    """The film meets the spheres at the contact angle where cos φ = -cos θ, at any pitch."""
    cell = 6e-3**2 * HEXAGON
    found = wet_surface(WALL, water(50, 1e-6), cell, refinements=2)
    level = SPHERE * (math.cos(START) + math.cos(math.radians(50)))
    assert found.vertices[:, 2] == pytest.approx(level, rel=1e-3)
    cap = math.cos(START) - level / SPHERE
    sunk = math.pi * SPHERE**3 * (math.cos(START) - cap - (math.cos(START) ** 3 - cap**3) / 3.0)
    assert found.volume == pytest.approx(cell * level - sunk, rel=3e-3)


def test_liquid_rises_higher_between_close_domes_and_their_pads_carry_it():
    heights = [bath_meniscus(WALL, water(50)).height]
    for pitch in (8e-3, 4e-3, 3.4e-3):
        found = wet_surface(WALL, water(50), HEXAGON * pitch**2)
        heights.append(found.mean_height)
        assert -found.force[2] == pytest.approx(9810.0 * found.volume, rel=5e-3)
    assert heights == sorted(heights)


@pytest.mark.parametrize(
    ('wall', 'degrees', 'word'),
    [
        (Wall.cone(2e-3, 2.1, 2e-3), 80, 'below the floor'),
        (Wall.cylinder(1e-3, 1e-3, 0.0), 0, 'top'),
    ],
)
def test_liquid_that_leaves_the_wall_is_refused(wall, degrees, word):
    with pytest.raises(NoSurface, match=word) as refusal:
        wet_surface(wall, water(degrees))
    assert refusal.value.status == 'rim'


def test_meshes_that_are_no_wall_are_refused():
    two = Mesh.dome_pattern(2, 4e-3, SPHERE, REST)
    twisted = shaped(lambda azimuth: 2 * [1.0 + 0.9 * np.cos(3.0 * azimuth)], (0.0, 0.0))
    leaning = Mesh(twisted.points + twisted.points[:, 2:] * (3.0, 0.0, 0.0), twisted.faces)
    for mesh in (two, leaning, Mesh.cylinder(1e-3, 2e-3, 1, 3)):
        with pytest.raises(MeshError, match='the wall'):
            wet_surface(mesh, water(50))
