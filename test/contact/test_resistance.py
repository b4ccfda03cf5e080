# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math
import re

import pytest
import yaml

from ros_pad import configuration
from ros_pad.contact import LARGE_PAD, MeasuredLimit, force_limit
from ros_pad.contact.resistance import Foot, tangential_resistance
from ros_pad.errors import ConfigError, InvalidInput

FEET = [name for name in configuration.names('feet') if name.startswith('large')]
THICK = 1.0e-3  # m, a film too thick for dry contact


def bare_foot(**changes):
    """Return a foot with round numbers, so that expected values can be computed by hand."""
    values = {
        'source': 'test',
        'pad': LARGE_PAD,
        'pads': 20,
        'sole_radius': 0.01,
        'friction': 0.4,
        'shear_strength': 5000.0,
        'conforming_pressure': 10000.0,
        'boundary_friction': 0.1,
        'critical_film': 1e-6,
        'film_exponent': 2.0,
        'shear_stiffness': 5000.0,
        'chamber_volume': 0.0,
        'ceiling': 90e3,
        'limit': 'measured',
    }
    return Foot(**(values | changes))


def drained(foot, load, pressure, time=0.3, viscosity=1e-3, start=3e-4):
    """Return films, m, under domes and sole after a stance, by the Stefan-Reynolds equation."""
    domes = 0.0
    if pressure > 0.0:
        area = load / pressure / (foot.pads * math.pi)
        domes = (start**-2 + 4.0 * pressure * time / (3.0 * viscosity * area)) ** -0.5
    mean = load / (math.pi * foot.sole_radius**2)
    sole = (start**-2 + 4.0 * mean * time / (3.0 * viscosity * foot.sole_radius**2)) ** -0.5
    return domes, sole


# --- values by hand ---------------------------------------------------------------------------


def test_flat_on_dry_ground():
    # From 3.14 N on, the whole sole of 3.14 cm² touches: then τA is 5000·3.1416e-4 = 1.5708 N.
    foot = bare_foot()
    assert tangential_resistance(foot, 5.0, 0.0) == pytest.approx(0.4 * 5.0 + 1.570796, rel=1e-6)
    # At 1 N the sole touches on 1 cm²: 0.5 N of adhesion.
    assert tangential_resistance(foot, 1.0, 0.0) == pytest.approx(0.9, rel=1e-12)


def test_domes_on_dry_ground():
    # 20 pads at 75 kPa carry up to 20·0.2833 = 5.67 N; under 3 N they touch on 3/75000 m², which
    # gives 0.2 N of adhesion.
    assert tangential_resistance(bare_foot(), 3.0, 75e3) == pytest.approx(1.2 + 0.2, rel=1e-12)


def test_domes_past_their_limit():
    # At 65 kPa 20 pads carry 20·(0.2833 − 0.125) = 3.166 N; the sole carries the other 1.834 N.
    expected = 0.4 * 5.0 + 5000.0 * (3.166 / 65e3 + 1.834 / 10e3)
    assert tangential_resistance(bare_foot(), 5.0, 65e3) == pytest.approx(expected, rel=1e-12)
    # At 20 N the sole touches wherever the domes do not: their area is no more than the sole.
    expected = 0.4 * 20.0 + 5000.0 * math.pi * 1e-4
    assert tangential_resistance(bare_foot(), 20.0, 65e3) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize('pressure', [71.1e3, 75.3e3, 89.9e3])
def test_domes_between_tabulated_limits(pressure):
    limit = 20 * force_limit(LARGE_PAD, pressure)
    assert bare_foot(limit='thickness').dome_load(1e3, pressure) == pytest.approx(limit, rel=5e-5)


def test_film_leaves_a_share_of_dry_contact():
    # A film of critical thickness leaves 1/e of (2 + 1.5708) N and gives 1 - 1/e of 0.1·5 N.
    share = math.exp(-1.0)
    expected = share * (2.0 + 1.5707963) + (1.0 - share) * 0.5
    found = tangential_resistance(bare_foot(), 5.0, 0.0, sole_film=1e-6)
    assert found == pytest.approx(expected, rel=1e-7)
    # The film under the domes has no effect on a flat foot.
    assert tangential_resistance(bare_foot(), 5.0, 0.0, THICK, 1e-6) == found


def test_liquid_round_domes_adds_its_force_on_wet_ground_only():
    foot = bare_foot(capillary_force=1e-3)  # 20 pads: 0.02 N
    for films in ((THICK, THICK), (1e-6, 0.0)):
        dry_of_it = tangential_resistance(bare_foot(), 2.0, 75e3, *films)
        assert tangential_resistance(foot, 2.0, 75e3, *films) == pytest.approx(dry_of_it + 0.02)
    for pressure, films in ((75e3, (0.0, 0.0)), (0.0, (THICK, THICK))):
        found = tangential_resistance(foot, 2.0, pressure, *films)
        assert found == tangential_resistance(bare_foot(), 2.0, pressure, *films)


# --- the four states, as the thesis orders them -----------------------------------------------


@pytest.mark.parametrize('name', FEET)
def test_on_wet_ground_pressure_helps(name):
    """Friction grows from 40 to 60 to 75 kPa (thesis 5.2). At 40 kPa domes carry no load."""
    foot = Foot.load(name)
    load = 0.12 * foot.pads
    found = []
    for pressure in (40e3, 60e3, 75e3):
        on_domes = foot.dome_load(load, pressure)
        films = drained(foot, max(on_domes, 1e-9), pressure)[0], drained(foot, load, 0.0)[1]
        found.append(tangential_resistance(foot, load, pressure, *films) / load)
    flat = tangential_resistance(foot, load, 0.0, 0.0, drained(foot, load, 0.0)[1]) / load
    assert flat == pytest.approx(found[0], rel=1e-9)
    assert found[0] < 0.8 * found[1]
    assert found[1] < 0.9 * found[2]


# --- sharing of the load ----------------------------------------------------------------------


# --- bad input --------------------------------------------------------------------------------


def test_pressure_above_the_ceiling():
    with pytest.raises(InvalidInput, match=r'pressure = 90001\.0 .* 90000 Pa'):
        tangential_resistance(bare_foot(), 1.0, 90001.0)


@pytest.mark.parametrize('field', [f.name for f in dataclasses.fields(Foot) if f.type == 'float'])
@pytest.mark.parametrize('value', [-1.0, math.nan])
def test_a_foot_refuses_bad_numbers(field, value):
    if field.startswith('_'):
        return
    with pytest.raises(InvalidInput, match=field):
        bare_foot(**{field: value})


@pytest.mark.parametrize('change', [{'pads': 0}, {'pads': 1.5}, {'pads': 45}, {'limit': 'guess'}])
def test_a_foot_refuses_other_nonsense(change):
    with pytest.raises(InvalidInput, match=next(iter(change))):
        bare_foot(**change)


# --- files ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', FEET)
def test_shipped_feet(name):
    foot = Foot.load(name)
    assert foot.source == name
    # The pads fit on the sole in hexagonal cells of 2√3·2.25 r² (equation 3.84, corrected).
    assert foot.pads * 2.0 * math.sqrt(3.0) * 2.25 * foot.pad.radius**2 <= foot.sole_area
    # At 55 kPa a large pad is a cap 1.37540981938 mm high: π c (3r² + c²)/6.
    assert foot.pad == LARGE_PAD
    cap = math.pi * 1.37540981938e-3 * (3.0 * 1.5e-3**2 + 1.37540981938e-3**2) / 6.0
    assert foot.air_volume(55e3) - foot.chamber_volume == pytest.approx(foot.pads * cap, rel=1e-9)
    assert foot.air_volume(0.0) == foot.chamber_volume


def written(tmp_path, change):
    values = yaml.safe_load((configuration.shared_folder() / 'feet/large37.yaml').read_text())
    change(values)
    path = tmp_path / 'mine.yaml'
    path.write_text(yaml.safe_dump(values))
    return path


@pytest.mark.parametrize(
    'key, value, message',
    [
        ('pads', 0, 'a whole number from 1 to 10000'),
        ('sole_radius', '17 mm', "sole_radius = '17 mm' is not allowed: a number from 0.001"),
        ('friction', 'nan', 'friction = nan is not allowed'),
        ('shear_stiffness', 0, 'N/m'),
        ('film_exponent', True, 'film_exponent = True'),
        ('force_limit', 'felt', 'one of thickness, flattening, measured'),
        ('ceiling', 100e3, 'ceiling = 100000 Pa is not allowed'),
        ('ceiling', 2e6, 'from 1000 to 1000000 Pa'),
        ('colour', 'red', "unknown key 'colour'"),
    ],
)
def test_bad_files(tmp_path, key, value, message):
    path = written(tmp_path, lambda values: values.update({key: value}))
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        Foot.load(path)
    assert str(path) in str(caught.value)


def test_the_measured_line_is_of_one_pad(tmp_path):
    path = written(tmp_path, lambda values: values['pad'].update(stiffness=44.0))
    with pytest.raises(ConfigError, match=r'no force limit was measured on it.*one of thickness'):
        Foot.load(path)
    path.write_text(path.read_text().replace('force_limit: measured', 'force_limit: thickness'))
    assert Foot.load(path).dome_load(100.0, 50e3) > 0.0
    path.write_text(path.read_text().replace('force_limit: thickness', ''))
    assert Foot.load(path).limit == 'thickness'


def test_a_foot_file_may_give_the_limit_of_its_pads(tmp_path):
    shipped = configuration.locate('feet', 'large19').read_text()
    line = '  measured_limit: {force: 0.2, pressure: 60.0e+3, slope: 1.0e-5}\n'
    path = tmp_path / 'own.yaml'
    path.write_text(shipped.replace('\npads:', f'{line}\npads:', 1))
    foot = Foot.load(path)
    assert foot.pad.measured_limit == MeasuredLimit(0.2, 60e3, 1e-5)
    assert foot.dome_load(100.0, 60e3) == pytest.approx(19 * 0.2)
    assert foot.dome_load(100.0, 70e3) == pytest.approx(19 * 0.3, rel=1e-6)
    path.write_text(path.read_text().replace('slope: 1.0e-5', 'slope: -1.0'))
    with pytest.raises(ConfigError, match=r'own\.yaml.*slope'):
        Foot.load(path)


# --- rough floors -----------------------------------------------------------------------------


def test_a_rough_floor_by_hand():
    """Texture of 1.2 µm, critical film 0.5 µm: √(0.5² + 1.2²) = 1.3 µm, a factor of 2.6."""
    foot = Foot.load('large37')
    rough = foot.on_rough(1.2e-6)
    assert rough.critical_film == pytest.approx(1.3e-6)
    # Flat and dry: friction 0.35, and 4700 Pa on an area of N/(2.6 · 10444 Pa).
    held = tangential_resistance(rough, 6.8, 0.0)
    assert held == pytest.approx(6.8 * (0.35 + 4700.0 / (2.6 * 10444.0)))
    # Domes at 75 kPa still conform to the texture and hold as on a smooth floor.
    assert tangential_resistance(rough, 6.8, 75e3) == tangential_resistance(foot, 6.8, 75e3)
    # At 100 µm not even domes conform: that would need 200 times the pressure, 2.09 MPa.
    coarse = foot.on_rough(100e-6)
    expected = 6.8 * (0.35 + 4700.0 / (10444.0 * math.hypot(1.0, 200.0)))
    assert tangential_resistance(coarse, 6.8, 75e3) == pytest.approx(expected)
    assert tangential_resistance(coarse, 6.8, 0.0) == pytest.approx(expected)
    # On the rough floor a film of 0.6 µm leaves more dry contact than on a smooth one.
    share = math.exp(-((0.6 / 1.3) ** 2))
    dry = 6.8 * (0.35 + 4700.0 / 75e3)
    expected = share * dry + (1.0 - share) * 0.12 * 6.8
    assert tangential_resistance(rough, 6.8, 75e3, 0.6e-6) == pytest.approx(expected)


@pytest.mark.parametrize('value', [-1e-6, math.nan, math.inf])
def test_bad_roughness(value):
    with pytest.raises(InvalidInput, match='roughness'):
        Foot.load('large37').on_rough(value)
