# SPDX-License-Identifier: Apache-2.0
"""Figures 26 to 31 of the thesis."""

import math

import numpy as np
import pytest

from ros_pad.contact import WATER
from studies.thesis import liquid as figures

pytestmark = pytest.mark.slow

FIGURES = {each.number: each for each in figures.draw()}


def test_exact_curvature_is_that_of_the_surface():
    for degrees in (60.0, 30.0):
        found = figures.exact(0.004, degrees)
        out, up = np.diff(found.radii[:7]), np.diff(found.heights[:7])
        along = np.append(0.0, np.cumsum(np.hypot(out, up)))
        middles = 0.5 * (along[1:] + along[:-1])
        bend = -np.polyfit(middles, np.arctan2(-up, out), 3)[-2]
        liquid = figures.liquid_at(0.004, degrees)
        assert math.degrees(liquid.angle) == pytest.approx(degrees)
        assert figures.exact_curvature(found, liquid) == pytest.approx(1.0 / bend, rel=1e-3)


def test_pull_on_one_half_is_what_half_the_liquid_needs():
    """Half of the liquid, cut along the axis, is balanced by tension and suction in the cut."""
    found, liquid = figures.exact(0.004, 60.0), figures.liquid_at(0.004, 60.0)
    sphere, rest = figures.dome()
    r, z = found.radii, found.heights
    longer = float(np.sum(np.hypot(np.diff(r), np.diff(z)) - np.diff(r)))
    levels = np.linspace(0.0, found.height, 2001)[1:]
    outer = np.interp(levels, z[::-1], r[::-1])
    wall = np.sqrt(sphere**2 - (levels - math.sqrt(sphere**2 - rest**2)) ** 2)
    suction = 9810.0 * float(np.mean(levels * (outer - wall))) * found.height
    expected = 2.0 * (0.004 * (found.radius - longer) - suction)
    assert figures.one_sided(found, liquid) == pytest.approx(expected, rel=2e-3)


def test_radius_is_in_proportion_on_a_cone_alone():
    """R = h/(1 + cos(θ + a)), which is 5.53 h where θ + a = 145°."""
    first, last, *cone = FIGURES[30].claims[0].numbers
    assert first > 5.0 * last
    expected = 1.0 / (1.0 + math.cos(math.radians(145.0)))
    assert cone == pytest.approx([expected] * 3, rel=1e-3)


def test_water_between_domes_stays_below_its_limit():
    lone, close, limit = FIGURES[31].claims[0].numbers
    sphere, rest = figures.dome()
    assert limit == pytest.approx(math.sqrt(sphere**2 - rest**2) + sphere * math.cos(WATER.angle))
    assert 0.9 * limit < close < limit
    # Liquid at one dome alone is 0 to 20 % above 0.789 mm.
    assert 1.0 < lone / 0.789e-3 < 1.2
    # Volume of water: a hexagonal cell without a segment of the sphere.
    (volume,) = FIGURES[31].claims[2].numbers
    height = figures.filled(figures.PITCHES[0], 'energy').height
    centre = math.sqrt(sphere**2 - rest**2)
    inside = math.pi * (sphere**2 * height + ((centre - height) ** 3 - centre**3) / 3.0)
    cell = math.sqrt(0.75) * figures.PITCHES[0] ** 2
    assert volume == pytest.approx(cell * height - inside, rel=5e-3)


def test_general_shape_is_not_round_and_is_not_pushed_sideways():
    general, net, printed, mended, half = FIGURES[27].claims[0].numbers
    assert net < 0.01 * general
    assert printed > 0.0 > mended > half
    layers, surface = FIGURES[26].claims[1].numbers
    assert layers > surface > 10.0  # µm


def test_what_is_stated(agree):
    claims = [claim for each in FIGURES.values() for claim in each.claims]
    agree(claims)
    assert all(math.isfinite(each) for claim in claims for each in claim.numbers)
    assert [claim.holds for claim in FIGURES[29].claims] == [True, True, None]
