# SPDX-License-Identifier: Apache-2.0
"""The estimator node: what each foot feels, from its wrench, position and pressure.

Why a foot cannot know what is below it is on ``leg_i/doubt``, and on ``/diagnostics`` with the
health of its sensors.
"""

from __future__ import annotations

import math
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
from ros_pad.estimation import Estimate
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation.listening import LISTEN_PERIOD_NS
from ros_pad.estimation.listening import FootListener
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
from ros_pad.pace import Pace

_TUNING = Tuning()
PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    AMBIENT_PRESSURE,
    Parameter(
        'position_noise', _TUNING.position_noise,
        'Standard deviation of a marker coordinate; 0: it may repeat itself.', 'm', 0.0, 0.1,
    ),
    Parameter(
        'force_noise', _TUNING.force_noise,
        'Standard deviation of a force component; 0: it may repeat itself.', 'N', 0.0, 100.0,
    ),
    Parameter(
        'moment_noise', 0.0,
        'Standard deviation of the torque z of a wrench; 0: the sensors measure none.',
        'N m', 0.0, 10.0,
    ),
    Parameter(
        'force_range', 0.0,
        'Largest force that a sensor shows in any direction; 0: not known.', 'N', 0.0, 1e5,
    ),
    Parameter(
        'patch_length', _TUNING.patch_length,
        'Way over which wet and dry ground change.', 'm', 0.01, 100.0,
    ),
    Parameter(
        'wet_prior', _TUNING.wet_prior,
        'Probability of wet ground where nothing is known.', '', 0.01, 0.99,
    ),
    Parameter('publish_rate', 50.0, 'Estimates a second.', 'Hz', 5.0, 1000.0),
)  # fmt: skip

_LEVELS = {True: DiagnosticStatus.OK, False: DiagnosticStatus.ERROR}


class _Leg(FootListener):
    """Estimator of one leg, the messages it waits for, and those it sends."""

    def __init__(
        self,
        node: Node,
        leg: int,
        estimator: FootEstimator,
        period_ns: int,
        ambient: float,
        moments: bool,
    ) -> None:
        super().__init__(
            estimator, period_ns, moments, self._publish, self._publish_doubt, self._warn
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
        """Whether a frame is not that of another leg; if it is, say so."""
        try:
            check_frame(frame, self._leg)
        except InvalidInput as error:
            self.refused(error)
            return False
        return True

    def _on_pressure(self, message: FluidPressure) -> None:
        if self._is_ours(message.header.frame_id):
            self.pressure(message.fluid_pressure - self._ambient)

    def _on_wrench(self, message: WrenchStamped) -> None:
        if not self._is_ours(message.header.frame_id):
            return
        force = message.wrench.force
        self.wrench(
            nanoseconds(message.header.stamp),
            (force.x, force.y, force.z),
            message.wrench.torque.z,
        )

    def _on_position(self, message: PointStamped) -> None:
        if not self._is_ours(message.header.frame_id):
            return
        point = message.point
        self.position(nanoseconds(message.header.stamp), (point.x, point.y, point.z))

    def _warn(self, error: InvalidInput) -> None:
        self._node.get_logger().warning(f'sample ignored: {error}', throttle_duration_sec=1.0)

    def _publish_doubt(self, doubt: str) -> None:
        self._doubts.publish(String(data=doubt))

    def status(self) -> DiagnosticStatus:
        """Return how the foot is doing, for ``/diagnostics``."""
        estimate = self._estimator.estimate
        return DiagnosticStatus(
            name=f'{self._node.get_name()}: leg {self._leg} sensing',
            hardware_id=f'foot {self._leg}',
            level=_LEVELS[self.sound],
            message=self.doubt or 'knows the ground',
            values=[
                KeyValue(key='P(wet)', value=f'{estimate.wet_probability:.3f}'),
                KeyValue(key='friction', value=f'{estimate.friction_mean:.3f}'),
                KeyValue(key='friction sd', value=f'{estimate.friction_sd:.3f}'),
                KeyValue(key='samples', value=str(self.samples)),
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
            moment_noise=values['moment_noise'],
            force_range=values['force_range'] or math.inf,
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
                moments=values['moment_noise'] > 0.0,
            )
            for leg in values['legs']
        }
        self._diagnostics = topics.DIAGNOSTICS.publisher(self)
        self._diagnostics_pace = Pace(1_000_000_000)
        self._reported = [True] * len(self.legs)
        self._health_pace = Pace(LISTEN_PERIOD_NS)
        on_tick(self, LISTEN_PERIOD_NS * 1e-9, self._tick)

    def _tick(self, now_ns: int) -> None:
        if not self._health_pace.due(now_ns):
            return
        for leg in self.legs.values():
            leg.listen(now_ns)
        sound = [leg.sound for leg in self.legs.values()]
        if self._diagnostics_pace.due(now_ns) or sound != self._reported:
            self._reported = sound
            array = DiagnosticArray(status=[leg.status() for leg in self.legs.values()])
            set_stamp(array.header.stamp, now_ns)
            self._diagnostics.publish(array)

    @property
    def samples(self) -> int:
        """Number of samples taken so far, of all legs."""
        return sum(leg.samples for leg in self.legs.values())


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
