# SPDX-License-Identifier: Apache-2.0
import dataclasses

import pytest

from ros_pad import cli
from ros_pad.commands import run
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError
from ros_pad.errors import PadError
from ros_pad.estimation import Tuning
from ros_pad.estimation.foot import shared_friction
from ros_pad.estimation.scales import Scale
from ros_pad.trials import learnt

FOOT = Foot.load('large37')
GOOD = """
foot: large37
flat_dry: {scale: 0.7, sd: 0.1}
flat_wet: {scale: 1.2, sd: 0.2}
dome: {scale: 1.0, sd: 0.4}
"""


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / 'learnt.yaml'
        path.write_text(text)
        return path

    return write


def test_a_file_gives_the_settings_of_an_estimator(file):
    known = learnt.load(file(GOOD), 'large37')
    tuning = Tuning(**{name.replace('.', '_'): value for name, value in known.items()})
    assert tuning.scales == {
        'flat_dry': Scale(0.7, 0.1), 'flat_wet': Scale(1.2, 0.2), 'dome': Scale(1.0, 0.4),
    }  # fmt: skip


def test_all_policies_of_a_run_begin_with_it(file, tmp_path, monkeypatch):
    found = []

    def others(*given):
        found.extend(each.scales['flat_wet'] for each in given if isinstance(each, Tuning))
        raise PadError('enough')

    monkeypatch.setattr(run, 'Others', others)
    words = ['--learnt', str(file(GOOD)), '--out', str(tmp_path / 'walk')]
    assert cli.main(['run', 'hexapod_patches', '--no-ros', *words]) != 0
    assert found == [Scale(1.2, 0.2)]


def test_what_is_saved_is_what_was_known_and_less_certain(file, tmp_path):
    tuning = Tuning(scale_flat_dry=0.7, scale_sd_flat_dry=0.1)
    settings = learnt.settings_of(shared_friction(FOOT, 6.83, tuning))
    path = tmp_path / 'new.yaml'
    learnt.save(path, settings, FOOT)
    known = learnt.load(path, 'large37')
    assert known == settings
    assert known['scale.flat_dry'] == pytest.approx(0.7, rel=0.01)
    assert known['scale_sd.flat_dry'] == pytest.approx(0.1414, rel=0.02)  # √(0.1² + 0.1²)
    assert known['scale_sd.dome'] <= 0.4
    assert [each.name for each in tmp_path.iterdir()] == ['new.yaml']


def test_the_name_of_a_foot_may_have_quotes(tmp_path):
    foot = dataclasses.replace(FOOT, source="it's: a {foot}.yaml")
    learnt.save(tmp_path / 'a', learnt.settings_of(shared_friction(foot, 6.83, Tuning())), foot)
    assert learnt.load(tmp_path / 'a', foot.source)


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('large37', 'small19', "foot = 'small19' is not allowed"),
        ('0.7', '7', 'flat_dry: scale = 7 is not allowed: a number from 0.3 to 3.4'),
        ('sd: 0.2', 'sd: .nan', 'flat_wet: sd = nan is not allowed'),
        ('sd: 0.1}', 'sd: 0.1, more: 1}', 'more'),
        ('dome:', 'domes:', "key 'dome' is missing"),
        ('{scale: 1.0, sd: 0.4}', '3', 'expected a table'),
        ('foot:', '- ', 'not valid YAML'),
    ],
)
def test_a_wrong_file_gets_an_error_that_names_it(file, old, new, words):
    with pytest.raises(ConfigError) as caught:
        learnt.load(file(GOOD.replace(old, new)), 'large37')
    assert 'learnt.yaml' in str(caught.value) and words in str(caught.value)


def test_no_file_and_no_place_for_one(tmp_path):
    with pytest.raises(ConfigError, match='cannot be read'):
        learnt.load(tmp_path / 'none.yaml', 'large37')
    with pytest.raises(PadError, match='cannot be written'):
        learnt.save(tmp_path / 'none' / 'a', learnt.settings_of(
            shared_friction(FOOT, 6.83, Tuning())), FOOT)  # fmt: skip
