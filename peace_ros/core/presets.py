# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Presets are ROS parameter files; this fills the nodes' dataclasses from them, without ROS."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import describe
from peace_ros.core.resources import config_dir

DEFAULT_PRESET = 'peace_cs'
_EVERYWHERE = ('/**', '/*')
_Parameters = TypeVar('_Parameters')


@dataclass(frozen=True)
class Preset:
    """One parameter file."""

    name: str
    path: Path
    nodes: dict[str, dict[str, Any]]
    """Node name (or ``/**``) -> its parameters."""

    def values_for(self, node: str) -> dict[str, Any]:
        """Return what a node of that name gets: the wildcards' values, then its own."""
        values: dict[str, Any] = {}
        for key in (*_EVERYWHERE, node, f'/{node}', f'/**/{node}'):
            values.update(self.nodes.get(key, {}))
        return values

    def fill(self, node: str, parameters: type[_Parameters], **given: Any) -> _Parameters:
        """Return a parameter dataclass with the values of a node; ``given`` ones go before.

        Raises:
            ConfigurationError: a value of the wrong type or outside its bounds.

        """
        values = self.values_for(node)
        chosen: dict[str, Any] = {}
        for info in describe(parameters):
            if info.name in given:
                chosen[info.name] = given[info.name]
            elif info.name in values:
                chosen[info.name] = self._converted(node, info.name, values, info.default)
        return parameters(**chosen)

    def _converted(self, node: str, name: str, values: dict[str, Any], default: Any) -> Any:
        value = values[name]
        expected = type(default)
        if expected is float and type(value) is int:
            return float(value)
        if expected is tuple and isinstance(value, list):
            return tuple(value)
        if type(value) is not expected:
            raise ConfigurationError(
                f'{self.path}: {node}.{name} = {value!r}: give a value such as {default!r}'
            )
        return value


def preset_names() -> list[str]:
    """Return the names of the shipped presets."""
    return sorted(path.stem for path in _presets_dir().glob('*.yaml'))


def load_preset(name_or_path: str = DEFAULT_PRESET) -> Preset:
    """Read a shipped preset by name (``peace_cs``, also written ``PEACE-CS``) or a file by path.

    Raises:
        ConfigurationError: there is none, or it is no ROS parameter file.

    """
    path = Path(name_or_path)
    if path.suffix not in {'.yaml', '.yml'}:
        path = _presets_dir() / f'{name_or_path.lower().replace("-", "_")}.yaml'
    if not path.is_file():
        raise ConfigurationError(
            f'preset {name_or_path!r} does not exist: choose one of {", ".join(preset_names())}, '
            'or give a ROS parameter file'
        )
    return Preset(path.stem, path, _read(path))


def _presets_dir() -> Path:
    return config_dir() / 'presets'


def _read(path: Path) -> dict[str, dict[str, Any]]:
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigurationError(f'{path} cannot be read as YAML: {error}') from error
    nodes = {}
    for name, section in content.items() if isinstance(content, dict) else ():
        if not isinstance(section, dict) or not isinstance(section.get('ros__parameters'), dict):
            raise ConfigurationError(
                f'{path}: {name} has no ros__parameters: give a ROS parameter file'
            )
        nodes[str(name)] = section['ros__parameters']
    if not nodes:
        raise ConfigurationError(f'{path} holds no node: give a ROS parameter file')
    return nodes
