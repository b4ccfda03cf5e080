# SPDX-License-Identifier: Apache-2.0
"""Intervals of the reliability diagram; its counts are tested with the report."""

import pytest

from ros_pad.reports import reliability


@pytest.mark.parametrize(
    ('hits', 'count', 'low', 'high'),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (81, 263, 0.2553, 0.3662)],
)
def testwilson_intervals_of_the_literature(hits, count, low, high):
    # 81 of 263: Newcombe (1998), table I, method 3.
    assert reliability.wilson(hits, count) == pytest.approx((low, high), abs=6e-5)
