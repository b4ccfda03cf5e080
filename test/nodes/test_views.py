# SPDX-License-Identifier: Apache-2.0
"""The views node: what records say of single legs, for people and for drivers of others."""

import math

import pytest
from helpers import AMBIENT, LOAD, MS, estimate, nanoseconds, record
from visualization_msgs.msg import Marker

from ros_pad.bags import topics
from ros_pad.estimation import doubt as doubts
from ros_pad.nodes.views import SHOWN, ViewsNode
from ros_pad.records import COMMAND, ESTIMATE, PRESSURE, SAMPLE

NAN = math.nan
SAMPLES = {
    'force': [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)], 'moment': [0.5, NAN],
    'position': [(7.0, 8.0, 9.0), (NAN, NAN, NAN)],
    'velocity': [(0.1, 0.2), (0.3, 0.4)], 'variance': [(1e-4, 2e-4), (math.inf, math.inf)],
}  # fmt: skip
ESTIMATES = {
    'load': [LOAD, NAN], 'slip': [(0.01, 0.02), (NAN, NAN)], 'slipping': [1.0, 0.0],
    'wetness': [0.75, NAN], 'friction': [0.4, NAN], 'margin': [-0.1, NAN],
}  # fmt: skip
# Numbers that the topic of each leg carries; None: it carries nothing.
CARRIED = {
    'wrench': ((1.0, 2.0, 3.0, 0.5), (4.0, 5.0, 6.0, 0.0)),
    'position': ((7.0, 8.0, 9.0), None),
    'contact_velocity': ((0.1, 0.2, 1e-4, 2e-4), (0.3, 0.4, -1.0, -1.0)),
    'pressure': ((AMBIENT + 60e3,), None),
    'pressure_setpoint': ((AMBIENT + 70e3,), None),
    'slip': ((0.01, 0.02), None),
    'slipping': ((True,), (False,)),
    'wetness': ((0.75,), None),
    'friction': ((0.4,), None),
    'friction_margin': ((-0.1,), None),
    'contact_load': ((LOAD,), None),
}


def give_all(bench, stamp_ns=5 * MS):
    bench.give(topics.SAMPLE, record(SAMPLE, stamp_ns, **SAMPLES))
    bench.give(topics.ESTIMATE, record(ESTIMATE, stamp_ns, **ESTIMATES))
    bench.give(topics.COMMAND, record(COMMAND, stamp_ns, setpoint=[70e3, NAN], dome=[1.0, 0.0]))
    bench.give(topics.PRESSURE, record(PRESSURE, stamp_ns, pressure=[60e3, NAN]))


def field(message, path):
    for part in path.replace('[', '.').replace(']', '').split('.'):
        message = message[int(part)] if part.isdigit() else getattr(message, part)
    return message


@pytest.mark.parametrize('schema', [each for each in SHOWN if not each.text], ids=lambda s: s.kind)
def test_each_topic_of_a_leg_carries_the_numbers_of_the_record(bench, schema):
    bench.start(ViewsNode, topics=schema.kind)
    give_all(bench)
    for leg, numbers in enumerate(CARRIED[schema.kind], 1):
        heard = bench.heard(schema, leg)
        if numbers is None:
            assert heard == []
            continue
        (message,) = heard
        assert tuple(field(message, path) for path in schema.values) == numbers
        if schema.frame:
            assert message.header.frame_id == schema.frame.format(leg=leg)
            assert nanoseconds(message.header.stamp) == 5 * MS
    assert {name for name in bench.sent if name.startswith('/leg')} <= {
        f'/{schema.name(leg)}' for leg in (1, 2)
    }


def test_texts_are_published_when_they_change(bench):
    bench.start(ViewsNode)
    lost, none = (doubts.LOST, (0.2, 0.0)), (0.0, (0.0, 0.0))
    missing, odd = (NAN, (NAN, NAN)), (1e3, (0.0, 0.0))
    for place, (code, detail) in enumerate((lost, lost, missing, none, none, odd, lost)):
        bench.give(
            topics.ESTIMATE, estimate(place * MS, doubt=[code, 0.0], detail=[detail, (0, 0)])
        )
    for place, dome in enumerate((0.0, 0.0, 1.0, NAN, 1.0, 0.0)):
        bench.give(topics.COMMAND, record(COMMAND, place, dome=[dome, NAN]))

    def said(schema, leg):
        return [each.data for each in bench.heard(schema, leg)]

    text = doubts.text(doubts.LOST, 0.2)
    assert said(topics.LEG_DOUBT, 1) == [text, '', text]
    assert said(topics.LEG_DOUBT, 2) == ['']
    assert said(topics.LEG_MORPHOLOGY, 1) == ['flat', 'dome', 'flat']
    assert said(topics.LEG_MORPHOLOGY, 2) == []


def test_markers_show_the_feet_in_colours_of_their_wetness(bench):
    bench.start(ViewsNode, frame='odom')
    bench.legs = (1, 2)
    wet = [(0.3, 0.1), (NAN, NAN)]
    for number in range(1, 16):  # at 20 ms each, to 0.3 s
        known = 1.0 if number < 10 else NAN
        places = [(0.1, 0.2), (0.3, 0.4)] if number == 1 else wet
        bench.give(
            topics.ESTIMATE, estimate(number * 20 * MS, wetness=[known, 0.0], position=places)
        )
    arrays = bench.heard(topics.FEET_MARKERS)
    stamps = [nanoseconds(each.markers[0].header.stamp) // MS for each in arrays]
    assert stamps == [20, 100, 200, 300]  # ten a second
    blue, yellow = arrays[1].markers
    assert [(each.ns, each.id, each.type) for each in (blue, yellow)] == [
        ('feet', 1, Marker.SPHERE), ('feet', 2, Marker.SPHERE)
    ]  # fmt: skip
    assert blue.header.frame_id == 'odom'
    assert blue.color.b > blue.color.r and yellow.color.r > yellow.color.b
    assert (blue.pose.position.x, blue.pose.position.y) == (0.3, 0.1)
    assert (yellow.pose.position.x, yellow.pose.position.y) == (0.3, 0.4)  # the last known place
    grey = arrays[-1].markers[0].color
    assert grey.r == grey.g == grey.b
