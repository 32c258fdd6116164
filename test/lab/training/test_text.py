# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the small text towers can read."""

import numpy as np
import pytest

from peace_ros.core.domain import Label

pytest.importorskip('tokenizers')
text = pytest.importorskip('peace_ros.lab.training.text')

ALL_CONDITION_WORDS = [word for words in text.CONDITION_WORDS.values() for word in words]


def test_every_vocabulary_word_template_and_term_group_is_known() -> None:
    tokenizer = text.build_tokenizer()
    unknown = tokenizer.token_to_id(text.UNKNOWN)
    sentences = [*ALL_CONDITION_WORDS, *(words for _, words in text.GROUPS + text.TERMS)]
    sentences.append("A bird's eye view of a lawn, in game screenshot, bad graphics, shade.")
    for sentence in sentences:
        assert unknown not in tokenizer.encode(sentence).ids, sentence


def test_unknown_words_are_marked_and_case_and_punctuation_do_not_matter() -> None:
    tokenizer = text.build_tokenizer()
    assert tokenizer.encode('Xylophone').tokens == [text.START, text.UNKNOWN]
    assert tokenizer.encode('GRASS, Lawn!').ids == tokenizer.encode('grass lawn').ids


def test_a_batch_is_padded_to_its_longest_prompt_and_cut_at_the_context_length() -> None:
    tokenizer = text.build_tokenizer()
    short, long = tokenizer.encode_batch(['grass', 'a photo of dead grass'])
    assert len(short.ids) == len(long.ids) == 6
    assert short.attention_mask == [1, 1, 0, 0, 0, 0]
    assert len(tokenizer.encode('grass ' * 100).ids) == text.CONTEXT_LENGTH


def test_an_empty_text_still_holds_a_token() -> None:
    assert text.build_tokenizer().encode('').tokens == [text.START]


def test_no_term_names_both_safe_ground_and_a_hazard_but_the_paved_group() -> None:
    safe = {Label.GRASS, Label.BARE_GROUND}
    mixed = [words for labels, words in text.TERMS + text.GROUPS if labels & safe and labels - safe]
    assert mixed == ['parking lot, sidewalk, gravel, dirt, sand, concrete floor, asphalt']


def test_sampled_prompts_fill_every_slot_mostly_with_the_true_words() -> None:
    rng = np.random.default_rng(0)
    prompts = [text.sample_prompt(rng, (('blurred',), ('film',), ('fog',))) for _ in range(400)]
    assert not [prompt for prompt in prompts if '{' in prompt.text]
    whole = [
        prompt.text for prompt in prompts if ' in ' in prompt.text and 'bird' not in prompt.text
    ]
    assert len(whole) > 100
    assert sum('fog.' in each for each in whole) > 0.6 * len(whole)
    assert {label for prompt in prompts for label in prompt.labels} == set(Label) - {
        Label.UNLABELED
    }
    assert any(not prompt.labels for prompt in prompts)
