# SPDX-License-Identifier: Apache-2.0
"""The harnesses of bench/fuzz.py still fit what they feed; no searching is done here."""

import importlib.util
import pathlib
import subprocess
import sys

import pytest

from ros_pad.errors import ConfigError

PATH = pathlib.Path(__file__).resolve().parents[1] / 'bench' / 'fuzz.py'
spec = importlib.util.spec_from_file_location('bench_fuzz', PATH)
bench = importlib.util.module_from_spec(spec)
spec.loader.exec_module(bench)


@pytest.mark.parametrize('name', bench.TARGETS)
def test_every_seed_is_read_and_the_first_one_to_its_end(name):
    target = bench.target(name)
    assert target.seeds
    for seed in target.seeds:
        target(seed)  # anything but an error of ros_pad comes out of it
    target._feed(target.seeds[0])  # without an error of ros_pad too
    target(b'')


def test_what_is_no_error_of_ours_is_found():
    def fail(data):
        raise {b'ours': ConfigError, b'other': ZeroDivisionError}[data]

    target = bench.Target(fail, [])
    target(b'ours')
    with pytest.raises(ZeroDivisionError):
        target(b'other')


def test_an_input_can_be_run_again(tmp_path):
    file = tmp_path / 'finding'
    file.write_bytes(b'{kind: leak')
    run = subprocess.run(
        [sys.executable, str(PATH), 'faults', str(file)], capture_output=True, text=True
    )
    assert (run.returncode, run.stdout) == (0, 'nothing but errors of ros_pad\n'), run.stderr
