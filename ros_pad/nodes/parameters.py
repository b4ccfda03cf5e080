# SPDX-License-Identifier: Apache-2.0
"""Parameters of nodes: one table each, from which descriptors, YAML and documentation follow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node

from ros_pad.errors import ConfigError


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
    """

    name: str
    default: Any
    description: str
    unit: str = ''
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if self.choices:
            return f'one of {", ".join(self.choices)}'
        if math.isfinite(self.low) or math.isfinite(self.high):
            return f'{self.low:g} to {self.high:g} {self.unit}'.rstrip()
        return f'any {type(self.default).__name__}'

    def descriptor(self) -> ParameterDescriptor:
        """Return what ROS tools show of it."""
        descriptor = ParameterDescriptor(
            description=f'{self.description} [{self.unit}]' if self.unit else self.description,
            additional_constraints=self.allowed,
            read_only=True,
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


LEGS = Parameter('legs', [1, 2, 3, 4, 5, 6], 'Legs that are served, numbers from 1 to 6.')
FOOT = Parameter('foot', 'large37', 'Name of a foot in config/feet, or path of a YAML file.')
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

    Raises
    ------
    ConfigError
        Naming node, parameter, value and what is allowed.
    """
    values = {}
    for parameter in table:
        given: Any = None
        try:
            if node.has_parameter(parameter.name):  # declared from overrides already
                given = node.get_parameter(parameter.name).value
                node.undeclare_parameter(parameter.name)
            value = node.declare_parameter(
                parameter.name, parameter.default, parameter.descriptor()
            ).value
            if parameter.choices and value not in parameter.choices:
                given = value
                raise InvalidParameterValueException(parameter.name, value, 'not a choice')
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            shown = repr(given) if given is not None else str(error)
            raise ConfigError(
                f'node {node.get_name()}: parameter {parameter.name} = {shown} is not allowed:'
                f' {parameter.allowed} is needed'
            ) from error
        values[parameter.name] = list(value) if isinstance(parameter.default, list) else value
    return values
