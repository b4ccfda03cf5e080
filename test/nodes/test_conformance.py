# SPDX-License-Identifier: Apache-2.0
"""Every node accepts names, parameters and time on its command line, like all ROS 2 nodes.

The tests share one process of each node, which receives all of these arguments.
"""

import subprocess
import sys
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rosgraph_msgs.msg import Clock

from ros_pad.configuration import shared_folder

# A parameter of each node, its text in the shipped file, and its value in a changed copy.
CHANGED = {
    'simulator': ('seed', '0', 7),
    'estimator': ('wet_prior', '0.5', 0.25),
    'controller': ('margin', '1.2', 1.5),
    'regulator': ('ceiling', '90000.0', 60000.0),
    'merge': ('source', 'markers', 'joints'),
    'views': ('frame', 'world', 'odom'),
    'recorder': ('folder', '""', 'FOLDER/bag'),
}
NODES = tuple(CHANGED)
CLOCK = 5000  # s, neither zero nor the time of day


class Lab:
    """Observes the graph, publishes ``/clock``, and records stamps of the nodes' messages."""

    def __init__(self):
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self.node = Node('observer', context=self._context)
        self._executor.add_node(self.node)
        self.stamps = {}
        self.processes = []
        clock = self.node.create_publisher(Clock, '/clock', 1)
        now = Clock()
        now.clock.sec = CLOCK

        def tick():
            now.clock.sec += 1  # nodes publish as time advances
            clock.publish(now)

        self.node.create_timer(0.1, tick)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.node.create_subscription(PoseStamped, '/lab/body/pose', self._on_pose, 10)

    def _on_diagnostics(self, message):
        for status in message.status:
            self.stamps[status.name.partition(':')[0]] = message.header.stamp.sec

    def _on_pose(self, message):
        self.stamps['other_simulator'] = message.header.stamp.sec

    def until(self, predicate, what):
        deadline = time.monotonic() + 60.0
        while not (found := predicate()):
            assert [each.poll() for each in self.processes] == [None] * len(self.processes)
            if time.monotonic() > deadline:
                pytest.fail(f'waited for {what}: timeout after 60 s')
            self._executor.spin_once(timeout_sec=0.05)
        return found

    def parameters(self, node, *names):
        client = self.node.create_client(GetParameters, f'/lab/{node}/get_parameters')
        self.until(client.service_is_ready, f'parameters of {node}')
        future = client.call_async(GetParameters.Request(names=names))
        self.until(future.done, f'an answer of {node}')
        self.node.destroy_client(client)
        return [parameter_value_to_python(value) for value in future.result().values]

    def close(self):
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self._executor.shutdown()
        rclpy.shutdown(context=self._context)


@pytest.fixture(scope='module')
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp('lab')
    shipped = shared_folder() / 'params.yaml'
    text = shipped.read_text(encoding='utf-8')
    for node, (name, old, new) in CHANGED.items():
        text = text.replace(f'/**/{node}:', f'/**/other_{node}:')
        assert f'\n    {name}: {old}\n' in text
        text = text.replace(f'\n    {name}: {old}\n', f'\n    {name}: {new}\n')
    mine = folder / 'mine.yaml'
    mine.write_text(text.replace('FOLDER', str(folder)), encoding='utf-8')
    lab = Lab()
    lab.folder = str(folder)
    lab.processes = [
        subprocess.Popen(
            [
                *(sys.executable, '-m', 'ros_pad.nodes.start', node, '--ros-args'),
                *('-r', '__ns:=/lab', '-r', f'__node:=other_{node}'),
                *('-r', 'feet/pressure:=feet/air', '-r', 'leg_1/pressure:=leg_1/air'),
                *('--params-file', str(shipped), '--params-file', str(mine)),
                *('-p', 'use_sim_time:=true'),
            ]
        )
        for node in NODES
    ]
    try:
        yield lab
    finally:
        for process in lab.processes:
            process.terminate()
        for process in lab.processes:
            try:
                process.wait(timeout=15)
            finally:
                process.kill()
        lab.close()


@pytest.mark.parametrize('node', NODES)
def test_topics_are_remapped_and_under_the_namespace(lab, node):
    def topics():
        try:
            ends = lab.node.get_publisher_names_and_types_by_node(f'other_{node}', '/lab')
            ends += lab.node.get_subscriber_names_and_types_by_node(f'other_{node}', '/lab')
        except rclpy.node.NodeNameNonExistentError:
            return set()
        return {name for name, _ in ends}

    # The merge node has no record before the first message of a driver.
    air = {'merge': '/lab/leg_1/air'}.get(node, '/lab/feet/air')
    lab.until(lambda: air in topics(), 'its topics')
    global_ones = {'/clock', '/diagnostics', '/parameter_events', '/rosout'}
    assert all(name in global_ones or name.startswith('/lab/') for name in topics())
    assert not {'/lab/feet/pressure', '/lab/leg_1/pressure'} & topics()


@pytest.mark.parametrize('node', NODES)
def test_parameters_of_a_file_and_of_the_command_line(lab, node):
    name, _, value = CHANGED[node]
    if node == 'recorder':
        value = value.replace('FOLDER', lab.folder)
    assert lab.parameters(f'other_{node}', name, 'use_sim_time') == [value, True]
