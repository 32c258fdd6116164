# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Strict reading of the YAML files that name words: nothing is guessed, ignored or overwritten."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.resources import config_dir
from peace_ros.core.yaml_files import read_yaml


def find_word_lists(path: Path | str) -> Path:
    """Return the file of a path, or the shipped one when only the name of such a file is given."""
    found = Path(path).expanduser()
    if not found.exists() and found.name == str(path):
        return config_dir() / found.name
    return found


def read_word_lists(path: Path, names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return name -> words, as they are written, of a file that holds these lists and no other.

    Raises:
        ConfigurationError: the file cannot be read, another list is there, one is missing or
            twice, or something in it is not a text (YAML reads ``no`` as false).

    """
    expected = f'give the lists {" and ".join(names)}, each once'
    document = read_yaml(path, expected)
    keys = list(map(str, document)) if isinstance(document, dict) else []
    if sorted(keys) != sorted(names):
        raise ConfigurationError(f'{path}: has {", ".join(keys) or "no lists"}; {expected}')
    return {name: _texts(document[name], f'{path}: {name}') for name in names}


def _texts(values: Any, where: str) -> tuple[str, ...]:
    if not isinstance(values, list):
        raise ConfigurationError(f'{where}: {values!r}; give a list ([] for none)')
    for value in values:
        if not isinstance(value, str):
            raise ConfigurationError(f'{where}: {value!r} is not a text; put it in quotes')
    return tuple(values)
