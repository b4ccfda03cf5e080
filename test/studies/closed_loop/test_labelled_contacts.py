# SPDX-License-Identifier: Apache-2.0
"""The study labelled_contacts: reader, ranking and alarms, on made-up feet."""

import json

import numpy as np
import pytest

from studies import samples
from studies.__main__ import main
from studies.closed_loop import labelled_contacts as contacts


def foot(label, load=10.0, **columns):
    """Return a recording of a foot with labels; it has no load at label 1, no contact."""
    label = np.array(label)
    empty = np.zeros((len(label), 3))
    parts = {name: empty.copy() for name in ('force', 'rate')}
    parts['force'][:, 2] = np.where(label == 1, 0.0, load)
    for name, value in columns.items():
        part, axis = name.split('_')
        parts[part][:, 'xyz'.index(axis)] = value
    return contacts.Recording(name='ROBOT_made_up', label=label, **parts)


def write(path, scale, seed):
    """Write a recording of 40 stances, each with a slip of 80 ms with fast rotation."""
    draw = np.random.default_rng(seed)
    label = np.tile(np.repeat([1, 0, 2, 0], [10, 20, 8, 12]), 40)
    table = draw.normal(0.0, 0.01, (len(label), 13))
    table[:, :3] = np.column_stack(
        [0.2 + 0.1 * (label == 2) + 0.02 * table[:, 0], table[:, 1], 1.0 + table[:, 2]]
    ) * np.where(label == 1, 0.0, 100.0 * scale)[:, None]  # fmt: skip
    table[:, 9:12] = scale * (table[:, 9:12] + (label == 2)[:, None])
    table[:, 12] = label
    np.savetxt(path, table, delimiter=',')
    return path


# --- reader --------------------------------------------------------------------------------------


def test_columns_are_read_in_their_order(tmp_path):
    rows = np.arange(36.0).reshape(3, 12) + 1.0
    np.savetxt(tmp_path / 'NAO_x.csv', np.column_stack([rows, [0, 2, 1]]), delimiter=',')
    found = contacts.read(tmp_path / 'NAO_x.csv')
    assert (found.name, found.robot) == ('NAO_x', 'NAO')
    np.testing.assert_array_equal(found.force[0], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(found.rate[2], [34.0, 35.0, 36.0])
    np.testing.assert_array_equal(found.label, [0, 2, 1])


# --- stances and slips ---------------------------------------------------------------------------


def test_runs_are_joined_over_short_gaps_only():
    mask = np.array([1, 0, 1, 1, 0, 0, 0, 1], dtype=bool)
    assert samples.runs(mask) == [(0, 1), (2, 4), (7, 8)]
    assert samples.runs(mask, join=2) == [(0, 4), (7, 8)]
    assert samples.runs(~mask) == [(1, 2), (4, 7)]
    assert samples.runs(np.zeros(3, dtype=bool)) == []


def test_events_last_and_quiet_is_clear_of_them():
    found = foot([0] * 20 + [2, 2, 2, 0, 0, 2, 2] + [0] * 20 + [2, 2] + [0] * 20)
    assert found.events == [(20, 27)]  # gaps of 20 ms are bridged; a slip of 20 ms is no event
    np.testing.assert_array_equal(np.flatnonzero(found.quiet), [*range(15), *range(32, 42),
                                                                *range(54, 69)])  # fmt: skip


def test_floors_are_what_slips_show_again_and_again():
    ratio = np.r_[
        np.full(50, 0.3), np.full(40, 0.05), np.full(9, 0.301), np.linspace(0.1, 0.2, 300)
    ]
    found = foot([2] * len(ratio), force_x=10.0 * ratio)
    assert found.floors == pytest.approx([0.3, 0.05])


# --- ranking -------------------------------------------------------------------------------------


def test_mixed_floors_hide_what_each_stance_shows():
    # T/N is 0.05 in slips and 0.04 in sticks on ice, 0.6 and 0.5 on dry ground. Most slips are on
    # ice.
    label = [0] * 2 + [2] * 8 + [1] + [0] * 8 + [2] * 2
    ratio = [0.04] * 2 + [0.05] * 8 + [0.0] + [0.5] * 8 + [0.6] * 2
    found = foot(label, force_x=10.0 * np.array(ratio))
    assert contacts.ranking(found.ratio, found)['within_stance'] == 1.0
    # 8 slips are above the 2 sticks on ice only, 2 slips above all 10: 36 of 100 pairs.
    assert samples.auc(found.ratio[found.slipping], found.ratio[found.sticking]) == 0.36


def test_samples_of_one_stance_are_no_new_evidence():
    draw = np.random.default_rng(2)
    label = np.tile([0, 0, 2, 2, 1], 30)
    score = draw.normal(size=len(label)) + (label == 2)
    once = contacts.ranking(score, foot(label))['interval']
    tenfold = contacts.ranking(np.repeat(score, 10), foot(np.repeat(label, 10)))['interval']
    assert once == pytest.approx(tenfold, abs=1e-12)
    assert once[0] < samples.auc(score[label == 2], score[label == 0]) < once[1]
    assert once[1] - once[0] > 0.05


# --- alarms --------------------------------------------------------------------------------------


def test_late_and_false_alarms_are_counted():
    label = ([0] * 50 + [2] * 10) * 12
    score = np.zeros(len(label))
    for start in range(0, len(label), 60):
        score[start + 53 : start + 60] = 1.0  # 30 ms into the slip
    score[53:60] = 0.0  # no alarm in the first slip
    score[[20, 21, 140]] = 2.0  # two false alarms, one of them of two samples
    found = contacts.alarm_figures(score, 0.5, foot(label))
    quiet_minutes = (45 + 11 * 40) * 0.01 / 60.0
    assert found['events'] == 12
    assert found['missed'] == pytest.approx(1.0 / 12.0)
    assert found['delay_s'] == pytest.approx(0.03)
    assert found['false_per_minute'] == pytest.approx(2.0 / quiet_minutes)


def test_threshold_allows_so_many_false_alarms():
    # In two minutes of stick two false alarms are allowed.
    score = np.zeros(12000)
    score[[1000, 3000, 5000]] = [3.0, 2.0, 1.0]
    threshold = contacts.operating_threshold([score], [foot([0] * 12000)])
    assert 1.0 <= threshold < 2.0


# --- the whole -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_robots_of_other_scale(tmp_path, capsys):
    files = [write(tmp_path / 'BIG_1.csv', 1.0, 0), write(tmp_path / 'SMALL_1.csv', 0.1, 1)]
    arguments = [*map(str, files), '--json', '--out', str(tmp_path)]
    assert main(['labelled_contacts', *arguments]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / 'labelled_contacts.json').read_text())
    assert (tmp_path / 'labelled_contacts.png').read_bytes().startswith(b'\x89PNG')
    small = document['recordings']['SMALL_1']
    assert small['labels']['slips'] == 320
    assert small['ranking']['rate']['auc'] == 1.0
    alarm = small['alarm']['rate']['own']
    assert (alarm['events'], alarm['missed'], alarm['delay_s']) == (40, 0.0, 0.0)
    assert alarm['false_per_minute'] <= 1.0
    # The noise of the other robot is above the threshold of one with a tenth of its rates.
    big = document['recordings']['BIG_1']['alarm']['rate']
    assert big['own']['false_per_minute'] <= 1.0 < 100.0 < big['other']['false_per_minute']
