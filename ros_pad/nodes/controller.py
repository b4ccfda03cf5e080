# SPDX-License-Identifier: Apache-2.0
"""The controller node: flat or dome for each foot, and the pressure that takes."""

from __future__ import annotations

import dataclasses
import math
import struct
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Float64
from std_msgs.msg import String

from ros_pad.control import POLICIES
from ros_pad.control import MorphologyController
from ros_pad.control import first_shapes
from ros_pad.control import policy_named
from ros_pad.control.listening import LOOK_PERIOD_NS
from ros_pad.control.listening import LegListener
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError
from ros_pad.estimation import trouble_in
from ros_pad.nodes import topics
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import EXPECTED_LOAD
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import SEED
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import on_tick
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import Pace
from ros_pad.simulation.scene import Scene


def _set_margin(node: ControllerNode, margin: float) -> None:
    """Let the domes of steps to come have another margin."""
    node.controller.margin = margin


PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    AMBIENT_PRESSURE,
    Parameter('policy', 'adaptive', 'How shapes are chosen.', choices=POLICIES),
    Parameter(
        'margin', 1.2, 'Factor on the load, for the pressure of a dome.', '', 1.0, 5.0,
        live=True, change=_set_margin,
    ),
    Parameter(
        'dome_pressure', 0.0, 'Gauge pressure of every dome; 0 chooses it from the load.',
        'Pa', 0.0, 1e6,
    ),
    Parameter(
        'scene', '', 'Scene whose ground the oracle sees; other policies need none.',
        read=lambda name: Scene.load(name) if name else None,
    ),
    dataclasses.replace(SEED, description='Seed of that ground.'),
)  # fmt: skip


class _Leg:
    """What the node hears of one leg, and what it says of it."""

    def __init__(self, node: ControllerNode, leg: int) -> None:
        self._node, self.leg = node, leg
        # Wrenches and positions come at the rate of the sensors, and are read as they travel.
        self.heard = LegListener(node.controller, leg, position_in)
        self._setpoints = topics.PRESSURE_SETPOINT.publisher(node, leg)
        self._shapes = topics.MORPHOLOGY.publisher(node, leg)
        self._message = FluidPressure()
        self._message.header.frame_id = f'leg_{leg}_pad'
        topics.WRENCH.subscription(node, self._on_wrench, leg, raw=True)
        topics.POSITION.subscription(node, self.heard.position, leg, raw=True)
        topics.PRESSURE.subscription(node, self._on_pressure, leg)
        topics.DOUBT.subscription(node, self._on_doubt, leg)
        topics.WETNESS.subscription(node, self._on_wetness, leg)

    def _on_wrench(self, data: bytes) -> None:
        self.heard.wrench(normal_force(data))
        self._node.wrenches += 1

    def _on_pressure(self, message: FluidPressure) -> None:
        self.heard.pressure(message.fluid_pressure - self._node.ambient)

    def _on_doubt(self, message: String) -> None:
        self.heard.trouble = trouble_in(message.data)

    def _on_wetness(self, message: Float64) -> None:
        node, controller = self._node, self._node.controller
        stamp = node.get_clock().now()
        try:
            gauge = self.heard.estimate(stamp.nanoseconds * 1e-9, message.data)
        except InvalidInput as error:  # no probability, and no set-point follows from it
            node.get_logger().warning(f'estimate ignored: {error}', throttle_duration_sec=1.0)
            gauge = None
        if self.leg in controller.refusals:
            node.get_logger().warning(
                f'leg {self.leg} stays flat: {controller.refusals[self.leg]}',
                throttle_duration_sec=10.0,
            )
        self.tell_shape()
        if gauge is None:
            return
        self._message.header.stamp = stamp.to_msg()
        self._message.fluid_pressure = gauge + node.ambient
        self._setpoints.publish(self._message)

    def tell_shape(self) -> None:
        """Publish the shape if it is another one."""
        shape = self.heard.new_shape()
        if shape is not None:
            self._shapes.publish(String(data=shape))


class ControllerNode(Node):
    """Decides at each lift-off, and sends a set-point with every estimate of wetness.

    Where the estimates stop, so do the set-points, and the regulators vent. What is wrong with a
    leg is said on ``/diagnostics``, once a second and as soon as it is found. Parameters are in
    :data:`PARAMETERS`.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'controller', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        values = declare(self, PARAMETERS)
        legs = values['legs']
        is_wet = None
        if values['scene']:
            is_wet = values['scene'].floor.build(values['seed']).wet
        elif values['policy'] == 'oracle':
            raise ConfigError(
                f"node {self.get_name()}: parameter scene = '' is not allowed:"
                ' policy oracle needs the scene whose ground it sees'
            )
        try:
            self.controller = MorphologyController(
                values['foot'],
                legs,
                policy_named(values['policy'], is_wet),
                values['expected_load'],
                start=first_shapes(values['policy'], legs),
                margin=values['margin'],
                fixed_pressure=values['dome_pressure'] or None,
            )
        except (InvalidInput, LimitError) as error:
            # What ranges of single parameters cannot say: how they go together.
            raise ConfigError(
                f'node {self.get_name()}: {error} (parameter dome_pressure)'
            ) from error
        self.ambient: float = values['ambient_pressure']
        self.wrenches = 0
        self._diagnostics = topics.DIAGNOSTICS.publisher(self)
        self._said: list[str] = []
        self._look_pace = Pace(LOOK_PERIOD_NS)
        self._diagnostics_pace = Pace(1_000_000_000)
        self._legs = [_Leg(self, leg) for leg in legs]
        on_tick(self, LOOK_PERIOD_NS * 1e-9, self._tick)

    def _tick(self, now_ns: int) -> None:
        """Look after legs of which no estimates come, and publish what is to be said."""
        if not self._look_pace.due(now_ns):
            return
        now = now_ns * 1e-9
        for each in self._legs:
            if each.heard.look(now):
                each.tell_shape()
        faults = [self.controller.fault(each.leg) for each in self._legs]
        if self._diagnostics_pace.due(now_ns) or faults != self._said:
            self._said = faults
            self._diagnose(now_ns)

    def _diagnose(self, now_ns: int) -> None:
        array = DiagnosticArray()
        set_stamp(array.header.stamp, now_ns)
        controller = self.controller
        for leg in (each.leg for each in self._legs):
            shape, watch = controller.morphology(leg), controller.watch(leg)
            fault, remark = controller.fault(leg), controller.remark(leg)
            status = DiagnosticStatus(
                name=f'{self.get_name()}: leg {leg} pad',
                hardware_id=f'leg {leg}',
                level=DiagnosticStatus.OK,
                message=shape,
            )
            if remark:
                status.level, status.message = DiagnosticStatus.WARN, remark
            if fault:
                status.level = DiagnosticStatus.ERROR
                status.message = '; '.join(filter(None, (fault, remark)))
            status.values = [
                KeyValue(key='pressure (Pa gauge)', value=f'{watch.pressure:.0f}'),
                KeyValue(key='set-point (Pa gauge)', value=f'{controller.setpoint(leg):.0f}'),
                KeyValue(key='shape', value=shape),
                KeyValue(key='time to fill (s)', value=f'{watch.fill_time:.2f}'),
                KeyValue(key='time to vent (s)', value=f'{watch.vent_time:.2f}'),
                KeyValue(key='steps decided ahead', value=str(controller.lead(leg))),
                KeyValue(
                    key='touch-downs with too little pressure',
                    value=str(controller.underpressure[leg]),
                ),
            ]
            array.status.append(status)
        self._diagnostics.publish(array)


def normal_force(data: bytes) -> float:
    """Return force.z, N, of a WrenchStamped as it travels: twenty times as fast as reading all.

    CDR: four bytes of encapsulation, a stamp of eight, the frame's length and text, and then,
    aligned to eight, six doubles. NaN where the bytes are too few: anybody can publish any.
    """
    try:
        return _normal_force(data)
    except (IndexError, struct.error):
        return math.nan


def _normal_force(data: bytes) -> float:
    order = '<' if data[1] & 1 else '>'
    (length,) = struct.unpack_from(order + 'I', data, 12)
    force: float
    (force,) = struct.unpack_from(order + 'd', data, 4 + (12 + length + 7) // 8 * 8 + 16)
    return force


def position_in(data: bytes) -> tuple[float, float]:
    """Return x and y, m, of a PointStamped as it travels; NaN where the bytes are none."""
    try:
        point = deserialize_message(data, PointStamped).point
    except Exception:  # whatever the middleware says: anybody can publish any bytes
        return math.nan, math.nan
    return point.x, point.y


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(ControllerNode, args)


if __name__ == '__main__':
    sys.exit(main())
