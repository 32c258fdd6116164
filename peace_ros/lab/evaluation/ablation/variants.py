# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The prompts that are compared: each differs from the default in one thing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from peace_ros.core.prompting.templates import TEMPLATES, resolve_template

DEFAULT = 'full vocabularies'
VOCABULARY, TEMPLATE, WORDS = 'vocabulary', 'template', 'environment words'
GROUPS = (VOCABULARY, TEMPLATE, WORDS)
_FULL = TEMPLATES['PEACE']


@dataclass(frozen=True)
class Variant:
    """One way to write prompts."""

    group: str
    """What it varies, one of GROUPS."""
    name: str
    template: str
    """Sentence with ``{term}``."""
    environment_words: int = 1
    fits_least: bool = False
    """Take the words that fit the image least instead of best: shows whether ranking matters."""


def default_variants(most_words: int, templates: Sequence[str] = ()) -> list[Variant]:
    """Return the default, and what varies vocabulary, template and number of words.

    Args:
        most_words: environment words, from none up to so many.
        templates: further templates to try.

    Raises ConfigurationError for a template that cannot be used.
    """
    variants = [
        Variant(VOCABULARY, DEFAULT, _FULL),
        Variant(VOCABULARY, 'words that fit least', _FULL, fits_least=True),
        Variant(VOCABULARY, 'no words', 'A picture of {term}.'),
        Variant(VOCABULARY, 'resolution alone', 'A {resolution} picture of {term}.'),
        Variant(VOCABULARY, 'frame alone', 'A {frame} of {term}.'),
        Variant(VOCABULARY, 'environment alone', 'A picture of {term} in {environment}.'),
        Variant(TEMPLATE, 'DD', TEMPLATES['DD']),
        Variant(TEMPLATE, 'D', TEMPLATES['D']),
        Variant(TEMPLATE, 'the term alone', '{term}'),
        Variant(TEMPLATE, 'aerial', 'An aerial photo of {term}.'),
    ]
    variants += [Variant(TEMPLATE, each, resolve_template(each)) for each in templates]
    variants.append(Variant(WORDS, '0', 'A {resolution} {frame} of {term}.'))
    variants += [
        Variant(WORDS, str(count), _FULL, environment_words=count)
        for count in range(2, most_words + 1)
    ]
    return variants
