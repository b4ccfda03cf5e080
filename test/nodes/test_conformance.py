# SPDX-License-Identifier: Apache-2.0
"""Every node accepts names, parameters and time on its command line, like all ROS 2 nodes."""

import pytest
from helpers import NODES, node_class
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from ros_pad.configuration import shared_folder

# A parameter of each node, its text in the shipped file, and its value in a changed copy.
CHANGED = {
    'simulator': ('seed', '0', 7),
    'body_estimator': ('velocity_noise', '0.03', 0.05),
    'estimator': ('wet_prior', '0.5', 0.25),
    'controller': ('margin', '1.2', 1.5),
    'regulator': ('ceiling', '90000.0', 60000.0),
    'merge': ('source', 'markers', 'joints'),
    'views': ('frame', 'world', 'odom'),
    'recorder': ('folder', '""', 'FOLDER/bag'),
}
GLOBAL = {'/clock', '/diagnostics', '/parameter_events', '/rosout'}


@pytest.mark.parametrize('name', NODES)
def test_names_parameters_and_time_of_the_command_line(name, context, executor, until, tmp_path):
    shipped = shared_folder() / 'params.yaml'
    parameter, old, new = CHANGED[name]
    new = new.replace('FOLDER', str(tmp_path)) if isinstance(new, str) else new
    text = shipped.read_text(encoding='utf-8').replace(f'/**/{name}:', f'/**/other_{name}:')
    assert f'\n    {parameter}: {old}\n' in text
    (tmp_path / 'mine.yaml').write_text(
        text.replace(f'\n    {parameter}: {old}\n', f'\n    {parameter}: {new}\n')
    )
    words = [
        *('--ros-args', '-r', '__ns:=/lab', '-r', f'__node:=other_{name}'),
        *('-r', 'feet/pressure:=feet/air', '-r', 'leg_1/pressure:=leg_1/air'),
        *('--params-file', str(shipped), '--params-file', str(tmp_path / 'mine.yaml')),
        *('-p', 'use_sim_time:=true'),
    ]
    node = node_class(name)(context=context, cli_args=words)
    executor.add_node(node)
    assert node.get_fully_qualified_name() == f'/lab/other_{name}'
    assert node.get_parameter(parameter).value == new
    topics = {each.topic_name for each in (*node.publishers, *node.subscriptions)}
    if name == 'recorder':
        topics |= set(node._intake.subscriptions)
    assert all(each in GLOBAL or each.startswith('/lab/') for each in topics)
    assert not {'/lab/feet/pressure', '/lab/leg_1/pressure'} & topics
    if name != 'body_estimator':
        assert {'/lab/feet/air', '/lab/leg_1/air'} & topics
    robot = Node('robot', context=context)
    clock = robot.create_publisher(Clock, '/clock', 1)
    now = Clock()
    now.clock.sec = 5000  # neither zero nor the time of day
    until(lambda: clock.publish(now) or node.now_ns() == 5000 * 10**9)
    robot.destroy_node()
