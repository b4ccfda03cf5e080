# SPDX-License-Identifier: Apache-2.0
import json
import shutil

import pytest
import yaml

from ros_pad import configuration
from studies import __main__ as studies

pytest.importorskip('mujoco')


def test_robots_of_a_file_walk(tmp_path, capsys):
    """A robot of the user's own file and the shipped one, one of them pushed."""
    (tmp_path / 'robots.yaml').write_text(yaml.safe_dump({'mine': ['quadruped.yaml']}))
    shutil.copy(configuration.shared_folder() / 'robots' / 'go2.yaml', tmp_path / 'quadruped.yaml')
    words = ['gaits', '--robots', str(tmp_path / 'robots.yaml'), '--cycles', '4', '--seeds', '1']
    words += ['--cases', 'dry', 'pushes of 15 %', '--out', str(tmp_path), '--processes', '1']
    assert studies.main(words) == 0
    rows = json.loads((tmp_path / 'gaits.json').read_text())['rows']
    assert [(row['case'], row['robot']) for row in rows] == [
        ('dry', 'shipped go2'), ('dry', 'mine'),
        ('pushes of 15 %', 'shipped go2'), ('pushes of 15 %', 'mine'),
    ]  # fmt: skip
    for row in rows:
        assert row['verdict'] is None and row['slip'] < 0.03
        assert row['distance'] == pytest.approx(1.0, abs=0.1)
    assert rows[0]['distance'] == rows[1]['distance'] != rows[3]['distance']
    assert 'pushes of 15 %' in capsys.readouterr().out
