# SPDX-License-Identifier: Apache-2.0
import dataclasses
import importlib
import inspect
import math
import pathlib
import re
import signal
import subprocess
import sys

import pytest
import yaml
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter as Override

from ros_pad.configuration import shared_folder
from ros_pad.errors import ConfigError
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.regulators import SimulatedRegulator

NODES = ['simulator', 'estimator', 'controller', 'regulator', 'recorder']
FILE = shared_folder() / 'params.yaml'
PAGE = pathlib.Path(__file__).resolve().parents[2] / 'docs' / 'parameters.md'
RATE = Parameter('rate', 50.0, 'Samples a second.', 'Hz', 1.0, 1000.0)
COUNT = Parameter('count', 3, 'How many.', '', 0, 9)
SHAPE = Parameter('shape', 'flat', 'Which.', choices=('flat', 'dome'))
SWITCH = Parameter('switch', False, 'Whether.')
GAIN = Parameter('gain', 2.0, 'Factor.', '', 1.0, 5.0, live=True)
MODE = Parameter('mode', 'slow', 'How.', choices=('slow', 'fast'), live=True)


def table_of(name):
    return importlib.import_module(f'ros_pad.nodes.{name}').PARAMETERS


def in_yaml(value):
    return yaml.safe_dump(value, default_flow_style=True).removesuffix('\n...\n').strip()


@pytest.mark.parametrize('name', NODES)
def test_the_shipped_file_has_every_parameter_with_its_default(name):
    shipped = yaml.safe_load(FILE.read_text())
    assert set(shipped) == {f'/**/{each}' for each in NODES}
    values = shipped[f'/**/{name}']['ros__parameters']
    expected = {parameter.name: parameter.default for parameter in table_of(name)}
    assert values == expected
    assert list(map(type, values.values())) == list(map(type, expected.values()))


@pytest.mark.parametrize('name', NODES)
def test_the_shipped_file_says_over_each_key_what_it_is(name):
    text = FILE.read_text().split(f'/**/{name}:\n')[1].split('\n/**/')[0]
    for parameter in table_of(name):
        over = re.search(rf'^    # (.*)\n    {parameter.name}: ', text, re.MULTILINE)
        assert over, parameter.name
        live = '; live' if parameter.live else ''
        assert over[1] == f'{parameter.description} ({parameter.allowed}{live})'
        assert parameter.description.endswith('.')
        assert parameter.unit in over[1]


def rows_below(heading):
    part = re.split(r'^##+ ', PAGE.read_text(), flags=re.MULTILINE)
    (part,) = [each for each in part if each.startswith(f'{heading}\n')]
    rows = [line.strip('| ').split(' | ') for line in part.splitlines() if line.startswith('| `')]
    return [[cell.strip('`') for cell in row] for row in rows]


@pytest.mark.parametrize('name', NODES)
def test_the_page_has_every_parameter(name):
    assert rows_below(name) == [
        [
            parameter.name,
            parameter.kind,
            in_yaml(parameter.default).replace("''", '""'),
            parameter.unit or '-',
            parameter.allowed,
            'yes' if parameter.live else '-',
            parameter.description,
        ]
        for parameter in table_of(name)
    ]


def test_the_page_has_every_option_of_the_simulated_backend():
    given_by_the_node = ('clock', 'ceiling')
    options = {
        f'backend_options.{name}': '-' if default is None or name == 'pad_volume' else str(default)
        for name, default in (
            (each.name, each.default)
            for each in inspect.signature(SimulatedRegulator).parameters.values()
        )
        if name not in given_by_the_node
    }
    rows = rows_below('Options of the backend `simulated`')
    assert {row[0]: row[1] for row in rows} == options
    assert all(len(row) == 5 and all(row) for row in rows)


@pytest.fixture
def declared(context):
    nodes = []

    def declared(*table, **given):
        overrides = [Override(name, value=value) for name, value in given.items()]
        node = Node('probe', context=context, parameter_overrides=overrides)
        nodes.append(node)
        return node, declare(node, table)

    yield declared
    for node in nodes:
        node.destroy_node()


def test_defaults_and_what_is_given(declared):
    _, values = declared(RATE, COUNT, SHAPE, SWITCH, LEGS, rate=100.0, shape='dome', legs=[6, 2])
    assert values == {
        'rate': 100.0, 'count': 3, 'shape': 'dome', 'switch': False, 'legs': [6, 2],
    }  # fmt: skip


def test_a_whole_number_will_do_for_a_double(declared):
    node, values = declared(RATE, rate=100)
    assert type(values['rate']) is float
    assert node.get_parameter('rate').value == 100.0


def test_ros_tools_see_type_range_and_unit(declared):
    node, _ = declared(RATE, COUNT, SHAPE)
    rate, count, shape = (node.describe_parameter(each) for each in ('rate', 'count', 'shape'))
    assert rate.type == ParameterType.PARAMETER_DOUBLE
    assert [(r.from_value, r.to_value) for r in rate.floating_point_range] == [(1.0, 1000.0)]
    assert [(r.from_value, r.to_value) for r in count.integer_range] == [(0, 9)]
    assert rate.description == 'Samples a second. [Hz]'
    assert shape.additional_constraints == 'one of flat, dome'


def test_parameters_do_not_change_later(declared):
    node, values = declared(RATE)
    (result,) = node.set_parameters([Override('rate', value=20.0)])
    assert not result.successful
    assert result.reason == 'Trying to set a read-only parameter: rate.'
    assert (node.get_parameter('rate').value, values['rate']) == (50.0, 50.0)
    assert node.describe_parameter('rate').read_only


def test_live_parameters_do(declared):
    told = []
    noted = dataclasses.replace(MODE, change=lambda node, value: told.append((node, value)))
    node, values = declared(GAIN, noted)
    assert not node.describe_parameter('gain').read_only
    results = node.set_parameters([Override('gain', value=3), Override('mode', value='fast')])
    assert [each.successful for each in results] == [True, True]
    assert values == {'gain': 3.0, 'mode': 'fast'}
    assert type(values['gain']) is float
    assert node.get_parameter('gain').value == 3.0
    assert told == [(node, 'fast')]


@pytest.mark.parametrize(
    ('name', 'given', 'reason'),
    [
        ('gain', 5.5, 'Parameter gain out of range'),  # ROS has the first word on ranges
        ('gain', math.nan, 'Parameter gain out of range'),
        ('gain', 'high', 'Wrong parameter type'),
        ('gain', True, 'Wrong parameter type'),
        (
            'gain',
            1.0 - 1e-9,  # a range that ROS takes for kept
            'node probe: parameter gain = 0.999999999 is not allowed: a number from 1 to 5 is',
        ),
        (
            'mode',
            'faster',
            "node probe: parameter mode = 'faster' is not allowed: one of slow, fast is needed",
        ),
        ('use_sim_time', True, 'node probe: parameter use_sim_time is read at the start'),
    ],
)
def test_a_change_that_is_not_allowed_is_refused_with_the_reason(declared, name, given, reason):
    told = []
    mode = dataclasses.replace(MODE, change=lambda *each: told.append(each))
    node, values = declared(GAIN, mode)
    good = Override('mode', value='fast')
    result = node.set_parameters_atomically([good, Override(name, value=given)])
    assert not result.successful
    assert result.reason.startswith(reason)
    assert values == {'gain': 2.0, 'mode': 'slow'}
    assert told == []
    assert not node.get_parameter('use_sim_time').value


LIVE = {
    'regulator': {'command_timeout': 0.3, 'slew_limit': 5e4, 'on_fault': 'vent'},
    'controller': {'margin': 1.5},
}
CLASSES = {name: f'{name.capitalize()}Node' for name in NODES}


@pytest.mark.parametrize('name', NODES)
def test_each_parameter_of_each_node_changes_or_is_refused(name, context, tmp_path):
    node = getattr(importlib.import_module(f'ros_pad.nodes.{name}'), CLASSES[name])(
        context=context,
        parameter_overrides=(
            [Override('folder', value=str(tmp_path / 'bag'))] if name == 'recorder' else []
        ),
    )
    try:
        live = LIVE.get(name, {})
        assert {each.name for each in table_of(name) if each.live} == set(live)
        for parameter in table_of(name):
            before = node.get_parameter(parameter.name).value
            given = live.get(parameter.name, parameter.default)
            (result,) = node.set_parameters([Override(parameter.name, value=given)])
            assert result.successful is (parameter.name in live), parameter.name
            if not result.successful:
                assert parameter.name in result.reason
                given = before
            assert node.get_parameter(parameter.name).value == given
        (result,) = node.set_parameters([Override('use_sim_time', value=True)])
        assert not result.successful
        if name == 'controller':
            assert node.controller.margin == 1.5
    finally:
        node.destroy_node()


@pytest.mark.parametrize(
    ('parameter', 'given', 'allowed'),
    [
        (RATE, 0.5, 'a number from 1 to 1000 Hz'),
        (RATE, 2000, 'a number from 1 to 1000 Hz'),
        (RATE, float('nan'), 'a number from 1 to 1000 Hz'),
        (RATE, float('inf'), 'a number from 1 to 1000 Hz'),
        (RATE, 'fast', 'a number from 1 to 1000 Hz'),
        (RATE, True, 'a number from 1 to 1000 Hz'),
        (AMBIENT_PRESSURE, 101.325, 'a number from 30000 to 120000 Pa'),
        (COUNT, 10, 'a whole number from 0 to 9'),
        (COUNT, 1.0, 'a whole number from 0 to 9'),
        (SHAPE, 'cone', 'one of flat, dome'),
        (SHAPE, 1, 'one of flat, dome'),
        (SWITCH, 1, 'true or false'),
        (LEGS, [0, 1], 'a list of different whole numbers from 1 to 6'),
        (LEGS, [7], 'a list of different whole numbers from 1 to 6'),
        (LEGS, [2, 2], 'a list of different whole numbers from 1 to 6'),
        (LEGS, [], 'a list of different whole numbers from 1 to 6'),
        (LEGS, [1.0], 'a list of different whole numbers from 1 to 6'),
        (LEGS, ['a'], 'a list of different whole numbers from 1 to 6'),
        (LEGS, 'all', 'a list of different whole numbers from 1 to 6'),
        (LEGS, 1, 'a list of different whole numbers from 1 to 6'),
        (FOOT, 3, 'text'),
    ],
)
def test_what_is_not_allowed_is_named(declared, parameter, given, allowed):
    expected = f'node probe: parameter {parameter.name} = {given!r} is not allowed: {allowed} is'
    with pytest.raises(ConfigError, match=re.escape(expected)):
        declared(parameter, **{parameter.name: given})


def run_node(name, *arguments):
    return subprocess.Popen(
        [sys.executable, '-m', f'ros_pad.nodes.{name}', '--ros-args', *arguments],
        stderr=subprocess.PIPE,
        text=True,
        cwd=PAGE.parents[1],
    )


@pytest.mark.parametrize(
    ('name', 'given', 'message'),
    [
        (
            'regulator',
            'ceiling:=-5.0',
            'node regulator: parameter ceiling = -5.0 is not allowed: '
            'a number from 1000 to 1000000 Pa is needed',
        ),
        (
            'regulator',
            'ceiling:=95000.0',
            'node regulator: parameter ceiling = 95000 Pa is not allowed: foot large37 bears',
        ),
        (
            'regulator',
            'backend_options.hose_lenght:=1.0',
            "node regulator: regulator backend 'simulated' has no option 'hose_lenght' (= 1.0)"
            " (did you mean 'hose_length'?)",
        ),
        (
            'regulator',
            'backend_options.hose_length:=-1.0',
            "node regulator: regulator backend 'simulated': hose_length = -1.0 is not allowed",
        ),
        (
            'regulator',
            'backend_options.ceiling:=500000.0',
            'node regulator: parameter backend_options.ceiling = 500000.0 is not allowed:',
        ),
        (
            'regulator',
            'celing:=60000.0',
            "node regulator: parameter 'celing' is not known here. Did you mean 'ceiling'?",
        ),
        (
            'regulator',
            'backend_optons.hose_length:=5.0',
            "node regulator: parameter 'backend_optons.hose_length' is not known here. Did you",
        ),
        (
            'controller',
            'dome_pressure:=75.0',
            'node controller: fixed_pressure = 75',
        ),
        ('regulator', 'backend:=alicatt', "node regulator: parameter backend = 'alicatt' is not"),
        (
            'estimator',
            'foot:=large36',
            "node estimator: parameter foot = 'large36' is not allowed: no foot named 'large36'."
            " Did you mean 'large37'?",
        ),
        (
            'simulator',
            'scene:=hexapod_patch',
            "node simulator: parameter scene = 'hexapod_patch' is not allowed: no scene named"
            " 'hexapod_patch'. Did you mean 'hexapod_patches'?",
        ),
        ('simulator', 'rate:=10.0', 'node simulator: parameter rate = 10 is not allowed: 0, or'),
        (
            'controller',
            'policy:=oracle',
            "node controller: parameter scene = '' is not allowed: policy oracle needs",
        ),
    ],
)
def test_a_bad_value_ends_the_node_with_one_line(name, given, message, capfd):
    main = importlib.import_module(f'ros_pad.nodes.{name}').main
    assert main([name, '--ros-args', '-p', given]) == 2
    errors = capfd.readouterr().err
    assert errors.startswith(f'ros_pad: {message}'), errors
    assert errors.count('\n') == 1


def test_a_params_file_that_is_not_there():
    process = run_node('estimator', '--params-file', 'nowhere.yaml')
    try:
        _, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 2
    assert 'nowhere.yaml' in errors
    assert 'Traceback' not in errors


def test_every_node_comes_up_with_the_shipped_file(context, executor, until, tmp_path):
    """The file has the defaults, so values are changed to see that each part arrives."""
    text = FILE.read_text().replace('legs: [1, 2, 3, 4, 5, 6]', 'legs: [4]')
    text = text.replace('scene: hexapod_patches', 'scene: leg_dry_flat')
    text = text.replace('folder: ""', f'folder: {tmp_path / "bag"}')
    text += '\n/**/regulator:\n  ros__parameters:\n    colour: red\n'
    (tmp_path / 'params.yaml').write_text(text)
    observer = Node('observer', context=context)
    executor.add_node(observer)
    served = {
        'simulator': '/lab/leg_1/position',
        'estimator': '/lab/leg_4/wetness',
        'controller': '/lab/leg_4/morphology',
        'regulator': '/lab/leg_4/pressure',
    }
    arguments = ('--params-file', str(tmp_path / 'params.yaml'), '-r', '__ns:=/lab')
    processes = {name: run_node(name, *arguments) for name in NODES}
    try:
        for topic in served.values():
            until(lambda t=topic: observer.count_publishers(t), 30.0, f'a publisher of {topic}')
        assert not observer.count_publishers('/lab/leg_4/position')
        assert not observer.count_publishers('/lab/leg_1/wetness')
        until((tmp_path / 'bag' / 'metadata.yaml').exists, 10.0, 'the bag')
    finally:
        for process in processes.values():
            process.send_signal(signal.SIGINT)
        ends = {}
        for name, process in processes.items():
            try:
                ends[name] = process.communicate(timeout=20)[1]
            finally:
                process.kill()
    assert {name: process.returncode for name, process in processes.items()} == dict.fromkeys(
        NODES, 0
    ), ends
    assert "parameter 'colour' is not known here" in ends['regulator']
