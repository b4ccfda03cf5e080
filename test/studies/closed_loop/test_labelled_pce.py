# SPDX-License-Identifier: Apache-2.0
"""The study labelled_pce: its files, the speed by an IMU, intervals, and a made-up folder."""

import json

import numpy as np
import pytest

from studies import samples
from studies.__main__ import main
from studies.closed_loop import labelled_contacts as contacts
from studies.closed_loop import labelled_pce as study


def atlas(path, slips=True):
    """Write ATLAS: three times 0.2 s in the air, 0.6 s on the floor, the last 0.2 s slipping."""
    table = np.zeros((2400, 13))
    phase = np.arange(2400) % 800
    slip = (phase >= 600) & slips
    table[:, 2] = np.where(phase < 200, 0.0, 800.0)
    table[:, 0] = np.where(phase < 200, 0.0, np.where(slip, 80.0, 8.0 + 0.01 * phase))
    table[:, 3:5] = np.random.default_rng(0).normal(0.0, 10.0, (2400, 2))
    table[:, 6] = np.where(slip, 1.0, 0.0)
    table[:, 9] = np.where(slip, 0.3, 1e-3)
    table[:, 12] = (phase >= 200) & ~slip
    np.savetxt(path, table, delimiter=',')
    return path


def go1(path, jolt):
    """Write a Go1: 6 steps of 0.4 s in the air and 0.4 s on the floor; a jolt in stances, g."""
    draw = np.random.default_rng(1)
    table = np.full((2400, 7), np.nan)
    table[:, 0] = np.where(np.arange(2400) % 400 < 200, 10.0, 300.0)
    standing = np.arange(1200) % 200 >= 100
    table[:1200, 1:4] = [0.0, 0.0, 1.0]
    table[:1200, 3] += np.where(standing, jolt * draw.uniform(0.5, 1.5, 1200), 0.0)
    table[:1200, 4:] = np.where(standing, 30.0, 400.0)[:, None] * [1.0, 0.0, 0.0]
    np.savetxt(path, table, delimiter=',')


def test_zero_is_slip_under_load_and_no_contact_without(tmp_path):
    found = study.read_atlas(atlas(tmp_path / 'ATLAS_x.csv'))
    phase = np.arange(2400) % 800
    assert (found.robot, found.period) == ('ATLAS', 1e-3)
    np.testing.assert_array_equal(found.label == contacts.NONE, phase < 200)
    np.testing.assert_array_equal(found.slipping, phase >= 600)
    assert len(found.events) == 3
    assert found.quiet_minutes == pytest.approx(3 * 0.35 / 60.0, rel=0.01)  # 50 ms clear of slips


@pytest.mark.parametrize(
    # Wilson's interval as in Newcombe, Statistics in Medicine 17 (1998) 857, Table I, method 3.
    ('hits', 'count', 'expected'),
    [(81, 263, (0.2553, 0.3662)), (15, 148, (0.0624, 0.1605)), (0, 20, (0.0, 0.1611))],
)
def test_interval_of_a_share(hits, count, expected):
    assert samples.share_interval(hits, count) == pytest.approx(expected, abs=1e-4)


def test_a_folder_of_made_up_feet(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, 'RESAMPLES', 50)
    for name in study.ATLAS:
        atlas(tmp_path / f'{name}.csv')
    for (name, _), jolt in zip(study.GO1.items(), (1.0, 0.1, 0.1), strict=True):
        go1(tmp_path / f'{name}.csv', jolt)
    assert main(['labelled_pce', str(tmp_path), '--json', '--out', str(tmp_path)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / 'labelled_pce.json').read_text())
    row = document['atlas']['ATLAS_01ground']
    assert row['ranking'][contacts.RATE]['auc'] == 1.0
    alarm = row['alarm'][f'{contacts.RATE}, own threshold']
    assert (alarm['events'], alarm['missed'], alarm['delay_s']) == (3, 0.0, 0.0)
    shipped = row['alarm'][f'{study.INERTIAL}, as shipped']
    assert shipped['missed'] == 0.0
    assert 0.0 < shipped['delay_s'] < 0.1
    go1_auc = document['go1']['auc']['acceleration off 1 g, mean (g)']
    assert go1_auc['normal'][0] == 1.0
    ground = document['go1']['ground']['normal']
    # Without a pull no ground can be told from another, and nothing slips.
    assert (ground['alarms'], set(ground['doubt'])) == (0, {'not yet', 'not pulled'})
    assert ground['stances'] == 5
