# SPDX-License-Identifier: Apache-2.0
import pytest

from studies.nodes import flood


@pytest.mark.realtime
def test_a_flood_of_set_points_keeps_no_pad_up():
    result = flood.run('invalid', rounds=1)
    assert result.rate > 2000.0  # messages/s; fewer would be no flood
    assert result.rounds == 1
    assert 0.9 * flood.TIMEOUT < result.reaction < flood.TIMEOUT + 1.0
    assert not result.flooded_up
    assert result.pressures > 10.0  # of 50; the monitor of the pads needs at least 10
    assert 0.5 < result.diagnostics < 5.0
    assert result.growth < 20.0
