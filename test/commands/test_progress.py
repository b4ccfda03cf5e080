# SPDX-License-Identifier: Apache-2.0
import pytest

from ros_pad.commands.progress import bar


def last(capsys: pytest.CaptureFixture[str]) -> str:
    """Return the last text of the progress bar."""
    return capsys.readouterr().err.replace('\n', '\r').rstrip('\r').rpartition('\r')[2]


def test_what_is_done_is_full(capsys: pytest.CaptureFixture[str]):
    # The last report of a walk comes a little before its end.
    with bar('walk', 9.8) as reach:
        for second in range(10):
            reach(float(second))
    assert 'walk 100%' in last(capsys)
    with bar('drawing', 1.0):
        pass  # so short that no progress is reported
    assert 'drawing 100%' in last(capsys)


def test_what_ended_early_stays_where_it_was(capsys: pytest.CaptureFixture[str]):
    with bar('walk', 60.0) as reach:
        for second in range(10):
            reach(float(second))
    assert 'walk  15%' in last(capsys)


def test_what_was_interrupted_stays_where_it_was(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(KeyboardInterrupt), bar('walk', 60.0) as reach:
        reach(30.0)
        raise KeyboardInterrupt
    assert 'walk  50%' in last(capsys)


def test_what_ends_before_the_delay_shows_nothing(capsys: pytest.CaptureFixture[str]):
    with bar('candidates', 1.0, delay=3600.0) as reach:
        reach(0.5)
    assert capsys.readouterr().err == ''
