# SPDX-License-Identifier: Apache-2.0
"""The layouts for Foxglove and RViz fit the topics of a walk that is recorded here."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import re
from typing import Any

import pytest
import yaml

from ros_pad.bags import BagReader
from ros_pad.nodes import composed
from ros_pad.simulation.scene import Scene

CONFIG = pathlib.Path(__file__).resolve().parent.parent.parent / 'config'
LAYOUT = json.loads((CONFIG / 'foxglove' / 'ros_pad.json').read_text())
RVIZ = yaml.safe_load((CONFIG / 'rviz' / 'ros_pad.rviz').read_text())

# Panels of both Foxglove and Lichtblick that need no account or extension.
PANELS = {'3D', 'Plot', 'DiagnosticSummary', 'RawMessages', 'Tab'}
OF_VIEWS = '/feet/markers'  # not in a bag
DRAWN = {'visualization_msgs/msg/MarkerArray', 'geometry_msgs/msg/PoseStamped'}
RVIZ_TYPES = {
    'rviz_default_plugins/MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'rviz_default_plugins/Pose': 'geometry_msgs/msg/PoseStamped',
}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('walk') / 'bag'
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=2)
    composed.run(scene, fidelity='L1', bag=folder)
    return BagReader(folder)


@pytest.fixture(scope='module')
def messages(bag):
    found: dict[str, list[Any]] = {}
    for name, message, _ in bag.messages():
        found.setdefault(name, []).append(message)
    return found


def panels(kind):
    for name, config in LAYOUT['configById'].items():
        if name.startswith(f'{kind}!'):
            yield name, config


def plain(value):
    """Return a byte as a number, as viewers read it."""
    return int.from_bytes(value) if isinstance(value, bytes) else value


def values(path, messages):
    """Return the values of a message path in all messages of the bag."""
    match = re.fullmatch(r'((?:/\w+)+)((?:\.\w+(?:\[(?::|\d+)\])?(?:\{\w+[!=]=\d+\})?)*)', path)
    assert match, f'{path} is no message path'
    assert match[1] in messages, f'{path}: the bag has no such topic'
    found = messages[match[1]]
    for name, place, key, sign, number in re.findall(
        r'\.(\w+)(?:\[(:|\d+)\])?(?:\{(\w+)([!=]=)(\d+)\})?', match[2]
    ):
        found = [getattr(each, name) for each in found]
        if place == ':':
            found = [each for array in found for each in array]
        elif place:
            found = [array[int(place)] for array in found]
        if key:
            found = [
                each
                for each in found
                if (plain(getattr(each, key)) == int(number)) == (sign == '==')
            ]
    return found


# The number of a record that each panel plots, for each leg.
PLOTTED = {
    'Plot!wetness': 'wetness', 'Plot!slip': 'slip_x', 'Plot!margin': 'margin', 'Plot!dome': 'dome',
    'Plot!alarms': 'slipping', 'Plot!doubts': 'doubt',
}  # fmt: skip


def test_every_plotted_path_is_a_number_in_the_bag(messages):
    for name, config in panels('Plot'):
        axis = [config['xAxisPath']] if config['xAxisVal'] == 'custom' else []
        assert config['paths'] and config['yAxisLabel'], name
        for path in (*config['paths'], *axis):
            found = values(path['value'], messages)
            assert found and all(isinstance(each, float) for each in found), (name, path)


def test_the_places_of_numbers_of_records_are_those_of_their_names(
    messages,
):
    def named(path):
        topic, _, place = path['value'].removesuffix(']').partition('.position[')
        (names,) = {tuple(each.name) for each in messages[topic]}
        return names[int(place)]

    shown = dict(panels('Plot'))
    legs = range(1, 7)
    for name, column in PLOTTED.items():
        found = [(named(path), path['label']) for path in shown.pop(name)['paths']]
        assert found == [(f'leg_{leg}/{column}', f'leg {leg}') for leg in legs]
    for leg in legs:
        paths = shown.pop(f'Plot!pressure{leg}')['paths']
        assert [(named(path), path['label']) for path in paths] == [
            (f'leg_{leg}/pressure', 'measured'), (f'leg_{leg}/setpoint', 'set-point')
        ]  # fmt: skip
    assert set(shown) == {'Plot!path'}


def test_what_is_drawn_is_in_the_bag_and_in_the_fixed_frame(bag, messages):
    ((_, config),) = panels('3D')
    assert config['followTf'] == 'world'
    assert set(config['topics']) == {'/markers', '/body/pose', OF_VIEWS}
    for topic, shown in config['topics'].items():
        assert shown['visible'] and (topic == OF_VIEWS or bag.topics[topic] in DRAWN)
    frames = {each.header.frame_id for array in messages['/markers'] for each in array.markers}
    frames |= {each.header.frame_id for each in messages['/body/pose']}
    assert frames == {'world'} == {RVIZ['Visualization Manager']['Global Options']['Fixed Frame']}


def test_rviz_shows_topics_of_the_bag(bag):
    displays = RVIZ['Visualization Manager']['Displays']
    shown = {each['Topic']['Value']: each for each in displays if 'Topic' in each}
    # Names are relative, so that a namespace applies to rviz2 as to the nodes.
    assert set(shown) == {'markers', 'body/pose', OF_VIEWS.removeprefix('/')}
    types = bag.topics | {OF_VIEWS: 'visualization_msgs/msg/MarkerArray'}
    for name, each in shown.items():
        assert types[f'/{name}'] == RVIZ_TYPES[each['Class']]
        assert each['Topic']['Reliability Policy'] == 'Best Effort'  # fits every publisher
    for each in displays:
        assert each['Enabled'] and each['Value'] is True
