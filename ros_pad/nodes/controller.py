# SPDX-License-Identifier: Apache-2.0
"""The controller node: flat or dome for each foot, and the pressure that takes."""

from __future__ import annotations

import dataclasses
import math
import struct
import sys
from typing import Any

from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Float64
from std_msgs.msg import String

from ros_pad.control import POLICIES
from ros_pad.control import MorphologyController
from ros_pad.control import first_shapes
from ros_pad.control import policy_named
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError
from ros_pad.nodes import topics
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import EXPECTED_LOAD
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import SEED
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.simulation.scene import Scene

PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    AMBIENT_PRESSURE,
    Parameter('policy', 'adaptive', 'How shapes are chosen.', choices=POLICIES),
    Parameter('margin', 1.2, 'Factor on the load, for the pressure of a dome.', '', 1.0, 5.0),
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


class ControllerNode(Node):
    """Decides at each lift-off, and sends a set-point with every estimate of wetness.

    Where the estimates stop, so do the set-points, and the regulators vent. Parameters are in
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
        self._ambient = values['ambient_pressure']
        self.wrenches = 0
        self._message = FluidPressure()
        for leg in legs:
            self._serve(leg)

    def _serve(self, leg: int) -> None:
        # Wrenches and positions come at the rate of the sensors. Of positions only the last one
        # counts when an estimate comes: it is kept as it travelled, and read then. Of loads the
        # heaviest since the last estimate counts: feet that bounce have not stepped.
        position = b''
        load, heaviest = math.nan, -math.inf
        shape = ''
        setpoints: Publisher = topics.PRESSURE_SETPOINT.publisher(self, leg)
        shapes: Publisher = topics.MORPHOLOGY.publisher(self, leg)
        frame = f'leg_{leg}_pad'

        def on_wrench(data: bytes) -> None:
            nonlocal load, heaviest
            load = normal_force(data)
            if heaviest < load < math.inf:  # an infinite one is no load, and refused below
                heaviest = load
            self.wrenches += 1

        def on_position(data: bytes) -> None:
            nonlocal position
            position = data

        def on_wetness(message: Float64) -> None:
            nonlocal shape, heaviest
            if not position:
                return
            point = deserialize_message(position, PointStamped).point
            if not math.isfinite(load + message.data + point.x + point.y):
                # A load that is no number is no lift-off. No set-point follows from it either:
                # if it stays so, the regulators vent.
                return
            weight = max(heaviest, load)  # the load where no wrench came since
            heaviest = -math.inf
            gauge = self.controller.update(leg, weight, message.data, (point.x, point.y))
            if leg in self.controller.refusals:
                self.get_logger().warning(
                    f'leg {leg} stays flat: {self.controller.refusals[leg]}',
                    throttle_duration_sec=10.0,
                )
            if self.controller.morphology(leg) != shape:
                shape = self.controller.morphology(leg)
                shapes.publish(String(data=shape))
            self._message.header.stamp = self.get_clock().now().to_msg()
            self._message.header.frame_id = frame
            self._message.fluid_pressure = gauge + self._ambient
            setpoints.publish(self._message)

        topics.WRENCH.subscription(self, on_wrench, leg, raw=True)
        topics.POSITION.subscription(self, on_position, leg, raw=True)
        topics.WETNESS.subscription(self, on_wetness, leg)


def normal_force(data: bytes) -> float:
    """Return force.z, N, of a WrenchStamped as it travels: twenty times as fast as reading all.

    CDR: four bytes of encapsulation, a stamp of eight, the frame's length and text, and then,
    aligned to eight, six doubles.
    """
    order = '<' if data[1] & 1 else '>'
    (length,) = struct.unpack_from(order + 'I', data, 12)
    force: float
    (force,) = struct.unpack_from(order + 'd', data, 4 + (12 + length + 7) // 8 * 8 + 16)
    return force


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(ControllerNode, args)


if __name__ == '__main__':
    sys.exit(main())
