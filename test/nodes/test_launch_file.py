# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file, against a stand-in for the launch packages, which have no wheels."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from peace_ros.core.node_parameters import named
from peace_ros.lab.parameter_docs import NODE_PARAMETERS

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Made:
    kind: str
    given: tuple[Any, ...]
    options: dict[str, Any] = field(default_factory=dict)


def maker(kind: str) -> Any:
    return lambda *given, **options: Made(kind, given, options)


@pytest.fixture
def description(monkeypatch) -> list[Made]:
    names = {
        'launch': ['LaunchDescription'],
        'launch.actions': ['DeclareLaunchArgument'],
        'launch.substitutions': ['LaunchConfiguration', 'PathJoinSubstitution'],
        'launch_ros': [],
        'launch_ros.actions': ['Node'],
        'launch_ros.parameter_descriptions': ['ParameterValue'],
        'launch_ros.substitutions': ['FindPackageShare'],
    }
    for name, kinds in names.items():
        module = ModuleType(name)
        for kind in kinds:
            setattr(module, kind, maker(kind))
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location(
        'landing_launch', ROOT / 'launch_scripts' / 'landing.launch.py'
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description().given[0]


def configurations(thing: Any) -> set[str]:
    if isinstance(thing, Made):
        if thing.kind == 'LaunchConfiguration':
            return {thing.given[0]}
        thing = [*thing.given, *thing.options.values()]
    if isinstance(thing, dict):
        thing = list(thing.values())
    if isinstance(thing, list | tuple):
        return set().union(*map(configurations, thing), set())
    return set()


def test_starts_the_three_nodes_on_board(description):
    nodes = [each.options for each in description if each.kind == 'Node']
    assert [each['executable'] for each in nodes] == ['prompt_generator', 'segmentation', 'landing']
    assert all(each['package'] == 'peace_ros' for each in nodes)


def test_every_argument_is_used_and_every_used_one_is_declared(description):
    declared = {each.given[0] for each in description if each.kind == 'DeclareLaunchArgument'}
    used = configurations([each for each in description if each.kind == 'Node'])
    assert used == declared


def test_given_parameters_exist_and_defaults_are_those_of_the_nodes(description):
    arguments = {
        each.given[0]: each.options['default_value']
        for each in description
        if each.kind == 'DeclareLaunchArgument'
    }
    assert (ROOT / 'config' / 'presets' / f'{arguments["preset"]}.yaml').is_file()
    for node in (each.options for each in description if each.kind == 'Node'):
        known = named(NODE_PARAMETERS[node['executable']])
        for parameters in node['parameters']:
            for name in parameters if isinstance(parameters, dict) else ():
                if name != 'use_sim_time':
                    assert str(known[name].default) == arguments[name]
