# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A prompt as pairs: what anybody on the network may send."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import ConfigurationError, Prompt, RankedWord
from peace_ros.core.prompting.pairs import prompt_from_pairs, prompt_pairs


def test_a_prompt_survives_its_pairs():
    ranking = {'environment': (RankedWord('spring', 0.5), RankedWord('winter', 0.25))}
    prompt = Prompt('A {term} in spring.', 7, ranking)
    assert prompt_from_pairs(prompt_pairs(prompt), 7) == prompt


@pytest.mark.parametrize(
    'pairs',
    [
        {'template': 'x' * 1_000_000},
        {'template': 'A {term}.', 'best/environment': 'x' * 1_000_000},
        {'template': 'A {term}.', **{f'score/environment/{n}': '0.5' for n in range(20_000)}},
    ],
)
def test_a_prompt_that_nobody_can_have_meant_is_refused_in_a_short_sentence(pairs):
    with pytest.raises(ConfigurationError, match='at most') as caught:
        prompt_from_pairs(pairs, 7)
    assert len(str(caught.value)) < 200
