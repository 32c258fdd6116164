# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Label, WorldError, is_safe
from peace_ros.simulation import World, draw_world, load_world


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    image = np.zeros((30, 40, 3), np.uint8)
    image[:10] = (0, 0, 250)  # BGR: red in the north
    path = tmp_path / 'photo.png'
    cv2.imwrite(str(path), image)
    return path


@pytest.fixture
def raster(tmp_path: Path) -> Path:
    path = tmp_path / 'labels.png'
    cv2.imwrite(str(path), np.full((30, 40), Label.WATER, np.uint8))
    return path


@pytest.fixture(scope='module')
def drawn() -> World:
    return draw_world(5, size_m=240.0, gsd_m=0.4)


def test_image_and_labels_are_loaded_as_rgb(photo, raster):
    world = load_world(photo, 0.5, raster)
    assert world.image_rgb.shape == (30, 40, 3)
    assert tuple(world.image_rgb[0, 0]) == (250, 0, 0)
    assert (world.labels == Label.WATER).all()
    assert world.size_m == (20.0, 15.0)
    assert world.name == 'photo'


def test_middle_of_the_image_is_the_local_origin_and_up_is_north(photo):
    world = load_world(photo, 0.5)
    assert world.labels is None
    assert world.pixel(0.0, 0.0) == (19.5, 14.5)
    assert world.pixel(5.0, 2.0) == (23.5, 4.5)
    assert world.place(*world.pixel(5.0, 2.0)) == pytest.approx((5.0, 2.0))


def test_jpeg_is_loaded(tmp_path):
    path = tmp_path / 'photo.jpg'
    cv2.imwrite(str(path), np.full((30, 40, 3), 128, np.uint8))
    assert load_world(path, 0.1).image_rgb.shape == (30, 40, 3)


def test_labels_of_another_size_are_refused(photo, tmp_path):
    other = tmp_path / 'other.png'
    cv2.imwrite(str(other), np.ones((30, 41), np.uint8))
    with pytest.raises(WorldError, match=r'41 x 30 px.*40 x 30 px'):
        load_world(photo, 0.5, other)


def test_labels_out_of_range_are_refused(photo, tmp_path):
    other = tmp_path / 'other.png'
    cv2.imwrite(str(other), np.full((30, 40), 12, np.uint8))
    with pytest.raises(WorldError, match='value 12'):
        load_world(photo, 0.5, other)


def test_labels_in_colour_are_refused(photo, tmp_path):
    other = tmp_path / 'other.png'
    cv2.imwrite(str(other), np.full((30, 40, 3), (1, 2, 3), np.uint8))
    with pytest.raises(WorldError, match='give one channel'):
        load_world(photo, 0.5, other)


def test_missing_empty_and_foreign_files_are_refused(tmp_path):
    with pytest.raises(WorldError, match='cannot be read'):
        load_world(tmp_path / 'none.png', 0.5)
    empty = tmp_path / 'empty.png'
    empty.touch()
    with pytest.raises(WorldError, match='0 bytes'):
        load_world(empty, 0.5)
    text = tmp_path / 'text.png'
    text.write_text('this is not an image at all')
    with pytest.raises(WorldError, match='not a readable image'):
        load_world(text, 0.5)


def test_truncated_jpeg_is_refused(tmp_path):
    path = tmp_path / 'photo.jpg'
    noise = np.random.default_rng(1).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    cv2.imwrite(str(path), noise)
    path.write_bytes(path.read_bytes()[:1500])
    with pytest.raises(WorldError, match='cut short'):
        load_world(path, 0.5)


def test_huge_images_are_refused_before_they_are_decoded(tmp_path):
    header = struct.pack('>IIBBBBB', 30_000, 30_000, 8, 2, 0, 0, 0)
    chunk = b'IHDR' + header
    body = struct.pack('>I', 13) + chunk + struct.pack('>I', zlib.crc32(chunk))
    path = tmp_path / 'huge.png'
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + body)
    with pytest.raises(WorldError, match=r'30000 x 30000 px.*400 Mpx'):
        load_world(path, 0.5)


@pytest.mark.parametrize('gsd_m', [0.0, -1.0, float('nan'), float('inf'), 500.0])
def test_impossible_ground_sampling_distances_are_refused(photo, gsd_m):
    with pytest.raises(WorldError, match='ground sampling distance'):
        load_world(photo, gsd_m)


def test_a_plain_image_needs_a_ground_sampling_distance(photo):
    with pytest.raises(WorldError, match='metres per pixel'):
        load_world(photo)


def test_drawn_world_is_the_same_for_the_same_seed():
    first, second, other = (draw_world(s, size_m=60.0, gsd_m=0.4) for s in (3, 3, 4))
    assert np.array_equal(first.image_rgb, second.image_rgb)
    assert np.array_equal(first.labels, second.labels)
    assert not np.array_equal(first.labels, other.labels)


def test_drawn_world_is_fully_labelled_and_as_large_as_asked(drawn):
    assert drawn.size_m == pytest.approx((240.0, 240.0))
    assert drawn.labels is not None
    assert (drawn.labels != Label.UNLABELED).all()


def test_drawn_world_has_room_to_land_and_things_to_avoid(drawn):
    safe = is_safe(drawn.labels).astype(np.uint8)
    clearance_m = cv2.distanceTransform(safe, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * drawn.gsd_m
    assert clearance_m.max() >= 12.0
    assert 0.3 < safe.mean() < 0.9
    seen = set(np.unique(drawn.labels).tolist())
    assert seen >= {Label.PAVED, Label.BUILDING, Label.TREE, Label.VEHICLE, Label.PERSON}


def test_tiles_of_a_drawn_world_join_without_seams():
    # 500 m at 0.25 m are 2 x 2 tiles of 1000 pixels; drawn at 0.5 m they are one.
    fine, coarse = draw_world(8, 500.0, 0.25), draw_world(8, 500.0, 0.5)
    reduced = cv2.resize(fine.image_rgb, coarse.image_rgb.shape[:2], interpolation=cv2.INTER_AREA)
    difference = np.abs(reduced.astype(float) - coarse.image_rgb).mean(axis=2)
    at_seam = difference[:, 498:502].mean()
    assert at_seam < 1.5 * difference.mean() + 1.0
    assert (fine.labels[::2, ::2] == coarse.labels).mean() > 0.93


@pytest.mark.parametrize(
    ('seed', 'size_m', 'gsd_m', 'said'),
    [
        (-1, 400.0, 0.1, 'seed -1'),
        (1, 10.0, 0.1, '60 to 2000'),
        (1, 400.0, 0.001, '0.05 to 2'),
        (1, 2000.0, 0.05, '400 Mpx'),
    ],
)
def test_drawn_worlds_out_of_range_are_refused(seed, size_m, gsd_m, said):
    with pytest.raises(WorldError, match=said):
        draw_world(seed, size_m, gsd_m)
