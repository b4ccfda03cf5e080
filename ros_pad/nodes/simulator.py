# SPDX-License-Identifier: Apache-2.0
"""The simulator node: a simulated robot behind the topics of a real one."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import PoseStamped
from geometry_msgs.msg import WrenchStamped
from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure
from sensor_msgs.msg import JointState

from ros_pad.contact import Foot
from ros_pad.errors import ConfigError
from ros_pad.nodes import topics
from ros_pad.nodes.markers import WalkMarkers
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import SCENE
from ros_pad.nodes.parameters import SEED
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import Pace
from ros_pad.simulation import fidelity
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.sensors import Sensors

PARAMETERS = (
    SCENE,
    Parameter(
        'foot',
        '',
        'Name of a foot in config/feet, or path of a YAML file; empty: the foot of the scene.',
        read=lambda name: Foot.load(name) if name else None,
    ),
    SEED,
    Parameter(
        'fidelity', 'auto', 'Fidelity level of the simulation.', choices=fidelity.FIDELITIES
    ),
    Parameter(
        'rate', 0.0, 'Samples a second, at least 50; 0: the rate of the scene.', 'Hz', 0.0, 1000.0
    ),
    Parameter('publish_clock', False, 'Stamp with simulated time, and publish it on /clock.'),
    Parameter('free_running', True, 'Step in real time by a timer; false: a program steps it.'),
    Parameter(
        'markers_rate',
        10.0,
        'Messages a second with markers for RViz and Foxglove; 0: none.',
        'Hz',
        0.0,
        60.0,
    ),
    AMBIENT_PRESSURE,
)

HIGHEST = 1e6
"""Highest gauge pressure that is accepted, Pa: no regulator's ceiling may exceed it."""

_SLOWEST = 50.0  # Hz, lowest rate that scenes allow


class SimulatorNode(Node):
    """Simulate a robot from the pressures of its pads, and publish the readings of its sensors.

    These are the wrench and position of each foot, the pose of the body, and joint positions if
    the robot has joints. Parameters are in :data:`PARAMETERS`. Pads are flat until their pressure
    is received.

    Attributes
    ----------
    scene : Scene
        Scene, with the foot of the parameter ``foot``.
    floor : Floor
        Floor of the scene, built with the seed.
    robot : Robot
        The simulated robot.
    period_ns, time_ns : int
        Period of samples and simulated time, ns.
    pressures : list of float
        Last pressure of each pad, gauge Pa, in the order of ``scene.legs``.
    pressure_stamps : list of int
        Stamps of these pressures, ns; 0 before the first one.

    Raises
    ------
    ConfigError
        When a parameter is not allowed.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'simulator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        values = declare(self, PARAMETERS)
        if 0.0 < values['rate'] < _SLOWEST:
            raise ConfigError(
                f'node {self.get_name()}: parameter rate = {values["rate"]:g} Hz is not allowed:'
                f' 0, or a number from {_SLOWEST:g} to 1000 Hz is needed'
            )
        self.scene: Scene = values['scene']
        if values['foot'] is not None:
            self.scene = replace(self.scene, foot=values['foot'])
        self.period_ns = round(1e9 / (values['rate'] or self.scene.sensors.rate))
        self.floor = self.scene.floor.build(values['seed'])
        self.robot = fidelity.build(
            self.scene, self.floor, self.period_ns * 1e-9, values['fidelity']
        )
        self._sensors = Sensors.of(self.scene, values['seed'])
        self._ambient = values['ambient_pressure']
        self.time_ns = 0
        self.pressures = [0.0] * len(self.scene.legs)
        self.pressure_stamps = [0] * len(self.scene.legs)
        for index, leg in enumerate(self.scene.legs):
            topics.PRESSURE.subscription(self, self._pressure_callback(index), leg)
        rate = values['markers_rate']
        self._markers = WalkMarkers(self.scene, self.floor) if rate else None
        self._markers_pace = Pace(round(1e9 / rate)) if rate else None
        self._simulated = values['publish_clock']
        self._advertise()
        # Without a timer, the caller of step() reports fidelity level and verdict.
        self._alone = values['free_running']
        self._ended = False
        if self._alone:
            choice = fidelity.choose(self.scene, values['fidelity'])
            self.get_logger().info(f'{self.scene.name} on {choice.level}: {choice.note}')
            # The timer cannot follow the clock that this node publishes.
            steady = NodeClock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(self.period_ns * 1e-9, self.step, clock=steady)

    def _advertise(self) -> None:
        """Create the publishers and their messages, which are reused to save time."""
        self._marker_publisher = topics.MARKERS.publisher(self) if self._markers else None
        self._clock_publisher = topics.CLOCK.publisher(self) if self._simulated else None
        self._pose = topics.BODY_POSE.publisher(self)
        self._joints = topics.JOINT_STATES.publisher(self) if self.robot.joint_names else None
        self._wrenches = [topics.WRENCH.publisher(self, leg) for leg in self.scene.legs]
        self._positions = [topics.POSITION.publisher(self, leg) for leg in self.scene.legs]
        self._clock_message = Clock()
        self._pose_message = PoseStamped()
        self._pose_message.header.frame_id = 'world'
        self._wrench_message = WrenchStamped()
        self._position_message = PointStamped()
        self._position_message.header.frame_id = 'world'
        self._joint_message = JointState(name=self.robot.joint_names)

    def _pressure_callback(self, index: int) -> Any:
        def callback(message: FluidPressure) -> None:
            gauge = message.fluid_pressure - self._ambient
            if not math.isfinite(gauge):
                return
            if gauge > HIGHEST:
                self.get_logger().warning(
                    f'leg {self.scene.legs[index]}: pressure of {gauge:g} Pa gauge ignored: at'
                    f' most {HIGHEST:g} Pa is allowed',
                    throttle_duration_sec=1.0,
                )
                return
            # A sensor at rest may read slightly below ambient; the pad is flat then.
            self.pressures[index] = max(0.0, gauge)
            self.pressure_stamps[index] = nanoseconds(message.header.stamp)

        return callback

    def step(self) -> None:
        """Advance the robot by one sample and publish the readings of its sensors."""
        self.robot.step(self.pressures)
        self.tick()
        if self._alone and self.robot.verdict and not self._ended:
            self._ended = True
            self.get_logger().error(
                f'the walk is not valid after {self.robot.time:.3f} s: {self.robot.verdict}'
            )
        stamp_ns = self.time_ns if self._simulated else self.get_clock().now().nanoseconds
        stamp = self._publish_feet(stamp_ns)
        pose = self._pose_message
        pose.header.stamp = stamp
        pose.pose.position.x, pose.pose.position.y, heading = self.robot.body
        pose.pose.orientation.z = math.sin(0.5 * heading)
        pose.pose.orientation.w = math.cos(0.5 * heading)
        self._pose.publish(pose)
        if self._joints is not None:
            self._joint_message.header.stamp = stamp
            self._joint_message.position = self.robot.joint_positions
            self._joints.publish(self._joint_message)
        self._publish_markers(stamp_ns)

    def _publish_feet(self, stamp_ns: int) -> Time:
        readings = self._sensors.read(self.robot)
        moments = self._sensors.read_moments(self.robot)
        wrench, position = self._wrench_message, self._position_message
        set_stamp(wrench.header.stamp, stamp_ns)
        position.header.stamp = wrench.header.stamp
        force, point = wrench.wrench.force, position.point
        for index, leg in enumerate(self.scene.legs):
            (force.x, force.y, force.z), (point.x, point.y, point.z) = readings[index]
            wrench.wrench.torque.z = moments[index] or 0.0
            wrench.header.frame_id = f'leg_{leg}_sole'
            self._wrenches[index].publish(wrench)
            self._positions[index].publish(position)
        stamp: Time = wrench.header.stamp
        return stamp

    def _publish_markers(self, stamp_ns: int) -> None:
        if self._markers and self._markers_pace and self._markers_pace.due(stamp_ns):
            assert self._marker_publisher
            message = self._markers.message(self.robot, self.pressures, stamp_ns)
            self._marker_publisher.publish(message)

    def tick(self) -> None:
        """Advance simulated time, but not the robot, by one sample; :meth:`step` calls this."""
        self.time_ns += self.period_ns
        if self._clock_publisher is not None:
            set_stamp(self._clock_message.clock, self.time_ns)
            self._clock_publisher.publish(self._clock_message)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(SimulatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
