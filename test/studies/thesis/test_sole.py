# SPDX-License-Identifier: Apache-2.0
import math

import mpmath
import numpy as np
import pytest

from ros_pad.contact import LARGE_PAD, Pad, force_limit, inflate
from ros_pad.contact.design import DESIGN_WATER
from ros_pad.errors import NoEquilibrium
from studies.thesis.sole import CELLS, FLAT, TENSION, rise

READINGS = ('corrected', 'thesis')


def rise_by_polynomial(radius_mm, reading):
    """Return all heights, mm, that satisfy equation 3.101: roots of its square at 30 digits."""
    with mpmath.workdps(30):
        r = mpmath.mpf(radius_mm)
        lift = 2 * mpmath.mpf('0.073') / 2 / (1000 * mpmath.mpf('9.81')) * 10**6  # mm²
        if reading == 'corrected':
            share = 9 * mpmath.sqrt(3) / 2 / mpmath.pi
            # lift √((3r − h) h) = h g(h), g = share r² − 1.5 r h + h²/3
            g = [mpmath.mpf(1) / 3, -1.5 * r, share * r * r]
        else:
            share = (mpmath.pi / 3 + mpmath.sqrt(3)) / mpmath.pi
            g = [mpmath.mpf(1) / 3, share * r * r - 1.5 * r]
        square = [mpmath.mpf(0)] * (2 * len(g))
        for i, first in enumerate(g):
            for j, second in enumerate(g):
                square[i + j] += first * second
        square[-2] += lift**2
        square[-1] -= 3 * lift**2 * r
        roots = mpmath.polyroots(square, maxsteps=500, extraprec=200)
        return [
            float(root.real)
            for root in roots
            if abs(root.imag) < 1e-15
            and 0 < root.real <= 3 * r
            and mpmath.polyval(g, root.real) >= 0
        ]


def test_coefficients_of_both_readings():
    assert FLAT['corrected'] == pytest.approx(1.721779607181829, rel=1e-14)
    assert FLAT['thesis'] == pytest.approx(4.860612, rel=1e-6)
    assert TENSION['corrected'] == pytest.approx(4.27170082044296, rel=1e-14)
    assert CELLS['corrected'] == pytest.approx(7.7942, rel=4e-6)
    assert CELLS['thesis'] == pytest.approx(2.7792, rel=2e-5)
    # The printed cell is smaller than the cell of touching flat pads.
    assert 2 * math.sqrt(3) / CELLS['thesis'] > 1.24


def test_the_design_pressure_inflates_to_one_and_a_half_radii():
    for pad in (LARGE_PAD, Pad(0.7e-3, 25.0)):
        pressure = TENSION['corrected'] * pad.stiffness / pad.radius
        dome = inflate(pad, pressure)
        assert dome.sphere_radius == pytest.approx(1.5 * pad.radius, rel=1e-13)
        assert dome.height > pad.radius  # more than a half sphere: it overhangs
        # It is beyond the model of the pressed dome.
        with pytest.raises(NoEquilibrium):
            force_limit(pad, pressure, 'flattening')


@pytest.mark.parametrize('reading', READINGS)
@pytest.mark.parametrize('radius', [0.05, 0.566, 1.0, 2.5, 20.0])
def test_rise_is_the_only_root_of_3_101(radius, reading):
    roots = rise_by_polynomial(radius, reading)
    (height,) = rise(np.array([radius * 1e-3]), DESIGN_WATER, reading)
    if reading == 'thesis' and radius < 0.5652:
        assert roots == []
        assert math.isnan(height)
        return
    assert len(roots) == 1
    assert height == pytest.approx(roots[0] * 1e-3, rel=1e-12)
