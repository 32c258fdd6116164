# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Preprocessing and token numbers equal those of the reference implementations."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip('torch')
pytest.importorskip('PIL')
pytest.importorskip('transformers')

from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil
from transformers.models.vit.image_processing_pil_vit import ViTImageProcessorPil

from peace_ros.core.inference import Preprocessor
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.lab.export.sources import default_input
from peace_ros.lab.export.vocabulary import shipped_vocabulary

pytestmark = pytest.mark.export

CONTEXT = 77


@settings(max_examples=12, deadline=None)
@given(height=st.integers(8, 500), excess=st.integers(0, 500), seed=st.integers(0, 99))
def test_clipseg_pixels_equal_the_reference(height: int, excess: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, height + excess, 3), np.uint8)
    spec = default_input('clipseg', 352)
    reference = ViTImageProcessorPil(
        size={'height': 352, 'width': 352},
        resample=2,
        image_mean=list(spec.mean),
        image_std=list(spec.std),
    )
    wanted = reference(image, return_tensors='np')['pixel_values']
    np.testing.assert_allclose(Preprocessor(spec)(image), wanted, atol=1e-3)


@settings(max_examples=12, deadline=None)
@given(height=st.integers(8, 500), excess=st.integers(0, 500), seed=st.integers(0, 99))
def test_clip_pixels_equal_the_reference(height: int, excess: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, height + excess, 3), np.uint8)
    wanted = CLIPImageProcessorPil()(image, return_tensors='np')['pixel_values']
    have = Preprocessor(default_input('clip', 224))(image)
    np.testing.assert_allclose(have, wanted, atol=1e-3)


def test_portrait_pixels_differ_by_one_level_at_most() -> None:
    image = np.random.default_rng(1).integers(0, 256, (640, 480, 3), np.uint8)
    spec = default_input('clipseg', 352)
    reference = ViTImageProcessorPil(
        size={'height': 352, 'width': 352}, resample=2,
        image_mean=list(spec.mean), image_std=list(spec.std),
    )  # fmt: skip
    wanted = reference(image, return_tensors='np')['pixel_values']
    level = 1.0 / 255.0 / min(spec.std)
    assert np.abs(Preprocessor(spec)(image) - wanted).max() <= level + 1e-5


@pytest.fixture(scope='module')
def ours(tmp_path_factory: pytest.TempPathFactory) -> Tokenizer:
    path = tmp_path_factory.mktemp('tokenizer') / 'tokenizer.json'
    shipped_vocabulary().write(path, CONTEXT)
    return Tokenizer(path, CONTEXT)


@pytest.fixture(scope='module')
def theirs() -> Any:
    """OpenAI's own tokenizer, without the rest of its package, which needs torchvision."""
    found = importlib.util.find_spec('clip')
    if found is None or not found.submodule_search_locations:
        pytest.skip('openai-clip is not installed')
    file = Path(next(iter(found.submodule_search_locations))) / 'simple_tokenizer.py'
    spec = importlib.util.spec_from_file_location('reference_tokenizer', file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.SimpleTokenizer()


def same(ours: Tokenizer, theirs: Any, text: str) -> bool:
    start, end = (theirs.encoder[mark] for mark in ('<|startoftext|>', '<|endoftext|>'))
    have = ours([text]).input_ids[0].tolist()
    return have == [start, *theirs.encode(text)[: CONTEXT - 2], end]


@pytest.mark.parametrize(
    'text',
    [
        'A photo of grass.',
        "A bird's eye view of a road, street, in game screenshot, bad graphics, shade, shadows.",
        'A bird\u2019s eye view &amp; more &lt;b&gt;',
        'na\u00efve caf\u00e9 \uff21\uff22\uff23 \ufb01 \u65e5\u672c\u8a9e \U0001f600 3D 1234',
        '\u0130stanbul \u03a3\u0391\u03a3 \u017ft \'\u017f "I\'LL"',
        'tab\tnew\nline \u200b zero width',
        'schÃ¶n',
        'word ' * 100,
    ],
)
def test_token_numbers_equal_the_reference(ours: Tokenizer, theirs: Any, text: str) -> None:
    assert same(ours, theirs, text)


TEXT = st.text(
    st.one_of(
        st.characters(min_codepoint=32, max_codepoint=126),
        st.characters(
            min_codepoint=160, max_codepoint=0x2FFF, categories=('L', 'N', 'P', 'S', 'Z')
        ),
        st.sampled_from('\u4e00\u65e5\uac00\U0001f600\t\n'),
    ),
    min_size=1,
    max_size=120,
).filter(lambda text: bool(text.strip()) and '<|' not in text)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(text=TEXT)
def test_token_numbers_equal_the_reference_on_any_text(
    ours: Tokenizer, theirs: Any, text: str
) -> None:
    assert same(ours, theirs, text)
