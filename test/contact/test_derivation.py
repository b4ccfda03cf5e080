# SPDX-License-Identifier: Apache-2.0
"""Numerical checks of steps in docs/derivation.md, by other methods than those of the code."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf

from ros_pad.contact import LARGE_PAD, inflate, press

R, K, GAMMA = mpf('1.5e-3'), mpf(40), mpf('0.006')
PRESSURES = (20e3, 55e3, 75e3, 90e3)


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(30):
        yield


def cut_sphere(height, depth):
    """Return area, contact disc included, and volume of a spherical dome, by quadrature.

    The sphere goes through the rim and has the given height; the floor cuts ``depth`` off.
    """
    sphere = (R * R + height * height) / (2 * height)

    def section(z):
        return sphere**2 - (z - height + sphere) ** 2

    gap = height - depth
    # Arc length of the meridian per height is sphere/radius; the circumference is 2 pi radius.
    wall = mpmath.quad(
        lambda z: 2 * mp.pi * mp.sqrt(section(z)) * sphere / mp.sqrt(section(z)), [0, gap]
    )
    volume = mpmath.quad(lambda z: mp.pi * section(z), [0, gap])
    return wall + mp.pi * section(gap), volume


def tension_energy(area):
    """Return the work, J, that stretches the flat pad to an area S against 1.5 k √(S/S₀) - k."""
    flat = mp.pi * R * R
    return mpmath.quad(lambda s: K * (mpf(3) / 2 * mp.sqrt(s / flat) - 1), [flat, area])


def printed_work(height, depth, contact, pressure):
    """Return W_F, J, as printed before equation 3.44, with the appendix' sign of adhesion."""
    side = R * R + height**2 - depth**2
    return (
        -pressure * mp.pi / 6 * height * (3 * R * R + height**2)
        + pressure * mp.pi / 6 * depth * (3 * contact**2 + depth**2)
        + mp.pi * K * side ** mpf(1.5) / R
        - mp.pi * K * side
        - GAMMA * mp.pi * contact**2
    )


@pytest.mark.parametrize('pressure', PRESSURES)
def test_free_dome_is_where_the_energy_is_least(pressure):
    def energy(height):
        area, volume = cut_sphere(height, mpf(0))
        return tension_energy(area) - pressure * volume

    height = mpf(inflate(LARGE_PAD, pressure).height)
    slope, bend = mpmath.diff(energy, height), mpmath.diff(energy, height, 2)
    assert bend > 0
    # The next Newton step to the least energy would be no more than rounding.
    assert abs(slope / bend / height) < 1e-14


@pytest.mark.parametrize('pressure', PRESSURES)
@pytest.mark.parametrize('share', [1e-6, 0.05, 0.4, 0.8, 0.95])
def test_both_balances_from_the_work(pressure, share):
    force = share * pressure * math.pi * 1.5e-3**2
    dome = press(LARGE_PAD, pressure, force)
    shape = (mpf(dome.height), mpf(dome.depth), mpf(dome.contact_radius))

    def partial(*order):
        return mpmath.diff(lambda *at: printed_work(*at, mpf(pressure)), shape, order)

    # Equation 3.57: the derivative by depth less that by height, at constant contact radius.
    assert partial(0, 1, 0) - partial(1, 0, 0) == pytest.approx(force, rel=1e-9)
    # Where the membrane is tangent to the floor, pressure on the disc balances load and adhesion.
    pull = 2 * mp.pi * GAMMA * dome.sphere_radius
    assert pressure * mp.pi * shape[2] ** 2 == pytest.approx(force + pull, rel=1e-12)
    # Equations 3.44 to 3.49 move the contact along the sphere: that gives less than half of the
    # pressure force, which only the approximation 3.52 doubles.
    with_b = partial(0, 0, 1) * mp.sqrt(dome.sphere_radius**2 - shape[2] ** 2) / shape[2]
    without_adhesion = with_b + 2 * mp.pi * GAMMA * mp.sqrt(dome.sphere_radius**2 - shape[2] ** 2)
    assert without_adhesion < pressure * mp.pi * shape[2] ** 2 / 2


# --- the branch ----------------------------------------------------------------------------------


def balance(x, depth, tension, a):
    """Return the residual of equation 3.58 with the force of 3.53; it is zero in equilibrium."""
    rho = 0.5 * (x + 1 / x)
    sigma = np.sqrt(1 + (x - depth) * (x + depth))
    force = tension * depth * (2 * rho - depth) - 2 * a * rho
    return (x + depth) * (tension * rho - 3 * sigma + 2) - force


def certificate(x, depth, tension):
    rho = 0.5 * (x + 1 / x)
    sigma = np.sqrt(1 + (x - depth) * (x + depth))
    return tension * (rho - 2 * depth) + 3 * sigma - 2 - 3 * depth * (x + depth) / sigma


def halved(falls, high):
    """Return the zero, from 0 to ``high``, of a function that is positive at 0, by bisection."""
    low = np.zeros_like(high)
    for _ in range(70):
        middle = 0.5 * (low + high)
        positive = falls(middle) > 0
        low, high = np.where(positive, middle, low), np.where(positive, high, middle)
    return low


def branch(tension, a):
    """Return heights over radius, whether each has a certified equilibrium, and forces."""
    free = math.tan(
        float(mpmath.findroot(lambda t: 6 * mp.sin(t) - 2 * mp.sin(2 * t) - tension, tension / 4))
    )
    x = np.linspace(1e-3, 1.1 * free, 20001)
    rho = 0.5 * (x + 1 / x)
    turn = halved(lambda depth: certificate(x, depth, tension), np.minimum(x, rho))
    there = (balance(x, 0 * x, tension, a) >= 0) & (balance(x, turn, tension, a) <= 0)
    depth = halved(lambda depth: balance(x, depth, tension, a), turn)
    return x, there, tension * depth * (2 * rho - depth) - 2 * a * rho


@given(st.floats(0.01, 3.4), st.floats(0.01, 1.0), st.floats(0.0, 1.0), st.sampled_from([0, 1e-3]))
def test_certificate_is_the_fall_of_the_balance_with_depth(tension, share, part, a):
    x = 0.6 * tension * share
    depth = part * min(x, 0.5 * (x + 1 / x))
    with mp.workdps(30):

        def exact(d):
            rho = (x + 1 / mpf(x)) / 2
            sigma = mp.sqrt(1 + (x - d) * (x + d))
            force = tension * d * (2 * rho - d) - 2 * a * rho
            return (x + d) * (tension * rho - 3 * sigma + 2) - force

        slope, bend = mpmath.diff(exact, depth), mpmath.diff(exact, depth, 2)
    assert float(slope) == pytest.approx(-certificate(x, depth, tension), rel=1e-9, abs=1e-9)
    assert bend > 0  # so each height has at most one depth with a certificate


# --- the liquid ----------------------------------------------------------------------------------
