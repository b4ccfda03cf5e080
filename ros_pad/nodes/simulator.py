# SPDX-License-Identifier: Apache-2.0
"""The simulator node: a simulated robot behind the topics of a real one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ros_pad.bags import topics
from ros_pad.contact import Foot
from ros_pad.errors import ConfigError, InvalidInput, LimitError
from ros_pad.estimation.tuning import SOURCES
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.markers import MARKERS_PERIOD_NS, WalkMarkers
from ros_pad.nodes.parameters import SCENE, SEED, Parameter
from ros_pad.nodes.qos import publisher
from ros_pad.pace import CONTROL_PERIOD_NS, LATE, Pace, RealTime
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
    Parameter('publish_clock', False, 'Stamp with simulated time, and publish it on /clock.'),
)

HIGHEST = 1e6
"""Highest gauge pressure that is accepted, Pa: no regulator's ceiling may exceed it."""

_LATEST_NS = 50_000_000  # difference of stamps from the clock up to which they stay even


class SimulatorNode(PadNode):
    """Simulate a robot from the pressures of its pads, and publish the readings of its sensors.

    These are samples of all feet, the pose of the body, and joint positions if the robot has
    joints. With the parameter ``sensing: joints`` they are the force on each foot in
    the axes of its link, IMU, positions, velocities and efforts of the joints, and, to compare
    with, the true pose of the body. Parameters are in :data:`PARAMETERS`. Pads are flat until
    their pressure is received. In real time, ``/diagnostics`` has once a second the wanted and the
    reached rate: where the computer is too slow, simulated time is left out.

    Parameters
    ----------
    free_running : bool
        Whether a timer steps the robot in real time; else a program does.
    **kwargs
        Passed on to `rclpy.node.Node`.

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
    answered : callable
        Called with a pressure record that answers the last block of samples, where a program steps
        the robot.

    Raises
    ------
    ConfigError
        When a parameter is not allowed.
    """

    def __init__(self, free_running: bool = True, **kwargs: Any) -> None:
        super().__init__('simulator', PARAMETERS, **kwargs)
        values, seed = self.values, self.values['seed']
        self.scene: Scene = values['scene']
        if values['foot'] is not None:
            self.scene = replace(self.scene, foot=values['foot'])
        self.period_ns = round(1e9 / self.scene.sensors.rate)
        self.floor = self.scene.floor.build(seed)
        joints = values['sensing'] == 'joints'
        try:
            level = fidelity.level(self.scene, values['fidelity'], joints=joints)
        except InvalidInput as error:
            raise ConfigError(f'node {self.get_name()}: {error}') from error
        period = self.period_ns * 1e-9
        self.robot = fidelity.build(with_terms(self.scene), self.floor, period, level)
        self._sensors: Sensors | BodySensors = Sensors(self.scene, seed)
        if joints:
            self._sensors = BodySensors(self.scene, seed, len(self.robot.joint_names))
        self.time_ns = self._last_ns = 0  # simulated time, and stamp of the last sample
        self.pressures = [0.0] * len(self.scene.legs)
        self._control_pace, self._markers_pace = Pace(CONTROL_PERIOD_NS), Pace(MARKERS_PERIOD_NS)
        self._markers = WalkMarkers(self.scene, self.floor)
        self._outputs = self._advertised(joints)
        self.receive_record(topics.PRESSURE, self.scene.legs, self._on_pressure)
        # Without a timer, the caller of step() reports fidelity level and verdict.
        self.answered: Callable[[], None] = lambda: None
        self._real_time: RealTime | None = None
        if free_running:
            choice = fidelity.choose(self.scene, level)
            self.get_logger().info(f'{self.scene.name} on {choice.level}: {choice.note}')
            # The timers cannot follow the clock that this node publishes.
            self.every(max(self.period_ns, CONTROL_PERIOD_NS) * 1e-9, self._on_timer)
            self.every(1.0, self._diagnose)

    def _advertised(self, joints: bool) -> dict[str, Callable[..., None]]:
        """Return a function for each topic, which publishes a message."""
        noise, moment = self.scene.sensors, ['moment'] * bool(self.scene.sensors.moment)
        pose = ('pose.position.x', 'pose.position.y', 'pose.orientation.z', 'pose.orientation.w')
        record, measured = topics.SAMPLE, ['force', 'position', *moment]
        if joints:
            record, measured = topics.FORCE, ['force', *moment]
        outputs: dict[str, Callable[..., None]] = {
            'markers': publisher(self, topics.MARKERS).publish,
            'pose': self.sender(topics.BODY_POSE, pose),
            'record': self.record_output(record, self.scene.legs, measured),
        }
        if self.values['publish_clock']:
            outputs['clock'] = self.sender(topics.CLOCK)
        if names := self.robot.joint_names:
            paths = ('position', *(('velocity', 'effort') if joints else ()))
            outputs['joints'] = self.sender(topics.JOINT_STATES, paths, constants={'name': names})
        if joints:
            covariances = {
                'orientation_covariance': [-1.0] + [0.0] * 8,  # it measures no orientation
                'angular_velocity_covariance': np.diag([noise.gyro**2] * 3).ravel(),
                'linear_acceleration_covariance': np.diag([noise.accelerometer**2] * 3).ravel(),
            }
            outputs['imu'] = self.sender(topics.IMU, topics.IMU.values, constants=covariances)
        return outputs

    def _on_pressure(self, block: Block) -> None:
        rows = block.rows[-1]
        # The true pressure acts on the pads, not what a faulty device reports.
        gauges = np.where(np.isfinite(rows['pad']), rows['pad'], rows['pressure']).tolist()
        for index, gauge in enumerate(gauges):
            if gauge > HIGHEST:
                error = LimitError(f'{gauge:g} Pa gauge: at most {HIGHEST:g} Pa is allowed')
                self.refuse(f'leg {self.scene.legs[index]}, {topics.PRESSURE.name()}', error)
            elif math.isfinite(gauge):
                # A sensor at rest may read slightly below ambient; the pad is flat then.
                self.pressures[index] = max(0.0, gauge)
        if block.last_ns == self._last_ns:
            self.answered()

    def _on_timer(self) -> None:
        now_ns = time.monotonic_ns()
        if self._real_time is None:  # what passed before the executor spun is no delay
            self._real_time = RealTime(self.period_ns, now_ns)
        # Half a period ahead, because a timer of the same period may come early or late.
        due = self._real_time.due(now_ns + self.period_ns // 2)
        if due:
            self._advance(due)
        if self.robot.verdict:
            text = f'the walk is not valid after {self.robot.time:.3f} s: {self.robot.verdict}'
            self.get_logger().error(text, once=True)

    def _diagnose(self) -> None:
        if self._real_time is None:
            return
        speed, wanted = self._real_time.speed(time.monotonic_ns()), 1e9 / self.period_ns
        text, level = f'{speed * wanted:.0f} of {wanted:.0f} samples a second', self.OK
        if speed < 0.95:
            text, level = f'{LATE}: {text}: choose L1, or a faster computer', self.WARN
            self.get_logger().warning(text, throttle_duration_sec=10.0)
        values = {
            'wanted rate (Hz)': f'{wanted:.1f}',
            'reached rate (Hz)': f'{speed * wanted:.1f}',
            'speed (times real time)': f'{speed:.3f}',
        }
        now_ns = self.time_ns if self.values['publish_clock'] else self.now_ns()
        self.report(now_ns, [self.status('rate', level, text, values)])

    def step(self, end_ns: int) -> bool:
        """Advance the robot to the next control moment, and publish what its sensors read.

        The walk may end before, at a simulated time, ns, or with a verdict. Return whether the
        samples will be answered: those before a control moment are not.
        """
        samples, due = 0, False
        while not due and self.time_ns + samples * self.period_ns < end_ns:
            samples += 1
            due = self._control_pace.due(self.time_ns + samples * self.period_ns)
        return self._advance(samples) == samples and due

    def _advance(self, samples: int) -> int:
        """Advance the robot by some samples, fewer if its walk ends; publish and count them."""
        simulated, first_ns = self.values['publish_clock'], self.time_ns + self.period_ns
        if not simulated:
            # Stamps are even, unless time was lost.
            first_ns = self._last_ns + self.period_ns
            begun_ns = self.now_ns() - (samples - 1) * self.period_ns
            if abs(first_ns - begun_ns) > _LATEST_NS:
                first_ns = begun_ns
        stamps = first_ns + self.period_ns * np.arange(samples)
        rows = SAMPLE.rows(samples, len(self.scene.legs))
        # Forces go first: a reading of the joints waits for them only until the next one.
        later: list[tuple[str, tuple[Any, ...]]] = []
        count = 0
        for row, stamp_ns in zip(rows, stamps.tolist(), strict=True):
            count += 1
            self.robot.step(self.pressures)
            x, y, heading = self.robot.body
            turn = math.sin(0.5 * heading), math.cos(0.5 * heading)
            self._outputs['pose'](stamp_ns, x, y, *turn)
            if isinstance(self._sensors, Sensors):
                row[:] = self._sensors.sample(self.robot)
            else:
                assert isinstance(self.robot, FullRobot)
                reading = self._sensors.read(self.robot.proprioception(), self.robot.time)
                row[:] = reading.rows
                later.append(('imu', (stamp_ns, *reading.imu.ravel().tolist())))
                later.append(('joints', (stamp_ns, *reading.joints)))
            if self.robot.verdict and simulated:
                break
        self._last_ns = stamp_ns
        self.tick(count)
        self._outputs['record'](Block(stamps[:count], rows[:count]))
        if self.robot.joint_names and not later:
            later.append(('joints', (stamp_ns, self.robot.joint_positions)))
        for name, values in later:
            self._outputs[name](*values)
        if self._markers_pace.due(stamp_ns):
            markers = self._markers.message(self.robot, self.pressures, stamp_ns)
            self._outputs['markers'](markers)
        return count

    def tick(self, samples: int = 1) -> None:
        """Advance simulated time, but not the robot; :meth:`step` does both."""
        self.time_ns += samples * self.period_ns
        if self.values['publish_clock']:
            self._last_ns = self.time_ns
            self._outputs['clock'](self.time_ns)
