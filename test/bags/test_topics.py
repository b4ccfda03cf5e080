# SPDX-License-Identifier: Apache-2.0
"""The table of topics agrees with nodes, messages and documentation."""

import pathlib
import re

import pytest
from rosbags.typesys import Stores
from rosbags.typesys import get_typestore

from ros_pad.bags import topics
from ros_pad.bags.codec import MessageType
from ros_pad.bags.fields import FieldReader
from ros_pad.bags.topics import FRAME
from ros_pad.bags.topics import STAMP
from ros_pad.bags.topics import TRIAL
from ros_pad.bags.topics import Topic

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TOPICS = [each for each in vars(topics).values() if isinstance(each, Topic)]


def test_the_documentation_has_every_topic_with_type_and_unit():
    page = next(p for p in (ROOT / 'docs' / 'topics.md', ROOT / 'README.md') if p.is_file())
    _, _, table = page.read_text(encoding='utf-8').partition('| topic | type | unit |')
    rows = [re.split(r'\s*\|\s*', line)[1:] for line in table.split('\n\n')[0].splitlines()[2:]]
    documented = {
        name: (message_type, unit.replace('*', ''))
        for names, message_type, unit, *_ in rows
        for name in re.findall('`([^`]+)`', names)
    }
    for topic in TOPICS:
        message_type, unit = documented.pop(topic.pattern.replace('{leg}', 'i'))
        package, _, name = topic.type_name.split('/')
        if topic.pattern.startswith('/'):  # a row of the page may have two of these topics
            assert package in message_type
        else:
            assert (message_type, unit) == (f'{package}/{name}', topic.unit)
    assert not documented


@pytest.mark.parametrize('topic', TRIAL, ids=[each.kind for each in TRIAL])
def test_each_type_has_the_values_of_its_topic(topic):
    store = get_typestore(Stores.ROS2_JAZZY)
    definition, _ = store.generate_msgdef(topic.type_name, ros_version=2)
    message_type = MessageType(topic.type_name, definition)
    paths = (*topic.values, *((*STAMP, FRAME) if topic.frame else ()))
    blank = message_type.blank()
    values = FieldReader(message_type, paths)(message_type.encode(blank))
    assert [isinstance(each, str) for each in values] == [
        path == FRAME or topic.text for path in paths
    ]


def test_nodes_have_the_classes_of_the_table():
    of_nodes = pytest.importorskip('ros_pad.nodes.topics')
    of_legs = [of_nodes.of_leg(each) for each in topics.OF_LEGS]
    every = (*of_legs, *of_nodes.COMMON_TOPICS, of_nodes.FEET_MARKERS)
    assert {topic.schema for topic in every} == set(TOPICS)
    for topic in every:
        package = topic.message.__module__.partition('.')[0]
        assert f'{package}/msg/{topic.message.__name__}' == topic.type_name
