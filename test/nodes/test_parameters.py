# SPDX-License-Identifier: Apache-2.0
import inspect
import re
import sys

import pytest
import yaml
from helpers import NODES, node_class
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as Override

from ros_pad.configuration import shared_folder
from ros_pad.errors import ConfigError
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.parameters import Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.regulators import SimulatedRegulator

FILE = shared_folder() / 'params.yaml'
RATE = Parameter('rate', 50.0, 'Samples a second.', 'Hz', 1.0, 1000.0)
COUNT = Parameter('count', 3, 'How many.', '', 0, 9)
SHAPE = Parameter('shape', 'flat', 'Which.', choices=('flat', 'dome'))
SWITCH = Parameter('switch', False, 'Whether.')
GAIN = Parameter('gain', 2.0, 'Factor.', '', 1.0, 5.0, live=True)
MODE = Parameter('mode', 'slow', 'How.', choices=('slow', 'fast'), live=True)


def table_of(name):
    return sys.modules[node_class(name).__module__].PARAMETERS


@pytest.mark.parametrize('name', NODES)
def test_the_shipped_file_has_every_parameter_with_its_default(name):
    shipped = yaml.safe_load(FILE.read_text())
    assert set(shipped) == {f'/**/{each}' for each in NODES}
    values = shipped[f'/**/{name}']['ros__parameters']
    expected = {parameter.name: parameter.default for parameter in table_of(name)}
    assert values == expected
    assert list(map(type, values.values())) == list(map(type, expected.values()))


def test_the_shipped_file_has_every_option_of_the_simulated_backend():
    options = inspect.signature(SimulatedRegulator).parameters.values()
    described = dict(re.findall(r'^#     backend_options\.(\w+):(.*)$', FILE.read_text(), re.M))
    assert described == {
        each.name: '' if each.default is None or each.name == 'pad_volume' else f' {each.default}'
        for each in options
        if each.name not in ('clock', 'ceiling')
    }


@pytest.fixture
def declared(context):
    nodes, told = [], []

    def declared(*table, **given):
        overrides = [Override(name, value=value) for name, value in given.items()]
        node = Node('probe', context=context, parameter_overrides=overrides)
        nodes.append(node)
        return node, declare(node, table, dict, lambda values: told.append(dict(values)))

    declared.told = told
    yield declared
    for node in nodes:
        node.destroy_node()


def test_ros_tools_see_type_range_and_unit(declared):
    node, _ = declared(RATE, COUNT, SHAPE)
    rate, count, shape = (node.describe_parameter(each) for each in ('rate', 'count', 'shape'))
    assert rate.type == ParameterType.PARAMETER_DOUBLE
    assert [(r.from_value, r.to_value) for r in rate.floating_point_range] == [(1.0, 1000.0)]
    assert [(r.from_value, r.to_value) for r in count.integer_range] == [(0, 9)]
    assert rate.description.endswith('[Hz]')
    assert shape.additional_constraints == 'one of flat, dome'


def test_live_parameters_change_later_and_others_do_not(declared):
    node, values = declared(GAIN, MODE, RATE)
    changes = [Override('gain', value=3.0), Override('mode', value='fast')]
    assert node.set_parameters_atomically(changes).successful
    assert values == {'gain': 3.0, 'mode': 'fast', 'rate': 50.0} == declared.told[-1]
    assert node.get_parameter('gain').value == 3.0
    assert not node.set_parameters([Override('rate', value=20.0)])[0].successful


def test_what_another_callback_refuses_takes_no_effect(context):
    def refuse(changes):
        return SetParametersResult(successful=all(each.value != 'fast' for each in changes))

    node, told = Node('probe', context=context), []
    try:
        node.add_on_set_parameters_callback(refuse)  # rclpy calls the first one last
        values = declare(node, (GAIN, MODE), dict, told.append)
        before = dict(values)
        changes = [Override('gain', value=3.0), Override('mode', value='fast')]
        assert not node.set_parameters_atomically(changes).successful
        assert (values, told) == (before, [])
    finally:
        node.destroy_node()


@pytest.mark.parametrize(
    ('name', 'given', 'reason'),
    [
        ('gain', 5.5, 'Parameter gain out of range'),  # ROS checks ranges first
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
    node, values = declared(GAIN, MODE)
    good = Override('mode', value='fast')
    result = node.set_parameters_atomically([good, Override(name, value=given)])
    assert not result.successful
    assert result.reason.startswith(reason)
    assert values == {'gain': 2.0, 'mode': 'slow'}
    assert declared.told == []
    assert not node.get_parameter('use_sim_time').value


LIVE = {
    'regulator': {'command_timeout': 0.3, 'on_fault': 'vent'},
    'controller': {
        'margin': 1.5,
        'command_timeout': 0.3,
        'policy.wet_above': 0.7,
        'policy.dry_below': 0.3,
        'policy.probe_below': 0.85,
        'policy.dwell': 3,
    },
}


@pytest.mark.parametrize('name', NODES)
def test_each_parameter_of_each_node_changes_or_is_refused(name, context, tmp_path):
    node = node_class(name)(
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


BAD = {
    'ceiling:=-5.0': 'parameter ceiling = -5.0 is not allowed: a number from 1000 to',
    'ceiling:=95000.0': 'parameter ceiling = 95000 Pa is not allowed: the ceiling of foot',
    'legs:=[2, 2]': 'parameter legs = [2, 2] is not allowed: a list of different whole numbers',
    'foot:=large36': "parameter foot = 'large36' is not allowed: no foot named 'large36'. Did you",
    'celing:=60000.0': "there is no parameter 'celing'. Did you mean 'ceiling'?",
    'backend_optons.hose_length:=5.0': "there is no parameter 'backend_optons.hose_length'. Did",
    'backend_options.hose_lenght:=1.0': "regulator backend 'simulated' has no option 'hose_l",
    'backend_options.ceiling:=5e5': 'parameter backend_options.ceiling = 500000.0 is not',
}


@pytest.mark.parametrize('given', BAD)
def test_a_bad_value_ends_the_node_with_one_line(given, capfd):
    def make():
        RegulatorNode().destroy_node()
        pytest.fail('the node accepts it')

    assert run(make, ['regulator', '--ros-args', '-p', given]) == 2
    errors = capfd.readouterr().err
    assert errors.startswith(f'ros_pad: node regulator: {BAD[given]}'), errors
    assert errors.count('\n') == 1


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
