# SPDX-License-Identifier: Apache-2.0
"""Parameters of nodes: a table for each node, from which descriptors, YAML and docs are made."""

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

from ros_pad.configuration import Setting
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError, InvalidInput, PadError
from ros_pad.estimation import tuning
from ros_pad.nodes import topics
from ros_pad.simulation.scene import Scene
from ros_pad.trials import label

BACKEND_OPTIONS = 'backend_options'
"""Prefix of the regulator's parameters that are options of its backend."""

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
    change : callable or None
        Called after a change with the node and the new value.
    """

    read: Callable[[Any], Any] | None = None
    live: bool = False
    change: Callable[[Any, Any], None] | None = None

    @property
    def kind(self) -> str:
        """The name of the type in ROS tools."""
        kinds = {bool: 'bool', int: 'integer', float: 'double', str: 'string'}
        return kinds.get(self.value_type, 'integer array')

    def descriptor(self) -> ParameterDescriptor:
        """Return the descriptor that ROS tools show."""
        descriptor = ParameterDescriptor(
            description=f'{self.description} [{self.unit}]' if self.unit else self.description,
            additional_constraints=self.allowed,
            read_only=not self.live,
        )
        bounded = math.isfinite(self.low) and math.isfinite(self.high)
        if bounded and isinstance(self.default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(self.low), to_value=float(self.high))
            ]
        elif bounded and isinstance(self.default, int):
            descriptor.integer_range = [
                IntegerRange(from_value=int(self.low), to_value=int(self.high))
            ]
        return descriptor


LEGS = Parameter(
    'legs', list(topics.LEGS), 'Numbers of the legs of this node.', '', 1, topics.MOST_LEGS
)
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
AMBIENT_PRESSURE = Parameter(**vars(label.AMBIENT_PRESSURE))


def declare(
    node: Node,
    table: Sequence[Parameter],
    together: Callable[[Mapping[str, Any]], object] | None = None,
) -> dict[str, Any]:
    """Declare a table of parameters and return their values by name.

    A node made with ``automatically_declare_parameters_from_overrides`` also refuses a name that
    looks misspelt, and warns of other unknown names.

    Later changes of live parameters are checked, and update the returned mapping when they are
    accepted. Changes of the other parameters of the table and of ``use_sim_time`` are refused with
    the reason.

    Parameters
    ----------
    node : Node
        Node to declare them on.
    table : sequence of Parameter
        Parameters of the node.
    together : callable or None
        Called with the values, now and before each change; raises `PadError` if values are not
        allowed together.

    Raises
    ------
    ConfigError
        When a value is not allowed, or a name looks misspelt. The message names node, parameter,
        value and what is allowed.
    """
    values = {}
    for parameter in table:
        name = parameter.name
        # ROS's own messages for a wrong type or range name neither node nor unit: accept any
        # value here, and check it below.
        if not node.has_parameter(name):
            node.declare_parameter(
                name, parameter.default, ParameterDescriptor(dynamic_typing=True)
            )
        given = node.get_parameter(name).value
        node.undeclare_parameter(name)
        value, values[name] = _checked(node, parameter, given)
        node.declare_parameter(name, value, parameter.descriptor(), ignore_override=True)
    _refuse_misspelt(node, [parameter.name for parameter in table])
    live = {parameter.name: parameter for parameter in table if parameter.live}
    if together:
        try:
            together(values)
        except PadError as error:
            raise ConfigError(f'node {node.get_name()}: {error}') from error
    _follow(node, live, values, together)
    return values


def _refuse_misspelt(node: Node, known: Sequence[str]) -> None:
    """Refuse a parameter whose name is near to a known one; warn of others."""
    for name in node.get_parameters_by_prefix(''):
        head = name.split('.')[0]
        if name in known or head in (*_OF_ROS, BACKEND_OPTIONS):
            continue
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.75)
        near = near or difflib.get_close_matches(head, [*known, BACKEND_OPTIONS], n=1, cutoff=0.75)
        if near:
            # A misspelt limit must not be ignored.
            raise ConfigError(
                f'node {node.get_name()}: there is no parameter {name!r}.'
                f' Did you mean {near[0]!r}?'
            )
        if '.' not in name:
            node.get_logger().warning(f'there is no parameter {name!r}: it is ignored')


def _checked(node: Node, parameter: Parameter, given: Any) -> tuple[Any, Any]:
    """Return a value as the parameter's type, and the value that the node works with."""
    where = f'node {node.get_name()}: parameter '
    try:
        value = parameter.accept(given.tolist() if isinstance(given, array) else given)
    except InvalidInput as error:
        raise ConfigError(f'{where}{error}') from None
    try:
        return value, parameter.read(value) if parameter.read else value
    except PadError as error:
        where += f'{parameter.name} = {value!r}'
        raise ConfigError(f'{where} is not allowed: {error}') from error


def _follow(
    node: Node,
    live: dict[str, Parameter],
    values: dict[str, Any],
    together: Callable[[Mapping[str, Any]], object] | None,
) -> None:
    """Accept changes of live parameters; ROS itself refuses changes of read-only ones."""

    def prepare(changes: list[RosParameter]) -> list[RosParameter]:
        # A whole number is accepted for a double, as at the start.
        return [
            RosParameter(each.name, value=float(each.value))
            if each.name in live and type(each.value) is int and live[each.name].kind == 'double'
            else each
            for each in changes
        ]

    def check(changes: list[RosParameter]) -> SetParametersResult:
        changed = dict(values)
        for each in changes:
            if each.name == 'use_sim_time' and each.value != node.get_parameter(each.name).value:
                # A node that waits for a missing /clock would not vent.
                return SetParametersResult(
                    reason=f'node {node.get_name()}: parameter use_sim_time is read only at the'
                    ' start of the node'
                )
            if each.name in live:
                try:
                    _, changed[each.name] = _checked(node, live[each.name], each.value)
                except ConfigError as error:
                    return SetParametersResult(reason=str(error))
        try:
            if together:
                together(changed)
        except PadError as error:
            return SetParametersResult(reason=f'node {node.get_name()}: {error}')
        return SetParametersResult(successful=True)

    def apply(changes: list[RosParameter]) -> None:
        changed = [each for each in changes if each.name in live]
        for each in changed:
            _, values[each.name] = _checked(node, live[each.name], each.value)
        for each in changed:  # only now: some values are allowed only together
            change = live[each.name].change
            if change:
                change(node, values[each.name])

    node.add_pre_set_parameters_callback(prepare)
    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(apply)


def plain(value: Any) -> Any:
    """Return the value of a parameter in a form that JSON can express."""
    if isinstance(value, array):
        return value.tolist()
    if isinstance(value, list) and value and isinstance(value[0], bytes):
        return list(b''.join(value))
    return value


def values_of(node: Node) -> dict[str, Any]:
    """Return every parameter of a node by name, in a form that JSON can express."""
    names = sorted(node.get_parameters_by_prefix(''))
    values = [each.value for each in node.get_parameters(names)]
    return {name: plain(value) for name, value in zip(names, values, strict=True)}
