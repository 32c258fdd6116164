# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS parameters declared from the dataclasses that hold them.

All parameters are read-only: a node is configured when it starts, and a flight is not the time
to change it.
"""

from __future__ import annotations

from difflib import get_close_matches
from sys import float_info
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import ParameterInfo, describe

_Parameters = TypeVar('_Parameters')
Group = tuple[str, type[Any]]
"""Prefix of the ROS names (empty for none) and the dataclass behind them."""

_INT64_MAX = 2**63 - 1
_OF_RCLPY = ('use_sim_time', 'start_type_description_service')


def declare_parameters(node: Node, parameters: type[_Parameters], group: str = '') -> _Parameters:
    """Declare every field of a parameter dataclass on a node and return the filled instance.

    With a group the ROS names are ``group.field``. The node must have been created with
    ``automatically_declare_parameters_from_overrides``, so that given values are judged here, in
    our own words, and unknown names can be found.

    Raises:
        ConfigurationError: a value of another type or outside its bounds.

    """
    infos = describe(parameters)
    values = {}
    for info in infos:
        name = ros_name(group, info)
        values[info.name] = info.default
        if node.has_parameter(name):
            values[info.name] = _converted(name, info, node.get_parameter(name).value)
            node.undeclare_parameter(name)
    filled = parameters(**values)
    for info in infos:
        value = values[info.name]
        value = list(value) if isinstance(value, tuple) else value
        node.declare_parameter(
            ros_name(group, info), value, descriptor_of(info), ignore_override=True
        )
    return filled


def refuse_unknown(node: Node, *groups: Group) -> None:
    """Raise ConfigurationError when a value was given for a parameter that nobody declares."""
    names = [ros_name(group, info) for group, each in groups for info in describe(each)]
    for name in node.get_parameters_by_prefix(''):
        if name in names or name in _OF_RCLPY or name.startswith('qos_overrides.'):
            continue
        near = get_close_matches(name, names, n=1)
        remedy = f'did you mean {near[0]}?' if near else 'see docs/parameters.md'
        raise ConfigurationError(f'parameter {name} of {node.get_name()} is unknown: {remedy}')


def ros_name(group: str, info: ParameterInfo) -> str:
    """Return the ROS name of a parameter of a group; the empty group has no prefix."""
    return f'{group}.{info.name}' if group else info.name


def descriptor_of(info: ParameterInfo) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter: meaning, unit, bounds; always read-only."""
    unit = f' [{info.unit}]' if info.unit else ''
    descriptor = ParameterDescriptor(description=f'{info.description}{unit}', read_only=True)
    if info.choices:
        descriptor.additional_constraints = f'one of: {", ".join(info.choices)}'
    if isinstance(info.default, bool) or (info.low is None and info.high is None):
        return descriptor
    if isinstance(info.default, int):
        low = -_INT64_MAX if info.low is None else int(info.low)
        high = _INT64_MAX if info.high is None else int(info.high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=0)]
    elif isinstance(info.default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=-float_info.max if info.low is None else float(info.low),
                to_value=float_info.max if info.high is None else float(info.high),
                step=0.0,
            )
        ]
    return descriptor


def _converted(name: str, info: ParameterInfo, value: Any) -> Any:
    """Return a given value in the type of the default; whole numbers serve as floats."""
    expected = type(info.default)
    if expected is float and type(value) is int:
        return float(value)
    if expected is tuple and not isinstance(value, str | bool | int | float) and value is not None:
        element = type(info.default[0]) if info.default else str
        if all(isinstance(each, element) for each in value):
            return tuple(value)
    if type(value) is expected:
        return value
    raise ConfigurationError(
        f'parameter {name} = {value!r}: give {_NAMES.get(expected, "another type")}, '
        f'such as {info.default!r}'
    )


_NAMES = {
    bool: 'true or false',
    int: 'a whole number',
    float: 'a number',
    str: 'a text',
    tuple: 'a list',
}
