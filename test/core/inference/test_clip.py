# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Embeddings have unit length and each text is encoded once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import BundleError, ConfigurationError, Frame
from peace_ros.core.inference import Bundle, ClipEncoder


@pytest.fixture
def encoder(clip_folder: Path) -> ClipEncoder:
    return ClipEncoder(Bundle.load(clip_folder), threads=1)


def test_image_embeddings_have_unit_length(encoder: ClipEncoder, frame: Frame) -> None:
    embedding = encoder.image_embedding(frame)
    assert embedding.shape == (8,)
    assert embedding.dtype == np.float32
    assert np.linalg.norm(embedding) == pytest.approx(1.0, abs=1e-6)
    assert encoder.calls == {'image_encoder': 1, 'text_encoder': 0}


def test_text_embeddings_have_unit_length(encoder: ClipEncoder) -> None:
    embeddings = encoder.text_embeddings(['grass', 'a photo of water', 'night'])
    assert embeddings.shape == (3, 8)
    assert embeddings.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(embeddings, axis=1), 1.0, atol=1e-6)


def test_all_new_texts_go_through_in_one_batch_and_only_once(encoder: ClipEncoder) -> None:
    first = encoder.text_embeddings(['grass', 'water', 'grass'])
    assert encoder.calls['text_encoder'] == 1
    np.testing.assert_array_equal(first[0], first[2])
    second = encoder.text_embeddings(['water', 'grass'])
    assert encoder.calls['text_encoder'] == 1
    np.testing.assert_array_equal(second, first[[1, 0]])
    encoder.text_embeddings(['grass', 'night'])
    assert encoder.calls['text_encoder'] == 2


def test_a_text_reads_the_same_alone_and_in_a_batch(clip_folder: Path) -> None:
    bundle = Bundle.load(clip_folder)
    batch = ClipEncoder(bundle, threads=1).text_embeddings(['car', 'a photo of grass in winter'])
    alone = ClipEncoder(bundle, threads=1).text_embeddings(['car'])
    np.testing.assert_allclose(alone[0], batch[0], atol=1e-6)


def test_the_second_process_encodes_no_text(clip_folder: Path, tmp_path: Path) -> None:
    bundle = Bundle.load(clip_folder)
    texts = ['grass', 'water']
    first = ClipEncoder(bundle, threads=1, cache_dir=tmp_path / 'cache').text_embeddings(texts)
    again = ClipEncoder(bundle, threads=1, cache_dir=tmp_path / 'cache')
    np.testing.assert_array_equal(again.text_embeddings(texts), first)
    assert again.calls['text_encoder'] == 0


def test_words_the_model_never_learned_are_named(encoder: ClipEncoder) -> None:
    unknown = encoder.unknown_words(['grass', 'quicksand', 'a photo of lava'])
    assert unknown == {'quicksand': ('quicksand',), 'a photo of lava': ('lava',)}


def test_no_texts_are_refused(encoder: ClipEncoder) -> None:
    with pytest.raises(ConfigurationError):
        encoder.text_embeddings([])


def test_a_segmenter_bundle_is_refused(clipseg_folder: Path) -> None:
    with pytest.raises(BundleError, match="'clip' is needed"):
        ClipEncoder(Bundle.load(clipseg_folder))


def test_an_embedding_without_direction_is_refused(tiny: Any, tmp_path: Path, frame: Frame) -> None:
    folder = tiny.write_bundle(tmp_path / 'dead', 'clip')
    encoder = ClipEncoder(Bundle.load(folder), threads=1)
    # Pixels at the mean, in a network without bias, leave nothing to tell apart.
    encoder._preprocess = lambda image: np.zeros((1, 3, 32, 40), np.float32)  # type: ignore[assignment]
    with pytest.raises(BundleError, match='not zero'):
        encoder.image_embedding(frame)
