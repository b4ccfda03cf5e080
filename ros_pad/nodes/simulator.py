# SPDX-License-Identifier: Apache-2.0
"""The simulator node: a simulated robot behind the topics of a real one."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node

from ros_pad.bags.topics import STAMP
from ros_pad.contact import Foot
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.estimation.tuning import SOURCES
from ros_pad.nodes import topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.markers import ARRAY, WalkMarkers
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import SCENE, SEED, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import split
from ros_pad.pace import CONTROL_PERIOD_NS, LATE, Pace, Rate, RealTime
from ros_pad.records import SAMPLE, Block
from ros_pad.simulation import fidelity
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.sensors import BodySensors, Sensors
from ros_pad.simulation.terms import with_terms

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
        'sensing',
        'markers',
        'Sensors: markers, or joints with IMU and forces in the axes of the feet (L2).',
        choices=SOURCES,
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
)

HIGHEST = 1e6
"""Highest gauge pressure that is accepted, Pa: no regulator's ceiling may exceed it."""

_SLOWEST = 50.0  # Hz, lowest rate that scenes allow
_REPORT_PERIOD_NS = 1_000_000_000
_LATEST_NS = 50_000_000  # difference of stamps from the clock up to which they stay even


class SimulatorNode(Node):
    """Simulate a robot from the pressures of its pads, and publish the readings of its sensors.

    These are samples of all feet, the pose of the body, and joint positions if the robot has
    joints. With the parameter ``sensing: joints`` they are the force on each foot in
    the axes of its link, IMU, positions, velocities and efforts of the joints, and, to compare
    with, the true pose of the body. Parameters are in :data:`PARAMETERS`. Pads are flat until
    their pressure is received. In real time, ``/diagnostics`` has once a second the wanted and the
    reached rate: where the computer is too slow, simulated time is left out.

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
    messages : Messages
        Publishers and subscriptions.
    answered : callable
        Called with a pressure record that answers the last block of samples, where a program steps
        the robot.

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
        joints = values['sensing'] == 'joints'
        try:
            level = fidelity.level(self.scene, values['fidelity'], joints=joints)
        except InvalidInput as error:
            raise ConfigError(f'node {self.get_name()}: {error}') from error
        scene, period = with_terms(self.scene), self.period_ns * 1e-9
        self.robot = fidelity.build(scene, self.floor, period, level)
        self._sensors = Sensors.of(self.scene, values['seed'])
        self._body_sensors: BodySensors | None = None
        if joints:
            count = len(self.robot.joint_names)
            self._body_sensors = BodySensors(self.scene, values['seed'], count)
        self.time_ns = 0
        self.pressures = [0.0] * len(self.scene.legs)
        self._pace = Pace(CONTROL_PERIOD_NS)
        self.messages = Messages(self)
        self.messages.receive_record(topics.PRESSURE, self.scene.legs, self._on_pressure)
        rate = values['markers_rate']
        self._markers = WalkMarkers(self.scene, self.floor) if rate else None
        self._markers_pace = Pace(round(1e9 / rate)) if rate else None
        self._simulated = values['publish_clock']
        self._advertise()
        # Without a timer, the caller of step() reports fidelity level and verdict.
        self._ended = False
        self.answered: Callable[[], None] = lambda: None
        self._last_ns = 0  # stamp of the last sample
        if values['free_running']:
            choice = fidelity.choose(self.scene, level)
            self.get_logger().info(f'{self.scene.name} on {choice.level}: {choice.note}')
            self._diagnostics = Diagnostics(self, self.messages)
            self._real_time: RealTime | None = None
            self._report_ns = 0  # time of the next message on /diagnostics
            # The timer cannot follow the clock that this node publishes.
            steady = NodeClock(clock_type=ClockType.STEADY_TIME)
            period = max(self.period_ns, CONTROL_PERIOD_NS)
            self.create_timer(period * 1e-9, self._on_timer, clock=steady)

    def _advertise(self) -> None:
        """Create the publishers."""
        messages, joints = self.messages, self.robot.joint_names
        self._send_markers = messages.output(topics.MARKERS) if self._markers else None
        self._send_clock = (
            messages.sender(topics.CLOCK, topics.CLOCK.schema.values) if self._simulated else None
        )
        pose = ('pose.position.x', 'pose.position.y', 'pose.orientation.z', 'pose.orientation.w')
        self._send_pose = messages.sender(topics.BODY_POSE, (*STAMP, *pose))
        record = topics.FORCE if self._body_sensors else topics.SAMPLE
        measured = ['force'] if self._body_sensors else ['force', 'position']
        measured += ['moment'] * bool(self.scene.sensors.moment)
        self._send_block = messages.record_output(record, self.scene.legs, measured)
        parts = ('position', 'velocity', 'effort') if self._body_sensors else ('position',)
        angles = [f'{part}[{place}]' for part in parts for place in range(len(joints))]
        zeros = {'name': joints} | {part: [0.0] * len(joints) for part in parts}
        if joints:
            self._send_joints = messages.sender(
                topics.JOINT_STATES, (*STAMP, *angles), constants=zeros
            )
        if self._body_sensors:
            noise = self.scene.sensors
            still = {
                'orientation_covariance': [-1.0] + [0.0] * 8,  # it measures no orientation
                'angular_velocity_covariance': np.diag([noise.gyro**2] * 3).ravel(),
                'linear_acceleration_covariance': np.diag([noise.accelerometer**2] * 3).ravel(),
            }
            imu = (*STAMP, *topics.IMU.schema.values)
            self._send_imu = messages.sender(topics.IMU, imu, constants=still)

    def _on_pressure(self, block: Block) -> None:
        rows = block.rows[-1]
        # The true pressure acts on the pads, not what a faulty device reports.
        gauges = np.where(np.isfinite(rows['pad']), rows['pad'], rows['pressure']).tolist()
        for index, gauge in enumerate(gauges):
            if gauge > HIGHEST:
                self.get_logger().warning(
                    f'leg {self.scene.legs[index]}: pressure of {gauge:g} Pa gauge ignored: at'
                    f' most {HIGHEST:g} Pa is allowed',
                    throttle_duration_sec=1.0,
                )
            elif math.isfinite(gauge):
                # A sensor at rest may read slightly below ambient; the pad is flat then.
                self.pressures[index] = max(0.0, gauge)
        if block.last_ns == self._last_ns:
            self.answered()

    def _on_timer(self) -> None:
        now_ns = time.monotonic_ns()
        if self._real_time is None:  # what passed before the executor spun is no delay
            self._real_time = RealTime(self.period_ns, now_ns)
            self._report_ns = now_ns + _REPORT_PERIOD_NS
        # Half a period ahead, because a timer of the same period may come early or late.
        due = self._real_time.due(now_ns + self.period_ns // 2)
        if due:
            self._advance(due)
        if self.robot.verdict and not self._ended:
            self._ended = True
            self.get_logger().error(
                f'the walk is not valid after {self.robot.time:.3f} s: {self.robot.verdict}'
            )
        if now_ns >= self._report_ns:
            self._report_ns = now_ns + _REPORT_PERIOD_NS
            self._diagnose(self._real_time.rate(now_ns))

    def _diagnose(self, rate: Rate) -> None:
        late = rate.reached < 0.95 * rate.wanted
        text = f'{rate.reached:.0f} of {rate.wanted:.0f} samples a second'
        if late:
            text = f'{LATE}: {text}: choose a lower rate, L1, or a faster computer'
            self.get_logger().warning(text, throttle_duration_sec=10.0)
        values = {
            'wanted rate (Hz)': f'{rate.wanted:.1f}',
            'reached rate (Hz)': f'{rate.reached:.1f}',
            'speed (times real time)': f'{rate.speed:.3f}',
        }
        status = self._diagnostics.status(
            'rate', Diagnostics.WARN if late else Diagnostics.OK, text, values
        )
        now_ns = self.time_ns if self._simulated else self.messages.now_ns()
        self._diagnostics.send(now_ns, [status])

    def step(self, end_ns: int) -> bool:
        """Advance the robot to the next control moment, and publish what its sensors read.

        The walk may end before, at a simulated time, ns, or with a verdict. Return whether the
        samples will be answered: those before a control moment are not.
        """
        samples, due = 0, False
        while not due and self.time_ns + samples * self.period_ns < end_ns:
            samples += 1
            due = self._pace.due(self.time_ns + samples * self.period_ns)
        return self._advance(samples) == samples and due

    def _advance(self, samples: int) -> int:
        """Advance the robot by some samples, fewer if its walk ends; publish and count them."""
        first_ns = self.time_ns + self.period_ns
        if not self._simulated:
            # Stamps are even, unless time was lost.
            first_ns = self._last_ns + self.period_ns
            begun_ns = self.messages.now_ns() - (samples - 1) * self.period_ns
            if abs(first_ns - begun_ns) > _LATEST_NS:
                first_ns = begun_ns
        stamps = first_ns + self.period_ns * np.arange(samples)
        rows = SAMPLE.rows(samples, len(self.scene.legs))
        # Forces go first: a reading of the joints waits for them only until the next one.
        later: list[tuple[Callable[..., None], tuple[float, ...]]] = []
        count = 0
        for row, stamp_ns in zip(rows, stamps.tolist(), strict=True):
            count += 1
            self.robot.step(self.pressures)
            stamp = split(stamp_ns)
            x, y, heading = self.robot.body
            self._send_pose(*stamp, x, y, math.sin(0.5 * heading), math.cos(0.5 * heading))
            if self._body_sensors:
                row[:] = self._sense(stamp, later)
            else:
                row[:] = self._sensors.sample(self.robot)
            if self.robot.verdict and self._simulated:
                break
        self._last_ns = int(stamps[count - 1])
        self.tick(count)
        self._send_block(Block(stamps[:count], rows[:count]))
        for send, values in later:
            send(*values)
        if self.robot.joint_names and not self._body_sensors:
            self._send_joints(*split(self._last_ns), *self.robot.joint_positions)
        if self._markers and self._markers_pace and self._markers_pace.due(self._last_ns):
            assert self._send_markers
            array = self._markers.message(self.robot, self.pressures, self._last_ns)
            self._send_markers(ARRAY.encode(array))
        return count

    def _sense(self, stamp: tuple[int, int], later: list[tuple[Any, Any]]) -> np.ndarray:
        """Return readings of the feet in their own axes; add those of IMU and joints."""
        assert self._body_sensors
        assert isinstance(self.robot, FullRobot)
        reading = self._body_sensors.read(self.robot.proprioception(), self.robot.time)
        later.append((self._send_imu, (*stamp, *reading.imu.ravel().tolist())))
        later.append((self._send_joints, (*stamp, *reading.joints.ravel().tolist())))
        return reading.rows

    def tick(self, samples: int = 1) -> None:
        """Advance simulated time, but not the robot; :meth:`step` does both."""
        self.time_ns += samples * self.period_ns
        if self._send_clock:
            self._last_ns = self.time_ns
            self._send_clock(*split(self.time_ns))


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(SimulatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
