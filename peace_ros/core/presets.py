# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Presets are ROS parameter files; this reads them, as strictly as a node does, without ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import describe
from peace_ros.core.node_parameters import (
    FLYING_NODES,
    OTHER_NODES,
    RECORDER,
    converted,
    groups_of,
    is_of_ros,
    named,
    refuse_misspelt,
    ros_name,
    unknown_name,
)
from peace_ros.core.resources import config_dir
from peace_ros.core.segmentation import SegmentationParameters, family_of
from peace_ros.core.yaml_files import WILDCARDS, Sections, read_sections

DEFAULT_PRESET = 'peace_cs'
_CHECKED = (*FLYING_NODES, RECORDER)
_Parameters = TypeVar('_Parameters')


@dataclass(frozen=True)
class Preset:
    """One parameter file."""

    name: str
    path: Path
    sections: Sections

    def fill(self, node: str, parameters: type[_Parameters], **given: Any) -> _Parameters:
        """Return one of a node's parameter dataclasses with the values of the file.

        Args:
            node: one of FLYING_NODES.
            parameters: one of its dataclasses.
            given: values that go before those of the file; empty ones ('', 0) do not, and names
                of other dataclasses are passed over.

        Raises:
            ConfigurationError: a value of the wrong type or outside its bounds.

        """
        prefix = next(prefix for prefix, each in groups_of(node) if each is parameters)
        values = self._values_for(node)
        chosen: dict[str, Any] = {}
        try:
            for info in describe(parameters):
                name = ros_name(prefix, info)
                if given.get(info.name):
                    chosen[info.name] = given[info.name]
                elif name in values:
                    chosen[info.name] = converted(name, info, values[name])
            return parameters(**chosen)
        except ConfigurationError as error:
            raise ConfigurationError(f'{self.path}: {node}: {error}') from error

    def _values_for(self, node: str) -> dict[str, Any]:
        """Return what a node of that name gets: of equal names the last in the file counts."""
        values: dict[str, Any] = {}
        for section, given in self.sections.items():
            if section in WILDCARDS or _node_of(section) == node:
                values.update(given)
        return values

    def with_values(self, node: str, given: Mapping[str, Any]) -> Preset:
        """Return the preset with other values for a node: those go before the ones of the file."""
        known = named(groups_of(node))
        own = {name: value for name, value in self._values_for(node).items() if name in known}
        section = f'/**/{node}'
        others = {name: values for name, values in self.sections.items() if name != section}
        return replace(self, sections={**others, section: {**own, **given}})

    def check(self) -> None:
        """Refuse what a node would refuse.

        Raises:
            ConfigurationError: a node or parameter is unknown, or a value cannot be used.

        """
        known = {node: named(groups_of(node)) for node in _CHECKED}
        for section, values in self.sections.items():
            node = _node_of(section)
            if section not in WILDCARDS and node not in (*_CHECKED, *OTHER_NODES):
                raise _unknown_section(self.path, section)
            for name in values:
                if is_of_ros(name) or node in OTHER_NODES:
                    continue
                try:
                    if section in WILDCARDS:
                        every = {each for names in known.values() for each in names}
                        refuse_misspelt(name, section, every)
                    elif name not in known[node]:
                        raise unknown_name(name, node, known[node])
                except ConfigurationError as error:
                    raise ConfigurationError(f'{self.path}: {error}') from error
        for node in _CHECKED:
            for _, parameters in groups_of(node):
                self.fill(node, parameters)
        family_of(self.fill('segmentation', SegmentationParameters))


def preset_names() -> list[str]:
    """Return the names of the shipped presets."""
    return sorted(path.stem for path in _presets_dir().glob('*.yaml'))


def load_preset(name_or_path: Path | str = DEFAULT_PRESET) -> Preset:
    """Read a shipped preset by name (``peace_cs``, also written ``PEACE-CS``) or a file by path.

    Raises:
        ConfigurationError: it does not exist, is not a parameter file, or a node would refuse it.

    """
    path = Path(name_or_path)
    if path.suffix not in {'.yaml', '.yml'}:
        path = _presets_dir() / f'{str(name_or_path).lower().replace("-", "_")}.yaml'
    if not path.is_file():
        raise ConfigurationError(
            f'preset {str(name_or_path)!r} does not exist: choose one of '
            f'{", ".join(preset_names())}, or give a ROS parameter file'
        )
    preset = Preset(path.stem, path, read_sections(path))
    preset.check()
    return preset


def _presets_dir() -> Path:
    return config_dir() / 'presets'


def _node_of(section: str) -> str:
    """Return the node that a section is for; one in a namespace is not known here."""
    return section.removeprefix('/**').removeprefix('/')


def _unknown_section(path: Path, section: str) -> ConfigurationError:
    names = (*_CHECKED, *OTHER_NODES)
    near = get_close_matches(section.rpartition('/')[2], names, n=1)
    remedy = f'did you mean {near[0]}?' if near else f'choose among {", ".join(names)}, /**'
    return ConfigurationError(f'{path}: node {section} is unknown: {remedy}')
