# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The network input against a straightforward reference."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from peace_ros.core.domain import ImageError
from peace_ros.core.inference import Preprocessor
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.inference.preprocess import MAX_PIXELS

MEAN, STD = (0.48, 0.46, 0.41), (0.27, 0.26, 0.28)


def spec(width: int = 24, height: int = 16, resize: str = 'stretch') -> InputSpec:
    return InputSpec(width, height, resize, MEAN, STD)


def noise(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)


def normalised(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    values = (image.astype(np.float64) / 255.0 - np.array(MEAN)) / np.array(STD)
    return values.transpose(2, 0, 1)[None].astype(np.float32)


def test_an_image_of_the_right_size_is_only_normalised() -> None:
    image = noise(16, 24)
    got = Preprocessor(spec())(image)
    assert got.dtype == np.float32
    assert got.shape == (1, 3, 16, 24)
    np.testing.assert_allclose(got, normalised(image), atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(height=st.integers(1, 70), width=st.integers(1, 70), seed=st.integers(0, 99))
def test_stretching_matches_the_reference(height: int, width: int, seed: int) -> None:
    image = noise(height, width, seed)
    shrinks = width >= 24 and height >= 16
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    reference = normalised(cv2.resize(image, (24, 16), interpolation=method))
    np.testing.assert_allclose(Preprocessor(spec())(image), reference, atol=1e-6)


def test_halving_averages_each_block() -> None:
    image = noise(32, 48)
    blocks = image.reshape(16, 2, 24, 2, 3).mean(axis=(1, 3))
    reference = normalised(blocks)
    np.testing.assert_allclose(Preprocessor(spec())(image), reference, atol=0.51 / 255 / min(STD))


@pytest.mark.parametrize(('height', 'width'), [(32, 96), (64, 48), (16, 24)])
def test_cropping_keeps_the_centre(height: int, width: int) -> None:
    image = np.zeros((height, width, 3), np.uint8)
    scale = min(height / 16, width / 24)
    part_height, part_width = round(16 * scale), round(24 * scale)
    top, left = (height - part_height) // 2, (width - part_width) // 2
    image[top : top + part_height, left : left + part_width] = 200
    got = Preprocessor(spec(resize='crop'))(image)
    np.testing.assert_allclose(got, normalised(np.full((16, 24, 3), 200, np.uint8)), atol=1e-6)


def test_the_buffer_is_used_again_and_the_image_left_alone() -> None:
    preprocess = Preprocessor(spec())
    first, second = noise(40, 40, 1), noise(40, 40, 2)
    first.setflags(write=False)
    before = preprocess(first).copy()
    buffer = preprocess(second)
    assert buffer is preprocess(first)
    np.testing.assert_array_equal(buffer, before)


def test_a_view_into_a_larger_image_is_taken() -> None:
    wide = noise(40, 80)
    view = wide[:, 10:50]
    np.testing.assert_array_equal(
        Preprocessor(spec())(view).copy(), Preprocessor(spec())(view.copy())
    )


def test_a_huge_image_is_refused_without_being_read() -> None:
    huge = np.broadcast_to(np.zeros((1, 1, 3), np.uint8), (MAX_PIXELS // 1000 + 1, 1000, 3))
    with pytest.raises(ImageError, match=rf'1000 x 64001 px: at most {MAX_PIXELS}'):
        Preprocessor(spec())(huge)
