# SPDX-License-Identifier: Apache-2.0
import functools
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import root

from ros_pad.contact import LARGE_PAD, Pad, inflate, press
from ros_pad.contact.membrane import LARGEST_PRESSURE, LARGEST_SHARE
from ros_pad.errors import NoEquilibrium

press_membrane = functools.partial(press, model='membrane')
LENGTHS = ('height', 'depth', 'contact_radius', 'sphere_radius', 'gap')
UNIT = Pad(1.0, 1.0)  # then pressure is P, and force is pi P times the share in contact
APPENDIX_PI = math.pi / 3.1415

# Pressure P and share of the pad in contact: one rectangle up to the cusp and one beyond it.
states = st.tuples(st.floats(1e-3, 5.14), st.floats(1e-9, 0.999)) | st.tuples(
    st.floats(5.14, 5.99), st.floats(1e-9, 0.7099)
)


def full(pad, pressure):
    """Return the force, N, at which the contact would span the pad."""
    return math.pi * pad.radius**2 * pressure


def exact_gap(pressure, share, digits=22):
    """Return gap over radius, by quadrature and bracketing in many digits.

    The surface has Kenmotsu's parameter a: r² = l² + m² + 2 l m sin(a), arc length l a.
    """
    with mp.workdps(digits):
        pressure, share = mp.mpf(pressure), mp.mpf(share)

        def shape(psi):
            inner = (1 - share) / (2 * mp.sin(psi))
            outer = mp.sqrt(inner**2 + share)
            start = -mp.asin(inner / outer)
            end = mp.atan2(mp.sin(psi) - inner, mp.cos(psi))
            end = end if end > start else end + 2 * mp.pi
            points, step = [start], mp.sqrt(share) / (4 * inner)
            while start + step < end:  # the integrands change fast near the floor
                points.append(start + step)
                step *= 6
            points.append(end)

            def r(a):
                return mp.sqrt(inner**2 + outer**2 + 2 * inner * outer * mp.sin(a))

            area = share + 2 * inner * mp.quad(r, points)
            gap = inner * mp.quad(lambda a: (inner + outer * mp.sin(a)) / r(a), points)
            return (1.5 * mp.sqrt(area) - 1) / inner, gap

        low, high = mp.mpf('1e-4') * pressure * (1 - share), mp.pi * (1 - mp.mpf('1e-4'))
        psi = mp.findroot(
            lambda psi: shape(psi)[0] / pressure - 1, (low, high), solver='anderson', tol=1e-40
        )
        return shape(psi)[1]


def balanced(psi, share):
    """Return pressure P and gap over radius at rim angles, by Gauss-Legendre in Kenmotsu's a."""
    inner = (1 - share) / (2 * np.sin(psi))
    outer = np.sqrt(inner**2 + share)
    start = -np.arcsin(inner / outer)
    end = np.arctan2(np.sin(psi) - inner, np.cos(psi))
    end = np.where(end > start, end, end + 2 * np.pi)
    node, weight = np.polynomial.legendre.leggauss(80)
    sine = np.sin(start + (end - start) * (0.5 + 0.5 * node[:, None]))
    r = np.sqrt(inner**2 + outer**2 + 2 * inner * outer * sine)
    half = 0.5 * inner * (end - start)
    area = share + 2 * half * (weight @ r)
    return (1.5 * np.sqrt(area) - 1) / inner, half * (weight @ ((inner + outer * sine) / r))


class TestAgainstOtherMethods:
    @pytest.mark.parametrize(
        ('force', 'gap'), [(0.08, 1.350e-3), (0.19, 0.756e-3), (0.285, 0.354e-3)]
    )
    def test_states_of_the_appendix(self, force, gap):
        assert press_membrane(LARGE_PAD, 75e3, force).gap == pytest.approx(gap, abs=0.9e-6)
        thesis = press(LARGE_PAD, 75e3, force, adhesion='none')
        exact = press(LARGE_PAD, 75e3, force, model='membrane')
        assert exact.contact_radius == pytest.approx(thesis.contact_radius, rel=1e-14)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ('pressure', 'share'),
        [
            (0.01, 0.999),
            (1.0, 1e-9),
            (2.8125, 0.2),
            (4.5, 0.05),
            (5.13, 0.714),
            (5.5, 0.7),
        ],
    )
    def test_gap_in_many_digits(self, pressure, share):
        force = float(math.pi * pressure * share)
        with mp.workdps(25):
            share = mp.mpf(force) / mp.pi / pressure  # the share of the rounded force
        exact = exact_gap(pressure, share)
        pressed = press_membrane(UNIT, pressure, force)
        assert abs(pressed.gap / exact - 1) < 1e-12
        assert abs(pressed.contact_radius / mp.sqrt(share) - 1) < 1e-14

    @pytest.mark.parametrize(('pressure', 'share'), [(2.8125, 0.2), (4.5, 0.5)])
    def test_shape_makes_the_energy_stationary(self, pressure, share):
        """The test uses only the energy of the thesis: no curvature, no tangent, no F = p pi b².

        The wall is any curve from the rim to the edge of contact: its distance from the pad's
        centre over the angle. This curve, contact radius and gap are all unknown.
        """
        order = 22
        node, weight = np.polynomial.legendre.leggauss(60)
        x, weight = 0.5 + 0.5 * node, 0.5 * weight
        hump = x * (1 - x)
        basis = np.polynomial.chebyshev.chebvander(node, order)
        slope = np.stack(
            [np.polynomial.Chebyshev.basis(n).deriv()(node) for n in range(order + 1)], axis=1
        )
        bulge = hump[:, None] * basis
        turn = 2 * hump[:, None] * slope + (1 - 2 * x)[:, None] * basis

        def potential(shape):
            b, gap, free = shape[0], shape[1], shape[2:]
            sweep, far = np.arctan(gap / b), np.sqrt(b * b + gap * gap)
            rho = 1 + (far - 1) * x + bulge @ free
            r = rho * np.cos(sweep * x)
            length = np.sqrt((far - 1 + turn @ free) ** 2 + (rho * sweep) ** 2)
            area = 2 * np.pi * (weight @ (r * length)) + np.pi * b * b
            volume = 2 * np.pi / 3 * sweep * (weight @ (rho**2 * r)) + np.pi / 3 * b * b * gap
            energy = area * (np.sqrt(area / np.pi) - 1)
            return energy - pressure * volume + np.pi * pressure * share * gap

        def gradient(shape):
            tilted = shape + 1e-30j * np.eye(shape.size)
            return np.array([potential(row).imag * 1e30 for row in tilted])

        guess = np.zeros(order + 3)
        guess[:2] = 0.5, 0.6 * inflate(UNIT, pressure).height

        def hessian(shape):
            step = 1e-6 * np.eye(shape.size)
            return np.array([gradient(shape + row) - gradient(shape - row) for row in step]) / 2e-6

        # Where root() stops depends on the machine's linear algebra. The contact radius is a
        # double root, so that each Newton step halves its error.
        found = root(gradient, guess, tol=1e-12).x
        for _ in range(12):
            found = found - np.linalg.solve(hessian(found), gradient(found))
        assert np.abs(gradient(found)).max() < 1e-12
        pressed = press_membrane(UNIT, pressure, np.pi * pressure * share)
        assert found[0] == pytest.approx(pressed.contact_radius, rel=1e-6)
        assert found[1] == pytest.approx(pressed.gap, rel=1e-6)

    # Error of the thesis' spherical wall, per cent: least and largest of 65, 75 and 85 kPa.
    @pytest.mark.parametrize(
        ('share', 'least', 'most'),
        [(0.05, 5.5, 7.0), (0.2, 16.5, 18.0), (0.4, 27.5, 36.5), (0.6, 38.5, 87.5)],
    )
    def test_gap_of_the_thesis_is_too_large(self, share, least, most):
        p = np.array([65e3, 75e3, 85e3])
        thesis = press(LARGE_PAD, p, share * full(LARGE_PAD, p), adhesion='none')
        exact = press_membrane(LARGE_PAD, p, share * full(LARGE_PAD, p))
        excess = (thesis.gap / exact.gap - 1) * 100
        assert least < excess.min() and excess.max() < most


class TestLimits:
    @pytest.mark.parametrize('pressure', [1e-3, 10.0, 40e3, 75e3, 120e3, 159e3])
    def test_no_force_is_the_free_dome(self, pressure):
        free = inflate(LARGE_PAD, pressure)
        apart = press_membrane(LARGE_PAD, pressure, 0)
        assert apart.status == 'no_contact'
        assert (apart.depth, apart.contact_radius) == (0.0, 0.0)
        assert apart.height == apart.gap == pytest.approx(free.height, rel=1e-14)
        assert apart.sphere_radius == pytest.approx(free.sphere_radius, rel=1e-14)
        # A tiny force, for which another equation is solved, changes almost nothing.
        touch = press_membrane(LARGE_PAD, pressure, 1e-15 * full(LARGE_PAD, pressure))
        assert touch.status == 'ok'
        for name in ('height', 'sphere_radius', 'gap'):
            assert getattr(touch, name) == pytest.approx(getattr(apart, name), rel=1e-11)

    def test_nearly_flattened_the_wall_is_an_arc(self):
        # The remaining ring is narrow and its tension k/2, so that it is an arc of radius 1/(2P).
        pressure, rest = 2.8125, np.array([1e-4, 1e-6])
        gap = press_membrane(UNIT, pressure, np.pi * pressure * (1 - rest)).gap
        width = rest / 2
        np.testing.assert_allclose(gap, width**2 * pressure, rtol=3e-4)

    @settings(max_examples=60)
    @given(states)
    def test_there_is_one_root_and_it_is_the_one_returned(self, state):
        pressure, share = state[0], max(state[1], 1e-3)  # ``balanced`` has too few nodes for less
        low = np.geomspace(1e-2, np.pi / 2, 700) * min(1.0, pressure * (1 - share))
        psi = np.unique(np.concatenate((low, np.pi - np.geomspace(1e-4, np.pi / 2, 1000))))
        balance, gap = balanced(psi, share)
        assert balance[0] < pressure < balance[-1]
        (before,) = np.flatnonzero((balance[:-1] < pressure) != (balance[1:] < pressure))
        pressed = press_membrane(UNIT, pressure, math.pi * pressure * share)
        assert gap[before] * (1 - 1e-6) < pressed.gap < gap[before + 1] * (1 + 1e-6)

    @given(states, st.floats(1e-5, 1e-1), st.floats(0.1, 1e4))
    def test_one_pad_is_every_pad(self, state, radius, stiffness):
        pressure, share = state
        # Exactly at the bounds, rounding of the scaled numbers decides.
        assume(abs(pressure - LARGEST_PRESSURE) > 1e-9 and abs(share - LARGEST_SHARE) > 1e-9)
        force = math.pi * pressure * share
        one = press_membrane(UNIT, pressure, force)
        pad = Pad(radius, stiffness, adhesion_energy=1.0)  # adhesion has no effect
        other = press_membrane(pad, pressure * stiffness / radius, force * stiffness * radius)
        loss = 1e-12 / min(1 - share, (6 - pressure) ** 2)
        for name in LENGTHS:
            assert getattr(other, name) / radius == pytest.approx(getattr(one, name), rel=loss)


class TestInterface:
    def test_statuses_at_the_edges(self):
        # The cusp is at P = 5.1427, 137.14 kPa for the large pad, and a share of 0.7143.
        cases = [
            (0.0, 0.0, 'flattened'),  # a flat pad
            (1.0, 0.0, 'no_contact'),
            (75e3, 0.9999999, 'ok'),
            (75e3, 1.0000001, 'flattened'),
            (75e3, 3.0, 'flattened'),
            (137.0e3, 0.9999, 'ok'),
            (137.0e3, 1.0001, 'flattened'),
            (137.2e3, 0.709, 'ok'),
            (137.2e3, 0.715, 'fold_zone'),
            (137.2e3, 1.5, 'fold_zone'),
            (159.9e3, 0.0, 'no_contact'),
            (159.9e3, 0.709, 'ok'),
            (160e3, 0.0, 'no_inflation'),
            (160e3, 0.5, 'no_inflation'),
        ]
        pressure, share, status = (np.array(column) for column in zip(*cases, strict=True))
        force = share * full(LARGE_PAD, pressure)
        together = press_membrane(LARGE_PAD, pressure, force)
        assert together.status.tolist() == status.tolist()
        there = np.isin(status, ('ok', 'no_contact'))
        for name in LENGTHS:
            assert (np.isfinite(getattr(together, name)) == there).all()
        for p, load, expected in zip(pressure, force, status, strict=True):
            if expected in ('ok', 'no_contact'):
                assert press_membrane(LARGE_PAD, p, load).status == expected
            else:
                with pytest.raises(NoEquilibrium, match=r'Pa.*N') as caught:
                    press_membrane(LARGE_PAD, p, load)
                assert caught.value.status == expected

    def test_past_the_cusp_there_are_three_shapes(self):
        balance, _ = balanced(np.linspace(1e-3, np.pi - 1e-3, 20001), 0.727)
        assert np.diff(balance < 5.2).sum() == 3
        with pytest.raises(NoEquilibrium, match='history'):
            press_membrane(UNIT, 5.2, math.pi * 5.2 * 0.727)
