# SPDX-License-Identifier: Apache-2.0
"""The page of a sweep."""

import re

import pytest

from ros_pad import cli
from ros_pad.errors import InvalidInput, PadError
from ros_pad.reports import sweep as pages
from ros_pad.trials import sweep as sweeps
from ros_pad.trials.sweep import Sweep, table
from ros_pad.trials.sweep.table import Results

SWEEP = Sweep(
    ['leg_wet_flat'],
    ['flat', 'dome'],
    range(8),
    {'body.rolling_drag': [0.5, 0.25], 'cycles': [1]},
    'L0',
)


def row(job, **changes):
    """Return a made-up row: distance grows with the seed, doubles with domes, falls with drag."""
    way = (0.010 + 0.001 * job.seed) * (2.0 if job.policy == 'dome' else 1.0)
    return job.labels | {
        'distance_per_cycle_m': way / job.labels['body.rolling_drag'],
        'cycles_walked': 2.0,
        'slip_path_m_leg1': 0.006,
        'switches_leg1': job.seed,
        'wet_accuracy': 0.75,
        'verdict': None,
        'level': 'L0',
        'real_time_factor': 100.0,
    } | changes  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a sweep of 32 trials, of which one failed and one ended early."""
    jobs = {job.key: job for job in SWEEP.jobs()}
    found = tmp_path / 'drag'
    with Results(found, table.identity(SWEEP), jobs) as results:
        # A pool of processes may finish trials in any order.
        for number, (key, job) in enumerate(reversed(jobs.items())):
            if number == 0:
                results.add(key, job.failed('ValueError: <oh>'))
            else:
                results.add(key, row(job, **({'verdict': 'it fell'} if number == 9 else {})))
    return found


def test_what_was_walked_is_read_in_order(folder):
    found = sweeps.read(folder)
    assert sweeps.is_sweep(folder) and not sweeps.is_sweep(folder.parent)
    assert found.sweep.scenes == ['leg_wet_flat'] and found.sweep.policies == ['flat', 'dome']
    assert found.sweep.seeds == list(range(8))
    assert list(found.sweep.parameters) == ['body.rolling_drag', 'cycles']
    assert found.sweep.parameters['body.rolling_drag'] == [0.5, 0.25]
    assert len(found.rows) == 32
    labels = [(r['body.rolling_drag'], r['policy'], r['seed']) for r in found.rows]
    assert labels == [(d, p, s) for d in (0.5, 0.25) for p in ('flat', 'dome') for s in range(8)]
    assert {tuple(r) for r in found.rows} == {tuple(found.rows[0])}


def test_page(folder):
    path = folder / 'report.html'
    before = (folder / table.RESULTS).read_bytes()
    pages.write(sweeps.read(folder), path)
    assert (folder / table.RESULTS).read_bytes() == before
    text = path.read_text(encoding='utf-8')
    assert '<script' not in text and not re.search('https?:', text)
    words = re.sub(r'\s+', ' ', re.sub('<[^>]*>', ' ', text.partition('<body>')[2]))
    assert 'Sweep drag' in words and '32 trials of 1 scene · 2 policies · seeds 0 to 7' in words
    assert '1 of 32 trials failed' in words and '1 of 32 walks ended early' in words
    # Flat feet at 0.5 N walk 20 to 34 mm in steps of 2; Student's t for 7 degrees is 2.365.
    half = 2.3646 * 2.0 * 6.0**0.5 / 8.0**0.5
    mean = f'27.0 {27.0 - half:.1f} to {27.0 + half:.1f}'
    assert f'0.5 flat 8 0 {mean}' in words
    # At 0.25 N one trial with domes failed, and one with flat feet ended early.
    assert '0.25 dome 7 1' in words
    found = sweeps.read(folder)
    means = [1e3 * each.mean for each in sweeps.points(found.rows, found.sweep.parameters)]
    (axes,) = pages.drawn(found).figure.axes
    marks = [line.get_ydata()[0] for line in axes.lines if line.get_marker() in ('s', '^')]
    assert sorted(marks) == pytest.approx(sorted(means))
    assert sum(line.get_markerfacecolor() == 'white' for line in axes.lines) == 2  # left out
    assert 'ValueError: &lt;oh&gt;' in text and 'it fell' in words
    again = 'pad sweep leg_wet_flat --policy dome --seed 7 --set body.rolling_drag=0.25'
    assert again in words
    assert 'fingerprint of leg_wet_flat' in words
    assert text.count('src="data:image/svg+xml;base64,') == 1
    with pytest.raises(PadError, match='exists'):
        pages.write(sweeps.read(folder), path)


def test_the_order_in_which_trials_were_done_does_not_matter(folder, tmp_path):
    jobs = {job.key: job for job in SWEEP.jobs()}
    other = tmp_path / 'other' / 'drag'
    known = {
        tuple(r[n] for n in ('policy', 'seed', 'body.rolling_drag')): r
        for r in sweeps.read(folder).rows
    }
    with Results(other, table.identity(SWEEP), jobs) as results:
        for key, job in jobs.items():
            mine = known[job.policy, job.seed, job.labels['body.rolling_drag']]
            results.add(key, job.labels | {n: v for n, v in mine.items() if v is not None})
    written = []
    for each in (folder, other):
        pages.write(sweeps.read(each), each / 'page.html')
        written.append((each / 'page.html').read_bytes())
    assert written[0] == written[1]


def test_folders_without_trials(tmp_path):
    with pytest.raises(InvalidInput, match='holds no sweep'):
        sweeps.read(tmp_path)
    at_work = Results(tmp_path / 'new', table.identity(SWEEP), [])
    with at_work, pytest.raises(PadError, match='is running'):
        sweeps.read(tmp_path / 'new')
    with pytest.raises(InvalidInput, match='no trial'):
        sweeps.read(tmp_path / 'new')
    (tmp_path / 'bad').mkdir()
    (tmp_path / 'bad' / table.RESULTS).write_bytes(b'no data base' * 100)
    with pytest.raises(PadError, match='not a database'):
        sweeps.read(tmp_path / 'bad')


def test_command(folder, tmp_path, capsys):
    figures = tmp_path / 'figures'
    assert cli.main(['report', str(folder)]) == 0
    assert capsys.readouterr().out.split() == [str(folder / 'report.html')]
    assert cli.main(['report', str(folder)]) == 2
    assert 'exists already' in capsys.readouterr().err
    # With --figures the page is not written.
    assert cli.main(['report', str(folder), '--figures', str(figures)]) == 0
    written = capsys.readouterr().out.split()
    assert written == [str(figures / 'sweep.pdf'), str(figures / 'sweep.png')]
    assert cli.main(['report', str(folder), '--figures', str(figures)]) == 2
    assert cli.main(['report', str(folder), '--figures', str(figures), '--force']) == 0
