# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ros_pad.capillary.bath import Wall, bath_meniscus
from ros_pad.contact.meniscus import GRAVITY, Liquid
from ros_pad.errors import NoSurface

# The quick tests of liquid are those of surfaces and meshes.
pytestmark = pytest.mark.slow

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference'
DOMES = json.loads((REFERENCE / 'wet_dome_layers.json').read_text())['rows']
FIBRES = json.loads((REFERENCE / 'fibre_meniscus.json').read_text())['rows']


def unit_liquid(degrees):
    """Return a liquid whose capillary length is 1 m, and whose weight is 1 N/m³."""
    return Liquid(1.0, 1.0, density=1.0 / GRAVITY, contact_angle=math.radians(degrees))


def rise(wall, degrees):
    return bath_meniscus(wall, unit_liquid(degrees))


@pytest.mark.parametrize('row', DOMES[::3], ids=lambda row: f'{row["gl"]}-{row["gs_gl"]}')
def test_dome_of_the_reference_table(row):
    liquid = Liquid(row['gl'], row['gs_gl'] * row['gl'])
    found = bath_meniscus(Wall.dome(1.55e-3, 0.583e-3), liquid)
    assert found.height == pytest.approx(row['exact_bath'], rel=1e-9)
    assert found.status == 'ok'


def runs_under(found, shift):
    """Return whether the surface falls below the bath if it starts higher by the share ``shift``.

    It is integrated outward from the contact line.
    """

    def rates(_, y):
        r, z, psi = y
        return math.cos(psi), -math.sin(psi), -(z + math.sin(psi) / r)

    def level(_, y):
        return y[1]

    def upright(_, y):
        return y[2]

    level.terminal = upright.terminal = True
    path = solve_ivp(
        rates,
        (0.0, 60.0),
        (found.radius, found.height * (1.0 + shift), found.slope),
        method='DOP853',
        rtol=1e-11,
        atol=1e-13,
        events=(level, upright),
    )
    return path.t_events[0].size > 0


@pytest.mark.parametrize(
    ('wall', 'degrees'),
    [
        (Wall.dome(0.5, 0.2), 0),
        (Wall.dome(0.5, 0.2), 90),
        (Wall.dome(0.05, 0.01), 40),
        (Wall.dome(5.0, 1.0), 60),
        (Wall.cone(0.3, 0.6), 30),
        (Wall.cone(2.0, 2.0), 30),
        (Wall.through([0.2, 0.4, 0.5, 0.45], [0.0, 0.3, 0.9, 3.0]), 50),
    ],
)
def test_surface_ends_in_the_bath_at_the_contact_angle(wall, degrees):
    """Integrated outward in arc length, unlike in the method, the surface meets the bath."""
    found = rise(wall, degrees)
    assert found.status == 'ok' and found.height > 0.01
    assert runs_under(found, -1e-7) and not runs_under(found, 1e-7)


def test_force_is_pull_and_suction():
    """The force on a cone is tension at the contact line and suction on each ring of its wall."""
    lean, rest = 1.0 / math.tan(0.7), 0.4
    found = rise(Wall.cone(rest, 0.7), 20)
    h = found.height
    suction = 2.0 * math.pi * lean * (rest * h**2 / 2.0 + lean * h**3 / 3.0)
    pull = 2.0 * math.pi * found.radius * math.sin(found.slope)
    assert found.force == pytest.approx(pull + suction, rel=1e-10)
    assert found.pressure == pytest.approx(-h, rel=1e-15)
    # The volume between surface and wall, by quadrature.
    under = np.trapezoid if hasattr(np, 'trapezoid') else np.trapz
    surface = -math.pi * under(found.heights * 2.0 * found.radii, -found.radii)
    cone = math.pi / 3.0 * (found.radius**2 + found.radius * rest + rest**2) * h
    volume = surface + math.pi * found.radius**2 * h - cone
    assert found.volume == pytest.approx(volume, rel=5e-3)


@pytest.mark.parametrize('row', FIBRES[::7], ids=lambda r: f'{r["theta"]}-{r["r_over_lambda"]}')
def test_cylinder_is_a_fibre(row):
    found = rise(Wall.cylinder(row['r_over_lambda']), row['theta'])
    assert found.height == pytest.approx(row['h_over_lambda'], rel=1e-7)
    weight = 2.0 * math.pi * row['r_over_lambda'] * math.cos(math.radians(row['theta']))
    assert found.force == pytest.approx(weight, rel=1e-12)


def test_right_angle_raises_nothing_on_a_cylinder_and_more_pushes_down():
    level = rise(Wall.cylinder(0.3), 90)
    assert (level.height, level.force, level.volume, level.status) == (0.0, 0.0, 0.0, 'ok')
    up, down = rise(Wall.cylinder(0.3), 60), rise(Wall.cylinder(0.3), 120)
    assert down.height == pytest.approx(-up.height, rel=1e-9)
    assert down.force == pytest.approx(-up.force, rel=1e-9)
    assert down.pressure > 0.0 and down.status == 'ok'


def test_edge_of_the_wall_holds_the_liquid():
    free = rise(Wall.cylinder(0.4), 10)
    held = rise(Wall.cylinder(0.4, height=0.5 * free.height), 10)
    assert held.status == 'rim'
    assert held.height == pytest.approx(0.5 * free.height, rel=1e-12)
    assert held.slope < free.slope
    assert runs_under(held, -1e-7) and not runs_under(held, 1e-7)


def test_of_several_the_first_from_the_floor_is_taken():
    """With a narrow neck under a wide rim the liquid can stand low, or high below the rim."""
    z = np.linspace(0.0, 1.6, 60)
    r = 0.02 + 0.6 / (1.0 + np.exp(-(z - 0.5) / 0.03))
    found = rise(Wall.through(r, z), 30)
    assert found.status == 'several'
    neck = rise(Wall.cylinder(0.02), 30)
    assert found.height == pytest.approx(neck.height, rel=1e-3)


def test_surface_through_the_wall_is_refused():
    """The wall has a ridge that juts out between the floor and the contact line."""
    z = np.linspace(0.0, 2.0, 2001)
    r = 0.4 + 0.4 * np.exp(-(((z - 0.54) / 0.003) ** 2))
    with pytest.raises(NoSurface, match='run through') as refusal:
        rise(Wall.through(r, z), 10)
    assert refusal.value.status == 'blocked'
