# SPDX-License-Identifier: Apache-2.0
"""Bad input to any command is status 2 with the reason, and nothing is printed or written."""

import shlex

import pytest

from ros_pad import cli, configuration

SHARED = configuration.shared_folder()
FILES = {
    'THESIS': SHARED / 'measurements' / 'thesis.csv',
    'BAG': SHARED.parent / 'bags' / 'hexapod_patches' / 'bag',
    'DOME': 'dome --radius 1.55e-3 --contact-radius 0.6e-3',
    'SHEET': '--material dragon_skin_10 --radius 1.5e-3',
}
BAD = {
    'bag info nothere': 'nothere: no such bag',
    'bag info empty': 'no metadata.yaml',
    'report nothere': 'no such bag',
    'run nothere.yaml': 'no such file',
    'run hexapod_patch': "Did you mean 'hexapod_patches'?",
    'run steep.yaml': 'steep.yaml: gait: cycle = -1.0 is not allowed: a number from 0.05 to 60 s',
    'run leg_dry_flat --no-ros --out empty': 'exists already',
    'run hexapod_patches --cycles 0': '--cycles = 0 is not allowed: a whole number from 1 to 100',
    'run hexapod_patches --seed -1': '--seed = -1 is not allowed: a whole number from 0 to',
    'run hexapod_patches --fidelity L0': "fidelity = 'L0'",
    'run leg_wet_dome_75 --no-ros --foot large0': "no foot named 'large0'",
    'contact --pressure nan': 'pressure = nan',
    'contact --pressure -75e3': 'pressure = -75000.0',
    'contact --pressure 30e3 SHEET --thickness 4e-4 --model thesis': '--model is not allowed for',
    'contact --pressure 30e3 SHEET': '--thickness = None is not allowed: a number from 1e-05',
    'contact --pressure 30e3 --radius 1e-3': '--radius is not allowed without --material',
    'calibrate nothere.csv': 'nothere.csv: cannot be read',
    'calibrate THESIS --out foot.txt': "'.txt' is not allowed: one of .yaml",
    'calibrate THESIS --thickness 4e-4': '--material and --thickness are both needed',
    'calibrate THESIS --material dragon_skin_10 --thickness 0.4': 'thickness = 0.4 is not allowed',
    'design --load 7': '--sole-radius',
    'design --load 0 --sole-radius 0.02': 'load = 0',
    'design --load 7 --sole-radius 8e-4 --radius 5e-4 --figure design.txt': '.png',
    'design --load 7 --sole-radius 0.018 --thickness 4e-4': '--thickness needs --material',
    'design --load 7 --sole-radius 0.018 --material all --stiffness 40': '--stiffness is not',
    'doctor --robot go3': "no robot named 'go3'. Did you mean 'go2'?",
    'doctor --robot go2 --mapping go': "no mapping named 'go'. Did you mean",
    'doctor --robot go2 --bag nothing': 'nothing: no such bag',
    'doctor --robot go2 --seconds 0': '--seconds = 0',
    'doctor --robot my.urdf': '3 to 8 different links are needed',
    'doctor --bag x': '--bag needs --robot',
    'emulate alicat --channels 3': '--channels',
    'emulate smc_itv --units kPa': "option of smc_itv = 'units' is not allowed: one of full",
    'emulate alicat --fault fire': "fault = 'fire' is not allowed: one of silence",
    'emulate alicat --unit-ids ab': "unit_ids = 'ab' is not allowed: [A-Z]+",
    'emulate alicat --link scene.yaml': "link = 'scene.yaml' is not allowed: a new path",
    'emulate alicat --link no/regulator': 'no/regulator',
    'replay nothere': 'no such bag',
    'replay BAG --set wet_prior': 'wet_prior: NAME=VALUE is needed\n',  # lists are refused
    'replay BAG --set margin=1.2 --set margin=1.3': 'margin is given twice',
    'replay BAG --set tau=0.2': "parameter = 'tau' is not allowed",
    'replay BAG --set policy.dwell=3 --policy dome': 'only the adaptive',
    'replay BAG --remap leg_1/wrench:=/x': "'/x' is not allowed",
    'replay BAG --namespace spider': 'in namespace /spider/ is needed',
    'replay BAG --figure picture.jpg': "'.jpg' is not allowed",
    'sweep leg_wet_fla --out out': "Did you mean 'leg_wet_flat'",
    'sweep leg_wet_flat --workers 0 --out out': 'workers = 0 is not allowed',
    'wet dome': 'a dome needs --radius --contact-radius',
    'wet DOME --top-radius 1': '--top-radius is no option of the mesh dome',
    'wet DOME --pads 3': '--pads needs --area',
    'wet DOME --area 1 --hysteresis 90 60': '--hysteresis is for a single pad',
    'wet DOME --hysteresis 60 90': 'advancing_angle - receding_angle',
    'wet DOME --area 1e-3 --pads 0': 'pads = 0',
    'wet DOME --tension 0.05': '--tension needs --angle',
    'wet DOME --layers 1': 'layers = 1',
    'wet DOME --direction nan': '--direction = nan',
    'wet DOME --figure dome.jpg': "'.jpg' is not allowed",
    'wet DOME --method energy --area 7e-6': 'area = 7e-06',
    'wet DOME --method energy --layers 50': '--layers is only for --method layers',
    'wet none.stl': 'none.stl: no such file',
    'wet none.stl --height 1': '--height is no option of the mesh none.stl',
}


@pytest.mark.parametrize('words', BAD)
def test_bad_input_is_status_2(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'scene.yaml').touch()
    scene = (SHARED / 'scenes' / 'hexapod_patches.yaml').read_text()
    (tmp_path / 'steep.yaml').write_text(scene.replace('cycle: 1.0 ', 'cycle: -1.0 '))
    reason = BAD[words]
    for name, text in FILES.items():
        words = words.replace(name, str(text))
    assert cli.main(shlex.split(words)) == 2
    said = capsys.readouterr()
    assert said.out == '' and reason in said.err
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ['empty', 'scene.yaml', 'steep.yaml']
