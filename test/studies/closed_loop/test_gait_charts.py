# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest

from studies import __main__ as studies

pytest.importorskip('mujoco')
from studies.closed_loop import gait_charts


def test_all_charts_of_short_walks(tmp_path, monkeypatch, capsys):
    """The independent walk is one of the go2 itself, which must be found to be the same."""
    np.savez(tmp_path / 'walk.npz', **gait_charts.simulated(0.0, 18))
    monkeypatch.setattr(gait_charts, 'CONTROLS', {4: 'o', 16: 's'})
    monkeypatch.setattr(gait_charts, 'PHYSICS', (1.0, 2.0))
    monkeypatch.setattr(gait_charts, 'PUSHES', (0.0, 0.7))
    monkeypatch.setattr(gait_charts, 'MAPS', {'friction': ('', (0.1, 0.8)), 'slope': ('', (25,))})
    words = ['--walk', str(tmp_path / 'walk.npz'), '--out', str(tmp_path), '--processes', '1']
    assert studies.main(['gait_charts', '--cycles', '6', '--seeds', '1', *words]) == 0
    made = [json.loads((tmp_path / f'gait_{part}.json').read_text()) for part in gait_charts.PARTS]
    cycle, steps, falls = made
    other, pushed, free = (np.array([*each.values()]) for each in cycle['curves'].values())
    assert np.array_equal(other, free) and not np.array_equal(other, pushed)
    loads = free[3:, 0]
    assert loads.sum(0).mean() == pytest.approx(1.0, abs=0.01)
    assert loads[0, 2] < 1e-3 < 0.2 < loads[0, 10]  # FL lands at sample 5
    found = [(row['control_ms'], row['falls'], row.get('place')) for row in steps['rows']]
    assert found[0] == (4, 0, 0.0) and found[1][2] > 0.0
    assert found[2:] == [(16, 1, None)] * 2
    assert [[*row['falls'].values()] for row in falls['rows']] == [[0, 0], [1, 0], [0], [1]]
    assert 'load in the first' in capsys.readouterr().out
