# SPDX-License-Identifier: Apache-2.0
"""Figures 29 and 30."""

import math

import numpy as np
import pytest

from ros_pad.contact import LARGE_PAD
from ros_pad.contact import press
from ros_pad.figures import capillary

FIGURES = {each.number: each for each in capillary.draw()}


def test_the_surface_turns_by_what_angles_leave():
    """A circle of radius R that rises by h from a level floor to a wall at α, at θ to it."""
    pressed = press(LARGE_PAD, 75e3, 0.19)
    wall = math.asin(pressed.contact_radius / pressed.sphere_radius)
    for ratio, angle in ((0.25, 90.0), (0.5625, 60.0), (1.0, 0.0)):
        one = capillary.ring(pressed, 0.002, 'corrected', np.array([ratio]))
        (height,), (radius,) = one.height, one.curvature
        # From level, the surface turns by π − θ − α over its arc.
        turn = math.pi - math.radians(angle) - wall
        assert radius * (1.0 - math.cos(turn)) == pytest.approx(height, rel=1e-9)


def test_curves_run_from_90_to_0_degrees():
    ax = FIGURES[29].drawn.figure.axes[0]
    curves = [line for line in ax.lines if line.get_marker() == 'None']
    assert len(curves) == 6
    for line, tension in zip(curves, (1.6, 1.6, 2.0, 2.0, 4.0, 4.0), strict=True):
        x = line.get_xdata()
        assert (x[0], x[-1]) == pytest.approx((tension / 4.0, tension))
    # Capillary length: heights go with the root of the tension, nearly.
    heights = [line.get_ydata()[45] for line in curves[::2]]
    assert heights[2] / heights[0] == pytest.approx(math.sqrt(2.5), rel=0.1)


def test_rays_join_points_of_the_same_angle():
    ax = FIGURES[30].drawn.figure.axes[0]
    rays = [line for line in ax.lines if len(line.get_xdata()) == 2]
    ends = [line for line in ax.lines if len(line.get_xdata()) > 2]
    assert len(rays) == 4 and len(ends) == 6
    slopes = [line.get_ydata()[1] / line.get_xdata()[1] for line in rays]
    for line in ends:
        x, y = line.get_xydata().T
        assert (y[0] / x[0], y[-1] / x[-1]) == pytest.approx((slopes[0], slopes[-1]))


def test_what_is_claimed():
    assert [claim.holds for claim in FIGURES[29].claims] == [None, True, None]
    assert [claim.holds for claim in FIGURES[30].claims] == [False]
