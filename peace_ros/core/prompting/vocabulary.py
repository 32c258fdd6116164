# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The words that describe an image, one list per category of the prompt template."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.word_lists import find_word_lists, read_word_lists

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
    found = find_word_lists(path)
    lists = read_word_lists(found, CATEGORIES)
    return Vocabularies(**{name: _tidy(words, f'{found}: {name}') for name, words in lists.items()})


def _tidy(values: tuple[str, ...], where: str) -> tuple[str, ...]:
    if not values:
        raise ConfigurationError(f'{where}: empty; give at least one word')
    words: dict[str, str] = {}
    for value in values:
        word = ' '.join(value.split())
        if not word or '{' in word or '}' in word:
            raise ConfigurationError(f'{where}: {value!r}; give a word, without braces')
        if word.casefold() in words:
            raise ConfigurationError(f'{where}: {word!r} is there twice; remove one')
        words[word.casefold()] = word
    return tuple(words.values())
