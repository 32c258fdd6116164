# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files of pictures: whole, upright and within limits, or one sentence."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from peace_ros.simulation.picture_files import RasterError, bytes_of, decoded
from peace_ros.simulation.rasters import read_photo

SMOOTH = np.add.outer(np.arange(96), np.arange(64))[..., None].astype(np.uint8)
RGB = np.concatenate([SMOOTH, 255 - SMOOTH, SMOOTH // 2], axis=2)
NOISE = np.random.default_rng(3).integers(0, 256, (400, 400, 3), np.uint8)


@pytest.mark.parametrize('orientation', range(1, 9))
def test_a_photo_is_turned_as_a_viewer_turns_it(tmp_path, orientation) -> None:
    from PIL import ImageOps

    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(RGB).save(tmp_path / 'a.jpg', quality=95, exif=exif)
    with Image.open(tmp_path / 'a.jpg') as image:
        expected = np.asarray(ImageOps.exif_transpose(image))
    photo = read_photo(tmp_path / 'a.jpg')
    assert photo.orientation == orientation
    assert photo.rgb.shape == expected.shape
    assert np.abs(photo.rgb.astype(int) - expected).max() <= 8


@pytest.mark.parametrize(('begin', 'end'), [(0.3, 0.5), (0.2, 0.6)])
def test_a_jpeg_without_its_middle_is_refused_without_noise(tmp_path, begin, end, capfd) -> None:
    _, jpeg = cv2.imencode('.jpg', NOISE)
    data = jpeg.tobytes()
    path = tmp_path / 'a.jpg'
    path.write_bytes(data[: int(len(data) * begin)] + data[int(len(data) * end) :])
    with pytest.raises(RasterError, match=r'a\.jpg cannot be decoded'):
        read_photo(path)
    assert capfd.readouterr().err == ''


@pytest.mark.parametrize('suffix', ['.png', '.bmp', '.webp', '.jpg'])
def test_each_format_gives_red_green_blue(tmp_path, suffix) -> None:
    path = tmp_path / f'a{suffix}'
    Image.fromarray(RGB).save(path, quality=98)
    picture = decoded(path.read_bytes(), path)
    assert picture.pixels.shape == RGB.shape
    assert np.abs(picture.upright().astype(int) - RGB).mean() < 3


@pytest.mark.parametrize('mode', ['P', 'L', 'LA', 'RGBA', '1', 'CMYK'])
def test_palette_grey_alpha_and_print_colours_look_as_elsewhere(tmp_path, mode) -> None:
    path = tmp_path / ('a.jpg' if mode == 'CMYK' else 'a.png')
    image = Image.fromarray(RGB).convert(mode)
    image.save(path)
    with Image.open(path) as opened:
        expected = np.asarray(opened.convert('RGB')).astype(int)
    photo = read_photo(path)
    assert np.abs(photo.rgb - expected).mean() < 12
    assert photo.known is None


def png_that_claims(width: int, height: int) -> bytes:
    def chunk(kind: bytes, content: bytes) -> bytes:
        sum_ = zlib.crc32(kind + content)
        return struct.pack('>I', len(content)) + kind + content + struct.pack('>I', sum_)

    header = struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)
    rows = zlib.compress(bytes(1000))
    return (
        b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + chunk(b'IDAT', rows) + chunk(b'IEND', b'')
    )


@pytest.mark.parametrize(
    ('width', 'height', 'says'),
    [(30_000, 30_000, 'over the limit of 400 Mpx'), (15_000, 15_000, 'bytes cannot hold 15000 x')],
)
def test_sizes_are_checked_before_the_pixels(tmp_path, width, height, says) -> None:
    path = tmp_path / 'a.png'
    path.write_bytes(png_that_claims(width, height))
    with pytest.raises(RasterError, match=says):
        read_photo(path)


def test_only_regular_files_are_read(tmp_path) -> None:
    os.mkfifo(tmp_path / 'fifo.png')
    for path in (tmp_path / 'fifo.png', Path('/dev/zero'), tmp_path):
        with pytest.raises(RasterError, match='not a regular file'):
            bytes_of(path)
    with pytest.raises(RasterError, match='null byte'):
        bytes_of(tmp_path / 'a\0.png')


def test_a_damaged_png_is_refused_without_noise(tmp_path, capfd) -> None:
    Image.fromarray(NOISE).save(tmp_path / 'a.png')
    data = bytearray((tmp_path / 'a.png').read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / 'a.png').write_bytes(data)
    with pytest.raises(RasterError, match='not a readable image'):
        read_photo(tmp_path / 'a.png')
    assert capfd.readouterr().err == ''
