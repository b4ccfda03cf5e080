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
from rcl_interfaces.msg import Parameter as RosParameter
from rcl_interfaces.msg import ParameterEvent, ParameterType, ParameterValue
from rclpy.node import Node
from rclpy.parameter import Parameter as Override

from ros_pad.configuration import shared_folder
from ros_pad.errors import ConfigError
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.parameters import AMBIENT_PRESSURE, FOOT, LEGS, Parameter, declare
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.regulators import SimulatedRegulator

NODES = [
    'simulator', 'body_estimator', 'estimator', 'controller', 'regulator', 'recorder', 'merge',
    'views',
]  # fmt: skip
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
    return (
        yaml.safe_dump(value, default_flow_style=True, width=1000).removesuffix('\n...\n').strip()
    )


@pytest.mark.parametrize('name', NODES)
def test_the_shipped_file_has_every_parameter_with_its_default(name):
    shipped = yaml.safe_load(FILE.read_text())
    assert set(shipped) == {f'/**/{each}' for each in NODES}
    values = shipped[f'/**/{name}']['ros__parameters']
    expected = {parameter.name: parameter.default for parameter in table_of(name)}
    assert values == expected
    assert list(map(type, values.values())) == list(map(type, expected.values()))


@pytest.mark.parametrize('name', NODES)
def test_the_shipped_file_describes_each_key(name):
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
    assert rate.description.endswith('[Hz]')
    assert shape.additional_constraints == 'one of flat, dome'


def test_parameters_do_not_change_later(declared):
    node, values = declared(RATE)
    (result,) = node.set_parameters([Override('rate', value=20.0)])
    assert not result.successful
    assert 'rate' in result.reason
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
        ('gain', 5.5, 'Parameter gain out of range'),  # ROS checks ranges first
        ('gain', math.nan, 'Parameter gain out of range'),
        ('gain', 'high', 'Wrong parameter type'),
        ('gain', True, 'Wrong parameter type'),
        (
            'gain',
            1.0 - 1e-9,  # ROS tolerates this
            'node probe: parameter gain = 0.999999999 is not allowed: a number from 1 to 5 is',
        ),
        (
            'mode',
            'faster',
            "node probe: parameter mode = 'faster' is not allowed: one of slow, fast is needed",
        ),
        ('use_sim_time', True, 'node probe: parameter use_sim_time is read only at the start'),
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
    'controller': {
        'margin': 1.5,
        'command_timeout': 0.3,
        'policy.wet_above': 0.7,
        'policy.dry_below': 0.3,
        'policy.probe_below': 0.85,
        'policy.dwell': 3,
    },
}
CLASSES = {name: f'{name.title().replace("_", "")}Node' for name in NODES}


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
        (LEGS, [0, 1], 'a list of different whole numbers from 1 to 8'),
        (LEGS, [9], 'a list of different whole numbers from 1 to 8'),
        (LEGS, [2, 2], 'a list of different whole numbers from 1 to 8'),
        (LEGS, [], 'a list of different whole numbers from 1 to 8'),
        (LEGS, [1.0], 'a list of different whole numbers from 1 to 8'),
        (LEGS, ['a'], 'a list of different whole numbers from 1 to 8'),
        (LEGS, 'all', 'a list of different whole numbers from 1 to 8'),
        (LEGS, 1, 'a list of different whole numbers from 1 to 8'),
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
            'node regulator: parameter ceiling = 95000 Pa is not allowed: the ceiling of foot',
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
            "node regulator: there is no parameter 'celing'. Did you mean 'ceiling'?",
        ),
        (
            'regulator',
            'backend_optons.hose_length:=5.0',
            "node regulator: there is no parameter 'backend_optons.hose_length'. Did you",
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
        ('simulator', 'rate:=10.0', 'node simulator: parameter rate = 10 Hz is not allowed:'),
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
    """The file has the defaults, so some values are changed to see that each part is read."""
    head, body, text = re.split(r'(/\*\*/body_estimator:\n(?:.*\n)+?\n)', FILE.read_text())
    text = head + text.replace('legs: [1, 2, 3, 4, 5, 6]', 'legs: [4]')
    # The body estimator has all legs of its robot, here in another namespace.
    text += body.replace('/**/body_estimator', '/**/body/body_estimator')
    text = text.replace('scene: hexapod_patches', 'scene: leg_dry_flat')
    text = text.replace('folder: ""', f'folder: {tmp_path / "bag"}')
    text += '\n/**/regulator:\n  ros__parameters:\n    colour: red\n'
    (tmp_path / 'params.yaml').write_text(text)
    observer = Node('observer', context=context)
    executor.add_node(observer)
    served = {
        'simulator': '/lab/feet/sample',
        'body_estimator': '/lab/body/odom',
        'estimator': '/lab/feet/estimate',
        'controller': '/lab/feet/command',
        'regulator': '/lab/feet/pressure',
        'views': '/lab/leg_4/wetness',
    }
    arguments = ('--params-file', str(tmp_path / 'params.yaml'), '-r', '__ns:=/lab')
    processes = {name: run_node(name, *arguments) for name in NODES if name != 'body_estimator'}
    arguments = (*arguments[:-1], '__ns:=/lab/body')
    processes['body_estimator'] = run_node('body_estimator', *arguments)
    try:
        for topic in served.values():
            until(lambda t=topic: observer.count_publishers(t), 30.0, f'a publisher of {topic}')
        assert not observer.count_publishers('/lab/leg_1/wetness')
        until(lambda: observer.count_subscribers('/lab/leg_4/wrench'), 30.0, 'merge')
        assert not observer.count_subscribers('/lab/leg_1/wrench')
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
    assert "there is no parameter 'colour'" in ends['regulator']


@pytest.fixture
def controller(context):
    nodes = []

    def make(**given):
        overrides = [Override(name, value=value) for name, value in given.items()]
        nodes.append(ControllerNode(context=context, parameter_overrides=overrides))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


def test_parameters_of_the_policy_must_fit_one_another(controller):
    node = controller()
    (result,) = node.set_parameters([Override('policy.dry_below', value=0.66)])
    assert not result.successful
    assert 'policy.dry_below = 0.66' in result.reason and '0.65' in result.reason
    both = [Override('policy.wet_above', value=0.8), Override('policy.dry_below', value=0.66)]
    for order in (both, both[::-1]):
        node.set_parameters_atomically([Override(each.name, value=0.5) for each in order[::-1]])
        assert node.set_parameters_atomically(order).successful
        assert node.get_parameter('policy.dry_below').value == 0.66
    with pytest.raises(ConfigError, match=r'policy\.dry_below = 0\.7'):
        controller(**{'policy.dry_below': 0.7})


def test_a_misspelt_parameter_of_the_policy_is_refused(controller):
    with pytest.raises(ConfigError, match=r"Did you mean 'policy\.dwell'"):
        controller(**{'policy.dwel': 3})


def test_the_controller_follows_the_command_timeout_of_the_regulator(
    controller, context, executor, until
):
    node = controller()
    regulator = RegulatorNode(context=context)
    executor.add_node(node)
    executor.add_node(regulator)
    until(lambda: node.count_publishers('/parameter_events') >= 2)

    def follows(seconds):
        regulator.set_parameters([Override('command_timeout', value=seconds)])
        return node.controller.command_timeout == seconds

    until(lambda: follows(1.5) or follows(2.5))
    changed = node.controller.command_timeout
    assert node.get_parameter('command_timeout').value == changed


def test_the_controller_asks_a_regulator_that_was_there_before(
    controller, context, executor, until
):
    regulator = RegulatorNode(
        context=context, parameter_overrides=[Override('command_timeout', value=1.5)]
    )
    executor.add_node(regulator)
    node = controller()
    executor.add_node(node)
    until(lambda: node.controller.command_timeout != 0.5)
    assert node.controller.command_timeout == 1.5
    assert node.get_parameter('command_timeout').value == 1.5


@pytest.mark.parametrize(
    ('publisher', 'name', 'value'),
    [
        ('/regulator', 'command_timeout', ParameterValue(type=99)),
        ('/regulator', 'command_timeout', ParameterValue()),
        ('/regulator', 'command_timeout', ParameterValue(type=4, string_value='long')),
        ('/regulator', 'command_timeout', ParameterValue(type=8, double_array_value=[1.5])),
        ('/regulator', 'command_timeout', ParameterValue(type=3, double_value=math.nan)),
        ('/regulator', 'command_timeout', ParameterValue(type=3, double_value=61.0)),
        ('/regulator', 'margin', ParameterValue(type=3, double_value=1.5)),
        ('/other/regulator', 'command_timeout', ParameterValue(type=3, double_value=1.5)),
    ],
)
def test_other_events_change_nothing(controller, context, executor, until, publisher, name, value):
    node = controller()
    sender = Node('sender', context=context)
    events = sender.create_publisher(ParameterEvent, '/parameter_events', 10)
    executor.add_node(node)
    executor.add_node(sender)
    good = ParameterValue(type=3, double_value=2.5)

    def send(publisher, name, value):
        changed = [RosParameter(name=name, value=value)]
        events.publish(ParameterEvent(node=publisher, changed_parameters=changed))

    try:
        until(lambda: events.get_subscription_count() >= 1)
        send(publisher, name, value)
        send('/regulator', 'command_timeout', good)  # if this arrives, the other one did
        timeouts = []

        def followed():
            timeouts.append(node.controller.command_timeout)
            return timeouts[-1] == 2.5

        until(followed)
        assert set(timeouts) <= {0.5, 2.5} and node.controller.margin == 1.2
    finally:
        sender.destroy_node()


def write_tables():
    """Write the parameters of all nodes into the shipped file and the documentation."""
    shipped, page = FILE.read_text(), PAGE.read_text()
    for name in NODES:
        keys, rows = [], []
        for each in table_of(name):
            default = in_yaml(each.default).replace("''", '""')
            live = '; live' if each.live else ''
            keys += [
                f'    # {each.description} ({each.allowed}{live})',
                f'    {each.name}: {default}',
            ]
            cells = [f'`{each.name}`', each.kind, f'`{default}`', each.unit or '-', each.allowed]
            rows.append(' | '.join([*cells, 'yes' if each.live else '-', each.description]))
        begin = f'/**/{name}:\n  ros__parameters:\n'
        before, _, rest = shipped.partition(begin)
        after = rest.partition('\n\n')[2]
        shipped = before + begin + '\n'.join(keys) + '\n' + ('\n' + after if after else '')
        table = re.compile(rf'(^##+ {name}\n.*?\|---\|[-|]*\n)(?:\|.*?\n)+', re.M | re.S)
        rows_of_page = ''.join(f'| {row} |\n' for row in rows)
        page = table.sub(lambda found, new=rows_of_page: found[1] + new, page, count=1)
    FILE.write_text(shipped)
    PAGE.write_text(page)


if __name__ == '__main__':
    write_tables()
