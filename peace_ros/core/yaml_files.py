# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading of YAML files as ROS reads them, but a name that is given twice is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from peace_ros.core.domain import ConfigurationError


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
