# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.contact import LARGE_PAD, Pad, inflate, press
from ros_pad.errors import InvalidInput, NoEquilibrium

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference'
LENGTHS = ('height', 'depth', 'contact_radius', 'sphere_radius', 'gap')
# The appendix used pi = 3.1415. Pi enters only through force/pi, so the exact pi gives the same
# numbers with a force that is larger by this factor.
APPENDIX_PI = math.pi / 3.1415

# Pressure of the large pad and share of its flattening force, over the model's domain.
pressures = st.floats(1e3, 91e3)
shares = st.just(0.0) | st.floats(1e-9, 0.98)


def rows(name):
    return json.loads((REFERENCE / name).read_text())['rows']


def flattening(pressure, pad=LARGE_PAD):
    """Return the load, N, that presses a dome flat: closed form to first order in adhesion."""
    r, k = pad.radius, pad.stiffness
    return math.pi * r * (pressure * r - math.sqrt(2 * pad.adhesion_energy * k))


class TestFree:
    def test_appendix_height_at_75_kpa(self):
        height = inflate(LARGE_PAD, 75e3).height
        assert height == pytest.approx(1.94126819416178841568e-3, rel=1e-15)

    def test_reference_table(self):
        table = rows('free_dome.json')
        assert len(table) >= 15
        for row in table:
            dome = inflate(LARGE_PAD, float(row['p_Pa']))
            assert dome.height == pytest.approx(float(row['c1_m']), rel=1e-12)
            assert dome.sphere_radius == pytest.approx(float(row['R1_m']), rel=1e-12)
            assert dome.volume == pytest.approx(float(row['V1_m3']), rel=1e-12)

    @pytest.mark.parametrize('below', ['1e-9', '1e-6', '1e-3', '0.1', '0.9', '1.05'])
    def test_digits_are_kept_up_to_bursting(self, below):
        # P = 6 - below; radius and stiffness are powers of two, so that they are exact.
        pad = Pad(radius=2.0**-9, stiffness=32.0)
        pressure = (6.0 - float(below)) * 2.0**14
        with mpmath.workdps(40):
            tension = mpmath.mpf(pressure) / 2**14
            t = mpmath.findroot(
                lambda t: 6 * mpmath.sin(t) - 2 * mpmath.sin(2 * t) - tension,
                (mpmath.mpf(1) / 10, mpmath.pi / 2),
                solver='illinois',
            )
            height = float(mpmath.tan(t) / 2**9)
        assert inflate(pad, pressure).height == pytest.approx(height, rel=2e-15)
        assert inflate(pad, [pressure, 1.0]).height[0] == pytest.approx(height, rel=2e-15)

    def test_no_inflation_from_the_bursting_pressure_on(self):
        for pressure in (160e3, 161e3, 1e9):
            with pytest.raises(NoEquilibrium, match='Pa') as caught:
                inflate(LARGE_PAD, pressure)
            assert caught.value.status == 'no_inflation'
        dome = inflate(LARGE_PAD, [75e3, 160e3, 159.99e3])
        assert dome.status.tolist() == ['ok', 'no_inflation', 'ok']
        assert np.isnan(dome.height).tolist() == [False, True, False]

    @pytest.mark.parametrize(
        'pressure',
        [-1.0, math.nan, math.inf, '75e3', None, True, 1j, [1.0, -2.0], [[1.0], [2, 3]]],
    )
    def test_bad_pressure(self, pressure):
        with pytest.raises(InvalidInput, match='pressure'):
            inflate(LARGE_PAD, pressure)


class TestPressed:
    # Appendix 7.2.2 at 75 kPa: force N; height, depth and contact radius mm.
    @pytest.mark.parametrize(
        ('force', 'height', 'depth', 'contact_radius'),
        [
            (0.08, 1.66022279516119, 0.117237907128961, 0.582908051229389),
            (0.19, 1.26776323737445, 0.293421907887954, 0.898138202873378),
            (0.285, 0.950178697820088, 0.417039184972249, 1.09994485972161),
        ],
    )
    def test_appendix_states(self, force, height, depth, contact_radius):
        dome = press(LARGE_PAD, 75e3, force * APPENDIX_PI)
        assert dome.height == pytest.approx(height * 1e-3, rel=1e-13)
        assert dome.depth == pytest.approx(depth * 1e-3, rel=1e-13)
        assert dome.contact_radius == pytest.approx(contact_radius * 1e-3, rel=1e-13)

    def test_reference_table(self):
        solved = flattened = 0
        for row in rows('pressed_dome.json'):
            if 'status' in row:
                flattened += 1
                with pytest.raises(NoEquilibrium) as caught:
                    press(LARGE_PAD, row['pressure'], row['force'])
                assert caught.value.status == row['status'] == 'flattened'
                continue
            solved += 1
            dome = press(LARGE_PAD, row['pressure'], row['force'])
            for name in ('height', 'depth', 'contact_radius', 'sphere_radius'):
                assert getattr(dome, name) == pytest.approx(float(row[name]), rel=1e-10), row
        assert (solved, flattened) == (39, 15)

    @settings(max_examples=100)
    @given(pressures, shares, st.sampled_from(['matlab', 'none']))
    def test_balances_and_certificate(self, pressure, share, adhesion):
        r, k = LARGE_PAD.radius, LARGE_PAD.stiffness
        sign = {'matlab': 1, 'none': 0}[adhesion]
        force = share * max(flattening(pressure), 0.0)
        dome = press(LARGE_PAD, np.array([pressure]), force, adhesion=adhesion)
        status = dome.status[0]
        if status != 'ok':
            expected = {
                'matlab': pressure < 500 and 'flattened',
                'none': force == 0 and 'no_contact',
            }
            assert status == expected[adhesion]
            return
        c, a, b, sphere, gap = (float(getattr(dome, name)[0]) for name in LENGTHS)
        assert 0 < a <= c and 0 < b < r
        assert gap == pytest.approx(c - a, abs=1e-12 * c)
        assert sphere == pytest.approx((r * r + c * c) / (2 * c), rel=1e-13)
        assert a * (2 * sphere - a) == pytest.approx(b * b, rel=1e-12)  # equation 3.48
        pull = sign * 2 * math.pi * LARGE_PAD.adhesion_energy * sphere
        scale = math.pi * r * r * pressure
        assert pressure * math.pi * b * b == pytest.approx(force + pull, abs=1e-12 * scale)  # 3.53
        sigma = math.sqrt(1 + (c * c - a * a) / r**2)
        push = math.pi * (c + a) * (pressure * sphere - 2 * k * (1.5 * sigma - 1))
        assert push == pytest.approx(force, abs=1e-11 * scale)  # equation 3.58
        certificate = (
            pressure * (sphere - 2 * a) / k + (3 * sigma - 2) - 3 * a * (c + a) / (r * r * sigma)
        )
        assert certificate > 0

    @given(
        st.lists(st.tuples(st.floats(1e-3, 3.5), st.floats(0.0, 1.1)), min_size=1, max_size=30),
        st.sampled_from(['matlab', 'none']),
        st.sampled_from([0.0, 1e-6, 1.5e-4, 0.01]),
    )
    def test_a_row_does_not_depend_on_its_neighbours(self, states, adhesion, energy):
        pad = Pad(1.0, 1.0, energy)
        tension, share = np.array(states).T
        force = math.pi * tension * share
        together = press(pad, tension, force, adhesion)
        for row in range(len(states)):
            try:
                alone = press(pad, float(tension[row]), float(force[row]), adhesion)
            except NoEquilibrium as error:
                assert together.status[row] == error.status
                assert np.isnan(together.height[row])
            else:
                assert together.status[row] == alone.status
                # Near flattening the height is ill-conditioned: its last digits may differ.
                rel = 1e-13 / max(1e-4, abs(1.0 - share[row]))
                assert together.height[row] == pytest.approx(alone.height, rel=rel)
                assert together.contact_radius[row] == pytest.approx(alone.contact_radius, rel=rel)

    def test_statuses_at_the_edges(self):
        cases = [
            (0.0, 0.0, 'flattened'),  # a flat pad
            (461.0, 0.0, 'flattened'),  # adhesion spreads the contact to the rim: sqrt(2 g k)/r
            (463.0, 0.0, 'ok'),
            (75e3, flattening(75e3) * 0.9999, 'ok'),
            (75e3, flattening(75e3) * 1.0001, 'flattened'),
            (91e3, 0.6, 'ok'),
            (91.4e3, 0.6, 'fold_zone'),
            (92.5e3, 0.0, 'fold_zone'),
            (159e3, 0.1, 'fold_zone'),
            (160e3, 0.1, 'no_inflation'),
        ]
        pressure, force, status = zip(*cases, strict=True)
        together = press(LARGE_PAD, pressure, force)
        assert together.status.tolist() == list(status)
        for name in LENGTHS:
            assert (np.isnan(getattr(together, name)) == (together.status != 'ok')).all()
        for p, f, expected in cases:
            if expected == 'ok':
                assert press(LARGE_PAD, p, f).status == 'ok'
            else:
                with pytest.raises(NoEquilibrium, match=r'Pa.*N') as caught:
                    press(LARGE_PAD, p, f)
                assert caught.value.status == expected

    def test_no_contact_is_the_free_dome(self):
        free = inflate(LARGE_PAD, 75e3)
        dome = press(LARGE_PAD, 75e3, 0.0, adhesion='none')
        assert dome.status == 'no_contact'
        assert (dome.depth, dome.contact_radius) == (0.0, 0.0)
        assert dome.height == dome.gap == pytest.approx(free.height, rel=1e-15)
        assert dome.sphere_radius == pytest.approx(free.sphere_radius, rel=1e-15)

    @settings(max_examples=100)
    @given(
        st.floats(0, 200e3),
        st.floats(0, 2.0),
        st.sampled_from(['matlab', 'none']),
        st.sampled_from([0.0, 1e-9, 0.006, 0.4]),
    )
    def test_never_a_silent_nan(self, pressure, force, adhesion, energy):
        pad = Pad(1.5e-3, 40.0, energy)
        dome = press(pad, [pressure], force, adhesion=adhesion)
        finite = [np.isfinite(getattr(dome, name)).all() for name in LENGTHS]
        assert all(finite) == (dome.status[0] in ('ok', 'no_contact'))
        assert all(finite) or not any(finite)

    def test_bad_words_and_shapes(self):
        with pytest.raises(InvalidInput, match='matlab, none'):
            press(LARGE_PAD, 75e3, 0.1, adhesion='both')
        with pytest.raises(InvalidInput, match=r'0\.4 J/m²'):
            press(Pad(1.5e-3, 40.0, adhesion_energy=0.5), 75e3, 0.1)
