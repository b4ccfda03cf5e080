# SPDX-License-Identifier: Apache-2.0
"""Parameters of nodes: one table each, from which descriptors, YAML and documentation follow."""

from __future__ import annotations

import difflib
import math
from array import array
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError
from ros_pad.errors import PadError
from ros_pad.nodes import topics
from ros_pad.simulation.scene import Scene

BACKEND_OPTIONS = 'backend_options'
"""Prefix of the regulator's parameters that are options of its backend, whatever they are."""

_OF_ROS = ('use_sim_time', 'start_type_description_service')


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node.

    Attributes
    ----------
    name : str
    default : bool, int, float, str or list of int
        Its type is the parameter's type.
    description : str
        One sentence.
    unit : str
        Empty for text and counts.
    low, high : float
        Allowed range of a number.
    choices : tuple of str
        Allowed words; empty for any.
    read : callable or None
        Makes of the value what the node works with; raises `PadError` where it cannot.
    live : bool
        Whether it may be changed while the node runs; all others are read-only.
    change : callable or None
        What besides is to be done then, with the node and the new value.
    """

    name: str
    default: Any
    description: str
    unit: str = ''
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    read: Callable[[Any], Any] | None = None
    live: bool = False
    change: Callable[[Any, Any], None] | None = None

    @property
    def kind(self) -> str:
        """The type as ROS tools call it."""
        kinds = {bool: 'bool', int: 'integer', float: 'double', str: 'string'}
        return kinds.get(type(self.default), 'integer array')

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if self.choices:
            return f'one of {", ".join(self.choices)}'
        if isinstance(self.default, list):
            return f'a list of different whole numbers from {self.low:g} to {self.high:g}'
        if isinstance(self.default, (int, float)) and not isinstance(self.default, bool):
            whole = 'a whole number' if isinstance(self.default, int) else 'a number'
            return f'{whole} from {self.low:.10g} to {self.high:.10g} {self.unit}'.rstrip()
        return 'true or false' if isinstance(self.default, bool) else 'text'

    def accept(self, value: Any) -> Any:
        """Return a value as this parameter's type; a whole number is taken for a double too.

        Raises
        ------
        ValueError
            When it has another type, or is not among what is allowed.
        """

        def whole(number: Any) -> bool:
            integer = isinstance(number, int) and not isinstance(number, bool)
            return integer and self.low <= number <= self.high

        match self.default:
            case bool():
                good = isinstance(value, bool)
            case int():
                good = whole(value)
            case float():
                good = isinstance(value, float) and self.low <= value <= self.high
                good = good or whole(value)
            case str():
                good = isinstance(value, str) and (not self.choices or value in self.choices)
            case _:
                value = list(value) if isinstance(value, (array, list)) else []
                good = all(map(whole, value)) and len(set(value)) == len(value) > 0
        if not good:
            raise ValueError
        return float(value) if isinstance(self.default, float) else value

    def descriptor(self) -> ParameterDescriptor:
        """Return what ROS tools show of it."""
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


LEGS = Parameter('legs', list(topics.LEGS), 'Legs that are served.', '', 1, 6)
FOOT = Parameter(
    'foot', 'large37', 'Name of a foot in config/feet, or path of a YAML file.', read=Foot.load
)
SCENE = Parameter(
    'scene', 'hexapod_patches', 'Name of a scene, or path of a YAML file.', read=Scene.load
)
SEED = Parameter('seed', 0, 'Seed of the floor and of the sensor noise.', '', 0, 2**31 - 1)
EXPECTED_LOAD = Parameter(
    'expected_load', 6.83, 'Normal force on a foot in stance: a third of the weight in a tripod.',
    'N', 0.01, 1000.0,
)  # fmt: skip
AMBIENT_PRESSURE = Parameter(
    'ambient_pressure', 101325.0, 'Pressure around the robot: messages are absolute, pads gauge.',
    'Pa', 30000.0, 120000.0,
)  # fmt: skip


def declare(node: Node, table: Sequence[Parameter]) -> dict[str, Any]:
    """Declare a table of parameters and return their values by name.

    A node that is made with ``automatically_declare_parameters_from_overrides`` also refuses what
    looks like a misspelt parameter, and warns of others that it does not have.

    Later changes are judged here too: those of live parameters are in what was returned as soon
    as they are accepted, and all others are refused with the reason, ``use_sim_time`` among them.

    Raises
    ------
    ConfigError
        Naming node, parameter, value and what is allowed.
    """
    values = {}
    for parameter in table:
        name = parameter.name
        # ROS's own words for a wrong type or range name neither node nor unit: take whatever
        # was given, and judge it here.
        if not node.has_parameter(name):
            node.declare_parameter(
                name, parameter.default, ParameterDescriptor(dynamic_typing=True)
            )
        given = node.get_parameter(name).value
        node.undeclare_parameter(name)
        value, values[name] = _judged(node, parameter, given)
        node.declare_parameter(name, value, parameter.descriptor(), ignore_override=True)
    known = [parameter.name for parameter in table]
    for name in node.get_parameters_by_prefix(''):
        head = name.split('.')[0]
        if head in (*known, *_OF_ROS, BACKEND_OPTIONS):
            continue
        near = difflib.get_close_matches(head, [*known, BACKEND_OPTIONS], n=1, cutoff=0.75)
        if near:
            # A limit that is not heard of because of a slip of the pen must not pass.
            raise ConfigError(
                f'node {node.get_name()}: parameter {name!r} is not known here.'
                f' Did you mean {near[0]!r}?'
            )
        if '.' not in name:
            node.get_logger().warning(f'parameter {name!r} is not known here')
    _follow(node, {parameter.name: parameter for parameter in table if parameter.live}, values)
    return values


def _judged(node: Node, parameter: Parameter, given: Any) -> tuple[Any, Any]:
    """Return a value as the parameter's type, and what the node works with."""
    where = f'node {node.get_name()}: parameter {parameter.name} = '
    try:
        value = parameter.accept(given)
    except ValueError:
        shown = given.tolist() if isinstance(given, array) else given
        raise ConfigError(
            f'{where}{shown!r} is not allowed: {parameter.allowed} is needed'
        ) from None
    try:
        return value, parameter.read(value) if parameter.read else value
    except PadError as error:
        raise ConfigError(f'{where}{value!r} is not allowed: {error}') from error


def _follow(node: Node, live: dict[str, Parameter], values: dict[str, Any]) -> None:
    """Let live parameters be changed; ROS itself refuses to change those that are read-only."""

    def prepare(changes: list[RosParameter]) -> list[RosParameter]:
        # As at the start, a whole number will do for a double.
        return [
            RosParameter(each.name, value=float(each.value))
            if each.name in live and type(each.value) is int and live[each.name].kind == 'double'
            else each
            for each in changes
        ]

    def judge(changes: list[RosParameter]) -> SetParametersResult:
        for each in changes:
            if each.name == 'use_sim_time' and each.value != node.get_parameter(each.name).value:
                # A node that waits for a /clock that nobody publishes would not vent.
                return SetParametersResult(
                    reason=f'node {node.get_name()}: parameter use_sim_time is read at the start'
                )
            if each.name in live:
                try:
                    _judged(node, live[each.name], each.value)
                except ConfigError as error:
                    return SetParametersResult(reason=str(error))
        return SetParametersResult(successful=True)

    def take(changes: list[RosParameter]) -> None:
        for each in changes:
            if each.name in live:
                parameter = live[each.name]
                _, values[each.name] = _judged(node, parameter, each.value)
                if parameter.change:
                    parameter.change(node, values[each.name])

    node.add_pre_set_parameters_callback(prepare)
    node.add_on_set_parameters_callback(judge)
    node.add_post_set_parameters_callback(take)


def plain(value: Any) -> Any:
    """Return the value of a parameter as JSON has it."""
    if isinstance(value, array):
        return value.tolist()
    if isinstance(value, list) and value and isinstance(value[0], bytes):
        return list(b''.join(value))
    return value


def values_of(node: Node) -> dict[str, Any]:
    """Return every parameter of a node as JSON has it, by name."""
    names = sorted(node.get_parameters_by_prefix(''))
    values = [each.value for each in node.get_parameters(names)]
    return {name: plain(value) for name, value in zip(names, values, strict=True)}
