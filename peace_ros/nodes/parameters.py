# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS parameters declared from the dataclasses that hold them.

Parameters are read-only, but for those that are declared as live: most of a node is configured when
it starts, and a flight is not the time to change it.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from sys import float_info
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import ParameterInfo, describe
from peace_ros.core.node_parameters import (
    Group,
    converted,
    is_of_ros,
    named,
    refuse_misspelt,
    ros_name,
    unknown_name,
)
from peace_ros.core.yaml_files import WILDCARDS, addresses, read_sections

_Parameters = TypeVar('_Parameters')

_FILE = '--params-file'
_INT64_MAX = 2**63 - 1


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
            values[info.name] = converted(name, info, node.get_parameter(name).value)
            node.undeclare_parameter(name)
    filled = parameters(**values)
    for info in infos:
        value = values[info.name]
        value = list(value) if isinstance(value, tuple) else value
        node.declare_parameter(
            ros_name(group, info), value, descriptor_of(info), ignore_override=True
        )
    return filled


def changed_parameters(
    filled: Mapping[type[Any], Any], groups: Sequence[Group], given: Mapping[str, Any]
) -> dict[type[Any], Any]:
    """Return the dataclasses in which a value changes, with the new values.

    Args:
        filled: the dataclasses so far.
        groups: their names.
        given: ROS name -> new value; names of others (``use_sim_time``) are passed over.

    Raises:
        ConfigurationError: a value of another type or outside its bounds.
    """
    changed = {}
    for group, parameters in groups:
        values = {
            info.name: converted(name, info, given[name])
            for info in describe(parameters)
            if (name := ros_name(group, info)) in given
        }
        if values:
            changed[parameters] = replace(filled[parameters], **values)
    return changed


def refuse_unknown(node: Node, *groups: Group) -> None:
    """Refuse values of unknown parameters; sections for all nodes may hold those of other nodes.

    Raises:
        ConfigurationError: a parameter is unknown, or use_sim_time neither true nor false.

    """
    sim_time = node.get_parameter('use_sim_time').value
    if not isinstance(sim_time, bool):  # rclpy logs it, and goes on with the clock of the machine
        raise ConfigurationError(f'parameter use_sim_time = {sim_time!r}: give true or false')
    known = named(groups)
    foreign = _only_in_wildcards(sys.argv, node.get_name())
    for name in node.get_parameters_by_prefix(''):
        if name in known or is_of_ros(name):
            continue
        if name not in foreign:
            raise unknown_name(name, node.get_name(), known)
        refuse_misspelt(name, foreign[name], known)
        node.get_logger().info(f'parameter {name} of section {foreign[name]} is left to others')


def refuse_files_for_others(node: Node, kind: str) -> None:
    """Refuse a parameter file that is for this kind of node and, by its sections, not for this one.

    ROS would ignore it without a word, and the defaults would fly.

    Args:
        node: with its namespace, and the name that it runs under.
        kind: its name where nobody renames it.

    Raises:
        ConfigurationError: there is such a file.
    """
    name = node.get_fully_qualified_name()
    for option, path in pairwise(sys.argv):
        sections = read_sections(Path(path)) if option == _FILE else ()
        meant = [each for each in sections if each.rpartition('/')[2] == kind]
        if meant and not any(addresses(each, name) for each in sections if each not in WILDCARDS):
            raise ConfigurationError(
                f'{path}: section {meant[0]} is not for node {name}, and would be ignored: name '
                f'the section /**/{node.get_name()}'
            )


def _only_in_wildcards(arguments: list[str], node: str) -> dict[str, str]:
    """Return parameter -> section, of what parameter files give to all nodes and not to this."""
    wild: dict[str, str] = {}
    own: set[str] = set()
    for option, path in pairwise(arguments):
        for section, values in read_sections(Path(path)).items() if option == _FILE else ():
            if section in WILDCARDS:
                wild.update(dict.fromkeys(values, section))
            elif section.rpartition('/')[2] == node:
                own.update(values)
    return {name: section for name, section in wild.items() if name not in own}


def descriptor_of(info: ParameterInfo) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter: meaning, unit, bounds, whether it is live."""
    unit = f' [{info.unit}]' if info.unit else ''
    descriptor = ParameterDescriptor(
        description=f'{info.description}{unit}', read_only=not info.live
    )
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
