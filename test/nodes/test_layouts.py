# SPDX-License-Identifier: Apache-2.0
"""The layouts for Foxglove and RViz fit the topics of a walk that is recorded here."""

from __future__ import annotations

import copy
import dataclasses
import json
import pathlib
import re
from collections.abc import Iterator
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
PANELS = {'3D', 'Plot', 'StateTransitions', 'DiagnosticSummary', 'RawMessages', 'Tab'}
DRAWN = {'visualization_msgs/msg/MarkerArray', 'geometry_msgs/msg/PoseStamped'}
RVIZ_TYPES = {
    'rviz_default_plugins/MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'rviz_default_plugins/Pose': 'geometry_msgs/msg/PoseStamped',
}


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> BagReader:
    folder = tmp_path_factory.mktemp('walk') / 'bag'
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=2)
    composed.run(scene, fidelity='L1', bag=folder)
    return BagReader(folder)


@pytest.fixture(scope='module')
def messages(bag: BagReader) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for name, message, _ in bag.messages():
        found.setdefault(name, []).append(message)
    return found


def panels(kind: str) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, config in LAYOUT['configById'].items():
        if name.startswith(f'{kind}!'):
            yield name, config


def leaves(tree: Any) -> list[str]:
    """Return the panels of a tree of splits: names, or two branches with a direction."""
    if isinstance(tree, str):
        return [tree]
    assert set(tree) == {'direction', 'first', 'second', 'splitPercentage'}
    assert tree['direction'] in ('row', 'column') and 0 < tree['splitPercentage'] < 100
    return leaves(tree['first']) + leaves(tree['second'])


def problems(layout: dict[str, Any]) -> list[str]:
    """Return the reasons why a viewer cannot open every panel of a layout exactly once."""
    configs = layout['configById']
    placed = leaves(layout['layout'])
    for name in placed:
        if name.startswith('Tab!'):
            for tab in configs.get(name, {}).get('tabs', []):
                placed = placed + leaves(tab['layout'])
    found = [f'{name}: twice' for name in set(placed) if placed.count(name) > 1]
    found += [f'{name}: no config' for name in set(placed) - set(configs)]
    found += [f'{name}: not placed' for name in set(configs) - set(placed)]
    return found + [
        f'{name}: unknown kind'
        for name in configs
        if not re.fullmatch(f'({"|".join(PANELS)})!\\w+', name)
    ]


def test_the_layout_is_whole():
    # Keys of Lichtblick's type LayoutData.
    assert set(LAYOUT) == {
        *('configById', 'layout', 'globalVariables', 'userNodes', 'playbackConfig')
    }
    assert problems(LAYOUT) == []
    assert {name.partition('!')[0] for name in LAYOUT['configById']} == PANELS
    broken = copy.deepcopy(LAYOUT)
    broken['configById']['Plot!other'] = broken['configById'].pop('Plot!slip')
    assert sorted(problems(broken)) == ['Plot!other: not placed', 'Plot!slip: no config']


def plain(value: Any) -> Any:
    """Return a byte as a number, as viewers read it."""
    return int.from_bytes(value) if isinstance(value, bytes) else value


def values(path: str, messages: dict[str, list[Any]]) -> list[Any]:
    """Return the values of a message path in all messages of the bag."""
    match = re.fullmatch(r'((?:/\w+)+)((?:\.\w+(?:\[:\])?(?:\{\w+[!=]=\d+\})?)*)', path)
    assert match, f'{path} is no message path'
    assert match[1] in messages, f'{path}: the bag has no such topic'
    found = messages[match[1]]
    for name, every, key, sign, number in re.findall(
        r'\.(\w+)(\[:\])?(?:\{(\w+)([!=]=)(\d+)\})?', match[2]
    ):
        found = [getattr(each, name) for each in found]
        if every:
            found = [each for array in found for each in array]
        if key:
            found = [
                each
                for each in found
                if (plain(getattr(each, key)) == int(number)) == (sign == '==')
            ]
    return found


@pytest.mark.slow
def test_every_plotted_path_is_a_number_in_the_bag(messages: dict[str, list[Any]]):
    shown = set()
    for name, config in panels('Plot'):
        axis = [config['xAxisPath']] if config['xAxisVal'] == 'custom' else []
        assert config['paths'] and config['yAxisLabel'], name
        for path in (*config['paths'], *axis):
            found = values(path['value'], messages)
            assert found and all(isinstance(each, float) for each in found), (name, path)
            shown.add(path['value'])
    for leg in range(1, 7):
        for quantity in ('pressure.fluid', 'pressure_setpoint.fluid', 'wetness', 'slip.twist',
                         'friction_margin'):  # fmt: skip
            assert any(each.startswith(f'/leg_{leg}/{quantity}') for each in shown)


def test_the_range_of_the_pressures_holds_all_of_them(messages: dict[str, list[Any]]):
    for name, config in panels('Plot'):
        if 'pressure' in name:
            for path in config['paths']:
                found = values(path['value'], messages)
                assert config['minYValue'] < min(found) <= max(found) < config['maxYValue']


def test_every_state_is_one_in_the_bag(messages: dict[str, list[Any]]):
    shown = []
    for name, config in panels('StateTransitions'):
        for path in config['paths']:
            found = values(path['value'], messages)
            # States are texts or booleans; a plot of states cannot show other numbers.
            assert found and all(isinstance(each, bool | str) for each in found), (name, path)
            shown.append(path['value'])
    for leg in range(1, 7):
        for state in ('morphology', 'slipping', 'doubt'):
            assert f'/leg_{leg}/{state}.data' in shown


def test_what_is_drawn_is_in_the_bag_and_in_the_fixed_frame(
    bag: BagReader, messages: dict[str, list[Any]]
):
    ((_, config),) = panels('3D')
    assert config['followTf'] == 'world'
    assert set(config['topics']) == {'/markers', '/body/pose'}
    for topic, shown in config['topics'].items():
        assert shown['visible'] and bag.topics[topic] in DRAWN
    frames = {each.header.frame_id for array in messages['/markers'] for each in array.markers}
    frames |= {each.header.frame_id for each in messages['/body/pose']}
    assert frames == {'world'} == {RVIZ['Visualization Manager']['Global Options']['Fixed Frame']}


def test_health_is_in_the_bag(bag: BagReader, messages: dict[str, list[Any]]):
    ((_, summary),) = panels('DiagnosticSummary')
    assert bag.topics[summary['topicToRender']] == 'diagnostic_msgs/msg/DiagnosticArray'
    ((_, raw),) = panels('RawMessages')
    levels = {plain(each.level) for each in values(raw['topicPath'].partition('{')[0], messages)}
    assert 0 in levels
    bad = {plain(each.level) for each in values(raw['topicPath'], messages)}
    assert bad == levels - {0}


def test_rviz_shows_topics_of_the_bag(bag: BagReader):
    displays = RVIZ['Visualization Manager']['Displays']
    shown = {each['Class']: each['Topic'] for each in displays if 'Topic' in each}
    assert set(shown) == set(RVIZ_TYPES)
    for kind, topic in shown.items():
        # Names are relative, so that a namespace applies to rviz2 as to the nodes.
        assert not topic['Value'].startswith('/')
        assert bag.topics[f'/{topic["Value"]}'] == RVIZ_TYPES[kind]
        assert topic['Reliability Policy'] == 'Best Effort'  # fits every publisher
    for each in displays:
        assert each['Enabled'] and each['Value'] is True
