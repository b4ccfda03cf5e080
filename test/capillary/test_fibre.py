# SPDX-License-Identifier: Apache-2.0
"""A vertical fibre in a wide bath: the limit of thin walls."""

import json
import math
import pathlib

import pytest
from scipy.integrate import solve_ivp

from ros_pad.capillary import Wall, bath_meniscus
from ros_pad.contact import Liquid

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference' / 'fibre_meniscus.json'
ROWS = json.loads(REFERENCE.read_text())['rows']


def rise(radius, theta):
    """Return the height on a fibre in capillary lengths."""
    liquid = Liquid(1.0, 1.0, 1.0, theta)
    return bath_meniscus(wall=Wall.cylinder(radius), liquid=liquid, gravity=1.0).height


@pytest.mark.parametrize('row', ROWS, ids=lambda row: f'{row["theta"]}-{row["r_over_lambda"]}')
def test_reference_table(row):
    radius, theta = row['r_over_lambda'], math.radians(row['theta'])
    # The largest error of the table itself is 7e-8.
    assert rise(radius, theta) == pytest.approx(row['h_over_lambda'], rel=1e-7)


@pytest.mark.parametrize(
    ('radius', 'degrees'), [(1e-4, 0), (1e-4, 85), (0.02, 40), (0.5, 0), (3.0, 70), (100.0, 10)]
)
def test_surface_ends_in_the_bath(radius, degrees):
    """Integrated outward, a surface that starts too high turns up, one too low dives under."""

    def runs_under(height):
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
            (0.0, 40.0),
            (radius, height, math.radians(90 - degrees)),
            method='DOP853',
            rtol=1e-11,
            atol=1e-14 * min(radius, height),
            events=(level, upright),
        )
        return path.t_events[0].size > 0

    height = rise(radius, math.radians(degrees))
    assert runs_under(height * (1 - 1e-7)) and not runs_under(height * (1 + 1e-7))


@pytest.mark.parametrize('theta', [0.0, 0.6, 1.5])
def test_thick_fibre_is_a_plate(theta):
    plate = math.sqrt(2.0 * (1.0 - math.sin(theta)))
    # The first correction is of the order of 1 / radius and lowers the height.
    assert 0.0 < plate - rise(1e4, theta) < 1e-4 * plate


@pytest.mark.parametrize('radius', [1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize('theta', [0.0, 0.5, 1.2, 2.0])
def test_thin_fibre_is_the_asymptote_of_derjaguin(radius, theta):
    thin = math.log(4.0 / (radius * (1.0 + math.sin(theta)))) - 0.5772156649015329
    thin *= radius * math.cos(theta)
    exact = rise(radius, theta)
    assert thin == pytest.approx(exact, rel=20 * radius**2 * abs(math.log(radius)) + 1e-10)


@pytest.mark.parametrize('theta', [0.01, 0.4, 1.3])
def test_depression_mirrors_rise(theta):
    assert rise(0.04, math.pi - theta) == pytest.approx(-rise(0.04, theta), rel=1e-9)
