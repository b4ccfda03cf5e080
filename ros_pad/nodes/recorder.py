# SPDX-License-Identifier: Apache-2.0
"""The recorder node: writes every topic of every leg into a bag."""

from __future__ import annotations

import datetime
import json
import sys
import time
from collections import Counter
from collections.abc import Callable
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters
from rcl_interfaces.srv import ListParameters
from rclpy.client import Client
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from rclpy.qos import qos_profile_parameter_events
from rclpy.subscription import Subscription
from rclpy.task import Future

from ros_pad.errors import BagError
from ros_pad.nodes import qos
from ros_pad.nodes import topics
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.parameters import plain
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import clock_time
from ros_pad.trials import label
from ros_pad.trials.bag import FLUSH_PERIOD
from ros_pad.trials.bag import BagWriter

PARAMETERS = (
    LEGS,
    Parameter(
        'folder', '', 'Folder of the bag, which must not exist; empty: named after the time.'
    ),
)


class RecorderNode(Node):
    """Writes every topic of `ros_pad.nodes.topics`, latched ones too, into a new bag.

    Messages are taken and written as the bytes they travel in, so that tens of thousands a
    second pass. Their log time is the node's clock: with ``use_sim_time`` that of the last
    ``/clock`` message, and 0 for what comes before the first one.

    What is recorded reaches the disk within about a second. Messages that were lost on the way
    here are counted by the middleware; the log tells of them as it happens, and the bag at its
    end, under `ros_pad.trials.label.LOST`.

    Its ROS parameters are in :data:`PARAMETERS`; ``use_sim_time`` is read at the start only.

    Parameters
    ----------
    custom_data : mapping of str to str, optional
        What the bag is to say about the trial. Without it, it says the versions of ros_pad and
        its libraries, and the parameters of all nodes in the namespace of this one, which are
        asked as they appear, with their changes since.
    **kwargs
        Passed on to `rclpy.node.Node`.

    Raises
    ------
    BagError
        When the folder exists or cannot be written. Once recording, a full disk raises it out
        of the executor.
    ConfigError
        When a parameter is not as it must be.
    """

    def __init__(self, custom_data: Mapping[str, str] | None = None, **kwargs: Any) -> None:
        super().__init__('recorder', **kwargs)
        try:
            values = declare(self, PARAMETERS)
            folder = values['folder'] or f'trial_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}'
            recorded = topics.names(values['legs'])
            self._simulated = self.get_parameter('use_sim_time').value
            # Called for every message; replaced when the first /clock message is there.
            self._now: Callable[[], int] = self._before_clock if self._simulated else time.time_ns
            self._clock_ns = 0
            self._bag = BagWriter(
                folder, custom_data or {label.MADE_WITH: json.dumps(label.made_with())}
            )
        except BaseException:
            super().destroy_node()
            raise
        self._recordings: dict[str, Subscription] = {}
        self._lost: Counter[str] = Counter()
        self._failed = False  # whether the bag takes no more
        # The clock comes first: an executor that finds several messages waiting takes them in
        # the order of their subscriptions.
        for name, topic in recorded.items():
            full_name = self.resolve_topic_name(name)
            self._bag.add_topic(full_name, topic.type_name, qos.offered_profiles(topic.publish))
            self._record(full_name, topic, qos.recording([topic.publish]))
        self._said: dict[str, dict[str, Any]] = {}
        # By which each node of the robot is asked; none where that is forbidden.
        self._askers: dict[str, tuple[Client, Client] | None] = {}
        self._answered: set[str] = set()
        self._lives: dict[str, set[bytes]] = {}  # of each node: who publishes its changes
        # Of wall time, whatever the clock of the trial does.
        self.create_timer(FLUSH_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._asks = custom_data is None
        self._changes: list[tuple[int, str, str, Any]] = []
        if self._asks:
            self.create_subscription(
                ParameterEvent, '/parameter_events', self._on_change, qos_profile_parameter_events
            )
        self.get_logger().info(f'recording {len(recorded)} topics into {self._bag.folder}')

    @property
    def message_count(self) -> int:
        """Number of messages recorded so far."""
        return self._bag.message_count

    @property
    def lost(self) -> dict[str, int]:
        """Number of messages that did not come, by topic; only topics that miss some."""
        return dict(self._lost)

    def describe(self, custom_data: Mapping[str, str]) -> None:
        """Add to what the bag says about the trial."""
        self._bag.describe(custom_data)

    def close(self, custom_data: Mapping[str, str] | None = None) -> None:
        """Stop recording and close the bag.

        Parameters
        ----------
        custom_data : mapping of str to str, optional
            Added to what the bag says about the trial.

        Raises
        ------
        BagError
            When the disk is full: says how many messages are saved.
        """
        for subscription in self._recordings.values():
            self.destroy_subscription(subscription)
        self._recordings.clear()
        self._bag.close({label.LOST: json.dumps(self.lost)} | dict(custom_data or {}))

    def destroy_node(self) -> None:
        """Close the bag, if nobody has, and the node; raises as :meth:`close` does."""
        try:
            self.close()
        finally:
            super().destroy_node()

    def _record(self, name: str, topic: topics.Topic, profile: QoSProfile) -> None:
        """Subscribe to a topic so that each message goes into the bag."""

        def adapt(_event: object) -> None:
            # A publisher offers less than we ask for, as drivers of sensors do: ask for less.
            offered = [info.qos_profile for info in self.get_publishers_info_by_topic(name)]
            self.destroy_subscription(self._recordings.pop(name))
            self._record(name, topic, qos.recording([topic.publish, *offered]))

        self._recordings[name] = self.create_subscription(
            topic.message,
            name,
            self._clock_writer(name) if topic is topics.CLOCK else self._writer(name),
            profile,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=adapt, message_lost=self._loss_counter(name)
            ),
            raw=True,
        )

    def _loss_counter(self, name: str) -> Callable[[Any], None]:
        known = 0

        def callback(event: Any) -> None:
            nonlocal known
            # The change that an event names may have been told by the one before.
            more, known = event.total_count - known, event.total_count
            self._lost[name] += more
            if more:
                self.get_logger().warning(
                    f'{self._lost.total()} messages lost so far, {self._lost[name]} of them on'
                    f' {name}: this machine or network does not keep up',
                    throttle_duration_sec=1.0,
                )

        return callback

    def _look(self) -> None:
        """Write down what has come, also when nothing comes any more, and who has appeared."""
        if self._failed:
            return
        if self._asks:
            self._ask_nodes()
        try:
            self._bag.flush()
        except BagError:
            self._failed = True
            raise

    def _ask_nodes(self) -> None:
        """Ask every node of the robot for its parameters, once its services are there.

        One that does not answer is asked again, and so is one that went and came back. One that
        was killed stays on the graph for a while: when it comes back before its name is dropped,
        only its publishers are new.
        """
        here = {
            f'{namespace.rstrip("/")}/{name}'
            for name, namespace in self.get_node_names_and_namespaces()
            if namespace == self.get_namespace() and not name.startswith('_')
        }
        for node in self._askers.keys() - here:
            for client in self._askers.pop(node) or ():
                self.destroy_client(client)
            self._answered.discard(node)
        for node in here - self._askers.keys():
            self._askers[node] = self._asker(node)
        lives: dict[str, set[bytes]] = {}
        for each in self.get_publishers_info_by_topic('/parameter_events'):
            node = f'{each.node_namespace.rstrip("/")}/{each.node_name}'
            lives.setdefault(node, set()).add(bytes(each.endpoint_gid))
        self._answered -= {
            node for node, publishers in lives.items() if publishers - self._lives.get(node, set())
        }
        self._lives = lives
        for node, clients in self._askers.items():
            if clients and node not in self._answered:
                lister, getter = clients
                if lister.service_is_ready() and getter.service_is_ready():
                    self._ask(node, lister, getter)

    def _asker(self, node: str) -> tuple[Client, Client] | None:
        try:
            lister = self.create_client(ListParameters, f'{node}/list_parameters')
            return lister, self.create_client(GetParameters, f'{node}/get_parameters')
        except RuntimeError as error:  # SROS 2 may forbid it
            self.get_logger().warning(f'the bag will lack the parameters of {node}: {error}')
            return None

    def _ask(self, node: str, lister: Client, getter: Client) -> None:
        def named(future: Future) -> None:
            self._said.setdefault(node, {})  # from now on its changes count
            self._ask_for(list(future.result().result.names), node, getter, {})

        lister.call_async(ListParameters.Request()).add_done_callback(named)

    def _ask_for(
        self, names: list[str], node: str, getter: Client, answers: dict[str, Any]
    ) -> None:
        """Ask a node for the values of parameters, and let the bag say them with its others."""

        def told(future: Future) -> None:
            # Only now: of a node that comes back, this service may be seen after the other.
            self._answered.add(node)
            values = future.result().values
            if len(values) == len(names):
                try:
                    said = {
                        name: plain(parameter_value_to_python(value))
                        for name, value in zip(names, values, strict=True)
                    }
                except RuntimeError as error:  # of a type that ROS does not have
                    self.get_logger().warning(
                        f'the bag will lack parameters of {node}: {error}', once=True
                    )
                    return
                answers.update(said)
                self._said[node] = answers
                self._bag.describe({label.PARAMETERS: json.dumps(self._said)})
            elif len(names) > 1:
                # One that is declared without a value keeps a node from telling all others.
                for name in names:
                    self._ask_for([name], node, getter, answers)

        request = GetParameters.Request(names=names)
        getter.call_async(request).add_done_callback(told)

    def _on_change(self, event: ParameterEvent) -> None:
        """Note which parameters changed of nodes that told theirs."""
        if event.node not in self._said:
            return
        now_ns = self._now()
        for each in event.changed_parameters:
            value = plain(parameter_value_to_python(each.value))
            self._changes.append((now_ns, event.node, each.name, value))
        self._bag.describe({label.CHANGES: json.dumps(self._changes)})

    def _writer(self, name: str) -> Callable[[bytes], None]:
        write = self._bag.write

        def callback(data: bytes) -> None:
            try:
                write(name, data, self._now())
            except BagError:
                # Once is enough: what has been on its way since finds the bag closed.
                if not self._failed:
                    self._failed = True
                    raise

        return callback

    def _clock_writer(self, name: str) -> Callable[[bytes], None]:
        write = self._writer(name)

        def callback(data: bytes) -> None:
            now_ns = clock_time(data)
            # A bag knows no time before 0.
            if now_ns is not None and now_ns >= 0:
                self._clock_ns = now_ns
                if self._simulated:
                    self._now = self._simulated_time
            write(data)

        return callback

    def _simulated_time(self) -> int:
        return self._clock_ns

    def _before_clock(self) -> int:
        self.get_logger().warning(
            'use_sim_time is on and no /clock has come yet: messages are recorded at time 0',
            once=True,
        )
        return 0


def main(args: list[str] | None = None) -> int:
    """Record until SIGINT or SIGTERM; return the exit status.

    Returns
    -------
    int
        0 when the bag was closed, 1 when it could not be written, 2 for a bad parameter.
    """
    return run(RecorderNode, args)


if __name__ == '__main__':
    sys.exit(main())
