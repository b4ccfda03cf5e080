# SPDX-License-Identifier: Apache-2.0
"""Joining of what single legs publish into records."""

import math

import numpy as np
import pytest

from ros_pad.joining import Joiner
from ros_pad.records import PRESSURE, SAMPLE

MS = 1_000_000
NAN = (math.nan,) * 3


class Fields(Joiner):
    """A joiner that takes fields by name."""

    def add(self, leg, stamp_ns, **fields):
        values = {}
        for name, value in fields.items():
            axes = ('_x', '_y', '_z') if np.ndim(value) else ('',)
            numbers = zip(axes, np.atleast_1d(value), strict=False)
            values |= {name + axis: each for axis, each in numbers}
        return super().add(leg, stamp_ns, values)


def joiner(legs=(1, 2), needed=('force', 'position')):
    return Fields(SAMPLE, legs, needed)


def force(load):
    return {'force': (0.0, 0.0, load), 'moment': 0.0}


def place(x):
    return {'position': (x, 0.0, 0.0)}


def given(blocks, field='force', axis=2):
    """Return stamps, ms, and one number of each leg."""
    return [(block.last_ns / MS, *block.rows[0][field][:, axis].tolist()) for block in blocks]


def test_a_record_goes_out_when_it_is_complete():
    join = joiner()
    assert join.add(1, 4 * MS, **force(1.0)) == []
    assert join.add(2, 4 * MS, **place(0.2)) == []
    assert join.add(2, 4 * MS, **force(2.0)) == []
    (block,) = join.add(1, 4 * MS, **place(0.1))
    assert given([block]) == [(4, 1.0, 2.0)]
    assert block.rows[0]['position'][:, 0].tolist() == [0.1, 0.2]
    assert np.isnan(block.rows[0]['velocity']).all()
    # A hidden marker is NaN, which is a position that has come.
    join.add(1, 8 * MS, **force(1.0), **place(0.1))
    assert given(join.add(2, 8 * MS, **force(2.0), position=NAN)) == [(8, 1.0, 2.0)]


def test_records_go_out_in_order_with_what_they_have():
    join = joiner()
    join.add(1, 4 * MS, **force(1.0), **place(0.1))
    join.add(1, 8 * MS, **force(3.0), **place(0.3))
    found = given(join.add(2, 8 * MS, **force(4.0), **place(0.4)))
    assert [each[:2] for each in found] == [(4, 1.0), (8, 3.0)]
    assert math.isnan(found[0][2]) and found[1][2] == 4.0
    # What comes late is dropped, and changes nothing.
    assert join.add(2, 4 * MS, **force(2.0), **place(0.2)) == []
    join.add(1, 12 * MS, **force(5.0), **place(0.5))
    assert given(join.add(2, 12 * MS, **force(6.0), **place(0.6))) == [(12, 5.0, 6.0)]


def test_a_silent_leg_delays_the_others_by_the_limit_only():
    join, found = joiner(), []
    for ms in range(4, 40, 4):
        found += join.add(1, ms * MS, **force(1.0), **place(0.1))
    assert [stamp for stamp, *_ in given(found)] == [4, 8, 12, 16, 20, 24]
    assert all(math.isnan(load) for _, _, load in given(found))
    assert given(join.expire(37 * MS)) == []
    assert [stamp for stamp, *_ in given(join.expire(42 * MS))] == [28, 32]
    assert [stamp for stamp, *_ in given(join.expire(math.inf))] == [36]


@pytest.mark.parametrize('offset', [-(10**9) * MS, 0, 2 * MS, 3600 * 1000 * MS])
def test_slower_positions_of_another_clock_are_used_once(offset):
    join, found = joiner((1,)), []
    for step in range(1, 101):
        stamp_ns = 4 * step * MS + (1 if offset == 0 else 0)  # without equal stamps
        found += join.add(1, stamp_ns, **force(1.0))
        if step % 5 == 0:
            found += join.add(1, 4 * step * MS + offset, **place(0.001 * step))
    found += join.expire(math.inf)
    assert len(found) == 100
    used = [(row, x) for row, (_, x) in enumerate(given(found, 'position', 0), 1) if x == x]
    steps = [round(1000 * x) for _, x in used]
    assert steps == list(range(5, 5 * len(steps) + 1, 5)) and len(steps) in (19, 20)
    # Each is in the next record, or as long before as records wait.
    assert all(abs(row - step) <= 3 for (row, _), step in zip(used, steps, strict=True))


def test_markers_that_are_late_by_more_than_the_limit_are_still_used():
    join, found = joiner((1,)), []
    for step in range(1, 101):
        found += join.add(1, 4 * step * MS, **force(1.0))
        if step > 8:
            found += join.add(1, 4 * (step - 8) * MS, **place(0.001 * (step - 8)))
    known = [x for _, x in given(found, 'position', 0) if x == x]
    assert len(known) > 85 and known == sorted(set(known))


def test_a_late_position_is_not_used_after_a_newer_one():
    join = joiner((1,))
    join.add(1, 4 * MS, **force(1.0))
    join.add(1, 8 * MS, **force(1.0))
    found = join.add(1, 8 * MS, **place(0.8))
    assert join.add(1, 4 * MS, **place(0.4)) == []
    join.add(1, 12 * MS, **force(1.0))
    found += join.add(1, 12 * MS, **place(1.2))
    join.add(1, 16 * MS, **force(1.0))
    found += join.expire(math.inf)
    xs = [x for _, x in given(found, 'position', 0)]
    assert xs[1:3] == [0.8, 1.2] and math.isnan(xs[0]) and math.isnan(xs[3])


def test_a_clock_that_is_set_back_begins_anew():
    join = joiner((1,))
    assert len(join.add(1, 5000 * MS, **force(1.0), **place(0.1))) == 1
    join.add(1, 5004 * MS, **force(2.0))
    # What waits is not lost.
    assert given(join.add(1, 4 * MS, **force(3.0))) == [(5004, 2.0)]
    assert given(join.add(1, 4 * MS, **place(0.3))) == [(4, 3.0)]
    assert join.add(1, 3 * MS, **force(4.0)) == []  # late by 1 ms


def test_nothing_waits_without_end():
    join = joiner((1,))
    for step in range(1, 2001):
        join.add(1, 10**15 + 4 * step * MS, **place(0.1))  # before any wrench
    assert len(join._waiting) <= 1000
    join.add(1, 4 * MS, **force(1.0))
    for step in range(2, 1001):
        join.add(1, 4 * step * MS, **force(1.0))
        join.add(1, 10**15 + 4 * step * MS, **place(0.1))
    assert len(join._waiting) < 10


def test_pressures_do_not_wait():
    join = Fields(PRESSURE, (1, 2))
    (block,) = join.add(2, 20 * MS, pressure=3e4)
    assert block.last_ns == 20 * MS
    pressures = block.rows[0]['pressure'].tolist()
    assert math.isnan(pressures[0]) and pressures[1] == 3e4
