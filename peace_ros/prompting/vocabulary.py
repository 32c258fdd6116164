# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The words that describe an image, one list per category of the prompt template."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from peace_ros.domain import ConfigurationError
from peace_ros.resources import config_dir

CATEGORIES = ('resolution', 'frame', 'environment')
"""What the words tell: how sharp the image is, what kind of image it is, what season and light."""
SHIPPED_NAME = 'vocabularies.yaml'


@dataclass(frozen=True)
class Vocabularies:
    """The words of each category, in the order of the file, without duplicates."""

    resolution: tuple[str, ...]
    frame: tuple[str, ...]
    environment: tuple[str, ...]

    def words(self, category: str) -> tuple[str, ...]:
        """Return the words of one of CATEGORIES."""
        words: tuple[str, ...] = getattr(self, category)
        return words


def load_vocabularies(path: Path | str = SHIPPED_NAME) -> Vocabularies:
    """Read vocabularies from a YAML file, given by path or by the name of a shipped one.

    Raises ConfigurationError that names the file, the word and what to do.
    """
    found = Path(path).expanduser()
    if not found.exists() and found.name == str(path):
        found = config_dir() / found.name
    lists = _read_categories(found)
    words = {name: _check_words(lists[name], f'{found}: {name}') for name in CATEGORIES}
    return Vocabularies(**words)


def _read_categories(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding='utf-8')
        document = yaml.safe_load(text)
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except OSError as error:
        raise ConfigurationError(
            f'vocabularies {path}: {error.strerror}; give a YAML file with {_expected()}'
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigurationError(f'vocabularies {path}: not YAML ({error}); correct it') from error
    if not isinstance(document, dict):
        raise ConfigurationError(f'vocabularies {path}: must hold {_expected()}')
    # The YAML reader keeps the last of two equal keys in silence, so the keys are read apart.
    keys = [key.value for key, _ in root.value] if isinstance(root, yaml.MappingNode) else []
    if sorted(keys) != sorted(CATEGORIES):
        raise ConfigurationError(
            f'vocabularies {path}: has {", ".join(map(str, keys))}; give {_expected()}, each once'
        )
    return document


def _expected() -> str:
    return f'one list of words for each of {", ".join(CATEGORIES)}'


def _check_words(values: Any, where: str) -> tuple[str, ...]:
    if not isinstance(values, list) or not values:
        raise ConfigurationError(f'{where}: {values!r}; give a list of at least one word')
    words: dict[str, str] = {}
    for value in values:
        if not isinstance(value, str):
            raise ConfigurationError(f'{where}: {value!r} is no text; put it in quotes')
        word = ' '.join(value.split())
        if not word or '{' in word or '}' in word:
            raise ConfigurationError(f'{where}: {value!r}; give a word, without braces')
        if word.casefold() in words:
            raise ConfigurationError(f'{where}: {word!r} is there twice; remove one')
        words[word.casefold()] = word
    return tuple(words.values())
