# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ros_pad.contact.squeeze import HalfSpace, Membrane, squeeze, trapped_film
from ros_pad.errors import InvalidInput

RADIUS, LOAD, MODULUS, WATER = 1.5e-3, 0.3, 395e3, 1.0e-3
MEAN = LOAD / (math.pi * RADIUS**2)


def balance(film):
    """Return by how much the liquid in the film and the liquid that has left differ over time."""
    liquid = film.thickness @ film.area + film.drained
    return np.max(np.abs(liquid / liquid[0] - 1.0))


# --- deflection -------------------------------------------------------------------------------


def deflections(surface, force, rings):
    """Return radii, and deflections in units of a/E* or a²/T, by a pressure.

    It is given by its force on the disc of radius r, over π.
    """
    edges = np.linspace(0.0, 1.0, rings + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    pressure = np.diff(force(edges)) / np.diff(edges**2)
    return middles, surface.deflection(edges, middles) @ pressure


@pytest.mark.parametrize(
    'force, exact',
    [
        # Johnson, Contact Mechanics, 3.4: pressures √(1 - r²) and, of a flat punch, 1/√(1 - r²).
        (lambda r: (1.0 - (1.0 - r**2) ** 1.5) / 1.5, lambda r: 0.25 * math.pi * (2.0 - r**2)),
        (lambda r: 2.0 - 2.0 * np.sqrt(1.0 - r**2), lambda r: np.full_like(r, math.pi)),
    ],
)
def test_a_half_space_deflects_as_in_the_books(force, exact):
    errors = []
    for rings in (50, 200):
        r, found = deflections(HalfSpace(RADIUS, MODULUS), force, rings)
        inner = r < 0.9
        errors.append(np.max(np.abs(found - exact(r))[inner]))
    assert errors[1] < 2e-3 and errors[1] < 0.3 * errors[0]


def test_a_membrane_deflects_as_a_paraboloid():
    r, found = deflections(Membrane(RADIUS, 50.0, 75e3), np.square, 50)
    assert found == pytest.approx(0.25 * (1.0 - r**2), rel=1e-10)


# --- stiff and soft limits --------------------------------------------------------------------


def test_a_stiff_sole_is_a_rigid_disc():
    """Stefan: 1/h² grows by 4 p t/(3 η a²). A dent adds at most its depth to the mean film."""
    times = np.array([1e-4, 1e-3, 1e-2])
    stefan = (1.0 / 3e-4**2 + 4.0 * MEAN * times / (3.0 * WATER * RADIUS**2)) ** -0.5
    for modulus in (2e8,):
        film = squeeze(HalfSpace(RADIUS, modulus), 3e-4, times, load=LOAD).mean
        dent = 2.0 * MEAN * RADIUS / modulus
        assert np.all(film > stefan)
        assert np.all(film < 1.0003 * stefan + dent)


def test_a_flat_soft_sole_traps_a_lens():
    """Uniform pressure p: depth (2 - 4/π) p a/E* in the middle, 16/(3π) - 4/π in the mean."""
    film = squeeze(HalfSpace(RADIUS, MODULUS), 3e-4, [1e-3, 0.01, 0.1], load=LOAD)
    unit = MEAN * RADIUS / MODULUS
    assert film.mean[-1] == pytest.approx((16.0 / 3.0 - 4.0) / math.pi * unit, rel=2e-3)
    assert film.thickness[-1, 0] == pytest.approx((2.0 - 4.0 / math.pi) * unit, rel=2e-3)
    assert trapped_film(RADIUS, MODULUS, MEAN) == pytest.approx(film.mean[-1], rel=2e-3)
    middle = film.radius < 0.9 * RADIUS
    assert film.pressure[-1, middle] == pytest.approx(MEAN, rel=0.01)
    # The lens keeps its shape, and the rim closes as η E* a/(p² t): ten times in ten.
    assert film.thickness[:2, -1][0] / film.thickness[1, -1] == pytest.approx(10.0, rel=0.4)
    assert film.status == 'ok'


# --- published results for curved surfaces ----------------------------------------------------


def pinched_rim():
    """Return K and the least H of H''' = 1/H³ with H' -> -1 inward and H'' -> K outward.

    It is the rim of the dimple under a surface of constant tension (Frankel and Mysels, J. Phys.
    Chem. 66 (1962) 190; Jones and Wilson, J. Fluid Mech. 87 (1978) 263).
    """
    start = 400.0  # far inside: H = start, H' = -1 + 1/(2 H), H'' = 1/(2 H²)
    found = solve_ivp(
        lambda x, y: [y[1], y[2], y[0] ** -3],
        (0.0, 2.0 * start),
        [start, -1.0 + 0.5 / start, 0.5 / start**2],
        rtol=1e-10,
        atol=1e-12,
        max_step=0.5,
    )
    return found.y[2, -1], found.y[0].min()


def test_the_dimple_under_a_dome_drains_as_one_of_constant_tension():
    """Parabola of height m, rim slope s = 2 m/b: dm/dt = -4 q/b, q = T K s⁵/(12 η κ), κ = p/T."""
    pressure, contact, tension = 75e3, 0.57e-3, 58.0
    load = pressure * math.pi * contact**2
    times = np.array([0.03, 0.3, 3.0])
    film = squeeze(Membrane(1.5 * contact, tension, pressure), 3e-4, times, load=load)
    end, least = pinched_rim()
    bend = pressure / tension
    middle = (WATER * bend * contact**6 / (128.0 / 3.0 * end * tension * times)) ** 0.25
    rim = least * end * (2.0 * middle / contact) ** 2 / bend
    for found, limit in ((film.thickness[:, 0], middle), (film.thickness.min(axis=1), rim)):
        away = np.abs(found / limit - 1.0)
        assert away[2] < 0.03
        assert away[2] < away[1] < away[0] < 0.15
    assert film.radius[film.thickness[-1].argmin()] == pytest.approx(contact, rel=0.01)


def test_a_pressed_sphere_ends_in_hertz_contact():
    """Its pressure falls outward, so it traps no lens: the film drains and the rest is Hertz'."""
    curvature, load, modulus = 200.0, 0.05, 395e3
    contact = (0.75 * load / (curvature * modulus)) ** (1.0 / 3.0)
    surface = HalfSpace(2.5 * contact, modulus, curvature)
    film = squeeze(surface, 2e-5, [0.1, 10.0, 1000.0], load=load, rings=150)
    hertz = 1.5 * load / (math.pi * contact**2)
    assert film.pressure[-1, 0] == pytest.approx(hertz, rel=0.02)
    assert film.pressure[-1, film.radius > 1.1 * contact] == pytest.approx(0.0, abs=0.01 * hertz)
    assert film.thickness[-1, 0] < 0.2 * film.thickness[0, 0]
    assert film.load == pytest.approx([load] * 3, rel=1e-10)


# --- what holds for each film -----------------------------------------------------------------


@pytest.mark.parametrize('modulus', [40e3, 395e3])
def test_liquid_and_load_are_kept_and_films_stay_positive(modulus):
    times = np.geomspace(1e-6, 3.0, 9)
    film = squeeze(HalfSpace(RADIUS, modulus), 3e-4, times, load=LOAD, rings=80)
    assert balance(film) < 1e-9
    assert film.load == pytest.approx([LOAD] * 9, rel=1e-10)
    assert np.all(film.thickness > 0.0)
    assert film.drained[-1] > 0.0
    assert film.status == ('large_strain' if modulus == 40e3 else film.status)


def test_second_order_in_rings():
    sole = HalfSpace(RADIUS, MODULUS)
    means = [
        squeeze(sole, 3e-4, [1e-3], load=LOAD, rings=rings, tolerance=1e-8).mean[0]
        for rings in (20, 40, 80)
    ]
    order = math.log2((means[0] - means[1]) / (means[1] - means[2]))
    assert 1.7 < order < 2.6


def test_share_of_dry_contact():
    film = squeeze(HalfSpace(RADIUS, MODULUS), 3e-6, [0.0, 1.0], load=LOAD, rings=50)
    assert film.dry_share(1e-6)[0] == pytest.approx(math.exp(-9.0), rel=1e-9)
    assert film.dry_share(1e-6, 1.0)[0] == pytest.approx(math.exp(-3.0), rel=1e-9)
    assert film.dry_share(1.0) == pytest.approx([1.0, 1.0])


# --- refusals ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'changed, words',
    [
        ({'time': [0.1, 0.1]}, 'time = .* rising'),
        ({'surface': HalfSpace(RADIUS, 1e13)}, 'it is rigid, use film_thickness'),
        ({'surface': Membrane(1e-3, 50.0, 1e5)}, r'radius = 0.001 m .* 0.001466 m, is needed'),
    ],
)
def test_refused(changed, words):
    values = {'surface': HalfSpace(RADIUS, MODULUS), 'initial': 3e-4, 'time': [0.1], 'load': LOAD}
    with pytest.raises(InvalidInput, match=words):
        squeeze(**(values | changed))
