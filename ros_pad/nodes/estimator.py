# SPDX-License-Identifier: Apache-2.0
"""The estimator node: slip, wetness and friction of each foot, from wrench, position, pressure.

The reason why the ground is unobservable is published on ``leg_i/doubt`` and, with the health of
the sensors, on ``/diagnostics``.
"""

from __future__ import annotations

import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import TwistWithCovarianceStamped
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Bool
from std_msgs.msg import Float64
from std_msgs.msg import String

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import SETTINGS
from ros_pad.estimation import Estimate
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.tuning import attribute
from ros_pad.nodes import topics
from ros_pad.nodes.frames import check_frame
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import EXPECTED_LOAD
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import on_tick
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.pace import Pace

PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    AMBIENT_PRESSURE,
    *(Parameter(**vars(setting)) for setting in SETTINGS),
    Parameter(**vars(PUBLISH_RATE)),
)  # fmt: skip

_LEVELS = {True: DiagnosticStatus.OK, False: DiagnosticStatus.ERROR}


class _LegTopics:
    """Connect the topics of one leg to its estimation stage."""

    def __init__(
        self,
        node: Node,
        leg: int,
        estimator: FootEstimator,
        period_ns: int,
        ambient: float,
    ) -> None:
        self.stage = EstimationStage(
            estimator, period_ns, self._publish, self._publish_doubt, self._warn
        )
        self._node = node
        self._leg = leg
        self._ambient = ambient
        self._slip = topics.SLIP.publisher(node, leg)
        self._slipping = topics.SLIPPING.publisher(node, leg)
        self._friction = topics.FRICTION.publisher(node, leg)
        self._margin = topics.FRICTION_MARGIN.publisher(node, leg)
        self._wetness = topics.WETNESS.publisher(node, leg)
        self._doubts = topics.DOUBT.publisher(node, leg)
        self._slip_message = TwistWithCovarianceStamped()
        self._slip_message.header.frame_id = 'world'
        topics.PRESSURE.subscription(node, self._on_pressure, leg)
        topics.WRENCH.subscription(node, self._on_wrench, leg)
        topics.POSITION.subscription(node, self._on_position, leg)

    def _is_ours(self, frame: str) -> bool:
        """Return whether a frame is allowed for this leg; otherwise reject the sample."""
        try:
            check_frame(frame, self._leg)
        except InvalidInput as error:
            self.stage.reject(error)
            return False
        return True

    def _on_pressure(self, message: FluidPressure) -> None:
        if self._is_ours(message.header.frame_id):
            self.stage.pressure(message.fluid_pressure - self._ambient)

    def _on_wrench(self, message: WrenchStamped) -> None:
        if not self._is_ours(message.header.frame_id):
            return
        force = message.wrench.force
        self.stage.wrench(
            nanoseconds(message.header.stamp),
            (force.x, force.y, force.z),
            message.wrench.torque.z,
        )

    def _on_position(self, message: PointStamped) -> None:
        if not self._is_ours(message.header.frame_id):
            return
        point = message.point
        self.stage.position(nanoseconds(message.header.stamp), (point.x, point.y, point.z))

    def _warn(self, error: InvalidInput) -> None:
        self._node.get_logger().warning(
            f'leg {self._leg}: sample ignored: {error}', throttle_duration_sec=1.0
        )

    def _publish_doubt(self, doubt: str) -> None:
        self._doubts.publish(String(data=doubt))

    def status(self) -> DiagnosticStatus:
        """Return the health of the sensors and the estimate, for ``/diagnostics``."""
        stage = self.stage
        estimate = stage.estimator.estimate
        return DiagnosticStatus(
            name=f'{self._node.get_name()}: leg {self._leg} sensing',
            hardware_id=f'foot {self._leg}',
            level=_LEVELS[stage.sound],
            message=stage.doubt or 'the ground is observable',
            values=[
                KeyValue(key='P(wet)', value=f'{estimate.wet_probability:.3f}'),
                KeyValue(key='friction', value=f'{estimate.friction_mean:.3f}'),
                KeyValue(key='friction sd', value=f'{estimate.friction_sd:.3f}'),
                KeyValue(key='samples', value=str(stage.samples)),
            ],
        )

    def _publish(self, stamp_ns: int, estimate: Estimate) -> None:
        slip = self._slip_message
        set_stamp(slip.header.stamp, stamp_ns)
        slip.twist.twist.linear.x, slip.twist.twist.linear.y = estimate.slip_velocity
        variance = estimate.slip_speed_sd**2
        slip.twist.covariance[0] = slip.twist.covariance[7] = variance
        self._slip.publish(slip)
        self._slipping.publish(Bool(data=estimate.slipping))
        self._friction.publish(Float64(data=estimate.friction_mean))
        self._margin.publish(Float64(data=estimate.margin))
        # Published last, because it triggers the controller.
        self._wetness.publish(Float64(data=estimate.wet_probability))


class EstimatorNode(Node):
    """Estimate slip, friction and wetness under each foot; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    legs : dict
        For each leg, its topics and its estimation stage.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'estimator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        values = declare(self, PARAMETERS)
        foot: Foot = values['foot']
        tuning = Tuning(**{attribute(each): values[each.name] for each in SETTINGS})
        self.legs = {
            leg: _LegTopics(
                self,
                leg,
                FootEstimator(foot, values['expected_load'], tuning),
                round(1e9 / values['publish_rate']),
                values['ambient_pressure'],
            )
            for leg in values['legs']
        }
        self._diagnostics = topics.DIAGNOSTICS.publisher(self)
        self._diagnostics_pace = Pace(1_000_000_000)
        self._reported = [True] * len(self.legs)
        self._health_pace = Pace(TICK_PERIOD_NS)
        on_tick(self, TICK_PERIOD_NS * 1e-9, self._tick)

    def _tick(self, now_ns: int) -> None:
        if not self._health_pace.due(now_ns):
            return
        for leg in self.legs.values():
            leg.stage.tick(now_ns)
        sound = [leg.stage.sound for leg in self.legs.values()]
        if self._diagnostics_pace.due(now_ns) or sound != self._reported:
            self._reported = sound
            array = DiagnosticArray(status=[leg.status() for leg in self.legs.values()])
            set_stamp(array.header.stamp, now_ns)
            self._diagnostics.publish(array)

    @property
    def samples(self) -> int:
        """Number of samples accepted so far, of all legs."""
        return sum(leg.stage.samples for leg in self.legs.values())


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
