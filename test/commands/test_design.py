# SPDX-License-Identifier: Apache-2.0
"""``pad design`` as a user types it."""

import json
import math

import pytest

from ros_pad import cli, configuration


def said(capsys, *arguments):
    assert cli.main(['design', *arguments, '--json']) == 0
    printed = capsys.readouterr()
    assert printed.err == ''
    return json.loads(printed.out)


def test_a_shipped_foot_as_built_and_full(capsys):
    values = said(capsys, '--load', '7', '--foot', 'large37')
    built, full = values['designs']
    assert [each['name'] for each in values['designs']] == ['as built', 'full']
    assert built['pads'] == 37
    # Each pad needs 1.2 * 7/37 N; the measured line gives the pressure for it.
    needed = 75e3 + (1.2 * 7 / 37 - 0.2833) / 1.25e-5
    assert built['pressure_pa'] == pytest.approx(needed, rel=1e-12)
    assert built['reachable_load_n'] == pytest.approx(37 * 0.4708 / 1.2)
    assert full['pads'] == 31
    assert not full['touching']


def test_what_is_given_goes_before_the_foot(capsys):
    values = said(
        capsys,
        *('--load', '2', '--foot', 'large37', '--radius', '1e-3', '--stiffness', '30'),
        *('--pressure', '70e3', '--margin', '1', '--criterion', 'flattening'),
    )
    assert [each['name'] for each in values['designs']] == ['full']
    first = values['designs'][0]
    expected = {
        'radius_m': 1e-3,
        'stiffness_n_per_m': 30.0,
        'ceiling_pa': 70e3,
        'margin': 1.0,
        'criterion': 'flattening',
        'area_m2': math.pi * 0.017**2,
    }
    assert {key: first[key] for key in expected} == expected


@pytest.mark.parametrize(
    ('arguments', 'parts'),
    [
        (['25', '--criterion', 'measured'], ['64 pads would be enough']),
        (['9.73', '--pressure', '80e3', '--criterion', 'measured'], ['A supply of 82']),
        (['7'], ['is carried: 31 pads', 'It can be cast']),
    ],
)
def test_words_say_what_would_carry(arguments, parts, capsys):
    assert cli.main(['design', '--sole-radius', '0.017', '--load', *arguments]) == 0
    printed = capsys.readouterr().out
    for part in parts:
        assert part in printed


def test_figure(tmp_path, capsys):
    path = tmp_path / 'design.png'
    values = said(capsys, '--load', '7', '--foot', 'large19', '--figure', str(path))
    assert values['figure'] == str(path)
    assert path.read_bytes().startswith(b'\x89PNG')
    # At this pressure no pad carries a load, so that a logarithmic axis has nothing to show.
    arguments = ['--load', '7', '--sole-radius', '0.017', '--pressure', '5e4']
    assert said(capsys, *arguments, '--figure', str(tmp_path / 'other.png'))
    assert cli.main(['design', *arguments, '--figure', str(path)]) == 2  # not overwritten


def test_a_measured_limit_holds_for_its_radius(tmp_path, capsys):
    """A foot file that states the thesis' line itself gives the designs of the shipped foot."""
    shipped = configuration.locate('feet', 'large37').read_text()
    own = tmp_path / 'own.yaml'
    line = '{force: 0.2833, pressure: 75.0e+3, slope: 1.25e-5}'
    own.write_text(shipped.replace('pad:', f'pad:\n  measured_limit: {line}', 1))
    for radius, criterion in ([], 'measured'), (['--radius', '0.0005'], 'thickness'):
        theirs = said(capsys, '--load', '7', '--foot', 'large37', *radius)
        mine = said(capsys, '--load', '7', '--foot', str(own), *radius)
        for a, b in zip(
            theirs['designs'] + theirs['radii'], mine['designs'] + mine['radii'], strict=True
        ):
            for key in ('pads_needed', 'carried', 'reachable_load_n', 'pressure_pa'):
                assert b[key] == (a[key] if a[key] is None else pytest.approx(a[key], rel=1e-9))
        assert {each['criterion'] for each in mine['designs']} == {criterion}
        assert {each['criterion'] for each in mine['radii']} == {'thickness'}


def of_materials(capsys, *arguments):
    """Return what is printed; a slow machine shows a progress bar."""
    assert cli.main(['design', *arguments, '--json']) == 0
    return json.loads(capsys.readouterr().out)


class TestMaterials:
    def test_materials_and_thicknesses(self, capsys):
        values = of_materials(
            capsys,
            *('--load', '1.2', '--sole-radius', '0.017', '--pressure', '60e3'),
            *('--material', 'dragon_skin_10', 'ecoflex_00_30', '--thickness', '0.2e-3', '0.4e-3'),
        )
        found = values['candidates']
        assert [(each['material'], each['thickness_m']) for each in found] == [
            ('dragon_skin_10', 0.2e-3),
            ('dragon_skin_10', 0.4e-3),
            ('ecoflex_00_30', 0.2e-3),
            ('ecoflex_00_30', 0.4e-3),
        ]
        # 31 pads are flat at p π r²; Dragon Skin 10 ends at 46.65 kPa (reference study).
        pressure = 1.2 * 1.2 / (31 * math.pi * 1.5e-3**2)
        assert found[1]['pressure_pa'] == pytest.approx([pressure] * 3, rel=1e-9)
        assert found[1]['largest_pressure_pa'][0] == pytest.approx(46.65e3, rel=1e-3)
        assert found[1]['ballooning_margin'][2] == pytest.approx(
            2.1 * 46.65e3 / pressure, rel=1e-3
        )
        assert found[2]['pressure_pa'] == [None, pytest.approx(pressure), None]
        assert [each['carried'] for each in found] == ['yes', 'yes', 'in doubt', 'yes']
        assert (values['criterion'], values['ceiling']) == ('flattening', 60e3)
        assert '3 of 4 candidates carry 1.2 N at up to 60000 Pa' in values['says'][0]
        assert '; 1 more if' in values['says'][0]

    def test_the_table_and_the_picture(self, tmp_path, capsys):
        path = tmp_path / 'materials.png'
        arguments = ['--load', '7', '--sole-radius', '0.017', '--figure', str(path)]
        assert cli.main(['design', *arguments, '--material', 'all']) == 0
        lines = capsys.readouterr().out.splitlines()
        rows = [line for line in lines if line.startswith(('dragon', 'ecoflex'))]
        assert len(rows) == 3 * len(configuration.names('materials'))
        assert all(line.endswith(('yes', 'in doubt', 'no')) for line in rows)
        assert '7 N at up to' in lines[-4]
        assert path.read_bytes().startswith(b'\x89PNG')

    def test_a_foot_of_a_material(self, capsys):
        values = of_materials(capsys, '--load', '1', '--foot', 'small217')
        (found,) = values['candidates']
        assert (found['material'], found['pads']) == ('ecoflex_00_20', 217)
        assert (values['ceiling'], values['criterion']) == (11e3, 'flattening')
        # The neighbours of its material balloon at 11.7 and 13.6 kPa.
        assert 11.7e3 < found['largest_pressure_pa'][0] < 13.6e3
        other = of_materials(
            capsys, '--load', '1', '--foot', 'small217', '--material', 'dragon_skin_10'
        )
        assert other['candidates'][0]['radius_m'] == 0.5e-3
        assert other['ceiling'] == 90e3
