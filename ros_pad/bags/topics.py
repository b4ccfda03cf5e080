# SPDX-License-Identifier: Apache-2.0
"""The topics of ros_pad: name, message type, unit, and the values that are read from them.

Nodes of ros_pad send one another records of all feet. Robots of others publish by leg, and people
look at single legs: :data:`OF_LEGS` has these topics, with the numbers of a record that they have.
Nodes add message class and QoS to this table, in `ros_pad.nodes.qos`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.bags.wire import TYPE
from ros_pad.records import COMMAND as COMMANDS
from ros_pad.records import ESTIMATE as ESTIMATES
from ros_pad.records import PRESSURE as PRESSURES
from ros_pad.records import SAMPLE as SAMPLES
from ros_pad.records import Kind

STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
FRAME = 'header.frame_id'


@dataclass(frozen=True, eq=False)
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
        Fields of a message that are read, such as ``wrench.force.x``: numbers, or one text.
    text : bool
        Whether the one value is a text.
    record : Kind or None
        Kind of the record that the message is, or of which it has some numbers of one leg.
    columns : tuple of str
        For the topic of a leg, the number of the record in each of the values.
    """

    pattern: str
    type_name: str
    unit: str = ''
    frame: str = ''
    values: tuple[str, ...] = ()
    text: bool = False
    record: Kind | None = None
    columns: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """The name without ``leg_{leg}/`` and without the leading slash."""
        return self.pattern.removeprefix('leg_{leg}/').removeprefix('/')

    def name(self, leg: int | None = None) -> str:
        """Return the name; a topic of each leg needs the number of the leg."""
        return self.pattern.format(leg=leg)


def _record(name: str, kind: Kind, unit: str) -> Topic:
    return Topic(f'feet/{name}', TYPE, unit, record=kind)


SAMPLE = _record('sample', SAMPLES, 'N, N m, m, m/s')
FORCE = _record('force', SAMPLES, 'N')
ESTIMATE = _record('estimate', ESTIMATES, 'm, N, m/s')
COMMAND = _record('command', COMMANDS, 'Pa gauge')
PRESSURE = _record('pressure', PRESSURES, 'Pa gauge')

RECORDS = (SAMPLE, FORCE, ESTIMATE, COMMAND, PRESSURE)
"""Topics of records; ``feet/force`` has samples with forces alone, in the axes of the feet."""


def _axes(path: str, axes: str = 'xyz') -> tuple[str, ...]:
    return tuple(f'{path}.{axis}' for axis in axes)


def _of_leg(
    name: str, type_name: str, kind: Kind, columns: Sequence[str], values: Sequence[str],
    unit: str = '', frame: str = '',
) -> Topic:  # fmt: skip
    pattern = f'leg_{{leg}}/{name}'
    return Topic(pattern, type_name, unit, frame, tuple(values), False, kind, tuple(columns))


def _number(
    name: str, column: str, type_name: str = 'std_msgs/msg/Float64', unit: str = ''
) -> Topic:
    return _of_leg(name, type_name, ESTIMATES, (column,), ('data',), unit)


_WRENCH = 'geometry_msgs/msg/WrenchStamped'
_TWIST = 'geometry_msgs/msg/TwistWithCovarianceStamped'
_FLUID = 'sensor_msgs/msg/FluidPressure'
_FORCES = ('force_x', 'force_y', 'force_z')
# Variances of x and y; the matrix has rows of 6.
_PLANE = (*_axes('twist.twist.linear', 'xy'), 'twist.covariance[0]', 'twist.covariance[7]')

LEG_WRENCH = _of_leg(
    'wrench', _WRENCH, SAMPLES, (*_FORCES, 'moment'),
    (*_axes('wrench.force'), 'wrench.torque.z'), 'N', 'leg_{leg}_sole',
)  # fmt: skip
LEG_POSITION = _of_leg(
    'position', 'geometry_msgs/msg/PointStamped', SAMPLES,
    ('position_x', 'position_y', 'position_z'), _axes('point'), 'm', 'world',
)  # fmt: skip
LEG_VELOCITY = _of_leg(
    'contact_velocity', _TWIST, SAMPLES,
    ('velocity_x', 'velocity_y', 'variance_x', 'variance_y'), _PLANE, 'm/s', 'odom',
)  # fmt: skip
LEG_FOOT_WRENCH = _of_leg(
    'foot_wrench', _WRENCH, SAMPLES, _FORCES, _axes('wrench.force'), 'N', 'leg_{leg}_foot'
)
LEG_PRESSURE = _of_leg(
    'pressure', _FLUID, PRESSURES, ('pressure',), ('fluid_pressure',), 'Pa absolute',
    'leg_{leg}_pad',
)  # fmt: skip
LEG_SETPOINT = _of_leg(
    'pressure_setpoint', _FLUID, COMMANDS, ('setpoint',), ('fluid_pressure',), 'Pa absolute',
    'leg_{leg}_pad',
)  # fmt: skip
LEG_WETNESS = _number('wetness', 'wetness')
LEG_DOUBT = Topic(
    'leg_{leg}/doubt', 'std_msgs/msg/String', values=('data',), text=True, record=ESTIMATES
)
LEG_MORPHOLOGY = Topic(
    'leg_{leg}/morphology', 'std_msgs/msg/String', values=('data',), text=True, record=COMMANDS
)

FROM_DRIVERS = (
    *(LEG_WRENCH, LEG_POSITION, LEG_VELOCITY, LEG_FOOT_WRENCH, LEG_PRESSURE, LEG_SETPOINT),
)
"""Topics of a leg that drivers of others publish, and that become records."""

OF_LEGS = (
    *FROM_DRIVERS,
    _of_leg('slip', _TWIST, ESTIMATES, ('slip_x', 'slip_y'), _PLANE[:2], 'm/s', 'world'),
    _number('slipping', 'slipping', 'std_msgs/msg/Bool'),
    LEG_WETNESS,
    _number('friction', 'friction'),
    _number('friction_margin', 'margin'),
    _number('contact_load', 'load', unit='N'),
    *(LEG_DOUBT, LEG_MORPHOLOGY),
)
"""Topics that each leg has: from drivers of others by ``merge``, for people by ``views``."""

BODY_POSE = Topic(
    'body/pose', 'geometry_msgs/msg/PoseStamped', 'm', 'world',
    (*_axes('pose.position', 'xy'), *_axes('pose.orientation', 'xyzw')),
)  # fmt: skip
ODOM = Topic(
    'odom', 'nav_msgs/msg/Odometry', 'm, m/s', 'odom',
    (*_axes('pose.pose.position'), *_axes('pose.pose.orientation', 'xyzw')),
)  # fmt: skip
BODY_DOUBT = Topic('body/doubt', 'std_msgs/msg/String', values=('data',), text=True)
IMU = Topic(
    'imu/data', 'sensor_msgs/msg/Imu', 'rad/s, m/s²', 'imu_link',
    (*_axes('angular_velocity'), *_axes('linear_acceleration')),
)  # fmt: skip
JOINT_STATES = Topic('joint_states', TYPE, 'rad')
MARKERS = Topic('markers', 'visualization_msgs/msg/MarkerArray', 'm')
FEET_MARKERS = Topic('feet/markers', 'visualization_msgs/msg/MarkerArray', 'm')
CLOCK = Topic('/clock', 'rosgraph_msgs/msg/Clock', 's', values=('clock.sec', 'clock.nanosec'))
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')
TF = Topic('/tf', 'tf2_msgs/msg/TFMessage', 'm', 'odom')
PARAMETERS = Topic('parameters', 'std_msgs/msg/String', values=('data',), text=True)
"""Values of the parameters of a node as JSON, from each node; for the custom data of a bag."""

RECORDED = (
    *(CLOCK, *RECORDS, BODY_POSE, IMU, JOINT_STATES),
    *(ODOM, BODY_DOUBT, MARKERS, DIAGNOSTICS),
)
"""The topics that a robot has only once; they are recorded."""

TRIAL = (
    *(SAMPLE, ESTIMATE, COMMAND, PRESSURE, BODY_POSE, ODOM),
    *(topic for topic in OF_LEGS if topic.columns and topic is not LEG_FOOT_WRENCH),
)
"""The topics that a trial is read from."""


def to_record(topic: Topic, values: np.ndarray, ambient: float) -> np.ndarray:
    """Return the numbers of a record that values of messages of a leg are.

    Parameters
    ----------
    topic : Topic
        One of :data:`OF_LEGS`.
    values : array (..., values)
        Values, in the order of ``topic.values``.
    ambient : float
        Ambient pressure, Pa: messages of a leg have absolute pressures.

    Returns
    -------
    array (..., columns)
    """
    numbers = np.array(values, float)
    if topic.record in (PRESSURES, COMMANDS):
        # Adding and subtracting the ambient pressure leaves rounding errors below 1 uPa.
        return np.round(numbers - ambient, 6)
    if topic is LEG_VELOCITY:  # below 0: it must not be used
        numbers[..., 2:] = np.where(numbers[..., 2:] < 0.0, np.inf, numbers[..., 2:])
    return numbers


def from_record(topic: Topic, numbers: np.ndarray, ambient: float) -> np.ndarray:
    """Return the values of messages of a leg from numbers of a record; see :func:`to_record`."""
    values = np.array(numbers, float)
    if topic.record in (PRESSURES, COMMANDS):
        return values + ambient
    if topic is LEG_VELOCITY:
        values[..., 2:] = np.where(np.isinf(values[..., 2:]), -1.0, values[..., 2:])
    return values


__all__ = [
    'FROM_DRIVERS',
    'OF_LEGS',
    'RECORDED',
    'RECORDS',
    'TRIAL',
    'Topic',
    'from_record',
    'to_record',
]
