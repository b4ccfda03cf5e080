# SPDX-License-Identifier: Apache-2.0
"""``pad wet`` as a user types it."""

import dataclasses
import json
import math

import pytest

from ros_pad import cli, configuration
from ros_pad.capillary import Mesh, Wall, bath_meniscus, wet, wet_pattern
from ros_pad.contact import THESIS_LIQUID, WATER

DOME = ['wet', 'dome', '--radius', '1.55e-3', '--contact-radius', '0.6e-3']


def asked(arguments, capsys, status=0):
    assert cli.main([*arguments, '--json']) == status
    return json.loads(capsys.readouterr().out)


def test_a_dome_in_json_is_the_result_in_python(capsys):
    values = asked([*DOME, '--direction', '30', '--balance', 'force'], capsys)
    found = wet(Mesh.dome(1.55e-3, 0.6e-3), WATER, 'force')
    assert values['status'] == 'ok'
    assert values['height_m'] == pytest.approx(found.mean_height)
    assert values['force_n'] == pytest.approx(found.force(math.radians(30.0)))
    assert values['capillary_force_n'] == abs(values['force_n'])
    pinned = asked([*DOME, '--balance', 'force', '--hysteresis', '100', '60'], capsys)
    assert pinned['capillary_force_n'] == pytest.approx(
        found.hysteresis_force(0.0, math.radians(100.0), math.radians(60.0))
    )
    assert values['pressure_pa'] == pytest.approx(found.pressure.mean())


def test_a_dome_for_the_reader(capsys):
    assert cli.main([*DOME, '--liquid', 'thesis', '--layers', '50']) == 0
    said = capsys.readouterr().out
    found = wet(Mesh.dome(1.55e-3, 0.6e-3), THESIS_LIQUID, layers=50)
    assert f'{found.mean_height:.6g} m' in said
    assert f'{found.force(0.0):.6g} N' in said
    assert 'contact angle     77.3493 °' in said


def test_other_shapes_and_many_pads(capsys):
    cone = ['wet', 'cone', '--contact-radius', '1e-3', '--top-radius', '2e-3', '--height', '4e-3']
    assert asked(cone, capsys)['height_m'] > 0.0
    cylinder = ['wet', 'cylinder', '--radius', '0.5e-3', '--height', '0.04', '--angle', '0']
    assert cli.main(cylinder) == 1  # too slender for a reliable height
    assert 'use --method energy' in capsys.readouterr().err
    alone = wet(
        Mesh.cylinder(0.5e-3, 0.04), dataclasses.replace(WATER, contact_angle=0.0), strict=False
    )
    # Pillars on half the area: Jurin's height between them is that in a tube of their radius.
    area = str(2.0 * math.pi * 0.5e-3**2)
    between = asked([*cylinder, '--area', area], capsys)
    assert between['height_m'] == pytest.approx(2 * 0.073 / (9810 * 0.5e-3), rel=2e-3)
    assert between['height_m'] > 10.0 * alone.mean_height
    sizes = ['--pitch', '4.4e-3', '--radius', '1.55e-3', '--contact-radius', '0.6e-3']
    pattern = ['wet', 'pattern', '--pads', '7', *sizes, '--height', '2.6e-3']
    area = math.sqrt(0.75) * 4.4e-3**2 * 7
    dome = [*DOME, '--height', '2.6e-3', '--pads', '7', '--area', str(area)]
    for words, mesh, pads in (
        (pattern, Mesh.dome_pattern(7, 4.4e-3, 1.55e-3, 0.6e-3, 2.6e-3), 1),
        (dome, Mesh.dome(1.55e-3, 0.6e-3, 2.6e-3), 7),
    ):
        values, found = asked(words, capsys), wet_pattern(mesh, WATER, area, pads)
        assert values['height_m'] == pytest.approx(found.height, rel=1e-9)
        assert values['force_n'] == pytest.approx(found.force, rel=1e-9)
        assert values['capillary_force_n'] == pytest.approx(-found.force / 7, rel=1e-9)


def test_least_energy_around_one_pad(tmp_path, capsys):
    asked_for = [*DOME, '--method', 'energy', '--hysteresis', '100', '60']
    figure = tmp_path / 'it.png'
    values = asked([*asked_for, '--figure', str(figure)], capsys)
    exact = bath_meniscus(Wall.dome(1.55e-3, 0.6e-3), WATER)
    assert abs(values['height_m'] / exact.height - 1.0) < values['height_error'][1] < 0.01
    assert values['pull_n'] == pytest.approx(exact.force, rel=2e-3)
    assert values['pressure_pa'] == pytest.approx(exact.pressure, rel=5e-3)
    width = 2.0 * exact.radius * 0.073 * (math.cos(math.radians(60)) - math.cos(math.radians(100)))
    assert values['capillary_force_n'] == pytest.approx(width, rel=1e-2)
    assert values['time_s'] > 0.0
    assert figure.read_bytes().startswith(b'\x89PNG')


def test_least_energy_without_an_answer(capsys):
    low = ['wet', 'cylinder', '--radius', '1e-3', '--height', '1e-3', '--angle', '0']
    assert cli.main([*low, '--method', 'energy']) == 1
    assert 'status rim: the liquid reaches the top' in capsys.readouterr().err


@pytest.mark.slow
def test_a_foot_takes_the_force(tmp_path, capsys):
    force = asked([*DOME, '--hysteresis', '100', '60'], capsys)['capillary_force_n']
    shipped = configuration.locate('feet', 'large37').read_text()
    foot = tmp_path / 'wetter.yaml'
    foot.write_text(f'{shipped}capillary_force: {force!r}\n')
    walk = ['run', 'hexapod_smooth_wet_dome', '--no-ros', '--no-compare', '--cycles', '1']
    here = ['--fidelity', 'L1', '--out']
    without = asked([*walk, *here, str(tmp_path / 'a')], capsys)
    within = asked([*walk, *here, str(tmp_path / 'b'), '--foot', str(foot)], capsys)
    terms = [{row['term'] for row in each['omitted']} for each in (without, within)]
    assert terms[0] - terms[1] == {'capillary force of the pads'}
    assert sum(within['slip_path_m']) < sum(without['slip_path_m'])


@pytest.mark.parametrize(
    ('options', 'name', 'advice'),
    [
        (['--balance', 'thesis', '--angle', '95'], 'dry', 'does not rise'),
        (['--angle', '0'], 'saturated', 'above the top'),
        (['--tension', '1e-6', '--angle', '60'], 'coarse', 'more --layers'),
        (['--balance', 'thesis', '--angle', '70'], 'far_off', '--balance energy'),
        (['--area', '1e-3', '--pads', '7'], 'far_apart', '--method energy'),
    ],
)
def test_no_answer_is_a_failure_with_advice(options, name, advice, capsys):
    assert cli.main([*DOME, *options, '--json']) == 1
    said = capsys.readouterr()
    values = json.loads(said.out)
    assert values['status'] == name
    assert values['height_m'] is values['force_n'] is None
    assert advice in said.err
    assert cli.main([*DOME, *options]) == 1
    assert 'no answer' in capsys.readouterr().out


def test_a_file_in_millimetres(tmp_path, capsys):
    pytest.importorskip('meshio')
    path = tmp_path / 'dome.stl'
    small = Mesh.dome(1.55e-3, 0.6e-3)
    small.write(tmp_path / 'metres.stl')
    import meshio

    meshio.Mesh(1e3 * small.points, [('triangle', small.faces)]).write(path)
    assert cli.main(['wet', str(path)]) == 2
    assert 'scale=1e-3' in capsys.readouterr().err
    values = asked(['wet', str(path), '--scale', '1e-3'], capsys)
    assert values['height_m'] == pytest.approx(asked([*DOME], capsys)['height_m'], rel=1e-4)
