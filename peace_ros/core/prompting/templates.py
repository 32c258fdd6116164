# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prompt templates: the three of the PEACE paper by name, and any other as a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from string import Formatter
from types import MappingProxyType

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.prompting.vocabulary import CATEGORIES

TEMPLATES: Mapping[str, str] = MappingProxyType(
    {
        'DD': 'A photo of {term}.',
        'D': "A bird's eye view of a {term}, in game screenshot, bad graphics, shade, shadows.",
        'PEACE': 'A {resolution} {frame} of {term} in {environment}.',
    }
)
"""Name -> sentence: DOVESEI-Default, DOVESEI and PEACE."""

_FIELDS = ('term', *CATEGORIES)


def resolve_template(name_or_sentence: str) -> str:
    """Return the sentence of a named template, or the sentence itself when it can be used.

    Raises ConfigurationError for unknown fields, a missing ``{term}`` or stray braces.
    """
    sentence = TEMPLATES.get(name_or_sentence.strip().upper(), name_or_sentence)
    try:
        parts = list(Formatter().parse(sentence))
    except ValueError as error:
        raise ConfigurationError(f'prompt template {sentence!r}: {error}; {_remedy()}') from error
    fields = []
    for literal, field, form, conversion in parts:
        if '{' in literal or '}' in literal:
            raise ConfigurationError(f'prompt template {sentence!r}: stray brace; {_remedy()}')
        if field is None:
            continue
        if field not in _FIELDS or form or conversion:
            raise ConfigurationError(
                f'prompt template {sentence!r}: unknown field {{{field}}}; {_remedy()}'
            )
        fields.append(field)
    if 'term' not in fields:
        raise ConfigurationError(f'prompt template {sentence!r} lacks {{term}}; {_remedy()}')
    return sentence


def categories_of(sentence: str) -> tuple[str, ...]:
    """Return the vocabulary categories that a sentence asks for; empty when it is static."""
    return tuple(name for name in CATEGORIES if '{' + name + '}' in sentence)


def _remedy() -> str:
    fields = ', '.join(f'{{{name}}}' for name in _FIELDS)
    return f'use one of {", ".join(TEMPLATES)} or a sentence with {{term}} and any of {fields}'
