# SPDX-License-Identifier: Apache-2.0
"""The topics of ros_pad: name, message type, unit, and the values that a trial reads.

Nodes add message class and QoS to this table, in `ros_pad.nodes.topics`.
"""

from __future__ import annotations

from dataclasses import dataclass

STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
FRAME = 'header.frame_id'


@dataclass(frozen=True)
class Topic:
    """A topic, or one per leg.

    Attributes
    ----------
    pattern : str
        The name, with ``{leg}`` in place of the leg's number.
    type_name : str
        The message type, such as ``std_msgs/msg/Float64``.
    unit : str
        Unit of the values; empty if they have none.
    frame : str
        ``header.frame_id``, with ``{leg}`` as in the name; empty if ros_pad writes none.
    values : tuple of str
        Fields of a message that a trial reads, such as ``wrench.force.x``: numbers, or one text.
    text : bool
        Whether the one value is a text.
    """

    pattern: str
    type_name: str
    unit: str = ''
    frame: str = ''
    values: tuple[str, ...] = ()
    text: bool = False

    @property
    def kind(self) -> str:
        """The name without ``leg_{leg}/`` and without the leading slash."""
        return self.pattern.removeprefix('leg_{leg}/').removeprefix('/')

    def name(self, leg: int | None = None) -> str:
        """Return the name; a topic of each leg needs the number of the leg."""
        return self.pattern.format(leg=leg)


PRESSURE = Topic(
    'leg_{leg}/pressure',
    'sensor_msgs/msg/FluidPressure',
    'Pa absolute',
    'leg_{leg}_pad',
    ('fluid_pressure',),
)
PRESSURE_SETPOINT = Topic(
    'leg_{leg}/pressure_setpoint',
    'sensor_msgs/msg/FluidPressure',
    'Pa absolute',
    'leg_{leg}_pad',
    ('fluid_pressure',),
)
WRENCH = Topic(
    'leg_{leg}/wrench',
    'geometry_msgs/msg/WrenchStamped',
    'N',
    'leg_{leg}_sole',
    ('wrench.force.x', 'wrench.force.y', 'wrench.force.z'),
)
POSITION = Topic(
    'leg_{leg}/position',
    'geometry_msgs/msg/PointStamped',
    'm',
    'world',
    ('point.x', 'point.y', 'point.z'),
)
BODY_POSE = Topic(
    'body/pose',
    'geometry_msgs/msg/PoseStamped',
    'm',
    'world',
    (
        *('pose.position.x', 'pose.position.y'),
        *(f'pose.orientation.{name}' for name in 'xyzw'),
    ),
)
ODOM = Topic(
    'odom',
    'nav_msgs/msg/Odometry',
    'm, m/s',
    'odom',
    (
        *(f'pose.pose.position.{axis}' for axis in 'xyz'),
        *(f'pose.pose.orientation.{name}' for name in 'xyzw'),
    ),
)
BODY_DOUBT = Topic('body/doubt', 'std_msgs/msg/String', values=('data',), text=True)
IMU = Topic(
    'imu/data',
    'sensor_msgs/msg/Imu',
    'rad/s, m/s²',
    'imu_link',
    (
        *(f'angular_velocity.{axis}' for axis in 'xyz'),
        *(f'linear_acceleration.{axis}' for axis in 'xyz'),
    ),
)
FOOT_WRENCH = Topic(
    'leg_{leg}/foot_wrench',
    'geometry_msgs/msg/WrenchStamped',
    'N',
    'leg_{leg}_foot',
    ('wrench.force.x', 'wrench.force.y', 'wrench.force.z'),
)
CONTACT_VELOCITY = Topic(
    'leg_{leg}/contact_velocity',
    'geometry_msgs/msg/TwistWithCovarianceStamped',
    'm/s',
    'odom',
    (
        *('twist.twist.linear.x', 'twist.twist.linear.y'),
        *('twist.covariance[0]', 'twist.covariance[7]'),
    ),
)
SLIP = Topic(
    'leg_{leg}/slip',
    'geometry_msgs/msg/TwistWithCovarianceStamped',
    'm/s',
    'world',
    (
        *('twist.twist.linear.x', 'twist.twist.linear.y'),
        *('twist.covariance[0]', 'twist.covariance[7]'),  # variances; the matrix has rows of 6
    ),
)
CONTACT_LOAD = Topic('leg_{leg}/contact_load', 'std_msgs/msg/Float64', 'N', values=('data',))
CONTACT_POSITION = Topic(
    'leg_{leg}/contact_position',
    'geometry_msgs/msg/PointStamped',
    'm',
    'world',
    ('point.x', 'point.y', 'point.z'),
)
SLIPPING = Topic('leg_{leg}/slipping', 'std_msgs/msg/Bool', values=('data',))
# The last topic of each estimate: it triggers a decision.
WETNESS = Topic('leg_{leg}/wetness', 'std_msgs/msg/Float64', '0 to 1', values=('data',))
FRICTION = Topic('leg_{leg}/friction', 'std_msgs/msg/Float64', values=('data',))
FRICTION_MARGIN = Topic('leg_{leg}/friction_margin', 'std_msgs/msg/Float64', values=('data',))
DOUBT = Topic('leg_{leg}/doubt', 'std_msgs/msg/String', values=('data',), text=True)
MORPHOLOGY = Topic('leg_{leg}/morphology', 'std_msgs/msg/String', values=('data',), text=True)
JOINT_STATES = Topic('joint_states', 'sensor_msgs/msg/JointState', 'rad')
MARKERS = Topic('markers', 'visualization_msgs/msg/MarkerArray', 'm')
CLOCK = Topic('/clock', 'rosgraph_msgs/msg/Clock', 's', values=('clock.sec', 'clock.nanosec'))
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')

TRIAL = {
    topic.kind: topic
    for topic in (
        *(WRENCH, POSITION, BODY_POSE, PRESSURE, PRESSURE_SETPOINT, SLIP, SLIPPING),
        *(WETNESS, FRICTION, FRICTION_MARGIN, DOUBT, MORPHOLOGY),
        *(ODOM, BODY_DOUBT, CONTACT_VELOCITY),
    )
}
"""The topics that a trial is read from, by kind."""

OF_BODY = tuple(topic.kind for topic in (BODY_POSE, ODOM, BODY_DOUBT))
"""Kinds of these topics that a robot has only once."""

__all__ = ['OF_BODY', 'TRIAL', 'Topic']
