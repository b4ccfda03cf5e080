# SPDX-License-Identifier: Apache-2.0
"""Parameters of nodes: a table for each node, from which descriptors and YAML are made."""

from __future__ import annotations

import difflib
import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ros_pad.bags.topics import Topic
from ros_pad.configuration import Setting, choice
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError, InvalidInput, PadError
from ros_pad.estimation import tuning
from ros_pad.simulation.scene import Scene
from ros_pad.trials import bag_notes

BACKEND_OPTIONS = 'backend_options'
"""Prefix of the regulator's parameters that are options of its backend."""

MOST_LEGS = 8
"""Largest number of a leg."""

_OF_ROS = ('use_sim_time', 'start_type_description_service')


@dataclass(frozen=True)
class Parameter(Setting):
    """One parameter of a node: a setting, and what the node does with its value.

    Attributes
    ----------
    read : callable or None
        Converts the value to what the node works with; raises `PadError` if it cannot.
    live : bool
        Whether it can be changed while the node runs; all others are read-only.
    """

    read: Callable[[Any], Any] | None = None
    live: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """Return the descriptor that ROS tools show."""
        descriptor = ParameterDescriptor(
            description=f'{self.description} [{self.unit}]' if self.unit else self.description,
            additional_constraints=self.allowed,
            read_only=not self.live,
        )
        kind = self.value_type
        if kind not in (int, float) or math.isinf(self.high - self.low):
            return descriptor
        bounds = {'from_value': kind(self.low), 'to_value': kind(self.high)}
        if kind is float:
            descriptor.floating_point_range = [FloatingPointRange(**bounds)]
        else:
            descriptor.integer_range = [IntegerRange(**bounds)]
        return descriptor


LEGS = Parameter('legs', [1, 2, 3, 4, 5, 6], 'Numbers of the legs of this node.', '', 1, MOST_LEGS)
FOOT = Parameter(
    'foot', 'large37', 'Name of a foot in config/feet, or path of a YAML file.', read=Foot.load
)
SCENE = Parameter(
    'scene',
    'hexapod_patches',
    'Name of a scene in config/scenes, or path of a YAML file.',
    read=Scene.load,
)
SEED = Parameter('seed', 0, 'Seed of the floor and of the sensor noise.', '', 0, 2**31 - 1)
EXPECTED_LOAD = Parameter(**vars(tuning.EXPECTED_LOAD))
AMBIENT_PRESSURE = Parameter(**vars(bag_notes.AMBIENT_PRESSURE))


def declare(
    node: Node,
    table: Sequence[Parameter],
    permit: Callable[[Mapping[str, Any]], object],
    apply: Callable[[Mapping[str, Any]], None],
) -> dict[str, Any]:
    """Declare a table of parameters and return their values by name.

    A name that looks misspelt is refused, other unknown names are warned of.

    Later changes of live parameters are checked, and update the returned mapping when nobody has
    refused them. Changes of the other parameters and of ``use_sim_time`` are refused.

    Parameters
    ----------
    node : Node
        Node to declare them on.
    table : sequence of Parameter
        Parameters of the node.
    permit : callable
        Called with all values before some change; raises `PadError` if they are not allowed
        together, and changes nothing, because another callback may still refuse the change.
    apply : callable
        Called with all values after some have changed.

    Raises
    ------
    ConfigError
        When a value is not allowed, or a name looks misspelt. The message names node, parameter,
        value and what is allowed.
    """
    known, values = {parameter.name: parameter for parameter in table}, {}
    for name, parameter in known.items():
        # ROS's own messages for a wrong type or range name neither node nor unit: accept any
        # value here, and check it below.
        if not node.has_parameter(name):
            node.declare_parameter(
                name, parameter.default, ParameterDescriptor(dynamic_typing=True)
            )
        given = node.get_parameter(name).value
        node.undeclare_parameter(name)
        try:
            value, values[name] = _checked(parameter, given)
        except ConfigError as error:
            raise ConfigError(f'node {node.get_name()}: {error}') from error
        node.declare_parameter(name, value, parameter.descriptor(), ignore_override=True)
    _refuse_misspelt(node, list(known))
    simulated = node.get_parameter('use_sim_time').value

    def read(changes: list[RosParameter]) -> dict[str, Any]:
        return {
            each.name: _checked(known[each.name], each.value)[1]
            for each in changes
            if each.name in known
        }

    def check(changes: list[RosParameter]) -> SetParametersResult:
        try:
            if any(each.name == 'use_sim_time' and each.value != simulated for each in changes):
                # A node that waits for a missing /clock would not vent.
                raise ConfigError('parameter use_sim_time is read only at the start of the node')
            permit(values | read(changes))
        except PadError as error:
            return SetParametersResult(reason=f'node {node.get_name()}: {error}')
        return SetParametersResult(successful=True)

    def follow(changes: list[RosParameter]) -> None:
        if changed := read(changes):
            values.update(changed)
            apply(values)

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(follow)
    return values


def _refuse_misspelt(node: Node, known: Sequence[str]) -> None:
    """Refuse a parameter whose name is near to a known one; warn of others."""
    for name in node.get_parameters_by_prefix(''):
        head = name.split('.')[0]
        if name in known or head in (*_OF_ROS, BACKEND_OPTIONS):
            continue
        for given, names in ((name, known), (head, [*known, BACKEND_OPTIONS])):
            for near in difflib.get_close_matches(given, names, n=1, cutoff=0.75):
                # A misspelt limit must not be ignored.
                raise ConfigError(
                    f'node {node.get_name()}: there is no parameter {name!r}.'
                    f' Did you mean {near!r}?'
                )
        if '.' not in name:
            node.get_logger().warning(f'there is no parameter {name!r}: it is ignored')


def _checked(parameter: Parameter, given: Any) -> tuple[Any, Any]:
    """Return a value as the parameter's type, and the value that the node works with."""
    try:
        value = parameter.accept(plain(given))
    except InvalidInput as error:
        raise ConfigError(f'parameter {error}') from None
    try:
        return value, parameter.read(value) if parameter.read else value
    except PadError as error:
        name = parameter.name
        raise ConfigError(f'parameter {name} = {value!r} is not allowed: {error}') from error


def plain(value: Any) -> Any:
    """Return the value of a parameter, an array as a list."""
    return value.tolist() if isinstance(value, array) else value


def chosen(known: Sequence[Topic]) -> Callable[[str], list[Topic]]:
    """Return a function that returns the topics of a leg that a text names, with commas."""
    kinds = {topic.kind: topic for topic in known}

    def read(text: str) -> list[Topic]:
        names = [each.strip() for each in text.split(',') if each.strip()]
        return [kinds[choice('topic of a leg', name, tuple(kinds))] for name in names]

    return read
