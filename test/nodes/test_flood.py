# SPDX-License-Identifier: Apache-2.0
import importlib.util
import pathlib
import sys

import pytest

PATH = pathlib.Path(__file__).resolve().parents[2] / 'bench' / 'flood.py'
spec = importlib.util.spec_from_file_location('bench_flood', PATH)
bench = importlib.util.module_from_spec(spec)
sys.modules['bench_flood'] = bench  # dataclasses look their module up
spec.loader.exec_module(bench)


@pytest.mark.realtime
def test_a_flood_of_set_points_keeps_no_pad_up():
    result = bench.run('invalid', rounds=1)
    assert result.rate > 2000.0  # a slow machine floods less
    assert result.rounds == 1
    assert 0.9 * bench.TIMEOUT < result.reaction < bench.TIMEOUT + 1.0
    assert not result.flooded_up
    assert result.pressures > 10.0  # of 50: the watch of the pads needs so many
    assert 0.5 < result.diagnostics < 5.0
    assert result.growth < 20.0
