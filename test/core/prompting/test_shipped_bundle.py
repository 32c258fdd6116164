# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bundled CLIP ranks the shipped vocabularies."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Frame
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, load_vocabularies

PARAMETERS = PromptingParameters(threads=1)


@pytest.fixture(scope='module')
def encoder() -> ClipEncoder:
    return ClipEncoder(Bundle.load(PARAMETERS.bundle), threads=1)


def test_it_knows_every_shipped_word(encoder: ClipEncoder) -> None:
    words = load_vocabularies()
    every = [*words.resolution, *words.frame, *words.environment]
    assert not encoder.unknown_words(every)
    embeddings = encoder.text_embeddings(every)
    np.testing.assert_allclose(np.linalg.norm(embeddings, axis=1), 1.0, atol=1e-5)


def test_a_frame_costs_one_image_and_gets_a_whole_sentence(encoder: ClipEncoder) -> None:
    generator = PromptGenerator(encoder, load_vocabularies(), PARAMETERS)
    before = dict(encoder.calls)
    frame = Frame(np.full((352, 352, 3), 90, np.uint8), 4)
    for _ in range(3):
        prompt = generator.generate(frame)
    assert encoder.calls['image_encoder'] - before['image_encoder'] == 3
    assert encoder.calls['text_encoder'] == before['text_encoder']
    sentence = prompt.text_for('grass')
    assert sentence.startswith('A ')
    assert ' of grass in ' in sentence
    assert '{' not in sentence
    assert all(-1.0 <= each.score <= 1.0 for words in prompt.ranking.values() for each in words)
