# SPDX-License-Identifier: Apache-2.0
"""The ``pad`` command as a user types it: output, exit status, and messages for bad input."""

import errno
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

import pytest
from shared import python, wait_for

from ros_pad import cli, configuration
from ros_pad.bags import BagReader
from ros_pad.errors import BagError
from ros_pad.records import PRESSURE
from ros_pad.signals import INTERRUPTED

SCENE = configuration.shared_folder() / 'scenes' / 'hexapod_patches.yaml'


@pytest.mark.parametrize('level', ['L1', 'L2'])
def test_a_gait_that_no_leg_reaches_leaves_no_folder(tmp_path, capsys, level):
    """So that the same command runs once the scene is mended."""
    pytest.importorskip('rclpy')
    scene, out = tmp_path / 'far.yaml', tmp_path / 'walk'
    scene.write_text(SCENE.read_text().replace('stride: 0.14', 'stride: 1.4'))
    assert cli.main(['run', str(scene), '--fidelity', level, '--out', str(out)]) == 2
    said = capsys.readouterr().err
    assert f'{scene}: gait.stride = 1.4 m is not allowed: at most 0.3' in said
    assert not out.exists()


def test_auto_runs_the_cheap_level_and_shows_why(tmp_path, capsys):
    out = tmp_path / 'walk'
    words = ['run', 'hexapod_dry_slow', '--no-ros', '--no-compare', '--cycles', '4']
    assert cli.main([*words, '--out', str(out)]) == 0
    shown = capsys.readouterr().out
    assert 'hexapod_dry_slow, seed 0, simulated on level L1: ' in shown
    assert 'numerical error: at most ' in shown and 'in 95 of 100 scenes' in shown
    assert 'left out' not in shown  # no shipped scene leaves out what matters to it
    text = SCENE.with_name('hexapod_dry_slow.yaml').read_text()
    (tmp_path / 'strict.yaml').write_text(re.sub('accuracy:.*', 'accuracy: 0.001', text))
    words[1:2] = [str(tmp_path / 'strict.yaml'), '--fidelity', 'L1', '--out', str(tmp_path / 'b')]
    assert cli.main(words) == 0
    assert re.search(r'it matters: joints, servos.*, about [0-9.]+ % of', capsys.readouterr().out)
    page = (out / 'report.html').read_text()
    assert 'effect of soft pads on the motion of the body' in page and 'joints, servos' in page


def test_auto_takes_the_answer_without_a_simulation(tmp_path, capsys, monkeypatch):
    """15 cycles of 60 mm, for a scene that asks for its distance alone."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(['run', 'hexapod_dry_distance', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found['fidelity'], found['distance_m']) == ('no slip', pytest.approx(0.9))
    assert 0.0 < found['bound'] <= 0.1 and 'nothing was simulated' in found['note']
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    'words',
    [['--live'], ['--out', 'walk']],
    ids=' '.join,
)
def test_without_a_simulation_options_of_a_walk_are_refused(words, tmp_path, capsys, monkeypatch):
    """The level that is offered is that of the policy: domes need L2 for this accuracy."""
    pytest.importorskip('mujoco')
    monkeypatch.chdir(tmp_path)
    shipped = SCENE.with_name('hexapod_dry_distance.yaml').read_text()
    scene = pathlib.Path('strict.yaml')
    scene.write_text(shipped.replace('accuracy: 0.1 ', 'accuracy: 0.044 '))
    for policy, level in (('flat', 'L1'), ('dome', 'L2')):
        assert cli.main(['run', str(scene), '--policy', policy, *words]) == 2
        said = capsys.readouterr().err
        assert f'{words[0]} is not allowed: strict requires its distance alone' in said
        assert f'--fidelity {level} walks it' in said
    assert [*tmp_path.iterdir()] == [tmp_path / scene]


def test_a_run_without_ros_writes_report_and_summary(tmp_path, capsys):
    out = tmp_path / 'walk'
    arguments = ['run', 'hexapod_patches', '--no-ros', '--cycles', '3', '--out', str(out)]
    assert cli.main([*arguments, '--seed', '4', '--json']) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary['seed'] == 4
    assert summary['bag'] is None
    assert summary['cycles'] == pytest.approx(3.0)
    assert summary['distance_m'] > 0.1
    assert len(summary['slip_path_m']) == len(summary['switches']) == 6
    assert {row['policy'] for row in summary['comparison']} == {'flat', 'dome', 'oracle'}
    assert all(row['term'] and row['reason'] for row in summary['omitted'])
    assert json.loads((out / 'summary.json').read_text()) == summary
    assert (out / 'report.html').stat().st_size > 10_000
    # The same folder is refused the second time, and nothing in it changes.
    before = (out / 'report.html').stat().st_mtime_ns
    assert cli.main(arguments) == 2
    assert 'exists already' in capsys.readouterr().err
    assert (out / 'report.html').stat().st_mtime_ns == before


@pytest.mark.slow
def test_without_a_folder_the_next_free_one_is_made(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ['run', 'leg_dry_flat', '--no-ros', '--cycles', '1']
    assert cli.main(arguments) == cli.main(arguments) == 0
    made = sorted(path.name for path in (tmp_path / 'runs').iterdir())
    assert made == ['leg_dry_flat_flat_seed0', 'leg_dry_flat_flat_seed0_2']


@pytest.mark.slow
def test_a_foot_of_ones_own_walks(tmp_path, capsys, monkeypatch):
    shipped = pathlib.Path(__file__).parent.parent / 'config' / 'feet' / 'large37.yaml'
    mine = tmp_path / 'mine.yaml'
    mine.write_text(shipped.read_text().replace('friction: 0.35', 'friction: 0.25'))
    monkeypatch.chdir(tmp_path)
    walk = ['run', 'hexapod_patches', '--no-ros', '--no-compare', '--cycles', '2', '--json']
    summaries = []
    for foot in ([], ['--foot', 'large37'], ['--foot', str(mine)]):
        assert cli.main([*walk, *foot]) == 0
        summaries.append(json.loads(capsys.readouterr().out))
    own, named, other = summaries
    assert own['foot'] == named['foot'] == 'large37'
    assert other['foot'] == str(mine)
    assert own['distance_m'] == named['distance_m'] > other['distance_m']
    assert cli.main([*walk, '--foot', 'wide']) == 2
    assert 'large19' in capsys.readouterr().err
    mine.write_text(mine.read_text().replace('90.0e+3', '70.0e+3'))
    assert cli.main(['run', 'leg_wet_dome_75', '--no-ros', '--foot', str(mine)]) == 2
    assert '0 to 70000 Pa is needed' in capsys.readouterr().err


def test_contact_of_a_pad_of_a_material(capsys):
    sheet = ['--material', 'dragon_skin_10', '--radius', '1.5e-3', '--thickness', '0.4e-3']
    assert cli.main(['contact', '--pressure', '30e3', *sheet, '--json']) == 0
    answer = json.loads(capsys.readouterr().out)
    assert set(answer['force_limit_n']) == {'thickness', 'flattening'}
    assert answer['model'] == 'membrane'


def test_contact_prints_the_thesis_height(capsys):
    assert cli.main(['contact', '--pressure', '75e3', '--force', '0.1', '--json']) == 0
    values = json.loads(capsys.readouterr().out)
    assert values['free']['height_m'] == pytest.approx(1.94126819416e-3, rel=1e-11)
    assert values['force_limit_n']['measured'] == pytest.approx(0.2833)
    assert values['force_limit_n']['thickness'] == pytest.approx(0.317, abs=5e-4)
    assert cli.main(['contact', '--pressure', '75e3', '--force', '0.1']) == 0
    assert '0.00194127' in capsys.readouterr().out


def test_contact_outside_the_model_is_reported(capsys):
    flattened = ['contact', '--pressure', '75e3', '--force', '0.6']
    assert cli.main(flattened) == 1
    said = capsys.readouterr()
    assert 'flattened' in said.err
    # The free dome and the force limit of one pad are printed nevertheless.
    assert '0.00194127 m' in said.out and '0.2833 N' in said.out
    assert cli.main([*flattened, '--json']) == 1
    values = json.loads(capsys.readouterr().out)
    assert values['free']['height_m'] == pytest.approx(1.94126819416e-3, rel=1e-11)
    assert values['pressed'] == {'status': 'flattened'} and 'meniscus' not in values


def test_a_shape_is_shown_where_no_force_limit_is_known(capsys):
    above = ['contact', '--pressure', '100e3', '--force', '0.1', '--model', 'membrane']
    assert cli.main(above) == 0
    said = capsys.readouterr().out
    assert said.count('not known above 91342 Pa') == 3
    assert cli.main([*above, '--json']) == 0
    limits = json.loads(capsys.readouterr().out)['force_limit_n']
    assert len(limits) == 3 and set(limits.values()) == {None}
    # No limit was measured on the small pad.
    assert cli.main(['contact', '--pressure', '40e3', '--pad', 'small', '--json']) == 0
    limits = json.loads(capsys.readouterr().out)['force_limit_n']
    assert 'measured' not in limits
    assert 0.0 < limits['thickness'] < limits['flattening']


def test_what_the_system_refuses_is_status_1(tmp_path, monkeypatch, capsys):
    def full(*_):
        try:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise BagError('bag: cannot be written') from error

    monkeypatch.setattr('ros_pad.bags.recovery.inspect', full)
    assert cli.main(['bag', 'repair', str(tmp_path)]) == 1
    assert 'cannot be written' in capsys.readouterr().err
    # The folder of the picture does not exist.
    figure = str(tmp_path / 'none' / 'design.png')
    assert cli.main(['design', '--load', '7', '--foot', 'large37', '--figure', figure]) == 1


INTERRUPTED_START = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == '{imported}':
            os.kill(os.getpid(), signal.{number})

sys.meta_path.insert(0, Interrupt())
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ['pad', 'contact', '--pressure', '75e3']
from {module} import {function}
assert '{imported}' not in sys.modules
sys.exit({function}())
"""


@pytest.mark.parametrize(
    ('imported', 'number'), [('argparse', 'SIGINT'), ('ros_pad.contact', 'SIGTERM')]
)
def test_a_signal_during_imports_leaves_no_traceback(imported, number):
    """It comes while the console script imports ros_pad, or ros_pad the command."""
    root = SCENE.parent.parent.parent
    module, function = re.search(
        r"'pad = ([\w.]+):(\w+)'", (root / 'setup.py').read_text()
    ).groups()
    script = INTERRUPTED_START.format(
        imported=imported, number=number, module=module, function=function
    )
    child = python('-c', script, cwd=root)
    assert (child.returncode, child.stdout) == (INTERRUPTED, '')
    assert child.stderr == 'pad: stopped\n'


@pytest.fixture
def environment():
    pytest.importorskip('rclpy', reason='a run on nodes needs ROS 2')
    return {**os.environ, 'PYTHONPATH': str(SCENE.parent.parent.parent)}


def test_a_run_on_nodes_is_recorded_and_reported(tmp_path, environment):
    out = tmp_path / 'walk'
    words = ('run', 'hexapod_patches', '--cycles', '4', '--out', out)
    child = python('-m', 'ros_pad', *words, env=environment)
    assert child.returncode == 0, child.stderr
    for part in ('adaptive', 'flat', 'dome', 'oracle', 'a gait cycle', 'report.html'):
        assert part in child.stdout
    summary = json.loads((out / 'summary.json').read_text())
    reader = BagReader(out / 'bag')
    label = json.loads(reader.custom_data['ros_pad'])
    assert label['metrics']['distance_m'] == summary['distance_m']
    assert len(label['settings']['comparison']) == 3
    # The report of the bag is the same as that of the run.
    page = (out / 'report.html').read_text()
    shutil.move(out / 'report.html', tmp_path / 'first.html')
    assert cli.main(['report', str(out / 'bag')]) == 0
    assert (out / 'report.html').read_text() == page
    assert cli.main(['report', str(out / 'bag')]) == 2


def test_ctrl_c_leaves_vented_pads_and_a_readable_bag(tmp_path, environment):
    out = tmp_path / 'walk'
    words = ['run', 'hexapod_patches', '--policy', 'dome', '--cycles', '600', '--out', str(out)]
    mcap = out / 'bag' / 'bag_0.mcap'
    with subprocess.Popen(
        [sys.executable, '-m', 'ros_pad', *words], stderr=subprocess.PIPE, text=True,
        env=environment,
    ) as child:  # fmt: skip
        try:
            wait_for(
                lambda: (
                    child.poll() is not None or (mcap.exists() and mcap.stat().st_size > 300_000)
                )
            )
            child.send_signal(signal.SIGINT)
            _, said = child.communicate()
        finally:
            child.kill()
    assert child.returncode == INTERRUPTED
    assert 'pads vented, bag closed' in said
    reader = BagReader(out / 'bag')
    assert reader.problem is None
    _, _, block = reader.records({'/feet/pressure': PRESSURE})['/feet/pressure']
    pressures = block.rows['pressure']
    assert pressures.max() > 60e3
    assert pressures.shape[1] == 6 and pressures[-1].max() < 1000.0


def test_a_walk_that_is_stopped_before_its_first_sample_is_a_trial(tmp_path, monkeypatch, capfd):
    composed = pytest.importorskip('ros_pad.nodes.composed')
    walk = composed.ComposedTrial.walk

    def stopped(trial, progress):
        trial.stopped = True
        walk(trial, progress)

    monkeypatch.setattr(composed.ComposedTrial, 'walk', stopped)
    words = ['run', 'hexapod_patches', '--no-compare', '--out', str(tmp_path / 'walk')]
    assert cli.main(words) == INTERRUPTED
    assert 'stopped at 0.0 s' in capfd.readouterr().err


def test_domes_that_cannot_carry_the_robot_are_reported(tmp_path, capsys):
    heavy = tmp_path / 'heavy.yaml'
    heavy.write_text(f'{SCENE.read_text()}\nbody: {{mass: 5.0, inertia: 0.08}}\n')
    out = tmp_path / 'walk'
    arguments = ['run', str(heavy), '--no-ros', '--cycles', '1', '--policy', 'dome']
    assert cli.main([*arguments, '--out', str(out)]) == 0
    said = capsys.readouterr().out
    assert said.count('stayed flat: leg ') == 6
    assert 'ceiling of 90000 Pa' in said
    assert re.search('(?i)stayed flat.* leg 1', (out / 'report.html').read_text())


def test_a_run_that_cannot_start_leaves_its_name_free(tmp_path, monkeypatch):
    out = tmp_path / 'walk'
    monkeypatch.setitem(sys.modules, 'ros_pad.nodes', None)
    assert cli.main(['run', 'leg_dry_flat', '--cycles', '1', '--out', str(out)]) == 1
    assert not out.exists()
