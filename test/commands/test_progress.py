# SPDX-License-Identifier: Apache-2.0
import contextlib
import os
import pathlib
import pty
import re
import select
import signal
import subprocess
import sys
import termios

import pytest
from tqdm import tqdm

from ros_pad import cli
from ros_pad.commands.progress import bar


def use_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let stderr, which capsys has, appear as a terminal."""
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: True)


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


def test_what_ends_before_the_delay_shows_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    use_terminal(monkeypatch)
    with bar('candidates', 1.0, delay=3600.0) as reach:
        reach(0.5)
    assert capsys.readouterr().err == ''


def test_a_file_has_few_lines(capsys: pytest.CaptureFixture[str]):
    with bar('walk', 1e4) as reach:
        for second in range(10_001):
            reach(second)
    assert capsys.readouterr().err.count('walk') <= 3
    with bar('candidates', 1.0, delay=1e-9) as reach:
        reach(0.5)
    assert capsys.readouterr().err == ''


BAG = pathlib.Path(__file__).parents[2] / 'bags' / 'hexapod_patches' / 'bag' / 'bag_0.mcap'


@pytest.mark.parametrize(
    'words, bars',
    [
        (['bag', 'info', str(BAG)], ['reading']),
        (['bag', 'info', 'cut.mcap'], ['opening']),
        (['bag', 'repair', 'cut.mcap'], ['reading', 'writing']),
        (['replay', str(BAG.parent), '--out', 'replayed'], ['replay', 'writing']),
        (['design', '--load', '30', '--foot', 'large37'], ['radii']),
        (['calibrate', 'free.csv'], ['fitting']),
        (['wet', 'dome', '--radius', '1.5e-3', '--contact-radius', '5e-4'], ['wetting']),
    ],
)
def test_long_tasks_report_their_progress(
    words: list[str],
    bars: list[str],
    tmp_path: pathlib.Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    """Every report is shown: a bar without reports would go from 0 to 100 %."""
    use_terminal(monkeypatch)
    monkeypatch.setattr(
        'ros_pad.commands.progress.tqdm',
        lambda **given: tqdm(**given | {'delay': 0.0, 'mininterval': 0.0}),
    )
    monkeypatch.setattr('ros_pad.bags.storage._BATCH_SIZE', 100_000)
    monkeypatch.chdir(tmp_path)
    pathlib.Path('free.csv').write_text(
        'pressure [kPa],height [mm]\n55,1.25\n65,1.6\n75,2.0\n85,2.4\n'
    )
    pathlib.Path('cut.mcap').write_bytes(BAG.read_bytes()[:500_000])
    cli.main(words)
    said = capsys.readouterr().err
    for name in bars:
        shares = re.findall(rf'{name} +(\d+)% .*?<(?:\d\d:\d\d|\?)\]', said)
        assert any(0 < int(share) < 100 for share in shares), said


INTERRUPTED = """
import io, sys, threading
from ros_pad.commands import progress

class Terminal(io.StringIO):
    isatty = lambda self: True
    seen = False

    def write(self, text):
        super().write(text)
        main = threading.current_thread() is threading.main_thread()
        if main and sys.argv[1] in text and not self.seen:
            self.seen = True
            raise KeyboardInterrupt

sys.stderr = Terminal()
try:
    with progress.bar('walk', 10.0) as reach:
        while True:
            reach(5.0)
except KeyboardInterrupt:
    print(repr(sys.stderr.getvalue()[-1]))
"""


@pytest.mark.parametrize('picture', ['walk   0%', 'walk  50%'])
def test_an_interrupt_while_the_bar_is_drawn_ends_its_line(picture: str):
    child = subprocess.run(
        [sys.executable, '-c', INTERRUPTED, picture],
        cwd=pathlib.Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert child.stdout == "'\\n'\n"


def test_ctrl_c_leaves_the_terminal_clean(tmp_path: pathlib.Path):
    """The message stands on a line of its own, below the bar; nothing of it is on stdout."""
    words = ['run', 'hexapod_patches', '--no-ros', '--no-compare', '--cycles', '9999', '--json']
    own, other = pty.openpty()
    termios.tcsetwinsize(other, (24, 100))
    child = subprocess.Popen(
        [sys.executable, '-m', 'ros_pad', *words],
        stdout=subprocess.PIPE,
        stderr=other,
        cwd=tmp_path,
        text=True,
        env=os.environ | {'PYTHONPATH': str(pathlib.Path(__file__).parents[2])},
    )
    os.close(other)
    said = b''
    try:
        # A pseudo-terminal reports its end as an error; silence for minutes is a failure.
        with contextlib.suppress(OSError):
            while select.select([own], [], [], 300.0)[0] and (data := os.read(own, 4096)):
                said += data
                if b'without ROS   0%' in said and b'^' not in said:
                    child.send_signal(signal.SIGINT)
                    said += b'^'
    finally:
        os.close(own)
        child.kill()
    assert child.communicate()[0] == '' and child.returncode == 130
    rows = said.decode().split('\r\n')
    assert rows[-2:] == ['pad: stopped', ''] and rows[-3].endswith(']')
