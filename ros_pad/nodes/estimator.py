# SPDX-License-Identifier: Apache-2.0
"""The estimator node: what each foot feels, from its wrench, position and pressure."""

from __future__ import annotations

import sys
from typing import Any

from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import TwistWithCovarianceStamped
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Bool
from std_msgs.msg import Float64

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import Estimate
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.nodes import topics
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import EXPECTED_LOAD
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.pace import Pace

_TUNING = Tuning()
PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    AMBIENT_PRESSURE,
    Parameter(
        'position_noise', _TUNING.position_noise,
        'Standard deviation of a marker coordinate.', 'm', 1e-7, 0.1,
    ),
    Parameter(
        'force_noise', _TUNING.force_noise,
        'Standard deviation of a force component.', 'N', 1e-6, 100.0,
    ),
    Parameter(
        'patch_length', _TUNING.patch_length,
        'Way over which wet and dry ground change.', 'm', 0.01, 100.0,
    ),
    Parameter(
        'wet_prior', _TUNING.wet_prior,
        'Probability of wet ground where nothing is known.', '', 0.01, 0.99,
    ),
    Parameter('publish_rate', 50.0, 'Estimates a second.', 'Hz', 1.0, 1000.0),
)  # fmt: skip


class _Leg:
    """Estimator of one leg, the messages it waits for, and those it sends."""

    def __init__(
        self, node: Node, leg: int, estimator: FootEstimator, period_ns: int, ambient: float
    ) -> None:
        self._node = node
        self._estimator = estimator
        self._pace = Pace(period_ns)
        self._ambient = ambient
        self._pressure = 0.0
        self._wrench: WrenchStamped | None = None
        self._position: PointStamped | None = None
        self.samples = 0
        self._slip = topics.SLIP.publisher(node, leg)
        self._slipping = topics.SLIPPING.publisher(node, leg)
        self._friction = topics.FRICTION.publisher(node, leg)
        self._margin = topics.FRICTION_MARGIN.publisher(node, leg)
        self._wetness = topics.WETNESS.publisher(node, leg)
        self._slip_message = TwistWithCovarianceStamped()
        self._slip_message.header.frame_id = 'world'
        topics.PRESSURE.subscription(node, self._on_pressure, leg)
        topics.WRENCH.subscription(node, self._on_wrench, leg)
        topics.POSITION.subscription(node, self._on_position, leg)

    def _on_pressure(self, message: FluidPressure) -> None:
        self._pressure = message.fluid_pressure - self._ambient

    def _on_wrench(self, message: WrenchStamped) -> None:
        if self._wrench is not None and self._position is not None:
            # No position came with the wrench before: its marker was out of sight, or it is
            # slower than the force. Use the last one.
            self._update(self._wrench, self._position)
        self._wrench = message
        if self._position is not None and self._position.header.stamp == message.header.stamp:
            self._take(message, self._position)

    def _on_position(self, message: PointStamped) -> None:
        self._position = message
        if self._wrench is not None and self._wrench.header.stamp == message.header.stamp:
            self._take(self._wrench, message)

    def _take(self, wrench: WrenchStamped, position: PointStamped) -> None:
        self._wrench = None
        self._update(wrench, position)

    def _update(self, wrench: WrenchStamped, position: PointStamped) -> None:
        stamp_ns = nanoseconds(wrench.header.stamp)
        force, point = wrench.wrench.force, position.point
        try:
            estimate = self._estimator.update(
                stamp_ns * 1e-9,
                (force.x, force.y, force.z),
                (point.x, point.y, point.z),
                self._pressure,
            )
        except InvalidInput as error:
            self._node.get_logger().warning(f'sample ignored: {error}', throttle_duration_sec=1.0)
            return
        self.samples += 1
        if self._pace.due(stamp_ns):
            self._publish(wrench, estimate)

    def _publish(self, wrench: WrenchStamped, estimate: Estimate) -> None:
        slip = self._slip_message
        slip.header.stamp = wrench.header.stamp
        slip.twist.twist.linear.x, slip.twist.twist.linear.y = estimate.slip_velocity
        variance = estimate.slip_speed_sd**2
        slip.twist.covariance[0] = slip.twist.covariance[7] = variance
        self._slip.publish(slip)
        self._slipping.publish(Bool(data=estimate.slipping))
        self._friction.publish(Float64(data=estimate.friction_mean))
        self._margin.publish(Float64(data=estimate.margin))
        # Last: it is what the controller acts on.
        self._wetness.publish(Float64(data=estimate.wet_probability))


class EstimatorNode(Node):
    """Serves the legs in the parameter ``legs``; parameters are in :data:`PARAMETERS`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'estimator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        values = declare(self, PARAMETERS)
        foot: Foot = values['foot']
        tuning = Tuning(
            position_noise=values['position_noise'],
            force_noise=values['force_noise'],
            patch_length=values['patch_length'],
            wet_prior=values['wet_prior'],
        )
        self.legs = {
            leg: _Leg(
                self,
                leg,
                FootEstimator(foot, values['expected_load'], tuning),
                round(1e9 / values['publish_rate']),
                values['ambient_pressure'],
            )
            for leg in values['legs']
        }

    @property
    def samples(self) -> int:
        """Number of samples taken so far, of all legs."""
        return sum(leg.samples for leg in self.legs.values())


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
