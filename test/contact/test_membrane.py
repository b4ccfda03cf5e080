# SPDX-License-Identifier: Apache-2.0
import functools
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.contact import LARGE_PAD, Pad, inflate, press
from ros_pad.errors import NoEquilibrium

press_membrane = functools.partial(press, model='membrane')
LENGTHS = ('height', 'depth', 'contact_radius', 'sphere_radius', 'gap')
UNIT = Pad(1.0, 1.0)  # then pressure is P, and force is pi P times the share in contact

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
