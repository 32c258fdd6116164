# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Image files are read whole and at their true scale, or refused with a remedy."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp
from rasterio.transform import Affine, from_origin

from peace_ros.core.domain import Label
from peace_ros.simulation import load_world
from peace_ros.simulation.picture_files import RasterError
from peace_ros.simulation.rasters import (
    _tell_scaling,
    read_gsd_m,
    read_indices,
    read_photo,
)

NORTH_UP = from_origin(5e5, 5e6, 0.25, 0.25)
RNG = np.random.default_rng(4)
NOISE = RNG.integers(0, 256, (3, 192, 256)).astype(np.uint8)


def write_tiff(path: Path, bands: Any = NOISE, **profile: Any) -> Path:
    """Write bands x height x width as a TIFF."""
    count, height, width = bands.shape
    colours = profile.pop('colours', None)
    profile = {'crs': 'EPSG:32633', 'transform': NORTH_UP, 'photometric': 'RGB', **profile}
    with rasterio.open(
        path, 'w', driver='GTiff', count=count, height=height, width=width, dtype=bands.dtype,
        **profile,
    ) as file:  # fmt: skip
        file.write(bands)
        if colours:
            file.colorinterp = colours
    return path


@pytest.mark.parametrize('compression', ['none', 'deflate', 'lzw', 'zstd', 'lerc', 'packbits'])
def test_all_lossless_compressions_are_read_exactly(tmp_path: Path, compression: str) -> None:
    photo = read_photo(write_tiff(tmp_path / 'a.tif', compress=compression, tiled=True))
    assert photo.known is None
    assert np.array_equal(photo.rgb, np.moveaxis(NOISE, 0, -1))


@pytest.mark.parametrize('compression', ['deflate', 'lzw', 'zstd', 'jpeg'])
def test_a_damaged_part_is_refused_without_noise(
    tmp_path: Path, compression: str, capfd: pytest.CaptureFixture[str]
) -> None:
    smooth = np.stack([np.add.outer(np.arange(512), np.arange(512)) % 200] * 3).astype(np.uint8)
    smooth += RNG.integers(0, 50, smooth.shape).astype(np.uint8)
    path = write_tiff(
        tmp_path / 'a.tif', smooth, compress=compression, tiled=True, interleave='pixel'
    )
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4000] = bytes(4000)
    path.write_bytes(data)
    with pytest.raises(RasterError, match=r'cannot be decoded, at least in parts.*copy it again'):
        read_photo(path)
    assert capfd.readouterr() == ('', '')


def test_a_file_that_ends_early_is_refused(tmp_path: Path) -> None:
    path = write_tiff(tmp_path / 'a.tif')
    path.write_bytes(path.read_bytes()[:60_000])
    with pytest.raises(RasterError, match='copy it again'):
        read_photo(path)


def test_further_bands_are_left_out_and_alpha_is_unknown_ground(tmp_path: Path) -> None:
    alpha = np.full((192, 256), 255, np.uint8)
    alpha[:, :64] = 0
    bands = np.stack([*NOISE, NOISE[1], alpha])
    meanings = [getattr(ColorInterp, name) for name in ('red', 'green', 'blue', 'nir', 'alpha')]
    photo = read_photo(write_tiff(tmp_path / 'a.tif', bands, colours=meanings))
    assert np.array_equal(photo.rgb, np.moveaxis(NOISE, 0, -1))
    assert photo.known is not None
    assert np.array_equal(photo.known, alpha > 0)


def test_bands_without_a_meaning_are_refused(tmp_path: Path) -> None:
    bands = np.stack([*NOISE, *NOISE[:2]])
    path = write_tiff(tmp_path / 'a.tif', bands, photometric='MINISBLACK')
    with pytest.raises(RasterError, match=r'5 bands.*gdal_translate -b 1 -b 2 -b 3'):
        read_photo(path)


def test_ground_without_data_is_never_safe(tmp_path: Path) -> None:
    bands = np.maximum(NOISE, 1)
    bands[:, :, :50] = 0
    path = write_tiff(tmp_path / 'a.tif', bands, nodata=0)
    labels = tmp_path / 'labels.png'
    cv2.imwrite(str(labels), np.full((192, 256), Label.GRASS, np.uint8))
    world = load_world(path, labels=labels)
    assert world.labels is not None
    assert (world.labels[:, :50] == Label.UNLABELED).all()
    assert (world.labels[:, 50:] == Label.GRASS).all()
    bgra = np.full((10, 10, 4), 255, np.uint8)
    bgra[0, :, 3] = 0
    cv2.imwrite(str(tmp_path / 'a.png'), bgra)
    known = read_photo(tmp_path / 'a.png').known
    assert known is not None
    assert known.sum() == 90


@pytest.mark.parametrize('suffix', ['tif', 'png'])
@pytest.mark.parametrize('factor', [16, 40, 257])
def test_sixteen_bits_are_scaled_by_their_values_and_that_is_said_once(
    tmp_path: Path, suffix: str, factor: int, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / f'a.{suffix}'
    wide = NOISE.astype(np.uint16) * factor
    if suffix == 'tif':
        write_tiff(path, wide)
    else:
        cv2.imwrite(str(path), np.moveaxis(wide[::-1], 0, -1))
    _tell_scaling.cache_clear()
    with caplog.at_level(logging.WARNING):
        found, again = (read_photo(path).rgb for _ in range(2))
    assert np.array_equal(found, again)
    assert np.abs(found.astype(int) - np.moveaxis(NOISE, 0, -1)).max() <= 2
    assert [each.getMessage()[:17] for each in caplog.records] == ['images of 16 bits']


def test_floating_point_is_refused_with_the_command_that_scales_it(tmp_path: Path) -> None:
    path = write_tiff(tmp_path / 'a.tif', NOISE.astype(np.float32))
    with pytest.raises(RasterError, match=r'float32.*gdal_translate -ot Byte -scale'):
        read_photo(path)


@pytest.mark.parametrize(
    ('crs', 'origin', 'pixel', 'metres'),
    [
        ('EPSG:32633', (5e5, 5e6), 0.25, 0.25),
        ('EPSG:2154', (1e5, 6.9e6), 0.5, 0.5),
        ('EPSG:2222', (7e5, 1e6), 1.0, 0.3048),
        ('EPSG:2263', (984_000, 200_000), 1.0, 1200 / 3937),
    ],
)
def test_the_scale_is_in_metres_whatever_the_unit(
    tmp_path: Path, crs: str, origin: tuple[float, float], pixel: float, metres: float
) -> None:
    path = write_tiff(tmp_path / 'a.tif', crs=crs, transform=from_origin(*origin, pixel, pixel))
    assert read_gsd_m(path) == pytest.approx(metres)
    assert load_world(path).gsd_m == pytest.approx(metres)
    assert load_world(path, 0.7).gsd_m == 0.7


def test_metres_of_mercator_shrink_with_the_latitude(tmp_path: Path) -> None:
    at_60_north = from_origin(1.5e6, 8_399_737.9, 0.4, 0.4)
    path = write_tiff(tmp_path / 'a.tif', crs='EPSG:3857', transform=at_60_north)
    assert read_gsd_m(path) == pytest.approx(0.2, rel=0.004)


@pytest.mark.parametrize(
    ('profile', 'complaint'),
    [
        ({'transform': NORTH_UP * Affine.rotation(30)}, 'upper edge is not north'),
        ({'transform': Affine(0.2, 0, 5e5, 0, 0.2, 5e6)}, 'upper edge is not north'),
        ({'transform': Affine(-0.2, 0, 5e5, 0, -0.2, 5e6)}, 'upper edge is not north'),
        ({'crs': 'EPSG:3995', 'transform': from_origin(2e6, 0, 1, 1)}, 'upper edge is not north'),
        ({'transform': from_origin(5e5, 5e6, 0.25, 0.5)}, r'0\.25 x 0\.5 m'),
        ({'crs': 'EPSG:4326', 'transform': from_origin(9, 50, 1e-5, 1e-5)}, 'in degrees'),
        ({'crs': 'LOCAL_CS["site",UNIT["metre",1]]'}, 'unit is not certain'),
        ({'crs': None}, 'no scale in a known reference system'),
        ({'transform': Affine.identity()}, 'no scale in a known reference system'),
    ],
)
def test_a_scale_that_is_not_understood_is_refused(
    tmp_path: Path, profile: dict[str, Any], complaint: str
) -> None:
    path = write_tiff(tmp_path / 'a.tif', **profile)
    with pytest.raises(RasterError, match=f'{complaint}.*(metres per pixel|north up)'):
        read_gsd_m(path)
    assert load_world(path, 0.2).image_rgb.shape == (192, 256, 3)


def test_a_world_file_alone_tells_no_unit(tmp_path: Path) -> None:
    path = write_tiff(tmp_path / 'a.tif', crs=None, transform=Affine.identity())
    (tmp_path / 'a.tfw').write_text('0.2\n0\n0\n-0.2\n500000\n5000000\n')
    with pytest.raises(RasterError, match='metres per pixel'):
        read_gsd_m(path)


def test_photos_are_upright_as_their_exif_says(tmp_path: Path) -> None:
    image = np.zeros((64, 48, 3), np.uint8)
    image[:16] = 250
    _, jpeg = cv2.imencode('.jpg', image)
    # An APP1 segment with one entry: orientation 6, "turn by 90 degrees clockwise to see it".
    tiff = b'MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0'
    segment = b'\xff\xe1' + (len(tiff) + 8).to_bytes(2, 'big') + b'Exif\0\0' + tiff
    path = tmp_path / 'a.jpg'
    path.write_bytes(jpeg.tobytes()[:2] + segment + jpeg.tobytes()[2:])
    rgb = read_photo(path).rgb
    assert rgb.shape == (48, 64, 3)
    assert rgb[:, -8:].min() > 200
    assert rgb[:, :40].max() < 50


def test_without_rasterio_the_package_is_named_and_other_images_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_tiff(tmp_path / 'a.tif')
    cv2.imwrite(str(tmp_path / 'a.png'), np.full((30, 40, 3), 90, np.uint8))
    monkeypatch.setitem(sys.modules, 'rasterio', None)
    with pytest.raises(RasterError, match='run pip install rasterio'):
        load_world(path, 0.2)
    assert load_world(tmp_path / 'a.png', 0.2).gsd_m == 0.2


def write_palette_png(path: Path, indices: Any, palette: list[tuple[int, int, int]]) -> None:
    height, width = indices.shape
    with rasterio.open(
        path, 'w', driver='PNG', height=height, width=width, count=1, dtype='uint8'
    ) as file:
        file.write_colormap(1, dict(enumerate(palette)))
        file.write(indices, 1)


def test_palette_pngs_give_their_indices_not_their_colours(tmp_path: Path) -> None:
    indices = np.array([[0, 1, 2], [2, 1, 0]], np.uint8)
    for palette in ([(0, 0, 0), (128, 0, 0), (0, 128, 0)], [(9, 9, 9), (1, 2, 3), (9, 9, 9)]):
        write_palette_png(tmp_path / 'a.png', indices, palette)
        assert read_indices(tmp_path / 'a.png').tolist() == indices.tolist()


def test_grey_saved_as_colour_still_holds_indices_and_colours_do_not(tmp_path: Path) -> None:
    grey = np.repeat(np.array([[3, 7]], np.uint8)[..., None], 3, axis=2)
    cv2.imwrite(str(tmp_path / 'grey.png'), grey)
    assert read_indices(tmp_path / 'grey.png').tolist() == [[3, 7]]
    grey[0, 0, 0] = 200
    cv2.imwrite(str(tmp_path / 'colour.png'), grey)
    with pytest.raises(RasterError, match='a colour image, but class indices are needed'):
        read_indices(tmp_path / 'colour.png')


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    (tmp_path / 'text.png').write_text('this is a text, and no image')
    (tmp_path / 'empty.png').write_bytes(b'')
    _, jpeg = cv2.imencode('.jpg', np.zeros((64, 64, 3), np.uint8))
    (tmp_path / 'short.jpg').write_bytes(jpeg.tobytes()[:-20])
    for name, complaint in (
        ('text.png', 'not a readable image'),
        ('empty.png', 'holds 0 bytes'),
        ('short.jpg', 'without the end mark'),
        ('missing.png', 'No such file'),
    ):
        with pytest.raises(RasterError, match=f'{name}.*{complaint}'):
            read_photo(tmp_path / name)
