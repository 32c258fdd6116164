# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's sentences, word for word, and the refusal of templates that cannot work."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import ConfigurationError, Prompt
from peace_ros.core.prompting import categories_of, resolve_template


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        ('DD', 'A photo of grass.'),
        (
            'D',
            "A bird's eye view of a grass, in game screenshot, bad graphics, shade, shadows.",
        ),
    ],
)
def test_static_templates_are_those_of_the_paper(name: str, sentence: str) -> None:
    template = resolve_template(name)
    assert Prompt(template, 0).text_for('grass') == sentence
    assert categories_of(template) == ()


def test_the_dynamic_template_asks_for_all_three_categories() -> None:
    assert categories_of(resolve_template('peace')) == ('resolution', 'frame', 'environment')


def test_any_sentence_with_a_term_will_do() -> None:
    sentence = 'A nadir {frame} of {term}.'
    assert resolve_template(sentence) == sentence
    assert categories_of(sentence) == ('frame',)


@pytest.mark.parametrize(
    ('sentence', 'says'),
    [
        ('A {mood} photo of {term}.', r'unknown field \{mood\}'),
        ('A photo of {term!r}.', 'unknown field'),
        ('A photo of {term:>9}.', 'unknown field'),
        ('A photo of {}.', r'unknown field \{\}'),
        ('A photo of {term.upper}.', 'unknown field'),
        ('A photo of {term} {', 'DD, D, PEACE'),
        ('A photo of {{term}}.', 'stray brace'),
        ('A photo of }term{.', 'DD, D, PEACE'),
        ('A photo of grass.', r'lacks \{term\}'),
        ('', r'lacks \{term\}'),
        ('PEACE2', r'lacks \{term\}'),
    ],
)
def test_sentences_that_cannot_work_are_refused(sentence: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        resolve_template(sentence)
