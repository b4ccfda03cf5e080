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

SILENCE = 0.4
"""Time without a sample after which a foot is said not to be heard, s."""

LARGEST_FORCE = 1e5
LARGEST_POSITION = 1e6
LARGEST_PRESSURE = 1e7
LARGEST_MOMENT = 1e5
"""What is believed of a sensor in either direction, N, m, Pa gauge, N m: what is larger, though a
number, would leave its mark on sums and means for good."""

_HEALTH_PERIOD_NS = 100_000_000  # of the look at which feet are heard
_LEVELS = {True: DiagnosticStatus.OK, False: DiagnosticStatus.ERROR}


class _Leg:
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
        self._node = node
        self._leg = leg
        self._estimator = estimator
        self._moments = moments
        self._pace = Pace(period_ns)
        self._ambient = ambient
        self._pressure = 0.0
        self._wrench: WrenchStamped | None = None
        self._position: PointStamped | None = None
        self._used: PointStamped | None = None  # position of the last sample ...
        self._used_ns = 0  # ... and when it was first used
        self._heard_ns: int | None = None  # when the last sample came
        self._refusal = ''
        self.samples = 0
        self.doubt: str | None = None
        self.sound = True
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
            self._refuse(error)
            return False
        return True

    def _refuse(self, error: InvalidInput) -> None:
        self._refusal = str(error)
        self._node.get_logger().warning(f'sample ignored: {error}', throttle_duration_sec=1.0)

    def _on_pressure(self, message: FluidPressure) -> None:
        # A device that does not answer may be told of so: what it said last counts.
        gauge = message.fluid_pressure - self._ambient
        if abs(gauge) <= LARGEST_PRESSURE and self._is_ours(message.header.frame_id):
            self._pressure = gauge

    def _on_wrench(self, message: WrenchStamped) -> None:
        if not self._is_ours(message.header.frame_id):
            return
        if self._wrench is not None and self._position is not None:
            # No position came with the wrench before: its marker was out of sight, or it is
            # slower than the force. Use the last one.
            self._update(self._wrench, self._position)
        self._wrench = message
        if self._position is not None and self._position.header.stamp == message.header.stamp:
            self._take(message, self._position)

    def _on_position(self, message: PointStamped) -> None:
        if not self._is_ours(message.header.frame_id):
            return
        point = message.point
        if math.isfinite(point.x + point.y + point.z):
            self._position = message
        # Some motion capture says so when a marker is out of sight: then the last one counts.
        elif self._position is None:
            return
        if self._wrench is not None and self._wrench.header.stamp == message.header.stamp:
            self._take(self._wrench, self._position)

    def _take(self, wrench: WrenchStamped, position: PointStamped) -> None:
        self._wrench = None
        self._update(wrench, position)

    def _update(self, wrench: WrenchStamped, position: PointStamped) -> None:
        stamp_ns = nanoseconds(wrench.header.stamp)
        if position is not self._used:
            # Its own stamp may be of another clock.
            self._used, self._used_ns = position, stamp_ns
        force = (wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z)
        point = (position.point.x, position.point.y, position.point.z)
        moment = wrench.wrench.torque.z if self._moments else None
        try:
            for name, values, largest, unit in (
                ('force', force, LARGEST_FORCE, 'N'),
                ('position', point, LARGEST_POSITION, 'm'),
                ('moment', (moment or 0.0,), LARGEST_MOMENT, 'N m'),
            ):
                if any(largest < abs(value) < math.inf for value in values):
                    raise InvalidInput(
                        f'{name} = {values!r} {unit}: at most {largest:g} {unit} is believed'
                    )
            estimate = self._estimator.update(
                stamp_ns * 1e-9, force, point, self._pressure, moment, self._used_ns * 1e-9
            )
        except InvalidInput as error:
            self._refuse(error)
            return
        self.samples += 1
        self._heard_ns, self._refusal = None, ''
        self._say(estimate.doubt, estimate.sound)
        if self._pace.due(stamp_ns):
            self._publish(wrench, estimate)

    def _say(self, doubt: str, sound: bool) -> None:
        # Details, after the colon, may change with every sample.
        news = self.doubt is None or doubt.partition(':')[0] != self.doubt.partition(':')[0]
        self.doubt, self.sound = doubt, sound
        if news:
            self._doubts.publish(String(data=doubt))

    def listen(self, now_ns: int) -> None:
        """Say so when no sample has come for long."""
        if self._heard_ns is None:
            self._heard_ns = now_ns
        silence = (now_ns - self._heard_ns) * 1e-9
        if silence > SILENCE:
            self._say(self._missing(silence), False)

    def _missing(self, silence: float) -> str:
        if self._refusal:
            return f'sample refused: {self._refusal}'
        if self._position is None and self._wrench is not None:
            return f'no position: for {silence:.1f} s'
        return f'no wrench: for {silence:.1f} s'

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
        self._health_pace = Pace(_HEALTH_PERIOD_NS)
        on_tick(self, _HEALTH_PERIOD_NS * 1e-9, self._tick)

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
