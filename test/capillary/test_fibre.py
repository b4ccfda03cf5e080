# SPDX-License-Identifier: Apache-2.0
"""A vertical fibre in a wide bath: the limit of thin walls."""

import json
import math
import pathlib

import pytest

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


@pytest.mark.parametrize('radius', [1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize('theta', [0.0, 0.5, 1.2, 2.0])
def test_thin_fibre_is_the_asymptote_of_derjaguin(radius, theta):
    thin = math.log(4.0 / (radius * (1.0 + math.sin(theta)))) - 0.5772156649015329
    thin *= radius * math.cos(theta)
    exact = rise(radius, theta)
    assert thin == pytest.approx(exact, rel=20 * radius**2 * abs(math.log(radius)) + 1e-10)
