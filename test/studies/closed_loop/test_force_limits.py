# SPDX-License-Identifier: Apache-2.0
"""The study of force limits."""

import json
import pathlib
from dataclasses import replace

import pytest

from ros_pad.simulation import Scene
from ros_pad.trials import run
from studies.__main__ import main
from studies.closed_loop import force_limits

REFERENCE = json.loads(
    (pathlib.Path(__file__).parents[2] / 'reference' / 'force_limits.json').read_text('utf-8')
)


def test_its_membrane_is_that_of_the_reference():
    found = force_limits.pads()['pads']['membrane']['limits']
    for criterion, values in REFERENCE['limits'].items():
        assert found[criterion][-3:] == pytest.approx(values, rel=2e-3)


def test_powers_by_hand():
    """Flattening is p π r²; the cap's limits are k r times a function of p r/k and h/r."""
    powers = force_limits.pads()['pads']
    assert powers['membrane']['powers']['flattening'] == pytest.approx([0.0, 2.0, 1.0], abs=1e-9)
    stiffness, radius, pressure = powers['cap']['powers']['flattening']  # not of the thickness
    assert stiffness == pytest.approx(1.0 - pressure, abs=0.05)
    assert radius == pytest.approx(1.0 + pressure, abs=0.05)


def test_command(tmp_path, capsys):
    assert main(['force_limits', '--out', str(tmp_path)]) == 0
    assert 'membrane' in capsys.readouterr().out
    assert {each.name for each in tmp_path.iterdir()} == {'force_limits.json', 'force_limits.png'}


@pytest.mark.slow
def test_a_low_dome_walks_by_one_criterion_and_not_by_the_other():
    """Pads of 40 kPa carry nothing by the measured line, so the foot floats as a flat one."""
    scene = Scene.load('leg_wet_dome_40')
    measured, thickness = (
        1e3
        * run(replace(scene, foot=replace(scene.foot, limit=each))).metrics.distance_per_cycle_m
        for each in ('measured', 'thickness')
    )
    assert measured == pytest.approx(9.38, rel=0.03)  # test_thesis_scenes
    assert thickness > 3.0 * measured
