# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Texts are padded to the longest, cut with a warning, and unknown words are named."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.tokenizer import Tokenizer


@pytest.fixture
def tokenizer(clip_folder: Path) -> Tokenizer:
    return Tokenizer(clip_folder / 'tokenizer.json', 6)


def test_a_batch_is_as_long_as_its_longest_text(tokenizer: Tokenizer) -> None:
    tokens = tokenizer(['grass', 'a photo of grass'])
    assert tokens.input_ids.shape == (2, 4)
    assert tokens.input_ids.dtype == tokens.attention_mask.dtype == 'int64'
    assert tokens.attention_mask.tolist() == [[1, 0, 0, 0], [1, 1, 1, 1]]
    assert tokens.input_ids[0, 0] == tokens.input_ids[1, 3]


def test_a_text_that_is_too_long_is_cut_with_one_warning(
    tokenizer: Tokenizer, caplog: pytest.LogCaptureFixture
) -> None:
    text = 'a photo of grass in winter in fog'
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            assert tokenizer([text]).input_ids.shape == (1, 6)
    assert [text in record.getMessage() for record in caplog.records] == [True]
    assert '6 tokens' in caplog.text


def test_a_text_that_just_fits_is_not_warned_of(
    tokenizer: Tokenizer, caplog: pytest.LogCaptureFixture
) -> None:
    assert tokenizer(['a photo of grass in winter']).input_ids.shape == (1, 6)
    assert not caplog.records


def test_unknown_words_are_named_as_written(tokenizer: Tokenizer) -> None:
    assert tokenizer.unknown_words('a photo of Quicksand, grass') == ('Quicksand',)
    assert tokenizer.unknown_words('a photo of grass') == ()


def test_words_of_a_script_that_leaves_no_token_are_unknown() -> None:
    bundle = Bundle.load('clipseg-small')
    bundled = Tokenizer(bundle.paths['tokenizer'], bundle.manifest.context_length)
    assert bundled.unknown_words('草地') == ('草地',)
    assert bundled.unknown_words('a photo of 草地, grass') == ('草地',)
    assert bundled.unknown_words('a photo of grass, a road') == ()


@pytest.mark.parametrize('texts', [[], ['grass', ' '], ['']])
def test_blank_texts_are_refused(tokenizer: Tokenizer, texts: list[str]) -> None:
    with pytest.raises(ConfigurationError, match='non-blank'):
        tokenizer(texts)


def test_a_file_that_is_no_tokenizer_is_named(tmp_path: Path) -> None:
    path = tmp_path / 'tokenizer.json'
    path.write_text('{}')
    with pytest.raises(BundleError, match=r'tokenizer\.json: not a tokenizer'):
        Tokenizer(path, 8)
