# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from studies import samples


def test_interval_of_a_share_is_exact():
    """None of n: 1 − 0.025^(1/n), a little more than the rule of three."""
    assert samples.share_interval(0, 10) == (0.0, pytest.approx(1.0 - 0.025**0.1))
    assert samples.share_interval(10, 10) == (pytest.approx(0.025**0.1), 1.0)
    assert samples.share_interval(0, 0) == (0.0, 1.0)


def test_pairs_are_drawn_together():
    assert samples.bootstrap([(1.0, 2.0)] * 5, 100) == (0.5, 0.5)
    assert all(map(math.isnan, samples.bootstrap([(0.0, 0.0), (1.0, 2.0)], 100)))
