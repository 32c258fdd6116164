# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The best words are chosen, computed once, and do not flicker."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peace_ros.core.domain import ConfigurationError, Frame
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, Vocabularies

SPRING = {'rendered': 0.3, 'image': 0.25, 'spring': 0.28, 'winter': 0.2, 'night': 0.1}


def frame_at(stamp_ns: int) -> Frame:
    return Frame(np.zeros((4, 4, 3), np.uint8), stamp_ns)


def make(encoder: Any, vocabularies: Vocabularies, **changes: Any) -> PromptGenerator:
    return PromptGenerator(encoder, vocabularies, PromptingParameters(**changes))


def test_the_best_words_make_the_sentence_of_the_paper(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    encoder.scores = SPRING
    prompt = make(encoder, vocabularies).generate(frame_at(77))
    assert prompt.text_for('grass') == 'A rendered image of grass in spring.'
    assert prompt.stamp_ns == 77


def test_the_ranking_holds_every_word_best_first(encoder: Any, vocabularies: Vocabularies) -> None:
    encoder.scores = SPRING
    ranking = make(encoder, vocabularies).generate(frame_at(0)).ranking
    assert [each.word for each in ranking['environment']] == [
        'spring',
        'winter',
        'night',
        'summer',
    ]
    assert ranking['environment'][0].score == pytest.approx(0.28)
    assert {name: len(words) for name, words in ranking.items()} == {
        'resolution': 3,
        'frame': 3,
        'environment': 4,
    }


def test_words_are_embedded_once_and_bare_and_a_frame_costs_one_image(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    generator = make(encoder, vocabularies)
    for stamp in range(5):
        generator.generate(frame_at(stamp))
    every = [*vocabularies.resolution, *vocabularies.frame, *vocabularies.environment]
    assert encoder.asked == [every]
    assert encoder.images == 5


def test_only_the_categories_of_the_template_are_embedded(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    make(encoder, vocabularies, template='A {frame} of {term}.')
    assert encoder.asked == [list(vocabularies.frame)]


def test_a_static_template_needs_no_encoder() -> None:
    generator = PromptGenerator(None, None, PromptingParameters(template='D'))
    prompt = generator.generate(frame_at(5))
    assert prompt.text_for('road').startswith("A bird's eye view of a road, in game")
    assert (prompt.stamp_ns, prompt.ranking) == (5, {})


def test_a_static_template_never_asks_the_encoder(encoder: Any, vocabularies: Vocabularies) -> None:
    make(encoder, vocabularies, template='DD').generate(frame_at(0))
    assert (encoder.asked, encoder.images) == ([], 0)


def test_a_dynamic_template_without_an_encoder_is_refused(vocabularies: Vocabularies) -> None:
    with pytest.raises(ConfigurationError, match='no encoder'):
        PromptGenerator(None, vocabularies, PromptingParameters())


def test_several_environment_words_are_joined(encoder: Any, vocabularies: Vocabularies) -> None:
    encoder.scores = SPRING
    prompt = make(encoder, vocabularies, environment_words=3).generate(frame_at(0))
    assert prompt.text_for('grass') == 'A rendered image of grass in spring, winter, night.'


def test_more_words_than_the_vocabulary_has_are_all_of_them(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    encoder.scores = SPRING
    prompt = make(encoder, vocabularies, environment_words=10).generate(frame_at(0))
    assert prompt.template.endswith('in spring, winter, night, summer.')


def test_a_new_word_must_lead_by_the_margin(encoder: Any, vocabularies: Vocabularies) -> None:
    generator = make(encoder, vocabularies, margin=0.05)
    told = []
    for stamp, winter in enumerate((0.20, 0.29, 0.32, 0.34, 0.34)):
        encoder.scores = SPRING | {'winter': winter}
        told.append(generator.generate(frame_at(stamp)).template.split()[-1])
    assert told == ['spring.', 'spring.', 'spring.', 'winter.', 'winter.']


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 3))
def test_noise_below_the_margin_never_changes_the_prompt(
    dictate: Any, seed: int, count: int
) -> None:
    words = Vocabularies(('3D', 'rendered'), ('image', 'view'), ('a', 'b', 'c', 'd', 'e'))
    encoder = dictate(words)
    generator = make(encoder, words, margin=0.02, environment_words=count)
    rng = np.random.default_rng(seed)
    templates = set()
    for stamp in range(40):
        encoder.scores = {word: 0.25 + rng.uniform(-0.01, 0.01) for word in encoder.axis}
        templates.add(generator.generate(frame_at(stamp)).template)
    assert len(templates) == 1


def test_without_a_margin_noise_does_change_the_prompt(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    generator = make(encoder, vocabularies, margin=0.0)
    rng = np.random.default_rng(0)
    templates = set()
    for stamp in range(40):
        encoder.scores = {word: 0.25 + rng.uniform(-0.01, 0.01) for word in encoder.axis}
        templates.add(generator.generate(frame_at(stamp)).template)
    assert len(templates) > 10


def test_a_word_that_leaves_gives_its_place_to_the_newcomer(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    generator = make(encoder, vocabularies, environment_words=2, margin=0.02)
    encoder.scores = SPRING
    assert generator.generate(frame_at(0)).template.endswith('in spring, winter.')
    encoder.scores = SPRING | {'winter': 0.29}
    assert generator.generate(frame_at(1)).template.endswith('in spring, winter.')
    encoder.scores = SPRING | {'night': 0.5, 'spring': 0.1}
    assert generator.generate(frame_at(2)).template.endswith('in night, winter.')


def test_smoothing_needs_the_change_to_last(encoder: Any, vocabularies: Vocabularies) -> None:
    generator = make(encoder, vocabularies, margin=0.0, smoothing=0.8)
    encoder.scores = SPRING
    generator.generate(frame_at(0))
    encoder.scores = SPRING | {'night': 0.45}
    told = [generator.generate(frame_at(stamp)).template for stamp in range(1, 8)]
    assert told[0].endswith('spring.')
    assert told[-1].endswith('night.')


def test_going_back_in_time_or_a_reset_begins_anew(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    generator = make(encoder, vocabularies, margin=0.5, smoothing=0.9)
    encoder.scores = SPRING
    generator.generate(frame_at(100))
    encoder.scores = SPRING | {'night': 0.4}
    assert generator.generate(frame_at(101)).template.endswith('spring.')
    assert generator.generate(frame_at(50)).template.endswith('night.')
    encoder.scores = SPRING
    assert generator.generate(frame_at(51)).template.endswith('night.')
    generator.reset()
    assert generator.generate(frame_at(52)).template.endswith('spring.')


@pytest.mark.parametrize(
    ('changes', 'says'),
    [
        ({'environment_words': 0}, 'environment_words = 0'),
        ({'margin': -0.1}, 'margin'),
        ({'margin': float('nan')}, 'margin'),
        ({'smoothing': 1.0}, 'smoothing'),
        ({'template': 'A {mood} of {term}'}, 'mood'),
        ({'threads': 0}, 'threads'),
    ],
)
def test_parameters_out_of_bounds_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        PromptingParameters(**changes)


def test_between_two_rankings_the_last_prompt_holds(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    generator = make(encoder, vocabularies, interval_s=2.0)
    encoder.scores = SPRING
    first = generator.generate(frame_at(1_000_000_000))
    encoder.scores = {**SPRING, 'spring': 0.0, 'winter': 0.9}
    held = generator.generate(frame_at(2_999_999_999))
    assert (held.template, held.ranking) == (first.template, first.ranking)
    assert held.stamp_ns == 2_999_999_999
    assert encoder.images == 1
    due = generator.generate(frame_at(3_000_000_000))
    assert due.text_for('grass') == 'A rendered image of grass in winter.'
    assert encoder.images == 2


def test_the_interval_counts_from_the_last_ranking_and_a_new_sequence_ranks_at_once(
    encoder: Any, vocabularies: Vocabularies
) -> None:
    generator = make(encoder, vocabularies, interval_s=1.0)
    encoder.scores = SPRING
    for stamp_ns in range(0, 3_000_000_000, 400_000_000):
        generator.generate(frame_at(stamp_ns))
    # Ranked at 0, 1.2 and 2.4 s.
    assert encoder.images == 3
    generator.generate(frame_at(0))
    assert encoder.images == 4
