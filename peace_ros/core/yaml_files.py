# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""YAML files and ROS parameter files, read as ROS does, but a name that stands twice is refused."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from peace_ros.core.domain import ConfigurationError

WILDCARDS = ('/**', '/*')
"""Sections that ROS reads for every node."""
Sections = Mapping[str, Mapping[str, Any]]
"""Section -> ROS name -> value, in the order of the file."""
_REMEDY = 'give a ROS parameter file'


class _Loader(yaml.SafeLoader):
    """PyYAML keeps the last of two equal names without a word, and takes 1e5 for a text."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise yaml.YAMLError(f'{name} is there twice (line {key.start_mark.line + 1})')
            seen.add(name)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'[-+]?\d+\.?\d*[eE][-+]?\d+$'), list('-+0123456789')
)


def read_yaml(path: Path, remedy: str) -> Any:
    """Return the content of a YAML file.

    Args:
        path: of the file.
        remedy: what the user is to give, as the end of a sentence.

    Raises:
        ConfigurationError: the file cannot be read, is no YAML, or has a name twice.

    """
    try:
        return yaml.load(path.read_text(encoding='utf-8'), Loader=_Loader)  # noqa: S506 (a SafeLoader)
    except OSError as error:
        raise ConfigurationError(f'{path}: {error.strerror}; {remedy}') from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigurationError(f'{path}: not usable YAML ({error}); {remedy}') from error


def read_sections(path: Path) -> Sections:
    """Return the sections of a ROS parameter file; groups of parameters become dotted names.

    Raises:
        ConfigurationError: the file cannot be read or a section has no parameters.

    """
    content = read_yaml(path, _REMEDY)
    sections = dict(_sections_of(content)) if isinstance(content, dict) else {}
    if not sections:
        raise ConfigurationError(f'{path} holds no node: {_REMEDY}')
    for section, values in sections.items():
        if not isinstance(values, dict):
            raise ConfigurationError(f'{path}: {section} has no ros__parameters: {_REMEDY}')
    return {section: _flat(values) for section, values in sections.items()}


def addresses(section: str, node: str) -> bool:
    """Return whether ROS gives the parameters of a section to a node.

    Args:
        section: as in the file, such as ``landing``, ``/drone/landing`` or ``/**/landing``.
        node: its name with namespace, such as ``/drone/landing``.
    """
    path = re.escape('/' + section.removeprefix('/'))
    pattern = path.replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'/\w+')
    return re.fullmatch(pattern, node) is not None


def _sections_of(content: Mapping[str, Any], namespace: str = '') -> Iterator[tuple[str, Any]]:
    """Yield section and what it holds; a namespace holds further sections."""
    for name, section in content.items():
        path = f'{namespace}/{name}' if namespace else str(name)
        if isinstance(section, dict) and 'ros__parameters' not in section:
            yield from _sections_of(section, path)
        else:
            yield path, section['ros__parameters'] if isinstance(section, dict) else None


def _flat(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            flat.update(_flat(value, f'{prefix}{name}.'))
        else:
            flat[f'{prefix}{name}'] = value
    return flat
