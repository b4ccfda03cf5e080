# SPDX-License-Identifier: Apache-2.0
"""The body estimator node: motion of body and feet from IMU, joints and forces, without markers.

It publishes what an estimator with ``source: joints`` needs of each foot, and ``odom``. The reason
why the motion must not be relied on is published on ``body/doubt`` and on ``/diagnostics``.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ros_pad.bags.topics import STAMP
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.nodes import qos, topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.listening import message_class
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import LEGS, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import nanoseconds, set_stamp, split
from ros_pad.pace import CONTROL_PERIOD_NS, TICK_PERIOD_NS, Pace
from ros_pad.records import SAMPLE, Block
from ros_pad.robots import Robot
from ros_pad.sensing import BodyEstimate, SensingStage
from ros_pad.sensing.mapping import Mapping
from ros_pad.sensing.stage import (
    SET_BACK_NS,
    SETTINGS,
    JointOrder,
    estimator_of,
    robot_of,
    sample_of,
    twist_of,
)

PARAMETERS = (
    LEGS,
    Parameter(
        'robot', 'ch3r', 'Name of a robot in config/robots, or path of a YAML or URDF file.'
    ),
    Parameter(
        'feet',
        '',
        'For URDF: links at the ends of the legs, in the order of legs, with commas between them.',
    ),
    Parameter('imu_link', '', 'For URDF: link of the IMU; empty: the base.'),
    Parameter(
        'foot_radius',
        -1.0,
        'Radius with which the feet roll; below 0: that of the YAML file, 0 for URDF.',
        'm',
        -1.0,
        1.0,
    ),
    Parameter(
        'mapping',
        '',
        'Name of a mapping in config/mappings, or path of a YAML file: what the topics of another'
        ' robot mean; empty: imu/data, joint_states and leg_i/foot_wrench.',
    ),
    *(Parameter(**vars(setting)) for setting in SETTINGS),
    Parameter(
        'publish_tf',
        False,
        'Publish the transform odom -> base_link on /tf; only one node may.',
    ),
    Parameter('base_frame', 'base_link', 'Frame of the base, the child of odom.'),
)

_SOURCES = {
    'feet': 'measured at the feet',
    'efforts': 'from the efforts of the joints',
    '': 'neither measured at the feet nor from efforts of the joints',
}

_RATE = tuple(f'angular_velocity.{axis}' for axis in 'xyz')
_PULL = tuple(f'linear_acceleration.{axis}' for axis in 'xyz')
_ABSENT = ('angular_velocity_covariance[0]', 'linear_acceleration_covariance[0]')
_MATRIX = [f'covariance[{place}]' for place in range(36)]
_TWIST = [f'twist.{part}.{axis}' for part in ('linear', 'angular') for axis in 'xyz']


class _Samples:
    """Samples of the feet, sent by control period; in simulated time one for each moment."""

    def __init__(self, send: Callable[[Block], None], legs: int) -> None:
        self._send, self._legs = send, legs
        self._pace = Pace(CONTROL_PERIOD_NS)
        self._rows: dict[int, np.ndarray] = {}  # of the next block, by stamp
        self._seen = dict.fromkeys(('forces', 'imu', 'joints'), 0)  # last stamps, ns
        self._sent_ns = 0

    def settle(self, source: str, stamp_ns: int, simulated: bool) -> None:
        """Note how far a source has come. A simulated moment without an estimate has none."""
        self._seen[source] = stamp_ns
        moment_ns = min(self._seen.values())
        if simulated and moment_ns not in self._rows:
            self.add(moment_ns, SAMPLE.rows(self._legs))

    def add(self, stamp_ns: int, rows: np.ndarray) -> None:
        """Send what was collected, if the estimates of the feet are due at this moment."""
        if stamp_ns <= self._sent_ns < stamp_ns + SET_BACK_NS:
            return  # the moment has been sent without it
        self._rows[stamp_ns] = rows
        if self._pace.due(stamp_ns):
            stamps = sorted(self._rows)
            self._send(Block(np.array(stamps), np.array([self._rows[n] for n in stamps])))
            self._rows, self._sent_ns = {}, stamp_ns


class BodyEstimatorNode(Node):
    """Estimate the motion of body and feet; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    stage : SensingStage
    messages : Messages
        Publishers and subscriptions.

    Raises
    ------
    ConfigError
        When a parameter is not allowed, or the robot has another number of legs.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'body_estimator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        values = declare(self, PARAMETERS)
        self._robot = robot = self._load(values)
        mapping = self._mapped(values)
        if mapping:
            values['force_axes'] = mapping.force_axes
        self._force_source = ''  # as reported last
        self._rate = np.zeros(3)  # last angular velocity, IMU axes, rad/s
        self.messages = Messages(self)
        self.stage = SensingStage(
            robot,
            estimator_of(robot, values),
            self._take,
            self._publish_doubt,
            self._warn,
            values['forces'],
        )
        self._gyro_noise: float = values['gyro_noise']
        self._order = JointOrder(robot)
        send = self.messages.record_output(topics.SAMPLE, values['legs'])
        self._samples = _Samples(send, len(values['legs']))
        self._send_odom = self._odometry(values['base_frame'])
        self._doubts = self.messages.output(topics.BODY_DOUBT)
        self._send_tf = self._transforms(values['base_frame']) if values['publish_tf'] else None
        if mapping:
            self._follow(mapping)
        else:
            self._subscribe(values['legs'])
        self._diagnostics = Diagnostics(self, self.messages)
        self._health_pace = Pace(TICK_PERIOD_NS)
        self.messages.on_tick(TICK_PERIOD_NS * 1e-9, self._tick)

    def _load(self, values: dict[str, Any]) -> Robot:
        try:
            robot = robot_of(values)
        except (ConfigError, InvalidInput) as error:
            raise ConfigError(
                f'node {self.get_name()}: parameter robot = {values["robot"]!r} is not allowed:'
                f' {error}'
            ) from error
        if len(robot.legs) != len(values['legs']):
            raise ConfigError(
                f'node {self.get_name()}: parameter legs = {list(values["legs"])} is not allowed:'
                f' robot {values["robot"]!r} has {len(robot.legs)} legs'
            )
        return robot

    def _mapped(self, values: dict[str, Any]) -> Mapping | None:
        """Return the mapping of another robot's topics; set what is always in doubt with it."""
        self._lasting = ''
        if not values['mapping']:
            return None
        try:
            mapping = Mapping.load(values['mapping'], self._robot)
        except ConfigError as error:
            raise ConfigError(
                f'node {self.get_name()}: parameter mapping = {values["mapping"]!r} is not'
                f' allowed: {error}'
            ) from error
        for text in mapping.missing:
            self.get_logger().warning(f'mapping {mapping.name}: {text}')
        # Without tangential forces nothing can be learnt about the ground, whatever slips.
        self._lasting = next((text for text in mapping.missing if text.startswith('friction')), '')
        return mapping

    def _follow(self, mapping: Mapping) -> None:
        """Subscribe to the topics of a mapping."""
        for source in mapping.sources:
            self.create_subscription(
                message_class(source.type_name),
                source.topic,
                self._source_callback(mapping, source.topic),
                qos.SENSOR,
            )

    def _source_callback(self, mapping: Mapping, topic: str) -> Callable[[Any], None]:
        def callback(message: Any) -> None:
            try:
                readings = mapping.read(topic, message, self.messages.now_ns())
            except InvalidInput as error:
                self.stage.reject(error)
                return
            if readings.gyro is not None:
                self._rate = readings.gyro
            readings.pass_to(self.stage)

        return callback

    def _odometry(self, base: str) -> Callable[..., None]:
        """Return a function that publishes odom."""
        pose, twist = ([f'{part}.{place}' for place in _MATRIX] for part in ('pose', 'twist'))
        paths = [*STAMP, *topics.ODOM.schema.values, *pose]
        paths += [*(f'twist.{each}' for each in _TWIST), *twist]
        constants = {'child_frame_id': base}
        return self.messages.sender(topics.ODOM, paths, constants=constants)

    def _transforms(self, base: str) -> Callable[[int, BodyEstimate], None]:
        """Return a function that publishes the transform from odom to the base."""
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError as error:
            raise ConfigError(
                f'node {self.get_name()}: parameter publish_tf = True is not allowed: the package'
                f' tf2_msgs of ROS is not found ({error})'
            ) from error
        publisher = self.create_publisher(TFMessage, '/tf', topics.ODOM.publish)

        def send(stamp_ns: int, estimate: BodyEstimate) -> None:
            transform = TransformStamped(child_frame_id=base)
            transform.header.frame_id = topics.ODOM.schema.frame
            set_stamp(transform.header.stamp, stamp_ns)
            place, turn = transform.transform.translation, transform.transform.rotation
            place.x, place.y, place.z = estimate.position.tolist()
            turn.x, turn.y, turn.z, turn.w = estimate.orientation.tolist()
            publisher.publish(TFMessage(transforms=[transform]))

        return send

    def _subscribe(self, legs: list[int]) -> None:
        messages = self.messages
        messages.receive_record(topics.FORCE, legs, self._on_forces)
        messages.receive(topics.IMU, self._on_imu, (*STAMP, *_ABSENT, *_RATE, *_PULL))
        messages.receive(topics.JOINT_STATES, self._on_joints)

    def _on_forces(self, block: Block) -> None:
        if self.messages.simulated:
            self.messages.advance(block.last_ns)
            self._tick(block.last_ns)
        for stamp_ns, rows in zip(block.stamps.tolist(), block.rows['force'], strict=True):
            for index, force in enumerate(rows):
                if np.isfinite(force).all():
                    self.stage.force(index, stamp_ns, force)
        self._samples.settle('forces', block.last_ns, self.messages.simulated)

    def _on_imu(
        self, sec: int, nanosec: int, no_gyro: float, no_accelerometer: float, *values: float
    ) -> None:
        for name, absent in (
            ('angular_velocity', no_gyro),
            ('linear_acceleration', no_accelerometer),
        ):
            if absent == -1.0:  # as the message defines it
                error = f'{name}_covariance[0] = -1: the IMU does not measure {name}, but it must'
                self.stage.reject(InvalidInput(error))
                return
        stamp_ns = sec * 1_000_000_000 + nanosec
        if math.isfinite(sum(values)):
            self._rate = np.array(values[:3])
            self.stage.imu(stamp_ns, values[:3], values[3:])
        self._samples.settle('imu', stamp_ns, self.messages.simulated)

    def _on_joints(self, message: JointState) -> None:
        try:
            values = self._order(message.name, message.position, message.velocity, message.effort)
        except InvalidInput as error:
            self.stage.reject(error)
            return
        stamp_ns = nanoseconds(message.header.stamp)
        if np.isfinite(values[0]).all():
            self.stage.joints(stamp_ns, *values)
        self._samples.settle('joints', stamp_ns, self.messages.simulated)

    def _take(self, stamp_ns: int, estimate: BodyEstimate) -> None:
        """Publish an estimate of the body, and collect what it shows of the feet."""
        if self.stage.force_source != self._force_source:
            self._force_source = self.stage.force_source
            text = _SOURCES[self._force_source]
            self.get_logger().info(f'forces of the feet: {text}', throttle_duration_sec=1.0)
        estimate = estimate._replace(doubt=estimate.doubt or self._lasting)
        values = [*split(stamp_ns), *estimate.position.tolist(), *estimate.orientation.tolist()]
        values += estimate.covariance[:6, :6].ravel().tolist()
        rate = self._robot.imu[:3, :3] @ self._rate
        velocity, covariance = twist_of(estimate, rate, self._gyro_noise)
        values += (*velocity.tolist(), *covariance.ravel().tolist())
        self._send_odom(*values)
        if self._send_tf:
            self._send_tf(stamp_ns, estimate)
        self._samples.add(stamp_ns, sample_of(estimate))

    def _publish_doubt(self, doubt: str) -> None:
        self._doubts(String(data=doubt or self._lasting))

    def _warn(self, error: InvalidInput) -> None:
        self.get_logger().warning(f'reading ignored: {error}', throttle_duration_sec=1.0)

    def _tick(self, now_ns: int) -> None:
        if not self._health_pace.due(now_ns):
            return
        self.stage.tick(now_ns)
        kind = (self.stage.doubt or '').partition(':')[0]
        if self._diagnostics.due(now_ns, kind):
            statuses = [self._status()]
            if not self.messages.simulated:
                stage = self.stage
                statuses.append(self._diagnostics.rate(now_ns, stage.samples, stage.last_ns))
            self._diagnostics.send(now_ns, statuses)

    def _status(self) -> DiagnosticStatus:
        """Return the doubt and the sources of the estimate, for ``/diagnostics``."""
        stage = self.stage
        waits = stage.doubt is None
        doubt = stage.doubt or self._lasting
        text = 'no sample yet' if waits else doubt or 'the motion is known'
        level = Diagnostics.WARN if waits or doubt else Diagnostics.OK
        values = {
            'samples': stage.samples,
            'forces': stage.force_source or 'none',
            'joint velocities': 'from positions' if stage.differentiates else 'measured',
        }
        return self._diagnostics.status('sensing', level, text, values, self._robot.name)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(BodyEstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
