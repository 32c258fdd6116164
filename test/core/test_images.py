# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every honest image is read as it was meant, every other one is refused with a sentence."""

from __future__ import annotations

from array import array
from io import BytesIO
from zlib import crc32

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

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
        (('yuv444', 4, 4, 12, bytes(48)), ['yuv444', 'rgb8', 'publish']),
        (('yuyv', 5, 4, 10, bytes(40)), ['5 x 4', 'even']),
        (('nv12', 4, 3, 4, bytes(18)), ['4 x 3', 'even']),
        (('nv12', 4, 4, 4, bytes(16)), ['16', '24', 'whole']),
        (('mono16', 4, 4, 7, bytes(28)), ['step 7', '8']),
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


@pytest.mark.parametrize(('begin', 'end'), [(0.3, 0.5), (0.2, 0.6), (0.4, 0.45)])
def test_refuses_a_jpeg_that_lacks_its_middle(begin, end):
    """Other decoders shift the rest of the picture and call it a success."""
    noise = np.random.default_rng(1).integers(0, 255, (60, 60, 3), np.uint8)
    whole = jpeg_from_rgb(cv2.resize(noise, (480, 480), interpolation=cv2.INTER_CUBIC), 90)
    assert rgb_from_compressed('jpeg', whole).shape == (480, 480, 3)
    damaged = whole[: int(begin * len(whole))] + whole[int(end * len(whole)) :]
    with pytest.raises(ImageError, match=r'damaged or truncated .* check the link'):
        rgb_from_compressed('jpeg', damaged)


@pytest.mark.parametrize('mode', ['L', 'CMYK'])
def test_a_jpeg_of_other_colours_comes_out_as_rgb(mode):
    file = BytesIO()
    Image.new(mode, (40, 30), 0 if mode == 'CMYK' else 255).save(file, 'JPEG')
    image = rgb_from_compressed('jpeg', file.getvalue())
    assert image.shape == (30, 40, 3)
    assert image.min() >= 250


def test_a_jpeg_may_be_followed_by_padding():
    read = rgb_from_compressed('jpeg', jpeg_from_rgb(scene(), 95) + bytes(512))
    assert read.shape == scene().shape


@pytest.mark.parametrize('data', [b'', b'no image', b'\xff\xd8', b'\x89PNG\r\n\x1a\n', bytes(999)])
def test_refuses_what_is_no_image(data):
    with pytest.raises(ImageError, match=str(len(data))):
        rgb_from_compressed('jpeg', data)


def padded(rows: np.ndarray, padding: int = 6) -> tuple[int, bytes]:
    """Return the step and the bytes of rows of bytes with padding behind each."""
    lines = np.ascontiguousarray(rows).view(np.uint8).reshape(rows.shape[0], -1)
    wide = np.pad(lines, ((0, 0), (0, padding)), constant_values=99)
    return wide.shape[1], wide.tobytes()


def smooth() -> np.ndarray:
    """Red grows to the right, green downwards, blue to the left; no colour changes quickly."""
    right, down = np.linspace(40.0, 210.0, 64), np.linspace(60.0, 200.0, 48)
    return np.dstack(
        np.broadcast_arrays(right[None, :], down[:, None], right[::-1][None, :])
    ).astype(np.uint8)


def yuv_of(rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Y, U, V of ITU-R BT.601 with their usual limits."""
    r, g, b = (rgb[..., each].astype(float) for each in range(3))
    y = 16 + 0.257 * r + 0.504 * g + 0.098 * b
    u = 128 - 0.148 * r - 0.291 * g + 0.439 * b
    v = 128 + 0.439 * r - 0.368 * g - 0.071 * b
    return tuple(np.rint(each).astype(np.uint8) for each in (y, u, v))


def raw_of(encoding: str, rgb: np.ndarray) -> np.ndarray:
    y, u, v = yuv_of(rgb)
    height, width = y.shape
    if encoding in {'nv12', 'nv21'}:
        pairs = (u, v) if encoding == 'nv12' else (v, u)
        colours = np.dstack([each[::2, ::2] for each in pairs]).reshape(height // 2, width)
        return np.vstack((y, colours))
    shared = np.empty_like(y)
    shared[:, ::2], shared[:, 1::2] = u[:, ::2], v[:, ::2]
    order = (y, shared) if encoding in {'yuyv', 'yuv422_yuy2'} else (shared, y)
    return np.dstack(order).reshape(height, 2 * width)


@pytest.mark.parametrize('encoding', ['yuyv', 'yuv422_yuy2', 'uyvy', 'yuv422', 'nv12', 'nv21'])
def test_reads_what_video_cameras_publish(encoding):
    step, data = padded(raw_of(encoding, smooth()))
    read = rgb_from_raw(encoding, 64, 48, step, data)
    assert np.abs(read.astype(int) - smooth()).max() <= 10


@pytest.mark.parametrize('pattern', ['rggb', 'bggr', 'gbrg', 'grbg'])
@pytest.mark.parametrize('bits', [8, 16])
def test_reads_the_bayer_pattern_that_begins_as_it_is_named(pattern, bits):
    rgb = smooth()
    mosaic = np.empty((48, 64), np.uint16 if bits == 16 else np.uint8)
    for place, colour in enumerate(pattern):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = rgb[row::2, column::2, 'rgb'.index(colour)]
    step, data = padded(mosaic * 256 if bits == 16 else mosaic)
    read = rgb_from_raw(f'bayer_{pattern}{bits}', 64, 48, step, data)
    assert np.abs(read[2:-2, 2:-2].astype(int) - rgb[2:-2, 2:-2]).max() <= 6


@pytest.mark.parametrize('is_bigendian', [False, True])
@pytest.mark.parametrize('used_bits', [10, 12, 14, 16])
@pytest.mark.parametrize('encoding', ['mono16', 'rgb16', 'bgra16'])
def test_16_bits_are_scaled_by_the_bits_that_are_used(encoding, used_bits, is_bigendian):
    rgb = smooth()
    samples = {'mono16': rgb[..., :1], 'rgb16': rgb, 'bgra16': rgb[..., [2, 1, 0, 0]]}[encoding]
    deep = (samples.astype(np.uint16) << (used_bits - 8)).astype('>u2' if is_bigendian else '<u2')
    step, data = padded(deep)
    read = rgb_from_raw(encoding, 64, 48, step, data, is_bigendian=is_bigendian)
    expected = np.repeat(rgb[..., :1], 3, axis=2) if encoding == 'mono16' else rgb
    np.testing.assert_array_equal(read, expected)


def test_a_dark_picture_of_16_bits_stays_dark_and_some_bright_pixels_do_not_darken_it():
    dark = np.random.default_rng(1).integers(0, 9, (48, 64)).astype('<u2')
    assert rgb_from_raw('mono16', 64, 48, 128, dark.tobytes()).max() <= 2
    twelve = (smooth()[..., 0].astype('<u2') << 4).astype('<u2')
    bright = twelve.copy()
    bright[0, :3] = 65_535
    whole, spotted = (
        rgb_from_raw('mono16', 64, 48, 128, each.tobytes()) for each in (twelve, bright)
    )
    np.testing.assert_array_equal(whole[1:], spotted[1:])


def deep_png(image: np.ndarray) -> bytes:
    return cv2.imencode('.png', image.astype(np.uint16) << 4)[1].tobytes()


def test_a_png_of_16_bits_is_scaled_too():
    read = rgb_from_compressed('png', deep_png(smooth()[..., ::-1]))
    np.testing.assert_array_equal(read, smooth())
    grey = rgb_from_compressed('16UC1; png compressed', deep_png(smooth()[..., 0]))
    np.testing.assert_array_equal(grey, np.repeat(smooth()[..., :1], 3, axis=2))
    whole = deep_png(smooth())
    with pytest.raises(ImageError, match=r'damaged|truncated'):
        rgb_from_compressed('png', whole[: len(whole) // 2])


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
