# SPDX-License-Identifier: Apache-2.0
import pytest

from studies.nodes import deadlock


@pytest.mark.slow
def test_the_events_come(monkeypatch: pytest.MonkeyPatch):
    """Whether something hangs is for the study itself, which takes half an hour."""
    monkeypatch.setattr(deadlock, 'LIVES', (3600.0, 3600.0))
    processes = deadlock.run(0.2, options=['--events', 'incompatible', 'matched'])
    assert [each.starts for each in processes] == [1, 1]
    for kind in ('message', 'incompatible', 'matched'):
        assert any(each.counts[kind] for each in processes)
    assert deadlock.table(processes).count('\n') == 2
