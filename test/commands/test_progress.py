# SPDX-License-Identifier: Apache-2.0
import contextlib
import os
import pathlib
import pty
import select
import signal
import subprocess
import sys
import termios
import time

import pytest

from ros_pad.commands.progress import bar


def test_what_takes_long_is_shown_and_what_was_interrupted_stays(capsys, monkeypatch):
    with bar('short', 9.8) as reach:
        reach(9.0)
    assert capsys.readouterr().err == ''
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: True, raising=False)
    with pytest.raises(KeyboardInterrupt), bar('halted', 60.0) as reach:
        time.sleep(1.1)
        reach(30.0)
        raise KeyboardInterrupt
    said = capsys.readouterr().err
    assert 'halted  50%' in said and 'halted 100%' not in said


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
