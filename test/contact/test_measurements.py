# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from ros_pad import configuration
from ros_pad.contact.measurements import Measurements
from ros_pad.errors import ConfigError

THESIS = configuration.shared_folder() / 'measurements' / 'thesis.csv'


def read(tmp_path, text):
    path = tmp_path / 'mine.csv'
    path.write_text(text)
    return Measurements.read(path)


def test_what_the_thesis_measured():
    thesis = Measurements.read(THESIS)
    np.testing.assert_allclose(thesis.free.pressure, [55e3, 65e3, 75e3, 85e3])
    np.testing.assert_allclose(thesis.free.height, [1.25e-3, 1.6e-3, 2.0e-3, 2.4e-3])
    np.testing.assert_allclose(thesis.pressed.pressure, 75e3)
    np.testing.assert_allclose(thesis.pressed.force, [0.08, 0.19, 0.285])
    np.testing.assert_allclose(thesis.pressed.height, [1.8e-3, 1.4e-3, 1.0e-3])
    np.testing.assert_allclose(thesis.pressed.depth, [84.434e-6, 362.17e-6, 436.8e-6])
    np.testing.assert_allclose(thesis.pressed.contact_radius, [0.5e-3, 0.98e-3, 1.1e-3])
    assert np.isnan(thesis.pressed.gap).all()
    np.testing.assert_allclose(thesis.force_limits.pressure, [65e3, 75e3, 85e3])
    np.testing.assert_allclose(thesis.force_limits.force_limit, [0.15, 0.30, 0.40])
    assert len(thesis.friction.load) == 0


@pytest.mark.parametrize(
    ('header', 'pressure', 'height'),
    [
        ('pressure [kPa],height [mm]', 55e3, 1.25e-3),
        (' pressure (kPa) , height(mm)', 55e3, 1.25e-3),
        ('pressure/kPa,height/mm', 55e3, 1.25e-3),
        ('pressure_kPa,height_mm', 55e3, 1.25e-3),
        ('pressure [Pa],height [m]', 55.0, None),
        ('pressure [psi],height [um]', 55 * 6894.757293, 1.25e-6),
        ('pressure [psi],height [\N{GREEK SMALL LETTER MU}m]', 55 * 6894.757293, 1.25e-6),
        ('pressure [mbar],height [cm]', 5500.0, 12.5e-3),
    ],
)
def test_units_of_the_header(tmp_path, header, pressure, height):
    if height is None:
        with pytest.raises(
            ConfigError, match=r'height = 1\.25 is not allowed: a number from 0 to 0\.1'
        ):
            read(tmp_path, f'{header}\n55,1.25\n')
        return
    free = read(tmp_path, f'# one dome\n\n{header}\n55,1.25\n').free
    assert free.pressure == pytest.approx([pressure])
    assert free.height == pytest.approx([height])


def test_rows_of_every_kind_in_one_table(tmp_path):
    both = read(
        tmp_path,
        'pressure_kPa,force_N,gap_mm,contact_radius_mm,load_N,tangential_force_mN,surface,'
        'stance_time_ms,height_mm,force_limit_mN\n'
        '75,0,,,,,,,2.0,\n'
        '75,0.1,1.4,,,,,,,\n'
        '75,0.2,,0.9\n'
        '75,,,,,,,,,300\n'
        '0,,,,5,4000,dry,,,\n'
        '60,,,,5,1500,wet,300,,\n',
    )
    assert both.free.height == pytest.approx([2e-3])
    assert both.pressed.gap[0] == pytest.approx(1.4e-3)
    assert np.isnan(both.pressed.gap[1])
    assert both.pressed.contact_radius[1] == pytest.approx(0.9e-3)
    assert both.force_limits.force_limit == pytest.approx([0.3])
    assert both.friction.tangential_force == pytest.approx([4.0, 1.5])
    assert both.friction.wet.tolist() == [False, True]
    assert both.friction.stance_time[1] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('pressure [kPa],height [mm]\n# nothing\n', 'header'),
        ('pressure,height [mm]\n1,1\n', r"mine\.csv:1: column 'pressure' .* kPa, Pa"),
        ('pressure [mm],height [mm]\n1,1\n', 'one of kPa, Pa'),
        ('pressure [kPa]; height [mm]\n55; 1,2\n', 'with commas between'),
        ('pressure [kPa],width [mm]\n1,1\n', r"column 'width \[mm\]'.* pressure, force"),
        ('height [mm],height [m]\n1,1\n', 'column height .* twice'),
        ('pressure [kPa],height [mm]\n55,tall\n', 'csv:2: height = tall is not allowed'),
        ('pressure [kPa],height [mm]\n55,-1\n', 'height = -1 .* a number from 0 to 100'),
        ('pressure [kPa],height [mm]\n55,nan\n', 'height = nan is not allowed'),
        ('pressure [kPa],height [mm]\n55,1,1\n', '3 values for 2 columns'),
        ('pressure [kPa],height [mm]\n,1\n', 'a row with height also needs pressure'),
        ('pressure [kPa],force [N]\n55,1\n', 'also needs height, depth, contact_radius or gap'),
        ('pressure [kPa],height [mm],force_limit [N]\n55,1,1\n', 'height, force_limit$'),
        ('pressure [kPa],load [N],surface\n0,1,damp\n', 'surface = damp is not allowed: dry or'),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, complaint):
    with pytest.raises(ConfigError, match=complaint):
        read(tmp_path, text)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match=r'none\.csv: cannot be read'):
        Measurements.read(tmp_path / 'none.csv')
    (tmp_path / 'picture.csv').write_bytes(b'\x89PNG\xff\xfe')
    with pytest.raises(ConfigError, match='cannot be read'):
        Measurements.read(tmp_path / 'picture.csv')
