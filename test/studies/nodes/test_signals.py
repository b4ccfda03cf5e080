# SPDX-License-Identifier: Apache-2.0
import pathlib
import signal

import pytest

from studies.nodes import signals


@pytest.mark.slow
def test_two_signals_end_a_node_in_order():
    tries = list(signals.run('recorder', 1, 3.0))
    assert [one.pair for one in tries] == list(signals.PAIRS)
    assert not any(one.problems for one in tries)
    assert signals.table(tries).splitlines()[1].split()[:3] == ['recorder', '3', '3']


def test_what_is_wrong_is_found(tmp_path: pathlib.Path):
    one = signals.Try('recorder', signals.PAIRS[0], 0.2, 0.01)
    script = 'trap "echo Traceback >&2; exit 3" INT TERM; sleep 5 & wait'
    signals.perform(one, [['bash', '-c', script]], tmp_path, lambda: True)
    assert one.reached and one.statuses == [3]
    assert one.problems == ['bash: exit status 3', "'Traceback' on stderr"]
    assert one.ending < 2.0
    (tmp_path / 'bag').mkdir()
    signals.check_bag(one, tmp_path / 'bag')
    assert len(one.problems) == 3


def test_a_process_that_has_ended_counts_as_ready(tmp_path: pathlib.Path):
    one = signals.Try('estimator', (signal.SIGINT, signal.SIGTERM), 0.1, 0.01)
    signals.perform(one, [['true']], tmp_path)
    assert one.statuses == [0] and not one.problems
