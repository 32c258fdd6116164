# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What to look for in the image: positive terms to land on, negative ones to keep away from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.word_lists import find_word_lists, read_word_lists

SHIPPED_NAME = 'terms.yaml'
MOST_TERMS = 128
_SIDES = ('positive', 'negative')


@dataclass(frozen=True)
class Terms:
    """Terms in lower case with single spaces; a term may be a comma-joined group of words.

    Raises ConfigurationError when there is no positive term, when a word stands on both sides or
    twice on one, or when there are more than MOST_TERMS.
    """

    positive: tuple[str, ...]
    negative: tuple[str, ...]

    def __post_init__(self) -> None:
        for side in _SIDES:
            object.__setattr__(self, side, tuple(_tidy(term) for term in getattr(self, side)))
        if not self.positive:
            raise ConfigurationError(
                'positive terms are empty: nothing would ever be safe; name at least one'
            )
        if len(self) > MOST_TERMS:
            raise ConfigurationError(
                f'{len(self)} terms: at most {MOST_TERMS} are taken; join some into groups'
            )
        self._refuse_repeats()

    def _refuse_repeats(self) -> None:
        sides: dict[str, str] = {}
        for side in _SIDES:
            for term in getattr(self, side):
                for word in term.split(', '):
                    other = sides.get(word)
                    if other is not None and other != side:
                        raise ConfigurationError(
                            f'term {word!r} is positive and negative: remove it from one side'
                        )
                    if other is not None:
                        raise ConfigurationError(f'{side} term {word!r} is there twice: remove one')
                    sides[word] = side

    def __len__(self) -> int:
        return len(self.positive) + len(self.negative)

    @property
    def all(self) -> tuple[str, ...]:
        """The positive terms, then the negative ones."""
        return self.positive + self.negative


def load_terms(path: Path | str = SHIPPED_NAME) -> Terms:
    """Read terms from a YAML file, given by path or by the name of a shipped one.

    Raises ConfigurationError that names the file, the term and what to do.
    """
    found = find_word_lists(path)
    lists = read_word_lists(found, _SIDES)
    try:
        return Terms(**lists)
    except ConfigurationError as error:
        raise ConfigurationError(f'{found}: {error}') from error


def _tidy(term: str) -> str:
    words = [' '.join(word.split()).lower() for word in term.split(',')]
    if not all(words) or '{' in term or '}' in term:
        raise ConfigurationError(f'term {term!r}: give words, without braces or empty places')
    return ', '.join(words)
