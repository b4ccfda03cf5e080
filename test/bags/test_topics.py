# SPDX-License-Identifier: Apache-2.0
"""The table of topics agrees with nodes, messages and documentation."""

import pathlib
import re

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from ros_pad.bags import topics
from ros_pad.bags.codec import MessageType, field_getter
from ros_pad.bags.topics import (
    FRAME,
    OF_LEGS,
    RECORDS,
    STAMP,
    TRIAL,
    Topic,
    from_record,
    to_record,
)

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TOPICS = {*OF_LEGS, *(each for each in vars(topics).values() if isinstance(each, Topic))}


def test_the_documentation_has_every_topic_with_type_and_unit():
    """Records have tables of their own: test_docs.py."""
    page = (ROOT / 'docs' / 'topics.md').read_text(encoding='utf-8')
    documented = {}
    for table in page.split('| topic | type | unit |')[1:]:
        for line in table.split('\n\n')[0].splitlines()[2:]:
            names, message_type, unit, *_ = re.split(r'\s*\|\s*', line)[1:]
            for name in re.findall('`([^`]+)`', names):
                documented[name] = message_type, unit.replace('*', '')
    for topic in TOPICS:
        if topic in RECORDS:
            assert f'`{topic.pattern}`' in page
            continue
        message_type, unit = documented.pop(topic.pattern.replace('{leg}', 'i'))
        package, _, name = topic.type_name.split('/')
        if topic.pattern.startswith('/'):  # a row of the page may have two of these topics
            assert package in message_type
        else:
            assert (message_type, unit) == (f'{package}/{name}', topic.unit)
    assert not documented


@pytest.mark.parametrize('topic', (*TRIAL, *OF_LEGS), ids=lambda topic: topic.pattern)
def test_each_type_has_the_values_of_its_topic(topic):
    store = get_typestore(Stores.ROS2_JAZZY)
    definition, _ = store.generate_msgdef(topic.type_name, ros_version=2)
    message_type = MessageType(topic.type_name, definition)
    paths = (*topic.values, *((*STAMP, FRAME) if topic.frame else ()))
    values = field_getter(paths)(message_type.blank())
    assert [isinstance(each, str) for each in values] == [
        path == FRAME or topic.text for path in paths
    ]


@pytest.mark.parametrize('topic', OF_LEGS, ids=lambda topic: topic.pattern)
def test_topics_of_legs_have_numbers_of_a_record(topic):
    assert topic.record in {each.record for each in RECORDS}
    assert len(topic.columns) == (0 if topic.text else len(topic.values))
    assert set(topic.columns) <= set(topic.record.columns)


@pytest.mark.parametrize('topic', [t for t in OF_LEGS if t.columns], ids=lambda t: t.pattern)
def test_numbers_of_a_record_come_back_from_messages_of_a_leg(topic):
    rng = np.random.default_rng(3)
    numbers = np.round(rng.uniform(0.0, 9e4, (50, len(topic.columns))), 6)
    ambient = 83210.7
    values = from_record(topic, numbers, ambient)
    assert np.array_equal(to_record(topic, values, ambient), numbers)
    assert to_record(topic, np.full(len(topic.columns), np.nan), ambient) == pytest.approx(
        [np.nan] * len(topic.columns), nan_ok=True
    )


def test_a_variance_below_0_is_that_of_a_velocity_that_must_not_be_used():
    numbers = to_record(topics.LEG_VELOCITY, np.array([0.1, 0.2, -1.0, 1e-4]), 0.0)
    assert numbers.tolist() == [0.1, 0.2, np.inf, 1e-4]
    assert from_record(topics.LEG_VELOCITY, numbers, 0.0).tolist() == [0.1, 0.2, -1.0, 1e-4]
