# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""YAML files and ROS parameter files, read as ROS does, but a name that stands twice is refused."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import isinf
from pathlib import Path
from typing import Any, cast

import yaml

from peace_ros.core.domain import ConfigurationError

WILDCARDS = ('/**', '/*')
"""Sections that ROS reads for every node."""
Sections = Mapping[str, Mapping[str, Any]]
"""Section -> ROS name -> value, in the order of the file."""
_REMEDY = 'give a ROS parameter file'


_TRUE = frozenset(['y', 'Y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'])
_FALSE = frozenset(['n', 'N', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'])
_INTEGER = re.compile(r'[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
_REAL = re.compile(
    r'[-+]?((\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|inf|infinity|nan)|[-+]?\.inf|\.nan', re.IGNORECASE
)
_LONGEST_NUMBER = 64
_LARGEST_BYTES = 16 << 20
_MOST_VALUES = 200_000
"""With every alias written out: nine lines of aliases to aliases may stand for a billion."""
_PLAIN = '!plain'
_DAMAGE = (yaml.YAMLError, ValueError, LookupError, AttributeError, RecursionError)
"""All that PyYAML raises on text that is no YAML, or on values that do not fit their tags."""


def _scalar(text: str) -> bool | int | float | str:
    """Return what ROS takes a word without quotes for; PyYAML takes 1e5 for a text, 1:30 for 90."""
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if len(text) <= _LONGEST_NUMBER and _INTEGER.fullmatch(text):
        octal = re.fullmatch(r'[-+]?0[0-7]+', text)
        whole = int(text, 8 if octal else 0)
        return whole if -(2**63) <= whole < 2**63 else float(whole)
    if _REAL.fullmatch(text):
        real = float(text.lower().replace('.inf', 'inf').replace('.nan', 'nan'))
        # What a double cannot hold stays a text, which no parameter of a number accepts.
        overflows = isinf(real) and 'inf' not in text.lower()
        return text if overflows else real
    return text


class _Loader(yaml.SafeLoader):
    """Reads words without quotes as ROS does, and refuses a name that stands twice."""

    yaml_implicit_resolvers = {  # noqa: RUF012 (PyYAML's own name and kind)
        None: [(_PLAIN, re.compile('.+', re.DOTALL))],
        '<': [('tag:yaml.org,2002:merge', re.compile('<<$'))],
        '': [('tag:yaml.org,2002:null', re.compile('$'))],
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise yaml.YAMLError(f'{name} is there twice (line {key.start_mark.line + 1})')
            seen.add(name)
            if key.tag == _PLAIN:
                key.tag = 'tag:yaml.org,2002:str'  # a parameter may be called y
        return super().construct_mapping(node, deep)


def _plain(loader: yaml.SafeLoader, node: yaml.Node) -> bool | int | float | str:
    return _scalar(str(loader.construct_scalar(cast('yaml.ScalarNode', node))))


_Loader.add_constructor(_PLAIN, _plain)


def read_yaml(path: Path, remedy: str) -> Any:
    """Return the content of a YAML file.

    Args:
        path: of the file.
        remedy: what the user is to give, as the end of a sentence.

    Raises:
        ConfigurationError: the file cannot be read, is no YAML, or has a name twice.

    """
    try:
        if (path.exists() and not path.is_file()) or path.stat().st_size > _LARGEST_BYTES:
            raise ConfigurationError(
                f'{path} is not a regular file of up to {_LARGEST_BYTES >> 20} MiB; {remedy}'
            )
        loader = _Loader(path.read_text(encoding='utf-8'))
        node = loader.get_single_node()
        if node is None:
            return None
        if (values := _written_out(node, {})) > _MOST_VALUES:
            raise yaml.YAMLError(f'{values:.2g} values, at most {_MOST_VALUES} are read')
        return loader.construct_document(node)
    except OSError as error:
        raise ConfigurationError(f'{path}: {error.strerror}; {remedy}') from error
    except _DAMAGE as error:
        reason = ' '.join(str(error).split())
        raise ConfigurationError(f'{path}: not usable YAML ({reason}); {remedy}') from error


def _written_out(node: yaml.Node, known: dict[int, int]) -> int:
    """Return how many values a node stands for; a RecursionError where it holds itself."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in known:
        parts = node.value
        if isinstance(node, yaml.MappingNode):
            parts = [each for pair in parts for each in pair]
        known[id(node)] = 1 + sum(_written_out(each, known) for each in parts)
    return known[id(node)]


def value_of(text: str) -> Any:
    """Return the value that ROS reads from ``-p name:=text``.

    Raises:
        ConfigurationError: the text is no YAML.
    """
    try:
        return yaml.load(text, Loader=_Loader)  # noqa: S506 (a SafeLoader)
    except _DAMAGE as error:
        raise ConfigurationError(f'value {text!r} is no YAML ({error}): quote texts') from error


def read_sections(path: Path) -> Sections:
    """Return the sections of a ROS parameter file; groups of parameters become dotted names.

    Raises:
        ConfigurationError: the file cannot be read or a section has no parameters.

    """
    content = read_yaml(path, _REMEDY)
    try:
        sections = dict(_sections_of(content)) if isinstance(content, dict) else {}
        if not sections:
            raise ConfigurationError(f'{path} holds no node: {_REMEDY}')
        for section, values in sections.items():
            if not isinstance(values, dict):
                raise ConfigurationError(f'{path}: {section} has no ros__parameters: {_REMEDY}')
        return {section: _flat(values) for section, values in sections.items()}
    except RecursionError as error:
        raise ConfigurationError(
            f'{path}: not usable YAML (an alias is inside of what it names); {_REMEDY}'
        ) from error


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
