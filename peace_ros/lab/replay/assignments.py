# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters that are given beside a preset, as ``landing.safety_threshold=0.7``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.node_parameters import FLYING_NODES
from peace_ros.core.presets import Preset
from peace_ros.core.yaml_files import value_of


def with_assignments(preset: Preset, assignments: Sequence[str]) -> Preset:
    """Return a preset with other values of some parameters.

    Args:
        preset: stays as it is.
        assignments: each ``NODE.PARAMETER=VALUE``, the value as ROS reads it.

    Raises:
        ConfigurationError: a node, a parameter or a value cannot be used.
    """
    for each in assignments:
        node, parameter, value = _parsed(each)
        try:
            changed = preset.with_values(node, {parameter: value})
            changed.check()
        except ConfigurationError as error:
            raise ConfigurationError(f'--set {each}: {error}') from error
        preset = replace(changed, name=f'{preset.name} {each}')
    return preset


def _parsed(assignment: str) -> tuple[str, str, Any]:
    name, equals, text = assignment.partition('=')
    node, dot, parameter = name.strip().partition('.')
    if not (equals and dot and parameter):
        raise ConfigurationError(
            f'--set {assignment!r}: give NODE.PARAMETER=VALUE, as landing.safety_threshold=0.7'
        )
    if node not in FLYING_NODES:
        raise ConfigurationError(
            f'--set {assignment!r}: node {node!r} is unknown, choose one of '
            f'{", ".join(FLYING_NODES)}'
        )
    return node, parameter, value_of(text)
