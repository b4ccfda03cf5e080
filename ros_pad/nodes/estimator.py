# SPDX-License-Identifier: Apache-2.0
"""The estimator node: slip, wetness and friction of each foot, from wrench, position, pressure.

The reason why the ground is unobservable is published on ``leg_i/doubt`` and, with the health of
the sensors, on ``/diagnostics``.
"""

from __future__ import annotations

import os
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from rclpy.node import Node
from std_msgs.msg import String

from ros_pad.bags.fields import FieldReader
from ros_pad.bags.topics import FRAME
from ros_pad.bags.topics import STAMP
from ros_pad.contact.resistance import Foot
from ros_pad.errors import BadMessage
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.errors import UnknownEncoding
from ros_pad.estimation import SETTINGS
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation import estimators_of
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.estimation.stage import Emission
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.tuning import attribute
from ros_pad.nodes import topics
from ros_pad.nodes.frames import check_frame
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.messages import Outgoing
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import EXPECTED_LOAD
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.refusals import rate_status
from ros_pad.nodes.stamps import set_stamp
from ros_pad.nodes.stamps import split
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.pace import Pace
from ros_pad.trials import learnt

PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    AMBIENT_PRESSURE,
    *(Parameter(**vars(setting)) for setting in SETTINGS),
    Parameter(**vars(PUBLISH_RATE)),
    Parameter(
        'learnt', '',
        'File in which what feet learn of friction is kept; empty: none. If it exists at the'
        ' start, scale and scale_sd follow from it.',
    ),
)  # fmt: skip

KEEP_PERIOD_NS = 10_000_000_000
"""Time between two savings of what was learnt, ns."""

OLDEST = 0.1
"""Age of the last sample, s, from which the estimator counts as late."""

_LEVELS = {True: DiagnosticStatus.OK, False: DiagnosticStatus.ERROR}


_FORCE = tuple(f'wrench.force.{axis}' for axis in 'xyz')
_POINT = ('point.x', 'point.y', 'point.z')
_SLIP = (*STAMP, *topics.SLIP.schema.values)


class _LegTopics:
    """Connect the topics of one leg to its estimation stage."""

    def __init__(
        self,
        node: EstimatorNode,
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
        data, place = ('data',), Outgoing(topics.CONTACT_POSITION, (*STAMP, *_POINT[:2]), leg)
        first = [Outgoing(topics.SLIP, _SLIP, leg)]
        for topic in (
            *(topics.SLIPPING, topics.FRICTION),
            *(topics.FRICTION_MARGIN, topics.CONTACT_LOAD),
        ):
            first.append(Outgoing(topic, data, leg))
        # The last one, because it triggers the controller.
        wetness = Outgoing(topics.WETNESS, data, leg)
        self._send = node.messages.joint_sender([*first, wetness])
        self._send_placed = node.messages.joint_sender([*first, place, wetness])
        self._doubts = node.messages.output(topics.DOUBT, leg)
        for topic, callback, paths in (
            (topics.PRESSURE, self._on_pressure, ('fluid_pressure',)),
            (topics.WRENCH, self._on_wrench, (*STAMP, *_FORCE, 'wrench.torque.z')),
            (topics.POSITION, self._on_position, (*STAMP, *_POINT)),
        ):
            node.messages.receive(topic, callback, (FRAME, *paths), leg)
        if estimator.tuning.source == 'joints':
            velocity = (FRAME, *STAMP, *topics.CONTACT_VELOCITY.schema.values)
            node.messages.receive(topics.CONTACT_VELOCITY, self._on_velocity, velocity, leg)

    def _is_ours(self, frame: str) -> bool:
        """Return whether a frame is allowed for this leg; otherwise reject the sample."""
        try:
            check_frame(frame, self._leg)
        except InvalidInput as error:
            self.stage.reject(error)
            return False
        return True

    def _on_pressure(self, frame: str, pressure: float) -> None:
        if self._is_ours(frame):
            self.stage.pressure(pressure - self._ambient)

    def _on_wrench(
        self, frame: str, sec: int, nanosec: int, x: float, y: float, z: float, moment: float
    ) -> None:
        if self._is_ours(frame):
            self.stage.wrench(sec * 1_000_000_000 + nanosec, (x, y, z), moment)

    def _on_position(
        self, frame: str, sec: int, nanosec: int, x: float, y: float, z: float
    ) -> None:
        if self._is_ours(frame):
            self.stage.position(sec * 1_000_000_000 + nanosec, (x, y, z))

    def _on_velocity(
        self, frame: str, sec: int, nanosec: int, x: float, y: float, *variances: float
    ) -> None:
        if self._is_ours(frame):
            self.stage.contact_velocity(sec * 1_000_000_000 + nanosec, x, y, *variances)

    def _warn(self, error: InvalidInput) -> None:
        self._node.get_logger().warning(
            f'leg {self._leg}: sample ignored: {error}', throttle_duration_sec=1.0
        )

    def _publish_doubt(self, doubt: str) -> None:
        self._doubts(String(data=doubt))

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
                KeyValue(key='position noise', value=stage.estimator.noise.position.text('m')),
                KeyValue(key='force noise', value=stage.estimator.noise.force.text('N')),
                KeyValue(key='samples', value=str(stage.samples)),
            ],
        )

    def _publish(self, emission: Emission) -> None:
        self._node.emissions += 1
        estimate, stamp = emission.estimate, split(emission.stamp_ns)
        variance = estimate.slip_speed_sd**2
        values = (
            *(*stamp, *estimate.slip_velocity, variance, variance, estimate.slipping),
            *(estimate.friction_mean, estimate.margin, emission.load),
        )
        if emission.position is None:
            self._send(*values, estimate.wet_probability)
        else:
            self._send_placed(*values, *stamp, *emission.position, estimate.wet_probability)


class EstimatorNode(Node):
    """Estimate slip, friction and wetness under each foot; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    legs : dict
        For each leg, its topics and its estimation stage.
    emissions : int
        Number of estimates published so far, of all legs.
    messages : Messages
        Publishers and subscriptions.
    """

    _learnt = ''  # until the parameters are declared

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'estimator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        self._begin_with_learnt()
        values = declare(self, PARAMETERS)
        self._foot: Foot = values['foot']
        self._learnt = values['learnt']
        tuning = Tuning(**{attribute(each): values[each.name] for each in SETTINGS})
        self.emissions = 0
        self.messages = Messages(self)
        estimators, self.shared = estimators_of(
            len(values['legs']), self._foot, values['expected_load'], tuning
        )
        self._kept = learnt.settings_of(self.shared)
        period_ns, ambient = round(1e9 / values['publish_rate']), values['ambient_pressure']
        self.legs = {
            leg: _LegTopics(self, leg, estimator, period_ns, ambient)
            for leg, estimator in zip(values['legs'], estimators, strict=True)
        }
        if tuning.source == 'joints':
            self.messages.receive(topics.BODY_DOUBT, self._on_body_doubt, ('data',))
        self._diagnostics = self.messages.output(topics.DIAGNOSTICS)
        self._diagnostics_pace = Pace(1_000_000_000)
        self._keep_pace = Pace(KEEP_PERIOD_NS)
        self._reported = [True] * len(self.legs)
        self._simulated: bool = self.get_parameter('use_sim_time').value
        self._since_ns, self._counted = self.messages.now_ns(), 0
        self._health_pace = Pace(TICK_PERIOD_NS)
        if not self._simulated:
            self._hold(round(1e9 / values['publish_rate']))
        self.messages.on_tick(TICK_PERIOD_NS * 1e-9, self._tick)

    def _begin_with_learnt(self) -> None:
        """Declare what was learnt in earlier trials, if there is a file of it."""

        def given(name: str, default: str) -> str:
            return str(self.get_parameter(name).value if self.has_parameter(name) else default)

        path = given('learnt', '')
        if not path or not os.path.exists(path):
            return
        known = learnt.load(path, given('foot', FOOT.default))
        for name, value in known.items():
            if self.has_parameter(name):
                self.undeclare_parameter(name)
            self.declare_parameter(name, value, ignore_override=True)

    def keep_learnt(self) -> None:
        """Write what feet have learnt of friction, if it is new and there is a file for it."""
        if not self._learnt or (settings := learnt.settings_of(self.shared)) == self._kept:
            return
        try:
            learnt.save(self._learnt, settings, self._foot)
            self._kept = settings
        except PadError as error:
            self.get_logger().warning(f'parameter learnt: {error}', throttle_duration_sec=60.0)

    def destroy_node(self) -> None:
        """Write what was learnt, and destroy the node."""
        self.keep_learnt()
        super().destroy_node()

    def _on_body_doubt(self, doubt: str) -> None:
        for leg in self.legs.values():
            leg.stage.body_doubt(doubt)

    def _hold(self, period_ns: int) -> None:
        """Process the samples of a period together, when the estimate of the period is due.

        A leg without a sample at that moment has its estimate with the next ones, a period later.
        """
        wrenches = {self.resolve_topic_name(topics.WRENCH.name(leg)) for leg in self.legs}
        read, pace = FieldReader(topics.WRENCH.message_type, STAMP), Pace(period_ns)

        def due(messages: list[tuple[str, bytes]]) -> bool:
            for topic, data in messages:
                if topic in wrenches:
                    try:
                        sec, nanosec = read(data)
                    except (BadMessage, UnknownEncoding):
                        return True
                    return pace.due(sec * 1_000_000_000 + nanosec)
            return False

        self.messages.hold(due)

    def _tick(self, now_ns: int) -> None:
        if not self._health_pace.due(now_ns):
            return
        for leg in self.legs.values():
            leg.stage.tick(now_ns)
        if self._keep_pace.due(now_ns):
            self.keep_learnt()
        sound = [leg.stage.sound for leg in self.legs.values()]
        if self._diagnostics_pace.due(now_ns) or sound != self._reported:
            self._reported = sound
            array = DiagnosticArray(status=[leg.status() for leg in self.legs.values()])
            array.status.append(self._learnt_status())
            array.status.extend(self.messages.refusals.statuses())
            if not self._simulated:
                array.status.append(self._rate(now_ns))
            set_stamp(array.header.stamp, now_ns)
            self._diagnostics(array)

    def _learnt_status(self) -> DiagnosticStatus:
        """Return the scales of friction with their intervals, for ``/diagnostics``."""
        values = []
        for name, scale in self.shared.scales.items():
            low, high = scale.interval
            text = f'{scale.scale:.2f} ({low:.2f} to {high:.2f})'
            values.append(KeyValue(key=name, value=text))
        return DiagnosticStatus(
            name=f'{self.get_name()}: friction of the floor',
            hardware_id='feet',
            level=DiagnosticStatus.OK,
            message='friction over that of the contact model, with the interval of 95 %',
            values=values,
        )

    def _rate(self, now_ns: int) -> DiagnosticStatus:
        """Return rate and age of the samples, for ``/diagnostics``."""
        elapsed = max(1, now_ns - self._since_ns) * 1e-9
        rate = (self.samples - self._counted) / elapsed / len(self.legs)
        self._since_ns, self._counted = now_ns, self.samples
        age = (now_ns - max(leg.stage.last_ns for leg in self.legs.values())) * 1e-9
        return rate_status(self.get_name(), ' of a foot', rate, age, OLDEST)

    @property
    def samples(self) -> int:
        """Number of samples accepted so far, of all legs."""
        return sum(leg.stage.samples for leg in self.legs.values())


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
