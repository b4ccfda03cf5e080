# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import yaml

from ros_pad import cli
from ros_pad.commands import run
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError, PadError
from ros_pad.estimation import Tuning
from ros_pad.estimation.friction import GroundModel
from ros_pad.estimation.scales import SCALE_RANGE, Scale
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


def test_a_file_gives_the_settings_of_an_estimator_on_the_next_floor(file):
    known = learnt.load(file(GOOD), 'large37')
    tuning = Tuning.of(Tuning().values | known)
    assert tuning.scales == {
        'flat_dry': Scale(0.7, pytest.approx(math.hypot(0.1, 0.1))),
        'flat_wet': Scale(1.2, pytest.approx(math.hypot(0.2, 0.1))),
        'dome': Scale(1.0, 0.4),
    }


def test_all_policies_of_a_run_begin_with_it(file, tmp_path, monkeypatch):
    found = []

    def others(*given):
        found.extend(each.scales['flat_wet'] for each in given if isinstance(each, Tuning))
        raise PadError('enough')

    monkeypatch.setattr(run.other_policies, 'beside', others)
    words = ['--learnt', str(file(GOOD)), '--out', str(tmp_path / 'walk')]
    assert cli.main(['run', 'hexapod_patches', '--no-ros', *words]) != 0
    assert found == [Scale(1.2, pytest.approx(math.hypot(0.2, 0.1)))]


@pytest.mark.parametrize(
    ('scale', 'sd', 'scale_error', 'sd_error'),
    # Where scales end, half of the distribution remains.
    [(0.7, 0.1, 0.01, 0.02), (SCALE_RANGE[0], 0.1, 0.1, 0.5), (SCALE_RANGE[1], 0.01, 0.01, 0.01)],
)
def test_what_is_saved_is_what_is_known(tmp_path, scale, sd, scale_error, sd_error):
    tuning = Tuning(scales={'flat_dry': Scale(scale, sd), 'dome': Scale(1.0, 1.0)})
    path = tmp_path / 'new.yaml'
    learnt.save(path, learnt.settings_of(GroundModel.of(FOOT, 6.83, tuning).shared), FOOT)
    kept = yaml.safe_load(path.read_text())
    assert kept['flat_dry']['scale'] == pytest.approx(scale, rel=scale_error)
    assert kept['flat_dry']['sd'] == pytest.approx(sd, rel=sd_error)
    assert kept['dome']['sd'] > 0.5
    assert learnt.load(path, 'large37')['scale.flat_dry'] == kept['flat_dry']['scale']
    assert [each.name for each in tmp_path.iterdir()] == ['new.yaml']


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('large37', 'small19', "foot = 'small19' is not allowed"),
        ('0.7', '7', 'flat_dry: scale = 7 is not allowed: a number from 0.3012 to 3.3201'),
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
