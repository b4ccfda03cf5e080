# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ros_pad.capillary.faces import Face
from ros_pad.capillary.menisci import spanned
from ros_pad.capillary.rails import Line, Rails
from ros_pad.capillary.surface import System, minimise
from ros_pad.errors import InvalidInput, NoSurface

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference'
BRIDGES = json.loads((REFERENCE / 'sphere_plane_bridge.json').read_text())['rows']


def between_discs(height, shift=0.0, sectors=16, rows=6, **asked):
    """Return the surface between two discs of radius 1, pinned at their edges."""
    plate, floor = Face.plate(1.0, height, (shift, 0.0)), Face.floor(1.0)
    start = spanned(plate, floor, (1.0, 1.0), (None, None), sectors, rows)
    return minimise(*start, surface_tension=1.0, **asked)


def test_gradient_and_hessian_are_those_of_finite_differences():
    """The surface has curved rails that vary with the azimuth, weight, pressure and wetting."""
    noise = np.random.default_rng(0)

    def rails(azimuths):
        phi = np.linspace(0.3, 2.5, 129)
        oval = 1.0 + 0.1 * np.cos(2.0 * azimuths)[:, None]
        return np.stack([oval * np.sin(phi), 0.0 * oval + 0.955 - np.cos(phi)], axis=-1)

    vertices, triangles, lines = spanned(
        Face(rails, (0.02, 0.01)), Face.floor(3.0), (0.3, 0.4), (1.0, 0.7), sectors=8, rows=3
    )
    vertices = vertices + 0.01 * noise.normal(size=vertices.shape)
    pressure = 0.3
    problem = Rails(System(1.0, 2.0, 1.0, None, vertices, triangles, lines, pressure))
    q = problem.start + 0.005 * noise.normal(size=problem.start.size)
    _, _, slope, volume_slope = problem.energy(q)
    matrix = problem.matrix(q, pressure).toarray()
    for k, step in enumerate(1e-5 * np.eye(q.size)):
        up, down = problem.energy(q + step), problem.energy(q - step)
        assert slope[k] == pytest.approx((up[0] - down[0]) / 2e-5, abs=1e-8)
        assert volume_slope[k] == pytest.approx((up[1] - down[1]) / 2e-5, abs=1e-8)
        row = (up[2] - down[2] - pressure * (up[3] - down[3])) / 2e-5
        assert matrix[k] == pytest.approx(row, abs=1e-7)


def test_catenoid_between_two_rings():
    half = 0.5
    waist = brentq(lambda c: c * math.cosh(half / c) - 1.0, 0.6, 1.0)
    area = math.pi * waist * (2.0 * half + waist * math.sinh(2.0 * half / waist))
    found = between_discs(2.0 * half, pressure=0.0, refinements=2)
    assert found.area == pytest.approx(area, rel=5e-4)
    # Second order: each refinement divides the error by four.
    errors = np.abs(np.array(found.history) / area - 1.0)
    assert np.all(errors[:-1] / errors[1:] > 3.7)
    x, y, z = found.vertices.T
    catenoid = waist * np.cosh((z - half) / waist)
    assert np.hypot(x, y) == pytest.approx(catenoid, rel=2e-3)
    assert found.residual < 1e-15 and abs(found.change) < 1e-4


@pytest.mark.parametrize('half', [0.67, 1.0])
@pytest.mark.slow
def test_no_catenoid_beyond_the_critical_distance(half):
    """Beyond half a distance of 0.6627 radii, c cosh(half/c) = 1 has no root."""
    with pytest.raises(NoSurface, match='collapses') as refusal:
        between_discs(2.0 * half, pressure=0.0, refinements=1)
    assert refusal.value.status == 'collapsed'


@pytest.mark.parametrize('height', [2.0, 5.0])
def test_lateral_stiffness_of_a_cylinder(height):
    found = between_discs(
        height, 0.01, 32, int(4 * height), volume=math.pi * height, refinements=1
    )
    side, _, up = found.forces[0]
    assert side == pytest.approx(-0.01 * math.pi / height, rel=2e-3)
    # The surface tension pulls the discs together with twice the force with which the pressure
    # pushes them apart.
    assert up == pytest.approx(-math.pi, rel=1e-2)
    assert found.pressure == pytest.approx(1.0, rel=6e-3)
    assert found.forces.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-6)
    assert found.volume == pytest.approx(math.pi * height, rel=1e-8)


def test_a_cylinder_longer_than_its_circumference_breaks():
    """The limit of Plateau and Rayleigh is 2 pi radii; one cylinder is shorter, one longer."""
    assert between_discs(6.1, rows=24, volume=6.1 * math.pi).pressure == pytest.approx(1, rel=0.03)
    with pytest.raises(NoSurface, match='collapses'):
        between_discs(6.5, rows=24, volume=6.5 * math.pi)


@pytest.mark.slow
@pytest.mark.parametrize(
    'row',
    [row for row in BRIDGES if row['beta'] == 30 and row['theta'] >= 20],
    ids=lambda row: f'{row["theta"]}',
)
def test_bridge_between_sphere_and_plane(row):
    theta, beta = math.radians(row['theta']), math.radians(row['beta'])
    phi = np.linspace(0.0, 3.0, 300)
    sphere, floor = Face.revolution(np.sin(phi), 1.0 - np.cos(phi)), Face.floor(2.0)
    start = spanned(
        sphere, floor, (beta / 3.0, row['r0'] / 2.0), (theta, theta), sectors=24, rows=6
    )
    found = minimise(*start, surface_tension=1.0, volume=row['V_over_R3'], refinements=2)
    assert found.forces[0, 2] == pytest.approx(-4 * math.pi * row['F_over_4piRg'], rel=2e-3)
    assert found.forces[1, 2] == pytest.approx(-found.forces[0, 2], rel=1e-6)
    assert found.pressure == pytest.approx(row['dpR_over_gamma'], rel=5e-3)
    assert 3.0 * found.lines[0].places == pytest.approx(beta, rel=4e-3)


def drop_by_ode(apex_curvature, theta):
    """Return volume and height of a sessile drop with capillary length 1."""

    def rates(phi, y):
        r, z, _ = y
        bend = 2.0 * apex_curvature + z - (math.sin(phi) / r if r > 1e-9 else apex_curvature)
        return (
            math.cos(phi) / bend,
            math.sin(phi) / bend,
            math.pi * r * r * math.sin(phi) / bend,
        )

    end = solve_ivp(rates, (1e-9, theta), (1e-9, 0.0, 0.0), rtol=1e-10, atol=1e-14).y[:, -1]
    return end[2], end[1], end[0]


@pytest.mark.parametrize('degrees', [80, 110])
def test_drop_on_the_floor(degrees):
    theta = math.radians(degrees)
    volume, height, radius = drop_by_ode(1.0, theta)
    ring = np.arange(6)
    angles = math.pi / 3.0 * ring
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), 0.0 * angles])
    vertices = np.vstack([rim, [0.0, 0.0, height]])
    triangles = np.column_stack([ring, (ring + 1) % 6, np.full(6, 6)])
    line = Line.ring(Face.floor(4.0), ring, radius / 4.0, theta)
    found = minimise(vertices, triangles, [line], 1.0, 1.0, volume=volume, refinements=4)
    assert found.vertices[:, 2].max() == pytest.approx(height, rel=3e-3)
    assert 4.0 * found.lines[0].places == pytest.approx(radius, rel=4e-3)
    assert found.pressure == pytest.approx(2.0 + height, rel=4e-3)
    # The floor carries the weight.
    assert found.forces[0, 2] == pytest.approx(-volume, rel=1e-6)


@pytest.mark.parametrize(
    ('change', 'name'),
    [
        ({'surface_tension': 0.0}, 'surface_tension'),
        ({'weight': -1.0}, 'weight'),
        ({'volume': -1.0}, 'volume'),
        ({'pressure': 0.0}, 'pressure and volume'),
        ({'volume': None}, 'pressure and volume'),
        ({'volume': None, 'pressure': math.nan}, 'pressure'),
        ({'refinements': 1.5}, 'refinements'),
        ({'vertices': np.zeros((4, 2))}, 'vertices'),
        ({'triangles': np.full((4, 3), 999)}, 'triangles'),
        ({'lines': ()}, 'lines'),
    ],
)
def test_bad_input(change, name):
    start = spanned(Face.plate(1.0, 1.0), Face.floor(1.0), (1.0, 1.0), (None, None))
    asked = dict(zip(('vertices', 'triangles', 'lines'), start, strict=True))
    with pytest.raises(InvalidInput, match=name):
        minimise(**{**asked, 'surface_tension': 1.0, 'volume': 3.0, **change})


def test_triangles_without_area_are_refused():
    vertices, triangles, lines = spanned(
        Face.plate(1.0, 1.0), Face.floor(1.0), (1.0, 1.0), (None, None)
    )
    vertices[30:40] = vertices[30]
    with pytest.raises(NoSurface):
        minimise(vertices, triangles, lines, 1.0, pressure=0.0)


def test_an_edge_on_no_line_is_refused():
    vertices, triangles, lines = spanned(
        Face.plate(1.0, 1.0), Face.floor(1.0), (1.0, 1.0), (None, None)
    )
    with pytest.raises(InvalidInput, match='no line'):
        minimise(vertices, triangles, lines[:1], 1.0, pressure=0.0)
