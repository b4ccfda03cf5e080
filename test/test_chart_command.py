# SPDX-License-Identifier: Apache-2.0
import json
import pathlib
import types

import numpy as np
import pytest

from ros_pad import cli
from ros_pad.commands import chart
from ros_pad.ladders import ladder

NUMBERS = np.array([1.0, 4.0, 9.0])
PROBLEM = ladder.Problem('root', {'square': NUMBERS}, NUMBERS**0.5, np.ones(3, dtype=bool))
METHODS = (
    ladder.Method('power', lambda square: square**0.5),
    ladder.Method('none at 9', lambda square: square**0.5 if square < 9.0 else float('nan')),
)


@pytest.fixture(autouse=True)
def small_ladder(monkeypatch):
    """Put a ladder of two rungs in the place of the real ones, which take ten seconds each."""

    def measure(progress):
        return ladder.climb(PROBLEM, METHODS, 'power', lambda done: progress(done / 2))

    small = types.SimpleNamespace(
        measure=measure, figures=lambda rungs, progress: {'small': ladder.chart(rungs)}
    )
    monkeypatch.setattr(chart, 'LADDERS', {'contact': small, 'meniscus': small})


def test_table_json_and_picture(tmp_path: pathlib.Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / 'new' / 'charts'
    assert cli.main(['chart', 'contact', '--out', str(out)]) == 0
    said = capsys.readouterr().out
    assert 'root (3 cases; times against power)' in said
    assert str(out) in said
    kept = json.loads((out / 'contact.json').read_text())
    assert {'processor', 'python', 'numpy', 'date'} <= set(kept['machine'])
    assert [row['method'] for row in kept['rows']] == ['power', 'none at 9']
    assert (out / 'small.png').stat().st_size > 10_000
    # Files of the same name are replaced where one asks for that very folder.
    assert cli.main(['chart', 'all', '--out', str(out), '--json']) == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 4
    assert rows[0]['versus'] == 1.0
    assert rows[1]['failures'] == 1
    assert {'method', 'us_per_solve', 'error', 'failures', 'cases', 'versus'} <= set(rows[0])


def test_without_a_folder_each_chart_gets_its_own(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert cli.main(['chart', 'meniscus']) == cli.main(['chart', 'meniscus']) == 0
    made = sorted(path.name for path in (tmp_path / 'runs').iterdir())
    assert made == ['chart_meniscus', 'chart_meniscus_2']


def test_unknown_ladder(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as stop:
        cli.main(['chart', 'walking'])
    assert stop.value.code == 2
    assert 'contact' in capsys.readouterr().err
