# SPDX-License-Identifier: Apache-2.0
"""Nodes of ros_pad with those of others: drivers by leg, through merge and views."""

import math
from functools import partial

from helpers import LOAD, fluid, overrides, position, wrench
from rclpy.node import Node

from ros_pad.bags import topics
from ros_pad.nodes import qos
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.merge import MergeNode
from ros_pad.nodes.views import ViewsNode

LEGS = (1, 2)
WRENCH, POSITION, PRESSURE = topics.LEG_WRENCH, topics.LEG_POSITION, topics.LEG_PRESSURE


class Driver(Node):
    """A robot of somebody else: it knows messages of ROS 2 by leg, and no records."""

    def __init__(self, context):
        super().__init__('driver', context=context)
        self.out = {
            (topic.pattern, leg): qos.publisher(self, topic, leg)
            for topic in (WRENCH, POSITION, PRESSURE)
            for leg in LEGS
        }
        self.commanded = {}
        self.wetness = {}
        for leg in LEGS:
            take = partial(self.regulate, leg)
            qos.subscription(self, topics.LEG_SETPOINT, take, leg)
            keep = partial(self.wetness.__setitem__, leg)
            qos.subscription(self, topics.LEG_WETNESS, lambda m, keep=keep: keep(m.data), leg)
        self.count = 0

    def regulate(self, leg, message):
        self.commanded[leg] = message.fluid_pressure
        message.header.frame_id = f'leg_{leg}_valve'
        self.out[PRESSURE.pattern, leg].publish(message)  # an ideal device

    def sense(self):
        """Publish what the sensors of a standing robot read."""
        self.count += 1
        now_ns = self.get_clock().now().nanoseconds
        jitter = 1e-6 * math.sin(self.count)
        for leg in LEGS:
            force = (0.1 * LOAD + jitter, 0.0, LOAD + jitter)
            self.out[WRENCH.pattern, leg].publish(wrench(now_ns, force, frame=f'leg_{leg}_foot'))
            self.out[POSITION.pattern, leg].publish(position(now_ns, (jitter, 0.0, 0.0)))


def test_a_driver_by_leg_walks_with_merge_and_views(context, executor, until):
    patient = {'legs': list(LEGS), 'command_timeout': 5.0}
    nodes = {
        kind: kind(context=context, parameter_overrides=overrides(values))
        for kind, values in (
            (MergeNode, {'legs': list(LEGS)}),
            (EstimatorNode, {'legs': list(LEGS)}),
            (ControllerNode, patient | {'policy': 'dome', 'dome_pressure': 40e3}),
            (ViewsNode, {'legs': list(LEGS), 'topics': 'pressure_setpoint, wetness'}),
        )
    }
    driver = Driver(context)
    for node in (*nodes.values(), driver):
        executor.add_node(node)
    until(lambda: all(each.get_subscription_count() for each in driver.out.values()))
    merge, estimator, controller, _ = nodes.values()

    def answered():
        driver.sense()
        return all(controller.controller.monitor(leg).pressure == 40e3 for leg in LEGS)

    until(answered, what='the pressures that answer the samples')
    assert driver.commanded == dict.fromkeys(LEGS, fluid(0, 40e3).fluid_pressure)
    until(lambda: len(driver.wetness) == 2, what='estimates by leg')
    assert all(0.0 < each < 1.0 for each in driver.wetness.values())
    assert min(estimator.stage.used) > 0
    assert not merge.contested
    for node in nodes.values():
        assert not node.refused
