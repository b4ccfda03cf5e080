# SPDX-License-Identifier: Apache-2.0
"""The common command of all studies, and functions that they share."""

import json
import os
import types

import numpy as np
import pytest

from studies import command
from studies.__main__ import STUDIES, main
from studies.work_precision import comparison

NUMBERS = np.array([1.0, 4.0, 9.0])
PROBLEM = comparison.Problem('root', {'square': NUMBERS}, NUMBERS**0.5, np.ones(3, dtype=bool))
METHODS = (
    comparison.Method('power', lambda square: square**0.5),
    comparison.Method('none at 9', lambda square: square**0.5 if square < 9.0 else float('nan')),
)
SMALL = types.SimpleNamespace(
    __doc__='Roots.',
    measure=lambda progress: comparison.run(
        PROBLEM, METHODS, 'power', lambda done: progress(done / 2)
    ),
    figures=lambda results, progress: {'small': comparison.chart(results)},
)


def test_all_studies_are_listed(capsys):
    assert main([]) == main(['--help']) == 0
    assert main(['unknown']) == 2
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line[:2] == '  ']
    assert listed == 3 * list(STUDIES)


@pytest.mark.parametrize('name', STUDIES)
def test_every_study_has_help(name, capsys):
    if name in ('nodes', 'flood'):
        pytest.importorskip('rclpy')
    environment = dict(os.environ)
    with pytest.raises(SystemExit) as stop:
        main([name, '--help'])
    assert stop.value.code == 0
    assert os.environ == environment
    text = capsys.readouterr().out
    assert text.startswith(f'usage: python -m studies {name} ')
    assert '--json' in text


def test_a_work_precision_study_writes_table_json_and_pictures(tmp_path, capsys):
    out = tmp_path / 'new' / 'charts'
    assert command.compare_methods('roots', SMALL, ['--out', str(out)]) == 0
    text = capsys.readouterr().out
    assert 'none at 9' in text
    assert str(out) in text
    kept = json.loads((out / 'roots.json').read_text())
    assert {'processor', 'python', 'numpy', 'date'} <= set(kept['machine'])
    assert [row['method'] for row in kept['rows']] == ['power', 'none at 9']
    assert (out / 'small.png').stat().st_size > 10_000
    # In a folder given by --out files are replaced.
    assert command.compare_methods('roots', SMALL, ['--out', str(out), '--json']) == 0
    rows = json.loads(capsys.readouterr().out)
    assert (rows[0]['versus'], rows[1]['failures']) == (1.0, 1)
    assert {'method', 'us_per_solve', 'error', 'failures', 'cases', 'versus'} <= set(rows[0])


def test_processes_keep_the_order_and_pass_errors_on():
    cases = [(number, 3) for number in range(20)]
    assert command.in_processes(divmod, cases, 2, 'test') == [divmod(*each) for each in cases]
    with pytest.raises(ZeroDivisionError):
        command.in_processes(divmod, [(7, 2), (9, 0)], 1, 'test')
