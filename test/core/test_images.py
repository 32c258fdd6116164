# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every honest image is read as it was meant, every other one is refused with a sentence."""

from __future__ import annotations

from array import array
from zlib import crc32

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import ImageError
from peace_ros.core.images import (
    MAX_PIXELS,
    jpeg_from_rgb,
    pixels_from_raw,
    rgb_from_compressed,
    rgb_from_raw,
)

CHANNELS = {'rgb8': 3, 'bgr8': 3, 'rgba8': 4, 'bgra8': 4, 'mono8': 1, '8UC3': 3, '8UC1': 1}


def rgb_of(encoding: str, pixels: np.ndarray) -> np.ndarray:
    order = {'rgb8': [0, 1, 2], 'rgba8': [0, 1, 2], 'mono8': [0, 0, 0], '8UC1': [0, 0, 0]}
    return pixels[..., order.get(encoding, [2, 1, 0])]


@given(
    encoding=st.sampled_from(sorted(CHANNELS)),
    width=st.integers(1, 9),
    height=st.integers(1, 9),
    padding=st.integers(0, 7),
    seed=st.integers(0, 2**16),
)
def test_reads_every_encoding_with_any_padding(encoding, width, height, padding, seed):
    channels = CHANNELS[encoding]
    step = width * channels + padding
    raw = np.random.default_rng(seed).integers(0, 256, (height, step), np.uint8)
    pixels = raw[:, : width * channels].reshape(height, width, channels)
    read = rgb_from_raw(encoding, width, height, step, array('B', raw.tobytes()))
    np.testing.assert_array_equal(read, rgb_of(encoding, pixels))


def test_reads_rgb_without_a_copy():
    data = array('B', bytes(4 * 5 * 3))
    read = pixels_from_raw('rgb8', 4, 5, 12, data)
    data[0] = 200
    assert read[0, 0, 0] == 200


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        (('yuv422', 4, 4, 8, bytes(32)), ['yuv422', 'rgb8', 'publish']),
        (('', 4, 4, 12, bytes(48)), ["''", 'publish']),
        (('rgb8', 0, 4, 0, b''), ['0 x 4', 'empty']),
        (('rgb8', 4, 0, 12, b''), ['4 x 0', 'empty']),
        (('rgb8', 4, 4, 12, bytes(47)), ['47', '48', 'whole']),
        (('rgb8', 4, 4, 12, bytes(49)), ['49', '48']),
        (('rgb8', 4, 4, 0, bytes(48)), ['step 0', '12']),
        (('rgb8', 4, 4, 11, bytes(44)), ['step 11', '12']),
        (('mono8', 60_000, 60_000, 60_000, b''), ['60000 x 60000', str(MAX_PIXELS), 'smaller']),
    ],
)
def test_refuses_a_bad_raw_image_with_value_and_limit(fields, words):
    with pytest.raises(ImageError) as caught:
        rgb_from_raw(*fields)
    assert all(word in str(caught.value) for word in words)


def scene() -> np.ndarray:
    ramp = np.linspace(0, 255, 60 * 40).reshape(40, 60)
    return np.dstack([ramp, ramp[::-1], ramp[:, ::-1]]).astype(np.uint8)


def png(image: np.ndarray) -> bytes:
    return cv2.imencode('.png', image[..., ::-1])[1].tobytes()


def test_reads_png_exactly_and_jpeg_nearly():
    np.testing.assert_array_equal(rgb_from_compressed('png', png(scene())), scene())
    read = rgb_from_compressed('rgb8; jpeg compressed bgr8', jpeg_from_rgb(scene(), 95))
    assert np.abs(read.astype(int) - scene()).mean() < 4.0


@pytest.mark.parametrize('kind', ['jpeg', 'png'])
@pytest.mark.parametrize('part', [0.3, 0.5, 0.9, 0.95])
def test_refuses_a_truncated_image(kind, part):
    whole = jpeg_from_rgb(scene(), 95) if kind == 'jpeg' else png(scene())
    with pytest.raises(ImageError, match=r'bytes'):
        rgb_from_compressed(kind, whole[: int(part * len(whole))])


def test_refuses_a_jpeg_that_lacks_its_last_byte():
    with pytest.raises(ImageError, match='truncated'):
        rgb_from_compressed('jpeg', jpeg_from_rgb(scene(), 95)[:-1])


def test_a_jpeg_may_be_followed_by_padding():
    read = rgb_from_compressed('jpeg', jpeg_from_rgb(scene(), 95) + bytes(512))
    assert read.shape == scene().shape


@pytest.mark.parametrize('data', [b'', b'no image', b'\xff\xd8', b'\x89PNG\r\n\x1a\n', bytes(999)])
def test_refuses_what_is_no_image(data):
    with pytest.raises(ImageError, match=str(len(data))):
        rgb_from_compressed('jpeg', data)


def test_refuses_16_bits():
    deep = cv2.imencode('.png', np.full((4, 4), 4000, np.uint16))[1].tobytes()
    with pytest.raises(ImageError, match='8 bits per colour'):
        rgb_from_compressed('png', deep)


def test_refuses_a_damaged_png():
    broken = bytearray(png(scene()))
    broken[40:60] = bytes(20)
    with pytest.raises(ImageError, match='damaged'):
        rgb_from_compressed('png', bytes(broken))


def test_refuses_a_huge_image_before_it_is_decoded():
    bomb = bytearray(png(scene()))
    bomb[16:24] = (50_000).to_bytes(4, 'big') * 2
    bomb[29:33] = crc32(bomb[12:29]).to_bytes(4, 'big')
    with pytest.raises(ImageError, match='2500000000 pixels'):
        rgb_from_compressed('png', bytes(bomb))


@given(st.binary(max_size=300), st.sampled_from([b'', b'\xff\xd8\xff', b'\x89PNG\r\n\x1a\n']))
def test_rubbish_never_ends_in_another_error(data, start):
    with pytest.raises(ImageError):
        rgb_from_compressed('jpeg', start + data)
