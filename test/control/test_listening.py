# SPDX-License-Identifier: Apache-2.0
import math

from ros_pad.contact import Foot
from ros_pad.control import MorphologyController
from ros_pad.control import flat
from ros_pad.control.listening import LegListener


class Watched(MorphologyController):
    """A controller that remembers what it was told."""

    def __init__(self):
        super().__init__(Foot.load('large37'), (1, 2), flat, 6.83)
        self.updates, self.observed, self.doubts = [], [], []

    def update(self, leg, load, wet_probability, position):
        self.updates.append((leg, load, wet_probability, position))
        return super().update(leg, load, wet_probability, position)

    def observe(self, leg, time, pressure):
        self.observed.append((time, pressure))
        super().observe(leg, time, pressure)

    def doubt(self, leg, reason):
        self.doubts.append(reason)
        super().doubt(leg, reason)


def listener():
    controller = Watched()
    return controller, LegListener(controller, 1, lambda place: place)


def test_the_heaviest_load_since_the_last_estimate_counts():
    controller, leg = listener()
    leg.position((0.1, 0.2))
    for load in (5.0, 0.5, math.inf, 1.0):
        leg.wrench(load)
    assert leg.estimate(0.02, 0.5) == 0.0
    leg.position((0.1, 0.2))
    assert leg.estimate(0.04, 0.5) == 0.0  # no wrench since: the last one
    leg.wrench(2.0)
    leg.estimate(0.06, 0.25)
    assert controller.updates == [
        (1, 5.0, 0.5, (0.1, 0.2)),
        (1, 1.0, 0.5, (0.1, 0.2)),
        (1, 2.0, 0.25, (0.1, 0.2)),
    ]


def test_no_setpoint_follows_from_what_is_old_or_no_number():
    controller, leg = listener()
    leg.wrench(5.0)
    assert leg.estimate(0.02, 0.5) is None  # no position yet
    leg.position((0.0, 0.0))
    assert leg.estimate(0.04, 0.5) is not None
    assert leg.estimate(0.23, 0.5) is not None
    assert leg.estimate(0.25, 0.5) is None  # 0.21 s old
    leg.position((math.nan, 0.0))
    assert leg.estimate(0.26, 0.5) is None
    leg.position((0.0, 0.0))
    leg.wrench(math.nan)
    assert leg.estimate(0.27, 0.5) is None
    assert len(controller.updates) == 2


def test_each_pressure_is_handed_over_once_with_the_trouble():
    controller, leg = listener()
    leg.position((0.0, 0.0))
    leg.wrench(5.0)
    leg.pressure(60e3)
    leg.estimate(0.02, 0.5)
    leg.trouble = 'force stands still'
    leg.estimate(0.04, 0.5)
    assert controller.observed == [(0.02, 60e3), (0.04, None)]
    assert controller.doubts == ['', 'force stands still']


def test_legs_without_estimates_are_looked_after():
    controller, leg = listener()
    assert not leg.look(1.0) and not leg.look(1.09)
    assert leg.look(1.2)
    assert [time for time, _ in controller.observed] == [1.2]
    assert not leg.look(1.25)


def test_a_shape_is_news_once():
    _, leg = listener()
    assert leg.new_shape() == 'flat'
    assert leg.new_shape() is None
