# SPDX-License-Identifier: Apache-2.0
"""What the nodes have in common: parameters, messages, ticks, and their health.

Nodes read the fields that they need in the bytes of a message, and send bytes in which only
numbers differ: rclpy takes several times as long to convert whole messages.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from ros_pad.bags import topics
from ros_pad.bags.codec import field_getter, message_type, put_field
from ros_pad.bags.topics import STAMP, Topic
from ros_pad.bags.wire import Wire
from ros_pad.nodes.parameters import Parameter, declare
from ros_pad.nodes.qos import publisher, subscription
from ros_pad.pace import LATE, TICK_PERIOD_NS, Pace
from ros_pad.records import Block, split
from ros_pad.regulators.channel import Level

_DIAGNOSTICS = message_type(topics.DIAGNOSTICS.type_name)
_Status = type(_DIAGNOSTICS.blank('diagnostic_msgs/msg/DiagnosticStatus'))
_KeyValue = type(_DIAGNOSTICS.blank('diagnostic_msgs/msg/KeyValue'))

OLDEST = 0.1
"""Age of the last sample, s, from which a node that needs samples counts as late."""


class PadNode(Node):
    """A node of ros_pad.

    Parameters
    ----------
    name : str
        Its name, unless it is remapped.
    parameters : sequence of Parameter
        Its parameters.
    **kwargs
        Passed on to `rclpy.node.Node`.

    Attributes
    ----------
    values : dict
        Values of the parameters by name; changes of live ones update it.
    now_ns : callable
        Returns the node's time, ns, five times as fast as rclpy does.
    simulated : bool
        Whether this is the time of ``/clock``.
    refused : Counter of str
        Number of messages that could not be read, by full name of the topic.
    reported : object
        What was found when the health was last reported.

    Raises
    ------
    ConfigError
        When a parameter is not allowed.
    """

    OK, WARN, ERROR = Level.OK, Level.WARN, Level.ERROR

    def __init__(self, name: str, parameters: Sequence[Parameter], **kwargs: Any) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **kwargs)
        self.prepare()
        self.values = declare(self, parameters, self.permit, self.apply)
        self._send_parameters = self.sender(topics.PARAMETERS, topics.PARAMETERS.values)
        self._publish_parameters()
        self.add_post_set_parameters_callback(self._publish_parameters)
        handle = self.get_clock().handle
        self.now_ns: Callable[[], int] = lambda: int(handle.get_now().nanoseconds)
        self.simulated: bool = self.get_parameter('use_sim_time').value
        self.refused: Counter[str] = Counter()
        self.reported: Any = None
        self._reason, self._quiet_until = '', 0.0  # of the last refusal
        self._record_ns = 0  # stamp of the last record that was processed
        self._tick: Callable[[int], object] = lambda now_ns: None
        self._pace, self._since_ns, self._counted = Pace(1_000_000_000), self.now_ns(), 0
        self._send_health = self.sender(topics.DIAGNOSTICS, ('status',))

    def prepare(self) -> None:
        """Change what is given for the parameters, before they are declared."""

    def permit(self, values: Mapping[str, Any]) -> None:
        """Raise `PadError` if these values are not allowed together; change nothing."""

    def apply(self, values: Mapping[str, Any]) -> None:
        """Live by changed parameters, which nobody has refused."""

    def _publish_parameters(self, changes: Sequence[object] = ()) -> None:
        """Tell recorders the values of all parameters; who comes later hears of them, too."""
        known = self.get_parameters(sorted(self.get_parameters_by_prefix('')))
        values = {self.get_fully_qualified_name(): {each.name: each.value for each in known}}
        self._send_parameters(json.dumps(values, default=list))

    # --- messages ------------------------------------------------------------------------------

    def sender(
        self,
        topic: Topic,
        paths: Sequence[str] = (),
        leg: int | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> Callable[..., None]:
        """Return a function that sends a message with these values, in the order of `paths`.

        Before them comes the time, ns, if the message has one. The frame is that of the table of
        topics, other fields are zero or empty.
        """
        publish, of_type = publisher(self, topic, leg).publish, message_type(topic.type_name)
        message, stamp = of_type.blank(), _stamp_of(topic)
        frame = {topics.FRAME: topic.frame.format(leg=leg)} if topic.frame else {}
        for path, value in (frame | dict(constants or {})).items():
            put_field(message, path, value)

        def send(*values: Any) -> None:
            if stamp:
                values = (*split(values[0]), *values[1:])
            for path, value in zip((*stamp, *paths), values, strict=True):
                put_field(message, path, value)
            publish(of_type.encode(message))

        return send

    def record_output(
        self, topic: Topic, legs: Sequence[int], fields: Sequence[str] | None = None
    ) -> Callable[[Block], None]:
        """Return a function that publishes blocks of records of these legs, with some fields."""
        assert topic.record
        encode, publish = Wire(topic.record, legs, fields).encode, publisher(self, topic).publish
        return lambda block: publish(encode(block))

    def receive_record(
        self, topic: Topic, legs: Sequence[int], callback: Callable[[Block], object]
    ) -> None:
        """Call a function with each block of records of these legs."""
        assert topic.record
        self._receive(topic, None, Wire(topic.record, legs).decode, callback)

    def receive(
        self,
        topic: Topic,
        callback: Callable[..., None],
        paths: Sequence[str] = (),
        leg: int | None = None,
    ) -> None:
        """Call a function with the time, ns, and some fields of each message."""
        get = field_getter((*_stamp_of(topic), *paths))

        def take(message: Any) -> None:
            seconds, fraction, *values = get(message)
            callback(seconds * 1_000_000_000 + fraction, *values)

        self._receive(topic, leg, message_type(topic.type_name).decode, take)

    def receive_message(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        """Call a function with each message, whole."""
        self._receive(topic, None, message_type(topic.type_name).decode, callback)

    def _receive(
        self,
        topic: Topic,
        leg: int | None,
        read: Callable[[bytes], Any],
        callback: Callable[[Any], object],
    ) -> None:
        full_name = self.resolve_topic_name(topic.name(leg))

        def take(data: bytes) -> None:
            try:
                content = read(data)
            except Exception as error:  # rclpy raises various ones
                self.refuse(full_name, error)
            else:
                callback(content)

        subscription(self, topic, take, leg, raw=True)

    def refuse(self, topic: str, error: Exception) -> None:
        """Count a message of a topic that is refused for the reason in `error`, and warn of it."""
        self.refused[topic] += 1
        self._reason = f'{topic}: message refused: {error}'
        # rclpy's own throttle takes 0.3 ms for each text that it drops.
        if time.monotonic() > self._quiet_until:
            self._quiet_until = time.monotonic() + 1.0
            self.get_logger().warning(f'{self._reason}; {self.refused[topic]} so far')

    # --- time ----------------------------------------------------------------------------------

    def every(self, period: float, callback: Callable[[], object]) -> None:
        """Call a function every so many seconds of a clock that no change of the time stops."""
        self.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def on_tick(
        self,
        callback: Callable[[int], object],
        period: float = TICK_PERIOD_NS * 1e-9,
        all_steps: bool = False,
    ) -> None:
        """Call a function again and again with the node's time, ns.

        In real time a timer calls it every ``period`` seconds. In simulated time nodes live by the
        stamps of records, see :meth:`advance`, and ``/clock`` calls it where no records come, once
        in 0.1 s, or at all steps.
        """
        pace = Pace(TICK_PERIOD_NS)
        self._tick = lambda now_ns: callback(now_ns) if all_steps or pace.due(now_ns) else None
        if not self.simulated:
            self.every(period, lambda: self._tick(self.now_ns()))
            return

        def on_clock(now_ns: int) -> None:
            # Which of a record and the clock of its moment comes first must mean nothing.
            if all_steps or abs(now_ns - self._record_ns) > TICK_PERIOD_NS:
                self._tick(now_ns)

        self.receive(topics.CLOCK, on_clock)

    def advance(self, stamp_ns: int) -> None:
        """Process the stamp of a record, ns, which is a tick in simulated time."""
        if self.simulated:
            self._record_ns = stamp_ns
            self._tick(stamp_ns)

    # --- health --------------------------------------------------------------------------------

    def due(self, now_ns: int, found: Any = None) -> bool:
        """Return whether to report: once a second, and as soon as what was found changes."""
        due = self._pace.due(now_ns) or found != self.reported
        self.reported = found
        return due

    def status(
        self,
        name: str,
        level: Level,
        message: str,
        values: Mapping[str, object] | None = None,
        part: str = '',
    ) -> Any:
        """Return a status of this node, with values by name, and the part that it is about."""
        pairs = [_KeyValue(key=key, value=str(each)) for key, each in (values or {}).items()]
        return _Status(
            name=f'{self.get_name()}: {name}',
            hardware_id=part,
            level=level,
            message=message,
            values=pairs,
        )

    def rate(self, now_ns: int, samples: int, last_ns: int) -> list[Any]:
        """Return rate and age of samples, of which so many have come; in real time only."""
        if self.simulated:
            return []
        rate = (samples - self._counted) / (max(1, now_ns - self._since_ns) * 1e-9)
        self._since_ns, self._counted = now_ns, samples
        age = (now_ns - last_ns) * 1e-9
        values = {
            'samples a second (Hz)': f'{rate:.1f}',
            'age of the last sample (s)': f'{age:.3f}',
        }
        if rate > 0.0 and not -OLDEST < age < OLDEST:
            text = f'{LATE}, or clocks differ: samples are {age:.3g} s old'
            return [self.status('rate', self.WARN, text, values)]
        return [self.status('rate', self.OK, f'{rate:.0f} samples a second', values)]

    def report(self, now_ns: int, statuses: Iterable[Any]) -> None:
        """Publish these on ``/diagnostics``, and which messages were refused."""
        every = list(statuses)
        if self.refused:
            every.append(self.status('refused messages', self.WARN, self._reason, self.refused))
        self._send_health(now_ns, every)


def _stamp_of(topic: Topic) -> tuple[str, ...]:
    """Return where messages of a topic have their time, as seconds and nanoseconds."""
    if topic is topics.CLOCK:
        return topic.values
    fields = dict(message_type(topic.type_name).fields(topic.type_name))
    return STAMP if 'header' in fields else ()
