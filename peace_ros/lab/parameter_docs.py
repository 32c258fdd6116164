# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the table of all parameters and the shipped defaults from the dataclasses.

``python -m peace_ros.lab.parameter_docs > docs/parameters.md`` and, with ``--yaml``,
``> config/defaults.yaml``.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import yaml

from peace_ros.core.domain.parameters import ParameterInfo, describe
from peace_ros.core.node_parameters import FLYING_NODES, RECORDER, Group, groups_of, named
from peace_ros.simulation.nodes.options import AUTOPILOT_SIM, SATELLITE_VIEW
from peace_ros.watch.options import WATCH

NODE_PARAMETERS: Mapping[str, tuple[Group, ...]] = MappingProxyType(
    {
        **{node: groups_of(node) for node in (*FLYING_NODES, RECORDER)},
        'satellite_view': SATELLITE_VIEW,
        'autopilot_sim': AUTOPILOT_SIM,
        'watch': WATCH,
    }
)
"""Node -> its groups of parameters."""

_INTRODUCTION = """\
# Parameters

Written by `python -m peace_ros.lab.parameter_docs`; a test keeps this table, the dataclasses and
`config/defaults.yaml` equal. Parameters are given when a node starts, by
`--params-file FILE` or `-p name:=value` after `--ros-args`. Those marked (live) may change while it
runs (`ros2 param set`), all others are read-only. A value of another type, outside its bounds, or
of a name that does not exist ends the node with one sentence and exit status 2. Besides
these, every node knows ROS's own `use_sim_time`, and image subscriptions know `qos_overrides`.
"""
_LICENCE = """\
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
# All parameters of all nodes with their defaults, written by
# `python -m peace_ros.lab.parameter_docs --yaml`. Copy what you change into a file of your own.
"""


def markdown() -> str:
    """Return docs/parameters.md."""
    parts = [_INTRODUCTION]
    for node, groups in NODE_PARAMETERS.items():
        parts.append(
            f'\n## {node}\n\n| parameter | default | unit | allowed | meaning |\n'
            '|---|---|---|---|---|\n'
        )
        parts.extend(_row(name, info) for name, info in named(groups).items())
    return ''.join(parts)


def defaults_yaml() -> str:
    """Return config/defaults.yaml: a ROS parameter file with a comment before each value."""
    parts = [_LICENCE]
    for node, groups in NODE_PARAMETERS.items():
        parts.append(f'\n/**/{node}:\n  ros__parameters:\n')
        section = ''
        for group, parameters in groups:
            if group != section:
                parts.append(f'    {group}:\n')
                section = group
            indent = ' ' * (6 if group else 4)
            parts.extend(_yaml_entry(info, indent) for info in describe(parameters))
    return ''.join(parts)


def _row(name: str, info: ParameterInfo) -> str:
    meaning = info.description.rstrip('.').replace('|', '\\|') + (' (live)' if info.live else '')
    cells = (f'`{name}`', f'`{_scalar(info.default)}`', info.unit, allowed(info), meaning)
    return f'| {" | ".join(cells)} |\n'


def allowed(info: ParameterInfo) -> str:
    """Return the bounds or choices of a parameter in words, empty when there are none."""
    if info.choices:
        return ', '.join(info.choices)
    if info.low is not None and info.high is not None:
        return f'{info.low:g} to {info.high:g}'
    if info.low is not None:
        return f'{info.low:g} or more'
    return '' if info.high is None else f'{info.high:g} or less'


def _yaml_entry(info: ParameterInfo, indent: str) -> str:
    bounds = allowed(info)
    facts = '; '.join(each for each in (info.unit, bounds) if each)
    comment = info.description.rstrip('.') + (f' [{facts}]' if facts else '')
    lines = textwrap.wrap(comment, 100 - len(indent) - 2, break_long_words=False)
    commented = ''.join(f'{indent}# {line}\n' for line in lines)
    return f'{commented}{indent}{info.name}: {_scalar(info.default)}\n'


def _scalar(value: Any) -> str:
    plain = list(value) if isinstance(value, tuple) else value
    dumped = yaml.safe_dump(plain, default_flow_style=True, width=1000)
    return dumped.replace('\n...\n', '').strip()


def main(args: Sequence[str] | None = None) -> int:
    """Print the table, or the YAML with ``--yaml``."""
    given = sys.argv[1:] if args is None else list(args)
    sys.stdout.write(defaults_yaml() if '--yaml' in given else markdown())
    return 0


if __name__ == '__main__':
    sys.exit(main())
