# SPDX-License-Identifier: Apache-2.0
"""The policy for SROS 2 allows exactly what nodes use, and ``pad run`` is isolated."""

import fnmatch
import pathlib
import xml.etree.ElementTree

import pytest
from helpers import NODES, SIX, node_class, overrides
from rclpy.node import Node

POLICY = pathlib.Path(__file__).resolve().parents[2] / 'config' / 'security' / 'policy.xml'
# Allowed, but not always used: joints exist at L2 only, the clock in simulated time only.
AT_TIMES = {
    ('simulator', 'publish', '/joint_states'),
    # Without markers:
    ('simulator', 'publish', '/feet/force'),
    ('simulator', 'publish', '/imu/data'),
    ('body_estimator', 'publish', '/tf'),
    ('merge', 'subscribe', '/leg_?/contact_velocity'),
    # With the first message of a driver:
    *(('merge', 'publish', f'/feet/{name}') for name in ('sample', 'force', 'pressure')),
    *((name, 'subscribe', '/clock') for name in NODES),
}


def allowed():
    """Return the policy as {(enclave, kind): {expression, ...}}."""
    found = {}
    root = xml.etree.ElementTree.parse(POLICY).getroot()
    for enclave in root.find('enclaves'):
        name = enclave.attrib['path'].removeprefix('/ros_pad/')
        (profile,) = enclave.iter('profile')
        assert (profile.attrib['ns'], profile.attrib['node']) == ('/', name)
        for group in profile:
            for kind, rule in group.attrib.items():
                assert rule == 'ALLOW'
                names = found.setdefault((name, kind), set())
                for entry in group:
                    text = entry.text.replace('~', f'/{name}', 1)
                    names.add(text if text.startswith('/') else f'/{text}')
    return found


@pytest.mark.parametrize('name', NODES)
def test_the_policy_names_what_a_node_has_and_no_more(context, executor, until, tmp_path, name):
    values = {'legs': list(SIX), 'use_sim_time': name == 'regulator'}
    if name == 'simulator':
        values |= {'publish_clock': True, 'fidelity': 'L1'}
    if name == 'recorder':
        values |= {'folder': str(tmp_path / 'bag')}
    node = node_class(name)(context=context, parameter_overrides=overrides(values))
    executor.add_node(node)
    observer = Node('observer', context=context, start_parameter_services=False)
    executor.add_node(observer)

    def live():
        """Return names and types of the node's topics and services, as other nodes see them."""
        return {
            'publish': observer.get_publisher_names_and_types_by_node(name, '/'),
            'subscribe': observer.get_subscriber_names_and_types_by_node(name, '/'),
            'reply': observer.get_service_names_and_types_by_node(name, '/'),
            'request': observer.get_client_names_and_types_by_node(name, '/'),
        }

    until(lambda: name in observer.get_node_names(), what='the node')
    own = len(list(node.publishers)) + len(list(node.subscriptions)) + len(list(node.services))
    until(lambda: sum(map(len, live().values())) >= own - 2, what='the whole node')
    policy = allowed()
    for kind, entries in live().items():
        names = {each for each, _ in entries}
        expressions = policy.get((name, kind), set())
        unnamed = {
            each for each in names if not any(fnmatch.fnmatchcase(each, e) for e in expressions)
        }
        assert not unnamed, f'the policy does not allow {name} to {kind} {unnamed}'
        spare = {e for e in expressions if not fnmatch.filter(names, e)}
        assert {(name, kind, each) for each in spare} <= AT_TIMES


def test_only_the_controller_may_move_pads_and_only_an_operator_may_call():
    policy = allowed()

    def movers(topic):
        return {
            name
            for (name, kind), expressions in policy.items()
            if kind == 'publish' and any(fnmatch.fnmatchcase(topic, e) for e in expressions)
        }

    assert movers('/feet/command') == {'controller'}
    assert movers('/leg_3/pressure_setpoint') == {'views'}  # for regulators of others
    assert movers('/feet/pressure') == {'regulator', 'merge'}
    assert {name for name, kind in policy if kind == 'request'} == {'operator'}
