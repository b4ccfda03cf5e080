# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ros_pad.contact.fibre import fibre_meniscus
from ros_pad.errors import InvalidInput

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference' / 'fibre_meniscus.json'
ROWS = json.loads(REFERENCE.read_text())['rows']
UNIT = {'surface_tension': 1.0, 'density': 1.0, 'gravity': 1.0}  # capillary length 1


@pytest.mark.parametrize('row', ROWS, ids=lambda row: f'{row["theta"]}-{row["r_over_lambda"]}')
def test_reference_table(row):
    radius, theta = row['r_over_lambda'], math.radians(row['theta'])
    # The largest error of the table itself is 7e-8.
    assert fibre_meniscus(radius, contact_angle=theta, **UNIT) == pytest.approx(
        row['h_over_lambda'], rel=1e-7
    )
    if radius <= 0.1:
        asymptote = fibre_meniscus(radius, contact_angle=theta, method='derjaguin', **UNIT)
        assert asymptote == pytest.approx(row['james'], rel=1e-13)


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

    height = fibre_meniscus(radius, contact_angle=math.radians(degrees), **UNIT)
    # A surface that starts too high turns up before it is level with the bath.
    assert runs_under(height * (1 - 1e-7)) and not runs_under(height * (1 + 1e-7))


@pytest.mark.parametrize('theta', [0.0, 0.6, 1.5])
def test_thick_fibre_is_a_plate(theta):
    plate = math.sqrt(2.0 * (1.0 - math.sin(theta)))
    height = fibre_meniscus(1e4, contact_angle=theta, **UNIT)
    # The first correction is of the order of 1 / radius and lowers the height.
    assert 0.0 < plate - height < 1e-4 * plate


@pytest.mark.parametrize('radius', [1e-6, 1e-4, 1e-2])
def test_thin_fibre_is_the_asymptote(radius):
    for theta in (0.0, 0.5, 1.2, 2.0):
        exact = fibre_meniscus(radius, contact_angle=theta, **UNIT)
        thin = fibre_meniscus(radius, contact_angle=theta, method='derjaguin', **UNIT)
        assert thin == pytest.approx(exact, rel=20 * radius**2 * abs(math.log(radius)) + 1e-10)


def test_depression_mirrors_rise():
    for theta in (0.0, 0.4, 1.3):
        up = fibre_meniscus(1e-4, 0.073, theta)
        assert fibre_meniscus(1e-4, 0.073, math.pi - theta) == pytest.approx(-up, rel=1e-12)
    assert abs(fibre_meniscus(1e-4, 0.073, math.pi / 2)) < 1e-18
    assert fibre_meniscus(1e-4, 0.073, 0.0) > 0


def test_units():
    length = math.sqrt(0.05 / (800.0 * 9.81))
    height = fibre_meniscus(0.3 * length, 0.05, 0.2, density=800.0)
    assert height == pytest.approx(
        length * fibre_meniscus(0.3, contact_angle=0.2, **UNIT), rel=1e-9
    )
    assert type(height) is float


def test_asymptote_takes_arrays():
    radii = np.array([[1e-5], [1e-4]])
    heights = fibre_meniscus(radii, 0.073, np.array([0.0, 0.5, 2.0]), method='derjaguin')
    assert heights.shape == (2, 3)
    assert heights[1, 2] == fibre_meniscus(1e-4, 0.073, 2.0, method='derjaguin') < 0
    with pytest.raises(InvalidInput, match='broadcast'):
        fibre_meniscus([1e-5, 1e-4], 0.073, [0.0, 0.5, 2.0], method='derjaguin')


@pytest.mark.parametrize(
    ('change', 'name'),
    [
        ({'radius': 0.0}, 'radius'),
        ({'radius': 1e-9}, 'capillary length'),
        ({'radius': 100.0}, 'capillary length'),
        ({'radius': 3e-4, 'method': 'derjaguin'}, 'capillary length'),
        ({'radius': [1e-4, 2e-4]}, 'radius'),
        ({'surface_tension': -1.0}, 'surface_tension'),
        ({'contact_angle': 3.2}, 'contact_angle'),
        ({'density': 0.0}, 'density'),
        ({'gravity': 0.0}, 'gravity'),
        ({'method': 'james'}, 'young_laplace, derjaguin'),
    ],
)
def test_bad_input(change, name):
    with pytest.raises(InvalidInput, match=name):
        fibre_meniscus(
            **{'radius': 1e-4, 'surface_tension': 0.073, 'contact_angle': 0.0, **change}
        )
