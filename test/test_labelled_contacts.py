# SPDX-License-Identifier: Apache-2.0
"""bench/labelled_contacts.py: reader, ranking, alarms and probabilities, on made-up feet.

With ROS_PAD_LCD set to a folder with ATLAS_7k_04ground.csv and NAO_05ground.csv, of
https://github.com/mrsp/lcd, they are read as well.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import pathlib
import sys
from types import ModuleType

import numpy as np
import pytest
from scipy import special
from scipy import stats

from ros_pad.errors import InvalidInput

ROOT = pathlib.Path(__file__).resolve().parent.parent
CHART = ROOT / 'docs' / 'charts' / 'labelled_contacts.json'
DATA = os.environ.get('ROS_PAD_LCD')


def program(name: str) -> ModuleType:
    """Return a program of bench/ as a module."""
    spec = importlib.util.spec_from_file_location(f'bench_{name}', ROOT / 'bench' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


bench = program('labelled_contacts')


def foot(label: list[int], load: float | np.ndarray = 10.0, **columns: object):
    """Return a recording of a foot with these labels; loaded unless they say no contact."""
    label = np.array(label)
    empty = np.zeros((len(label), 3))
    parts = {name: empty.copy() for name in ('force', 'moment', 'acceleration', 'rate')}
    parts['force'][:, 2] = np.where(label == 1, 0.0, load)
    for name, value in columns.items():
        part, axis = name.split('_')
        parts[part][:, 'xyz'.index(axis)] = value
    return bench.Recording(name='ROBOT_made_up', label=label, **parts)


def write(path: pathlib.Path, scale: float, seed: int) -> pathlib.Path:
    """Write a recording of 40 stances, each with a slip of 80 ms that turns fast."""
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
    found = bench.read(tmp_path / 'NAO_x.csv')
    assert (found.name, found.robot) == ('NAO_x', 'NAO')
    np.testing.assert_array_equal(found.force[0], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(found.moment[1], [16.0, 17.0, 18.0])
    np.testing.assert_array_equal(found.acceleration[0], [7.0, 8.0, 9.0])
    np.testing.assert_array_equal(found.rate[2], [34.0, 35.0, 36.0])
    np.testing.assert_array_equal(found.label, [0, 2, 1])


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('1,2,3\n4,5,6\n', '13 of finite numbers'),
        ('1,2,3,4,5,6,7,8,9,10,11,nan,0\n', '13 of finite numbers'),
        ('1,2,3,4,5,6,7,8,9,10,11,12,3\n', 'must be 0, 1 or 2'),
        ('1,2,3,4,5,6,7,8,9,10,11,foot,0\n', '13 columns of numbers'),
        ('1,2,3,4,5,6,7,8,9,10,11,12,0\n', 'no slip'),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path, text, says):
    (tmp_path / 'x.csv').write_text(text)
    with pytest.raises(InvalidInput, match=says):
        bench.read(tmp_path / 'x.csv')


def test_a_missing_file_is_told_where_to_get(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['labelled_contacts.py', str(tmp_path / 'NAO_05ground.csv')])
    assert bench.main() == 2
    assert 'fetch it from https://github.com/mrsp/lcd' in capsys.readouterr().err


# --- stances and slips ---------------------------------------------------------------------------


def test_runs_are_joined_over_short_gaps_only():
    mask = np.array([1, 0, 1, 1, 0, 0, 0, 1], dtype=bool)
    assert bench.runs(mask) == [(0, 1), (2, 4), (7, 8)]
    assert bench.runs(mask, join=2) == [(0, 4), (7, 8)]
    assert bench.runs(~mask) == [(1, 2), (4, 7)]
    assert bench.runs(np.zeros(3, dtype=bool)) == []


def test_a_lightly_loaded_foot_does_not_stand():
    load = np.array([10.0] * 8 + [0.9, 1.1])
    found = foot([0] * 7 + [2] * 3, load)
    assert found.expected_load == 10.0
    assert found.slipping.sum() == 2  # the label says three
    assert found.stances == [(0, 8), (9, 10)]


def test_events_last_and_quiet_is_clear_of_them():
    found = foot([0] * 20 + [2, 2, 2, 0, 0, 2, 2] + [0] * 20 + [2, 2] + [0] * 20)
    assert found.events == [(20, 27)]  # a gap of 20 ms does not part them; 20 ms alone are none
    np.testing.assert_array_equal(np.flatnonzero(found.quiet), [*range(15), *range(32, 42),
                                                                *range(54, 69)])  # fmt: skip


def test_floors_are_what_slips_show_again_and_again():
    ratio = np.r_[
        np.full(50, 0.3), np.full(40, 0.05), np.full(9, 0.301), np.linspace(0.1, 0.2, 300)
    ]
    found = foot([2] * len(ratio), force_x=10.0 * ratio)
    assert found.floors == pytest.approx([0.3, 0.05])
    assert found.at_friction.sum() == 99


# --- features ------------------------------------------------------------------------------------


def test_combined_ratio_is_friction_on_the_limit_surface():
    # The sole: centres of pressure over a box of 0.2 m by 0.1 m.
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 101), np.linspace(-0.05, 0.05, 101))
    x, y = x.ravel(), y.ravel()
    still = foot([0] * len(x), moment_x=10.0 * y, moment_y=-10.0 * x)
    assert still.sole_radius == pytest.approx(
        math.sqrt(0.98 * 0.2 * 0.98 * 0.1 / math.pi), rel=0.01
    )
    friction, slide = 0.4, 0.6  # of the tangential limit; the rest is torsion
    twist = 2.0 / 3.0 * still.sole_radius * friction * 10.0 * math.sqrt(1.0 - slide**2)
    pulled = foot(
        [0] * len(x),
        force_y=slide * friction * 10.0,
        moment_x=10.0 * y,
        moment_y=-10.0 * x,
        # A force at a centre of pressure off the axis has a moment that is no torsion.
        moment_z=twist + x * slide * friction * 10.0,
    )
    found = bench.features(pulled)
    np.testing.assert_allclose(pulled.torsion, twist / 10.0, rtol=1e-9)
    np.testing.assert_allclose(found[bench.TWIST], friction, rtol=1e-9)
    np.testing.assert_allclose(found[bench.RATIO], slide * friction, rtol=1e-12)


def test_scales_do_not_depend_on_units():
    draw = np.random.default_rng(0)
    rate = draw.gamma(2.0, size=50)
    one, other = (
        bench.features(
            foot([0] * 48 + [2] * 2, moment_x=rate, moment_y=rate[::-1], rate_z=k * rate)
        )
        for k in (1.0, 70.0)
    )
    for name in (bench.QUIETLY, bench.LARGELY, 'rate z / largest'):
        np.testing.assert_allclose(one[name], other[name], atol=1e-12)
    np.testing.assert_allclose(other[bench.RATE] - one[bench.RATE], math.log10(70.0))


def test_without_a_position_more_pull_raises_the_least_friction():
    pulls = np.repeat([0.02, 0.3], 40)
    label = [0] * 40 + [1] + [0] * 40
    found = foot(label, force_x=10.0 * np.insert(pulls, 40, 0.0))
    quantile = bench.margin(found) + found.ratio
    assert quantile[38] < 0.15  # nothing asked, nothing known
    assert quantile[-1] > 0.28


def test_a_steady_pull_is_no_news():
    found = foot([0] * 200, force_x=1.0)
    quantile = bench.margin(found) + found.ratio
    np.testing.assert_allclose(quantile, quantile[0], atol=1e-12)


# --- ranking -------------------------------------------------------------------------------------


def test_auc_of_normal_scores_is_known():
    draw = np.random.default_rng(1)
    slip, stick = draw.normal(1.0, 1.0, 20000), draw.normal(0.0, 1.0, 20000)
    assert bench.auc(slip, stick) == pytest.approx(stats.norm.cdf(1.0 / math.sqrt(2.0)), abs=0.005)
    test = stats.mannwhitneyu(slip, stick).statistic
    assert bench.auc(slip, stick) == pytest.approx(test / 20000**2, rel=1e-12)


def test_auc_counts_ties_half():
    assert bench.auc(np.array([1.0, 2.0]), np.array([1.0, 0.0])) == 0.875
    assert math.isnan(bench.auc(np.array([]), np.array([1.0])))


def test_mixed_floors_hide_what_each_stance_shows():
    # On ice slips pull 0.05 and sticks 0.04, on dry ground 0.6 and 0.5; slips are mostly on ice.
    label = [0] * 2 + [2] * 8 + [1] + [0] * 8 + [2] * 2
    ratio = [0.04] * 2 + [0.05] * 8 + [0.0] + [0.5] * 8 + [0.6] * 2
    found = foot(label, force_x=10.0 * np.array(ratio))
    assert bench.auc_within(found.ratio, found) == 1.0
    # 8 slips beat the 2 sticks on ice alone, 2 beat all 10: 36 of 100 pairs.
    assert bench.auc(found.ratio[found.slipping], found.ratio[found.sticking]) == 0.36


def test_samples_of_one_stance_are_no_new_evidence():
    draw = np.random.default_rng(2)
    label = np.tile([0, 0, 2, 2, 1], 30)
    score = draw.normal(size=len(label)) + (label == 2)
    once = bench.auc_interval(score, foot(label))
    tenfold = bench.auc_interval(np.repeat(score, 10), foot(np.repeat(label, 10)))
    assert once == pytest.approx(tenfold, abs=1e-12)
    assert once[0] < bench.auc(score[label == 2], score[label == 0]) < once[1]
    assert once[1] - once[0] > 0.05


# --- alarms --------------------------------------------------------------------------------------


def test_alarm_is_heard_late_and_goes_off_for_nothing():
    label = ([0] * 50 + [2] * 10) * 12
    score = np.zeros(len(label))
    for start in range(0, len(label), 60):
        score[start + 53 : start + 60] = 1.0  # 30 ms into the slip
    score[53:60] = 0.0  # and the first one never
    score[[20, 21, 140]] = 2.0  # two alarms, one of two samples
    found = bench.heard(score, 0.5, foot(label))
    quiet_minutes = (45 + 11 * 40) * 0.01 / 60.0
    assert found['events'] == 12
    assert found['missed'] == pytest.approx(1.0 / 12.0)
    assert found['delay_s'] == pytest.approx(0.03)
    assert found['false_per_minute'] == pytest.approx(2.0 / quiet_minutes)


def test_few_slips_give_no_share():
    assert bench.heard(np.ones(60), 0.5, foot([0] * 50 + [2] * 10))['missed'] is None


def test_threshold_allows_the_false_alarms_that_are_put_up_with():
    # Two minutes of stick: two alarms are allowed, a third is not.
    score = np.zeros(12000)
    score[[1000, 3000, 5000]] = [3.0, 2.0, 1.0]
    threshold = bench.operating_threshold([score], [foot([0] * 12000)])
    assert 1.0 <= threshold < 2.0


# --- probability ---------------------------------------------------------------------------------


def test_fit_to_a_yes_or_no_is_the_log_odds_of_each():
    x = np.repeat([0.0, 1.0], [400, 200])[:, None]
    slip = np.r_[np.arange(400) < 40, np.arange(200) < 150]
    found = bench.fit(x, slip, ridge=0.0)
    assert found.intercept == pytest.approx(special.logit(0.1), abs=1e-3)
    assert found.slope[0] == pytest.approx(special.logit(0.75) - special.logit(0.1), abs=1e-3)


def test_fit_to_parted_samples_is_finite():
    x = np.r_[np.zeros(10), np.ones(10)][:, None]
    found = bench.fit(x, x[:, 0] > 0.5)
    assert np.isfinite(found.slope).all()
    assert found.log_odds(np.array([[0.0], [1.0]])) @ [-1.0, 1.0] > 4.0


def test_brier_of_the_share_is_its_variance():
    slip = np.arange(100) < 30
    assert bench.brier(np.full(100, 0.3), slip) == pytest.approx(0.21)
    assert bench.brier(slip.astype(float), slip) == 0.0


def test_reliability_counts_what_comes_true():
    probability = np.repeat([0.15, 0.95, 0.55], [40, 40, 5])
    slip = np.r_[np.arange(40) < 6, np.arange(40) < 20, np.zeros(5, dtype=bool)]
    assert bench.reliability(probability, slip) == [
        (pytest.approx(0.15), pytest.approx(0.15), 40),
        (pytest.approx(0.95), pytest.approx(0.5), 40),
    ]


# --- the whole -----------------------------------------------------------------------------------


def test_two_robots_of_other_scale(tmp_path, capsys, monkeypatch):
    files = [write(tmp_path / 'BIG_1.csv', 1.0, 0), write(tmp_path / 'SMALL_1.csv', 0.1, 1)]
    arguments = [*map(str, files), '--json', '--out', str(tmp_path)]
    monkeypatch.setattr(sys, 'argv', ['labelled_contacts.py', *arguments])
    assert bench.main() == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / 'labelled_contacts.json').read_text())
    assert (tmp_path / 'labelled_contacts.png').read_bytes().startswith(b'\x89PNG')
    small = document['recordings']['SMALL_1']
    assert small['labels']['slip_at_edge'] == 0.0
    assert small['ranking'][bench.RATE]['auc'] == 1.0
    alarm = small['alarm'][bench.RATE]['own']
    assert (alarm['events'], alarm['missed'], alarm['delay_s']) == (40, 0.0, 0.0)
    assert alarm['false_per_minute'] <= 1.0
    # Ten times slower, it is never told from stick by the fit to the other robot ...
    probability = small['calibration'][bench.RATE]
    assert probability['own']['accuracy'] == 1.0
    assert probability['other']['accuracy'] == pytest.approx(1.0 - probability['share'], abs=0.01)
    # ... unless it is measured by its own largest.
    assert small['calibration'][bench.LARGELY]['other']['accuracy'] == 1.0


def test_one_robot_is_not_enough(tmp_path, capsys, monkeypatch):
    path = write(tmp_path / 'BIG_1.csv', 1.0, 0)
    monkeypatch.setattr(sys, 'argv', ['labelled_contacts.py', str(path), str(path)])
    assert bench.main() == 2
    assert 'two robots' in capsys.readouterr().err


@pytest.mark.skipif(not DATA, reason='needs ROS_PAD_LCD, a folder of recordings')
def test_recordings_rank_as_the_page_says():
    told = json.loads(CHART.read_text(encoding='utf-8'))['recordings']
    for name in ('ATLAS_7k_04ground', 'NAO_05ground'):
        found = bench.read(pathlib.Path(DATA) / f'{name}.csv')
        # Where nothing touches, nothing pushes: the numbering of the labels.
        assert not found.load[found.label == bench.NONE].any()
        assert found.load[found.label == bench.STABLE].min() > 0.0
        score = bench.features(found)
        for feature in (bench.RATIO, bench.RATE):
            slip, stick = score[feature][found.slipping], score[feature][found.sticking]
            told_auc = told[name]['ranking'][feature]['auc']
            test = stats.mannwhitneyu(slip, stick).statistic / (len(slip) * len(stick))
            assert test == pytest.approx(told_auc, abs=1e-5)
