# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ros_pad.contact import Material, Pad, force_limit, inflate, press, pressure_for
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.errors import InvalidInput, NoEquilibrium

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference'
LAWS = {'Yeoh': 'yeoh', 'Mooney-Rivlin': 'mooney_rivlin', 'Ogden': 'ogden'}
RADIUS, THICKNESS = 1.5e-3, 4e-4
RAW = Material('yeoh', (49365.3971147044, 3486.2557640943996, -65.8975627692))
NEO = Material('neo_hookean', (1.5e5,))
MOONEY = Material('mooney_rivlin', (1e5, 1e4))
OGDEN = Material('ogden', (6.3e5, 1.3, 1.2e3, 5.0, -1e4, -2.0))
MATERIALS = [RAW, NEO, MOONEY, OGDEN]


def of(material):
    return Pad.of(material, RADIUS, THICKNESS)


def rows(name):
    return json.loads((REFERENCE / name).read_text())['rows']


def unit(pad):
    """Return μ h/r, Pa."""
    return pad.material.shear_modulus * pad.thickness / pad.radius


class TestReference:
    @pytest.mark.parametrize('row', rows('hyper_free.json'), ids=lambda r: r['law'])
    def test_free(self, row):
        material = Material(LAWS[row['model']], row['parameters'])
        pad = Pad.of(material, row['radius_m'], row['thickness_m'])
        dome = inflate(pad, row['pressure_Pa'])
        assert dome.height == pytest.approx(row['height_m'], rel=1e-10)

    @pytest.mark.parametrize('row', rows('hyper_pressed.json'), ids=lambda r: r['law'])
    def test_pressed(self, row):
        pad = Pad.of(Material('yeoh', row['C_Pa']), row['radius_m'], row['thickness_m'])
        dome = press(pad, row['pressure_Pa'], row['force_N'])
        assert dome.status == 'ok'
        assert dome.gap == pytest.approx(row['gap_m'], rel=1e-8)
        assert dome.contact_radius == pytest.approx(row['contact_radius_m'], rel=1e-9)


class Wall:
    """The membrane from a disc to the rim, R as variable, tensions by differences of the energy.

    Pressure 1, thickness 1 and shear modulus 1, so that the rim is at P.
    """

    def __init__(self, material, stretch, disc):
        self.material, self.disc = material, disc
        contact = stretch * disc
        rim = lambda radius, y: y[1] - radius  # noqa: E731
        rim.terminal, rim.direction = True, -1.0
        start = max(disc, 1e-7)
        state = [stretch, stretch * start, 0.0, 0.0, 0.0]
        if disc == 0.0:
            pull = self.tensions(stretch, stretch)[0]
            state[2] = 0.5 * stretch**2 / pull * start
        end = solve_ivp(
            self.rates, (start, 50.0), state, 'DOP853', events=rim, rtol=1e-12, atol=1e-14,
            first_step=1e-3 * max(disc, 1e-4),
        )  # fmt: skip
        (self.end,), ((along, _, angle, height, volume),) = end.t_events[0], end.y_events[0]
        self.pressure, self.contact = self.end, contact / self.end
        self.gap, self.volume = height / self.end, volume / self.end**3
        # First integral: the tension at the rim carries pressure outside of the contact.
        pull = self.tensions(along, 1.0)[0] * math.sin(angle)
        self.off = pull - 0.5 * (self.end**2 - contact**2) / self.end

    def tensions(self, a, b):
        """Return dW/da, dW/db, d²W/da², d²W/da db, written out anew for each law."""
        kind, p = self.material.unit_law
        q = 1.0 / (a * a * b * b)
        if kind == 'ogden':
            pairs, c = list(zip(p[::2], p[1::2], strict=True)), 1.0 / (a * b)
            return (
                sum(m * (a**k - c**k) for m, k in pairs) / a,
                sum(m * (b**k - c**k) for m, k in pairs) / b,
                sum(m * ((k - 1) * a**k + (k + 1) * c**k) for m, k in pairs) / a**2,
                sum(m * k * c**k for m, k in pairs) / (a * b),
            )
        invariant = a * a + b * b + q - 3.0
        one, two = 2.0 * (a - q / a), 2.0 * (b - q / b)
        slope = p[0] + 2.0 * p[1] * invariant + 3.0 * p[2] * invariant**2
        bend = 2.0 * p[1] + 6.0 * p[2] * invariant
        more = slope * (2.0 + 6.0 * q / a**2) + bend * one**2
        return slope * one, slope * two, more, slope * 4.0 * q / (a * b) + bend * one * two

    def rates(self, flat, y):
        a, r, angle, _, _ = y
        b = r / flat
        pull, push, more, cross = self.tensions(a, b)
        d_r = a * math.cos(angle)
        d_b = (d_r - b) / flat
        d_a = ((push * math.cos(angle) - pull) / flat - cross * d_b) / more
        d_angle = a * (1.0 - push / a * math.sin(angle) / r) / (pull / b)
        d_z = a * math.sin(angle)
        return d_a, d_r, d_angle, d_z, math.pi * r * r * d_z


class TestFree:
    @pytest.mark.parametrize('material', MATERIALS, ids=str)
    def test_over_all_pressures(self, material):
        pad = of(material)
        end, last, checked = pressure_end(pad)[0], 0.0, 0
        for stretch in 1.0 + np.geomspace(0.003, 2.5, 15):
            wall = Wall(material, stretch, 0.0)
            before = Wall(material, 0.999 * stretch, 0.0).pressure
            if not before < wall.pressure < end / unit(pad):
                break  # past the maximum, or outside the range
            last, checked = wall.pressure * unit(pad), checked + 1
            assert abs(wall.off) < 1e-9
            dome = inflate(pad, last)
            assert dome.height == pytest.approx(RADIUS * wall.gap, rel=1e-8)
            assert dome.volume == pytest.approx(RADIUS**3 * wall.volume, rel=1e-7)
        assert checked > 9 and last > 0.8 * end

    def test_the_maximum_of_a_neo_hookean_pad(self):
        pad = of(NEO)
        end, status = pressure_end(pad)
        assert status == 'no_inflation'
        assert end / unit(pad) == pytest.approx(1.87917, abs=1e-5)
        assert inflate(pad, end).height / RADIUS == pytest.approx(1.17390, abs=1e-4)
        with pytest.raises(NoEquilibrium, match=r'balloon.*75166\.9 Pa') as caught:
            inflate(pad, end * (1 + 1e-12))
        assert caught.value.status == 'no_inflation'

    def test_outside_the_range_of_the_material(self):
        pad = of(Material('yeoh', RAW.parameters, 2.5))
        end, status = pressure_end(pad)
        assert status == 'out_of_range' and end < 0.8 * pressure_end(of(RAW))[0]
        with pytest.raises(NoEquilibrium, match=r'range of its material: at most') as caught:
            inflate(pad, end + 1.0)
        assert caught.value.status == 'out_of_range'
        dome = inflate(pad, [end - 1.0, end + 1.0])
        assert dome.status.tolist() == ['ok', 'out_of_range']
        assert np.isnan(dome.height).tolist() == [False, True]
        # A range changes what is refused, and no number.
        assert dome.height[0] == inflate(of(RAW), end - 1.0).height


class TestPressed:
    @pytest.mark.parametrize('material', MATERIALS, ids=str)
    def test_over_pressures_and_forces(self, material):
        """The certificate: independent states, wherever the wall of one ends below the maximum."""
        pad = of(material)
        end = min(pressure_end(pad)[0] / unit(pad), 2.2 if material is MOONEY else np.inf)
        rng, checked = np.random.default_rng(1), 0
        while checked < 12:
            stretch, disc = 1.0 + rng.uniform(0.003, 0.9) ** 2, rng.uniform(0.003, 1.0) ** 2 * end
            wall = Wall(material, stretch, disc)
            if wall.pressure > 0.99 * end or wall.contact > 0.995:
                continue
            checked += 1
            assert abs(wall.off) < 1e-9
            p = wall.pressure * unit(pad)
            force = p * math.pi * (RADIUS * wall.contact) ** 2
            dome = press(pad, p, force)
            assert dome.gap == pytest.approx(RADIUS * wall.gap, rel=1e-6)
            assert dome.contact_radius == pytest.approx(RADIUS * wall.contact, rel=1e-12)

    def test_statuses(self):
        pad = of(RAW)
        end, flat = pressure_end(pad)[0], math.pi * RADIUS**2
        force = [0.0, 0.1, 40e3 * flat, 0.1, 0.0]
        pressure = [40e3, 40e3, 40e3, end * 1.001, 0.0]
        words = ['no_contact', 'ok', 'flattened', 'no_inflation', 'flattened']
        dome = press(pad, pressure, force)
        assert dome.status.tolist() == words
        there = [each in ('ok', 'no_contact') for each in words]
        for name in ('height', 'depth', 'contact_radius', 'sphere_radius', 'gap'):
            assert np.isfinite(getattr(dome, name)).tolist() == there
        for p, f, word in zip(pressure, force, words, strict=True):
            if word in ('ok', 'no_contact'):
                assert press(pad, p, f).status == word
                continue
            with pytest.raises(NoEquilibrium, match='on a pad with radius') as caught:
                press(pad, p, f)
            assert caught.value.status == word

    def test_a_range_that_is_too_large_for_pressed_domes(self):
        pad = of(Material('mooney_rivlin', MOONEY.parameters, 8.0))
        assert inflate(pad, 150e3).height > 1.5 * RADIUS
        with pytest.raises(InvalidInput, match='a smaller largest_stretch may help'):
            press(pad, 50e3, 0.1)


class TestLimits:
    def test_ends(self):
        pad = of(RAW)
        end = pressure_end(pad)[0]
        limits = force_limit(pad, [end * 0.999, end * 1.001], 'flattening')
        assert np.isnan(limits).tolist() == [False, True]
        with pytest.raises(NoEquilibrium, match='no force limit') as caught:
            force_limit(pad, end * 1.001, 'flattening')
        assert caught.value.status == 'no_inflation'
        with pytest.raises(NoEquilibrium, match='too high for any pressure'):
            pressure_for(pad, 1.0, 'flattening')
