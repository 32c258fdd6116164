# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How pictures of the ground are compared, in numbers."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, radians

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import ground_to_image, quaternion_from_euler
from peace_ros.core.mapping import Displacement, Mismatch, View, register, small_grey
from peace_ros.core.mapping import registration as steps

CAMERA = Camera.from_degrees(256, 256, 73.0)


def pose_of(altitude_m: float, **deg: float) -> Pose:
    angles = (radians(deg.get(name, 0.0)) for name in ('roll', 'pitch', 'yaw'))
    return Pose(0, 0.0, 0.0, -altitude_m, quaternion_from_euler(*angles), altitude_m)


def texture(height: int, width: int, seed: int = 1) -> np.ndarray:
    """Smooth noise, grey levels."""
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (height, width)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return np.asarray(120.0 + 30.0 * smooth / smooth.std(), np.float32)


def view_of(ground: np.ndarray, altitude_m: float = 30.0, **deg: float) -> View:
    return View(np.clip(ground, 0.0, 255.0).astype(np.uint8), pose_of(altitude_m, **deg))


@pytest.mark.parametrize(
    ('shape', 'small'),
    [
        ((1080, 1920), (144, 256)),
        ((1920, 1080), (256, 144)),
        ((3000, 4), (256, 1)),
        ((4, 3000), (1, 256)),
        ((256, 200), (256, 200)),
        ((150, 200), (150, 200)),
    ],
)
def test_pictures_keep_their_shape_and_lose_their_size(
    shape: tuple[int, int], small: tuple[int, int]
) -> None:
    assert small_grey(np.zeros((*shape, 3), np.uint8)).shape == small


def test_pictures_are_grey_as_people_see_it_and_small_by_averaging() -> None:
    red = np.zeros((8, 8, 3), np.uint8)
    red[..., 0] = 255
    assert np.all(small_grey(red) == 76)
    striped = np.zeros((768, 768, 3), np.uint8)
    striped[:, ::3] = 255
    assert np.all(small_grey(striped) == 85)


@pytest.mark.parametrize(('top', 'left'), [(0, 0), (4, 3), (-5, 6), (7, -8), (-9, -2)])
def test_ground_in_both_patches_agrees_after_the_right_shift(top: int, left: int) -> None:
    ground = texture(160, 160)
    first = ground[16:144, 16:144]
    second = ground[16 + top : 144 + top, 16 + left : 144 + left]
    assert steps._agreement(first, second, top, left) == pytest.approx(1.0, abs=1e-5)
    assert steps._agreement(first, 255.0 - second, top, left) == pytest.approx(-1.0, abs=1e-5)
    assert steps._agreement(first, second, top + 6, left) < 0.5
    assert steps._agreement(first, second, top, left - 6) < 0.5
    down_px, right_px, ratio = steps._shift(first, second)
    assert (down_px, right_px) == pytest.approx((top, left), abs=0.1)
    assert ratio > 3.0
    faint = steps._shift(1e-3 * first, 1e-3 * second)
    assert faint == pytest.approx((down_px, right_px, ratio), rel=0.1, abs=0.02)


def test_even_ground_agrees_with_nothing() -> None:
    even = np.full((128, 128), 90.0, np.float32)
    assert steps._agreement(even, even, 0, 0) == 0.0
    assert steps._agreement(even, texture(128, 128), 0, 0) == 0.0
    faint = 1e-4 * (texture(128, 128) - 120.0)
    assert steps._agreement(faint, faint, 0, 0) == pytest.approx(1.0, abs=1e-3)


def test_a_shift_is_found_to_a_part_of_a_pixel() -> None:
    fine = texture(1280, 1280, 4)
    fine = cv2.GaussianBlur(fine, (0, 0), 12.0)
    large = np.asarray(120.0 + 30.0 * (fine - fine.mean()) / fine.std(), np.float32)

    def seen(row: int, column: int) -> np.ndarray:
        part = large[row : row + 1024, column : column + 1024]
        return cv2.resize(part, (128, 128), interpolation=cv2.INTER_AREA)

    down_px, right_px, _ = steps._shift(seen(100, 100), seen(100 + 20, 100 - 28))
    assert (down_px, right_px) == pytest.approx((2.5, -3.5), abs=0.15)


@pytest.mark.parametrize('seed', range(3))
def test_other_ground_has_no_peak_that_stands_out(seed: int) -> None:
    _, _, ratio = steps._shift(texture(128, 128, seed), texture(128, 128, seed + 50))
    assert 1.0 <= ratio < 1.6


@pytest.mark.parametrize(('apart_px', 'stands_out'), [(6, True), (7, False), (9, False)])
@pytest.mark.parametrize('axis', [0, 1])
@pytest.mark.parametrize('sign', [-1, 1])
def test_a_second_peak_counts_beyond_six_pixels(
    apart_px: int, stands_out: bool, axis: int, sign: int
) -> None:
    ground = texture(128, 128)
    twice = 0.52 * ground + 0.48 * np.roll(ground, sign * apart_px, axis)
    _, _, ratio = steps._shift(twice, ground)
    assert (ratio > 1.6) is stands_out


def test_a_displacement_is_the_way_of_the_middles_and_what_is_left_in_the_patches() -> None:
    ground = texture(160, 160)
    first, second = ground[16:144, 16:144], ground[20:148, 13:141]
    found = steps._compare(first, second, np.array([3.0, -2.0]), 64.0, 30.0)
    assert isinstance(found, Displacement)
    assert (found.north_m, found.east_m) == pytest.approx((3.0 - 2.0, -2.0 - 1.5), abs=0.05)


@pytest.mark.parametrize(('at', 'highest'), [(3, 3.2), (3, 2.6), (0, 0.3), (6, 5.9), (5, 5.0)])
def test_a_parabola_is_highest_at_its_vertex(at: int, highest: float) -> None:
    places = np.arange(7.0)
    around = (places - highest + 3.5) % 7.0 - 3.5
    assert steps._vertex(-(around**2), at) == pytest.approx(highest - at)


def test_without_a_peak_there_is_no_vertex() -> None:
    assert steps._vertex(np.full(5, 2.0), 2) == 0.0
    assert steps._vertex(np.array([4.0, 1.0, 0.0, 1.0, 3.0]), 2) == 0.0


@pytest.mark.parametrize(('along', 'ratio'), [(0.0, 0.0), (0.5, 0.25), (1.0, 1.0)])
@pytest.mark.parametrize('turned', [0.0, 45.0])
def test_texture_across_is_weighed_against_texture_along(
    along: float, ratio: float, turned: float
) -> None:
    rows, columns = np.mgrid[0:128, 0:128] * (2.0 * np.pi / 16.0)
    if turned:
        rows, columns = (rows + columns) / np.sqrt(2.0), (rows - columns) / np.sqrt(2.0)
    ground = (20.0 * np.sin(columns) + along * 20.0 * np.sin(rows)).astype(np.float32)
    assert steps._cross_texture(ground) == pytest.approx(ratio, abs=0.08)
    assert steps._cross_texture(1e-3 * ground) == pytest.approx(ratio, abs=0.08)


def test_even_ground_has_no_texture_across() -> None:
    assert steps._cross_texture(np.full((128, 128), 7.0, np.float32)) == 0.0


@pytest.mark.parametrize(
    'pose', [pose_of(30.0), pose_of(30.0, yaw=65.0), pose_of(40.0, roll=12.0, pitch=-9.0)]
)
@pytest.mark.parametrize('axis', [0, 1])
def test_a_patch_shows_the_ground_north_up(pose: Pose, axis: int) -> None:
    grey = np.mgrid[0:256, 0:256][axis].astype(np.uint8)
    middle = steps._middle(View(grey, pose), CAMERA)
    assert middle is not None
    u, v, w = ground_to_image(CAMERA, pose) @ [*middle, 1.0]
    assert (u / w, v / w) == pytest.approx((127.5, 127.5))
    aside = middle + np.array([1.5, -2.0])
    patch = steps._patch(View(grey, pose), CAMERA, aside, 12.8)
    assert patch is not None
    cells = np.array([(8, 100), (64, 64), (120, 20)])
    north = aside[0] + (63.5 - cells[:, 0]) * 0.1
    east = aside[1] + (cells[:, 1] - 63.5) * 0.1
    points = ground_to_image(CAMERA, pose) @ np.stack((north, east, np.ones(3)))
    expected = (points[1] if axis == 0 else points[0]) / points[2]
    found = [patch[row, column] for row, column in cells]
    assert found == pytest.approx(list(expected), abs=0.6)


def test_where_the_vehicle_is_does_not_count() -> None:
    view = view_of(texture(256, 256), pitch=8.0)
    away = replace(view, pose=replace(view.pose, north_m=500.0, east_m=-300.0))
    np.testing.assert_allclose(steps._middle(away, CAMERA), steps._middle(view, CAMERA))


def test_a_patch_is_smoothed_a_little() -> None:
    grey = np.zeros((256, 256), np.uint8)
    grey[127:129, 127:129] = 200  # ground of 2 x 2 pixels, 1.7 x 1.7 cells
    patch = steps._patch(View(grey, pose_of(30.0)), CAMERA, np.zeros(2), 28.0)
    assert patch is not None
    assert patch.dtype == np.float32
    across, along = patch[63], patch[:, 63]
    np.testing.assert_allclose(across, along, atol=0.5)
    spread = np.sqrt(np.sum(along * (np.arange(128) - 63.5) ** 2) / along.sum())
    assert spread == pytest.approx(1.25, abs=0.15)


def test_a_patch_must_be_in_view_as_a_whole() -> None:
    view = view_of(texture(256, 256))
    width_m = 256.0 / CAMERA.focal_px * 30.0
    middle = np.zeros(2)
    shown_m = 255.0 / 256.0 * width_m * 128.0 / 127.0  # between the outermost middles of cells
    assert steps._patch(view, CAMERA, middle, 0.999 * shown_m) is not None
    assert steps._patch(view, CAMERA, middle, 1.001 * shown_m) is None
    room_m = 0.5 * (0.999 - 0.5) * shown_m
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            aside = np.zeros(2)
            aside[axis] = sign * room_m * 0.98
            assert steps._patch(view, CAMERA, aside, 0.5 * shown_m) is not None
            aside[axis] = sign * (room_m + 0.02 * shown_m)
            assert steps._patch(view, CAMERA, aside, 0.5 * shown_m) is None


@pytest.mark.parametrize('towards', [0, 90, 180, 270])
def test_each_corner_of_a_patch_must_be_in_view(towards: int) -> None:
    """The camera heads north-east, so that corners of the patch point at edges of the picture."""
    view, edge_m = view_of(texture(256, 256), yaw=45.0), 8.0
    direction = np.radians(45.0 + towards)
    along = np.array([np.cos(direction), np.sin(direction)])
    room_m = 127.5 / CAMERA.focal_px * 30.0 - 63.5 / 128.0 * edge_m * np.sqrt(2.0)
    assert steps._patch(view, CAMERA, (room_m - 0.002 * edge_m) * along, edge_m) is not None
    assert steps._patch(view, CAMERA, (room_m + 0.002 * edge_m) * along, edge_m) is None


def test_above_the_horizon_there_is_no_ground() -> None:
    view = view_of(texture(256, 256), pitch=95.0)
    assert steps._middle(view, CAMERA) is None
    assert steps._patch(view, CAMERA, np.array([-20.0, 0.0]), 5.0) is None


@pytest.mark.parametrize('moved_px', [(0, 12), (15, 0), (-9, 14), (-20, -11)])
def test_a_level_camera_moved_by_what_the_picture_moved(moved_px: tuple[int, int]) -> None:
    """South and east, in pixels of 0.17 m; the same middles are compared."""
    down, right = moved_px
    ground = texture(320, 320)
    before = view_of(ground[32:288, 32:288])
    after = view_of(ground[32 + down : 288 + down, 32 + right : 288 + right])
    found = register(before, after, CAMERA)
    assert isinstance(found, Displacement)
    pixel_m = 30.0 / CAMERA.focal_px
    expected = (-down * pixel_m, right * pixel_m)
    assert (found.north_m, found.east_m) == pytest.approx(expected, abs=0.15 * pixel_m)
    cell_m = 0.9 * 256.0 * pixel_m / 128.0
    error_m = 0.3 * cell_m + 0.005 * 30.0 + 0.02 * hypot(found.north_m, found.east_m)
    assert found.error_m == pytest.approx(error_m)
    assert 0.9 < found.correlation <= 1.0


@pytest.mark.parametrize('axis', ['roll', 'pitch'])
@pytest.mark.parametrize(('lean', 'other_lean'), [(15.0, -5.0), (24.0, 4.0), (20.0, -10.0)])
def test_leaning_cameras_are_compared_around_what_both_see(
    lean: float, other_lean: float, axis: str
) -> None:
    """Two that lean apart see little of the same ground below them; both stand still."""
    ground = texture(1200, 1200, 8)
    middle, px_per_m = 600.0, 6.0

    def seen(**deg: float) -> View:
        pose = pose_of(30.0, **deg)
        to_ground = np.linalg.inv(ground_to_image(CAMERA, pose))
        picture_of_ground = np.array([[0, px_per_m, middle], [-px_per_m, 0, middle], [0, 0, 1.0]])
        matrix = picture_of_ground @ to_ground
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return View(
            cv2.warpPerspective(ground, matrix, (256, 256), flags=flags).astype(np.uint8), pose
        )

    found = register(seen(**{axis: lean}), seen(**{axis: other_lean}, yaw=4.0), CAMERA)
    assert isinstance(found, Displacement)
    assert hypot(found.north_m, found.east_m) < found.error_m < 0.5


def test_a_shift_beyond_a_third_of_the_patch_is_too_far() -> None:
    ground = texture(400, 400)
    before = view_of(ground[20:276, 20:276])
    for moved_px, far in ((72, False), (92, True)):
        east = view_of(ground[20:276, 20 + moved_px : 276 + moved_px])
        south = view_of(ground[20 + moved_px : 276 + moved_px, 20:276])
        for after in (east, south):
            assert (register(before, after, CAMERA) is Mismatch.FAR) == far


def test_ground_of_little_texture_or_texture_of_one_direction_is_refused() -> None:
    ground = texture(320, 320) - 120.0
    for scale, reason in ((0.06, Mismatch.TEXTURE), (0.5, None)):
        first, second = (view_of(120.0 + scale * ground[at : at + 256, :256]) for at in (0, 8))
        found = register(first, second, CAMERA)
        assert found is reason if reason else isinstance(found, Displacement)
    plain, rich = view_of(120.0 + 0.02 * ground[:256, :256]), view_of(ground[:256, :256] + 120.0)
    assert register(plain, rich, CAMERA) is Mismatch.TEXTURE
    assert register(rich, plain, CAMERA) is Mismatch.TEXTURE
    columns = np.tile(texture(1, 320, 9) * 2.0 - 100.0, (256, 1))
    stripes = view_of(columns[:, :256])
    assert register(stripes, view_of(columns[:, 8:264]), CAMERA) is Mismatch.AMBIGUOUS
    assert register(rich, stripes, CAMERA) is Mismatch.AMBIGUOUS


@pytest.mark.parametrize(('altitude_m', 'refused'), [(47.9, False), (48.1, True), (18.7, True)])
def test_altitudes_may_differ_by_six_tenths(altitude_m: float, refused: bool) -> None:
    ground = texture(256, 256)
    before, after = view_of(ground), view_of(ground[::-1], altitude_m)
    assert (register(before, after, CAMERA) is Mismatch.ALTITUDE) == refused
    assert (register(after, before, CAMERA) is Mismatch.ALTITUDE) == refused


@pytest.mark.parametrize('altitude_m', [float('nan'), float('inf'), 0.0, -30.0])
def test_both_altitudes_must_be_known(altitude_m: float) -> None:
    ground = texture(256, 256)
    before, after = view_of(ground), view_of(ground[::-1])
    wrong = replace(after, pose=replace(after.pose, altitude_agl_m=altitude_m))
    assert register(before, wrong, CAMERA) is Mismatch.ALTITUDE
    assert register(wrong, before, CAMERA) is Mismatch.ALTITUDE
    assert register(replace(before, pose=wrong.pose), wrong, CAMERA) is Mismatch.ALTITUDE


def test_a_picture_from_less_than_a_metre_is_compared_too() -> None:
    ground = texture(320, 320)
    before, after = (view_of(ground[32:288, at : at + 256], 0.9) for at in (32, 44))
    found = register(before, after, CAMERA)
    assert isinstance(found, Displacement)
    assert found.east_m == pytest.approx(12.0 * 0.9 / CAMERA.focal_px, rel=0.05)


@pytest.mark.parametrize('lean', [45.5, 95.0])
def test_either_camera_at_the_horizon_is_refused(lean: float) -> None:
    ground = texture(256, 256)
    level, leaning = view_of(ground), view_of(ground[::-1], roll=lean)
    assert register(level, leaning, CAMERA) is Mismatch.HORIZON
    assert register(leaning, level, CAMERA) is Mismatch.HORIZON


def test_the_same_picture_twice_is_no_standstill_but_another_size_is_another_picture() -> None:
    ground = texture(256, 256)
    view = view_of(ground)
    assert register(view, view_of(ground), CAMERA) is Mismatch.SAME
    half = View(cv2.resize(view.grey, (128, 128), interpolation=cv2.INTER_AREA), view.pose)
    found = register(view, half, CAMERA)
    assert isinstance(found, Displacement)
    assert hypot(found.north_m, found.east_m) < 0.1
