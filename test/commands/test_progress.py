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

BAG = pathlib.Path(__file__).parents[2] / 'bags' / 'hexapod_patches' / 'bag' / 'bag_0.mcap'


def test_what_is_done_is_full_and_what_was_interrupted_stays(capsys):
    with bar('walk', 9.8) as reach:
        reach(9.0)
    with pytest.raises(KeyboardInterrupt), bar('halted', 60.0) as reach:
        reach(30.0)
        raise KeyboardInterrupt
    said = capsys.readouterr().err
    assert 'walk 100%' in said and 'halted  50%' in said and 'halted 100%' not in said


def test_a_file_has_few_lines(capsys):
    with bar('walk', 1e4) as reach:
        for second in range(10_001):
            reach(second)
    assert capsys.readouterr().err.count('walk') <= 3
    with bar('candidates', 1.0, delay=1e-9) as reach:
        reach(0.5)
    assert capsys.readouterr().err == ''


@pytest.mark.parametrize(
    'words, bars',
    [
        (['bag', 'repair', 'cut.mcap'], ['reading', 'writing']),
        (['replay', str(BAG.parent), '--out', 'replayed'], ['replay', 'writing']),
    ],
)
def test_long_tasks_report_their_progress(words, bars, tmp_path, monkeypatch, capsys):
    """Every report is shown: a bar without reports would go from 0 to 100 %."""
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: True)
    monkeypatch.setattr(
        'ros_pad.commands.progress.tqdm',
        lambda **given: tqdm(**given | {'delay': 0.0, 'mininterval': 0.0}),
    )
    monkeypatch.setattr('ros_pad.bags.storage._BATCH_SIZE', 100_000)
    monkeypatch.chdir(tmp_path)
    pathlib.Path('cut.mcap').write_bytes(BAG.read_bytes()[:500_000])
    cli.main(words)
    said = capsys.readouterr().err
    for name in bars:
        shares = re.findall(rf'{name} +(\d+)% .*?<(?:\d\d:\d\d|\?)\]', said)
        assert any(0 < int(share) < 100 for share in shares), said


def test_ctrl_c_leaves_the_terminal_clean(tmp_path):
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
