# SPDX-License-Identifier: Apache-2.0
"""What ``pad explore`` computes, without a page: the numbers of the other commands."""

import dataclasses
import json
import math
import re
import warnings

import pytest

from ros_pad import cli
from ros_pad.contact import Film, Foot, MeasuredLimit, Pad, force_limit, tangential_resistance
from ros_pad.reports.explore import FIELDS, STATES, explore, inputs_of, rows
from ros_pad.reports.explore_drawings import drawings
from ros_pad.reports.explore_page import foot_file
from ros_pad.simulation import Hose, PneumaticChannel, RegulatorModel
from ros_pad.simulation.pneumatics import time_to

LARGE = inputs_of(Foot.load('large37'))


def changed(**values):
    return explore(LARGE | values)


def texts(found):
    return {key: text for group in rows(found).values() for key, (_, text) in group.items()}


def test_the_numbers_are_those_of_pad_contact(capsys):
    force = str(LARGE['load'] / 37)
    options = ('--foot', 'large37', '--pressure', '76500', '--force', force, '--json')
    assert cli.main(['contact', *options]) == 0
    said = json.loads(capsys.readouterr().out)
    found = explore(LARGE)
    (remark,) = found.remarks
    assert remark.name == 'liquid' and not remark.error and 'wider than the pad' in remark.text
    assert f'{1e3 * said["meniscus"]["ring_radius_m"]:.3g} mm' in remark.text
    assert found.free.height == said['free']['height_m']
    assert found.pressed.gap == said['pressed']['gap_m']
    assert found.pressed.contact_radius == said['pressed']['contact_radius_m']
    assert found.ring.height == said['meniscus']['height_m']
    assert found.limits == said['force_limit_n']
    assert found.limit == 37 * said['force_limit_n']['measured']


@pytest.mark.parametrize('roughness', [0.0, 2e-6])
def test_grip_is_that_of_the_foot_on_its_film(roughness):
    found = changed(roughness=roughness, load=13.0)
    foot = Foot.load('large37').on_rough(roughness)
    for state in STATES:
        pressure = 76500.0 if 'dome' in state else 0.0
        films = 0.0, 0.0
        if 'wet' in state:
            film = Film(foot)
            film.touch_down(3e-4)
            on_domes = foot.dome_load(13.0, pressure)
            films = film.stand(on_domes, 13.0 - on_domes, pressure, 0.3)
        value = tangential_resistance(foot, 13.0, pressure, *films)
        assert found.grip[state] == pytest.approx(value, rel=1e-12)
    above = next(each for each in found.remarks if each.name == 'load')
    assert 'above the force limit' in above.text and not above.error


def test_a_measured_limit_stays_with_its_pad():
    pad = Pad(1.6e-3, 45.0, measured_limit=MeasuredLimit(0.3, 70e3, 5e-6))
    foot = dataclasses.replace(LARGE['foot'], pad=pad, limit='measured')
    own = explore(inputs_of(foot))
    assert own.limits['measured'] == force_limit(pad, own.inputs['pressure'], 'measured')
    for other in ({'radius': 1.7e-3}, {'stiffness': 46.0}):
        assert 'measured' not in explore(own.inputs | other).limits


def test_switching_is_that_of_the_channel():
    found = changed(bore=1e-3, hose=5.0)
    channel = PneumaticChannel(RegulatorModel(), Hose(1e-3, 5.0), LARGE['foot'].air_volume)
    assert found.switching.fill == pytest.approx(
        time_to(channel, 76500.0, 0.9 * 76500.0), rel=0.01
    )
    channel.step(76500.0, 5.0)
    vent = time_to(channel, 0.0, 1e3)  # 1 kPa by docs/explore.md
    assert found.switching.vent == pytest.approx(vent, rel=0.01)
    slow = changed(bore=0.5e-3, hose=50.0)
    assert slow.switching.fill == math.inf
    assert [each.name for each in slow.remarks] == ['liquid', 'hose']


# The input that is marked, words there, and the numbers that go; all others stay.
PRESSED = {'pressed-gap', 'pressed-contact_radius', 'ring-height'}
LIMITS = {f'limit-{name}' for name in ('thickness', 'flattening', 'measured')}
GRIP = {f'grip-{state.replace(", ", "-")}' for state in STATES}
DOMED = {key for key in GRIP if 'dome' in key}
FOOT = {'limit', 'fill', 'vent'}
BAD = [
    ({'load': 25.0}, 'load', 'the contact would cover the whole pad', PRESSED),
    ({'load': math.nan}, 'load', 'from 0.001 to 10000 N', PRESSED | GRIP),
    ({'pressure': 95e3}, 'pressure', 'ceiling of the foot', {'all'}),
    ({'pressure': 0.0}, 'pressure', 'more pressure is needed', PRESSED | DOMED | {'fill', 'vent'}),
    ({'film': 2.0}, 'film', 'from 0.001 to 10 mm', {'grip-flat-wet', 'grip-dome-wet'}),
    ({'supply': 1.0}, 'supply', 'from 1 to 1000 kPa', GRIP | FOOT),
    ({'material': 'nix'}, 'material', "no material named 'nix'", {'all'}),
]  # fmt: skip


@pytest.mark.parametrize(('values', 'name', 'words', 'gone'), BAD)
def test_where_a_model_ends_the_rest_stays(values, name, words, gone):
    found = changed(**values)
    (error,) = (each for each in found.remarks if each.error)
    assert error.name == name
    assert words in error.text
    missing = {key for key, text in texts(found).items() if text == '–'}
    if gone == {'all'}:
        assert PRESSED | DOMED | {'fill', 'vent', 'free-height'} <= missing
    else:
        assert missing == gone | {'ring-height'}  # wider than these pads
    assert drawings(found).count('<svg') == 2


def test_a_foot_that_no_file_may_have_is_refused():
    found = changed(stiffness=1.0, radius=4e-3, pads=7, pressure=800.0, load=0.01)
    (error,) = (each for each in found.remarks if each.name == 'supply' and each.error)
    assert (
        error.text == 'ceiling = 849.0 is not allowed: a number from 1000 to 1000000 Pa is needed'
    )
    assert found.foot is None and found.free is not None


@pytest.mark.parametrize('field', FIELDS, ids=[field.name for field in FIELDS])
def test_the_ends_of_every_slider_are_drawn(field):
    for end in (field.low, field.high):
        value = int(end) if field.name == 'pads' else end * field.unit
        with warnings.catch_warnings():
            warnings.simplefilter('error')
            drawn = drawings(changed(**{field.name: value}))
        assert drawn.count('<svg') == 2 and 'nan' not in re.sub('(?s)<svg.*?</svg>', '', drawn)


@pytest.mark.parametrize('name', ['large37', 'large19', 'small217'])
def test_the_foot_file_gives_the_foot(name, tmp_path):
    start = dataclasses.replace(Foot.load(name), capillary_force=1.5e-4)
    inputs = inputs_of(start) | {'pads': 31, 'sole_radius': 16e-3}
    path = tmp_path / 'foot.yaml'
    path.write_text(foot_file(explore(inputs).foot), encoding='utf-8')
    again = Foot.load(path)
    wanted = dataclasses.replace(start, source=str(path), pads=31, sole_radius=16e-3)
    assert again == wanted
    other = {'radius': 0.7e-3, 'thickness': 0.15e-3, 'criterion': 'flattening'}
    found = explore(inputs | other).foot
    path.write_text(foot_file(found), encoding='utf-8')
    assert Foot.load(path) == dataclasses.replace(found, source=str(path))
