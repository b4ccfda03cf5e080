# SPDX-License-Identifier: Apache-2.0
"""The body estimator node: motion of body and feet from IMU, joints and forces, without markers.

It publishes what an estimator with ``source: joints`` needs of each foot, and ``odom``. The reason
why the motion must not be relied on is published on ``body/doubt`` and on ``/diagnostics``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ros_pad.bags import topics
from ros_pad.bags.codec import message_type, put_field
from ros_pad.bags.topics import FRAME, STAMP
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.nodes import qos
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import LEGS, Parameter
from ros_pad.nodes.qos import message_class
from ros_pad.pace import CONTROL_PERIOD_NS, Pace
from ros_pad.records import SAMPLE, Block, split
from ros_pad.sensing import BodyEstimate, SensingStage
from ros_pad.sensing.mapping import Mapping
from ros_pad.sensing.settings import SETTINGS
from ros_pad.sensing.stage import SET_BACK_NS, estimator_of, robot_of, sample_of, twist_of

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

_ABSENT = ('angular_velocity_covariance[0]', 'linear_acceleration_covariance[0]')
_TRANSFORM = 'geometry_msgs/msg/TransformStamped'
_POSE = (
    *(f'transform.translation.{axis}' for axis in 'xyz'),
    *(f'transform.rotation.{axis}' for axis in 'xyzw'),
)
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
        if any(abs(stamp_ns - each) > SET_BACK_NS for each in self._rows):
            self._flush()  # a clock that leapt: one message has the records of one period
        self._rows[stamp_ns] = rows
        if self._pace.due(stamp_ns):
            self._flush()
            self._sent_ns = stamp_ns

    def _flush(self) -> None:
        stamps = sorted(self._rows)
        self._send(Block(np.array(stamps), np.array([self._rows[n] for n in stamps])))
        self._rows = {}


class BodyEstimatorNode(PadNode):
    """Estimate the motion of body and feet; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    stage : SensingStage

    Raises
    ------
    ConfigError
        When a parameter is not allowed, or the robot has another number of legs.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('body_estimator', PARAMETERS, **kwargs)
        values, legs = self.values, self.values['legs']
        try:
            self._robot = robot = robot_of(values)
            mapping = Mapping.load(values['mapping'], robot) if values['mapping'] else None
            if len(robot.legs) != len(legs):
                raise ConfigError(f'parameter legs = {list(legs)}: {len(robot.legs)} are needed')
        except (ConfigError, InvalidInput) as error:
            raise ConfigError(
                f'node {self.get_name()}: parameter robot = {values["robot"]!r} or mapping ='
                f' {values["mapping"]!r} is not allowed: {error}'
            ) from error
        self._lasting = ''  # what is always in doubt
        if mapping:
            values['force_axes'] = mapping.force_axes
            for text in mapping.missing:
                self.get_logger().warning(f'mapping {mapping.name}: {text}')
                # Without tangential forces nothing can be learnt about the ground.
                self._lasting = self._lasting or (text if text.startswith('friction') else '')
        self._rate = np.zeros(3)  # last angular velocity, IMU axes, rad/s
        self.stage = SensingStage(
            robot,
            estimator_of(robot, values),
            self._take,
            self._publish_doubt,
            self._warn,
            values['forces'],
        )
        self._standard = Mapping.load('default', robot)
        self._samples = _Samples(self.record_output(topics.SAMPLE, legs), len(legs))
        self._doubts = self.sender(topics.BODY_DOUBT, topics.BODY_DOUBT.values)
        twist = (*(f'twist.{each}' for each in _TWIST), 'twist.covariance')
        paths = (*topics.ODOM.values, 'pose.covariance', *twist)
        base = {'child_frame_id': values['base_frame']}
        self._send_odom = self.sender(topics.ODOM, paths, constants=base)
        self._transform = message_type(topics.TF.type_name).blank(_TRANSFORM)
        for path, value in (base | {FRAME: topics.TF.frame}).items():
            put_field(self._transform, path, value)
        self._send_tf = self.sender(topics.TF, ('transforms',)) if values['publish_tf'] else None
        if mapping:
            self._follow(mapping)
        else:
            self.receive_record(topics.FORCE, legs, self._on_forces)
            self.receive(topics.IMU, self._on_imu, (*_ABSENT, *topics.IMU.values))
            self.receive_message(topics.JOINT_STATES, self._on_joints)
        self.on_tick(self._look)

    def _follow(self, mapping: Mapping) -> None:
        """Subscribe to the topics of a mapping."""

        def take(topic: str, message: Any) -> None:
            try:
                readings = mapping.read(topic, message, self.now_ns())
            except InvalidInput as error:
                self.stage.reject(error)
                return
            if readings.gyro is not None:
                self._rate = readings.gyro
            readings.pass_to(self.stage)

        for source in mapping.sources:
            callback = partial(take, source.topic)
            kind = message_class(source.type_name)
            self.create_subscription(kind, source.topic, callback, qos.SENSOR)

    def _on_forces(self, block: Block) -> None:
        self.advance(block.last_ns)
        for stamp_ns, rows in zip(block.stamps.tolist(), block.rows['force'], strict=True):
            for index, force in enumerate(rows):
                if np.isfinite(force).all():
                    self.stage.force(index, stamp_ns, force)
        self._samples.settle('forces', block.last_ns, self.simulated)

    def _on_imu(
        self, stamp_ns: int, no_gyro: float, no_accelerometer: float, *values: float
    ) -> None:
        if -1.0 in (no_gyro, no_accelerometer):  # as the message defines it
            name = 'angular_velocity' if no_gyro == -1.0 else 'linear_acceleration'
            self.stage.reject(InvalidInput(f'{name}_covariance[0] = -1: the IMU must measure it'))
            return
        if math.isfinite(sum(values)):
            self._rate = np.array(values[:3])
            self.stage.imu(stamp_ns, values[:3], values[3:])
        self._samples.settle('imu', stamp_ns, self.simulated)

    def _on_joints(self, message: Any) -> None:
        try:
            readings = self._standard.read('joint_states', message, 0)
        except InvalidInput as error:
            self.stage.reject(error)
            return
        readings.pass_to(self.stage)
        self._samples.settle('joints', readings.stamp, self.simulated)

    def _take(self, stamp_ns: int, estimate: BodyEstimate) -> None:
        """Publish an estimate of the body, and collect what it shows of the feet."""
        estimate = estimate._replace(doubt=estimate.doubt or self._lasting)
        pose = [*estimate.position.tolist(), *estimate.orientation.tolist()]
        rate = self._robot.imu[:3, :3] @ self._rate
        velocity, covariance = twist_of(estimate, rate, self.values['gyro_noise'])
        matrices = estimate.covariance[:6, :6].ravel(), covariance.ravel()
        self._send_odom(stamp_ns, *pose, matrices[0], *velocity.tolist(), matrices[1])
        if self._send_tf:
            for path, value in zip((*STAMP, *_POSE), (*split(stamp_ns), *pose), strict=True):
                put_field(self._transform, path, value)
            self._send_tf([self._transform])
        self._samples.add(stamp_ns, sample_of(estimate))

    def _publish_doubt(self, doubt: str) -> None:
        self._doubts(doubt or self._lasting)

    def _warn(self, error: InvalidInput) -> None:
        self.get_logger().warning(f'reading ignored: {error}', throttle_duration_sec=1.0)

    def _look(self, now_ns: int) -> None:
        """Look for silent sensors, and report on the motion."""
        stage = self.stage
        stage.tick(now_ns)
        if not self.due(now_ns, (stage.doubt or '').partition(':')[0]):
            return
        waits, doubt = stage.doubt is None, stage.doubt or self._lasting
        text = 'no sample yet' if waits else doubt or 'the motion is known'
        level = self.WARN if waits or doubt else self.OK
        values = {
            'samples': stage.samples,
            'forces': stage.force_source or 'none',
            'joint velocities': 'from positions' if stage.differentiates else 'measured',
        }
        status = self.status('sensing', level, text, values, self._robot.name)
        self.report(now_ns, [status, *self.rate(now_ns, stage.samples, stage.last_ns)])
