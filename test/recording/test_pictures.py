# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pictures show what they were given: compared by pixels, not by eye."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.recording import (
    FilmMoment,
    SiteMark,
    TrackPoint,
    TrajectoryScene,
    draw_filmstrip,
    draw_trajectory,
    save_picture,
)
from peace_ros.recording.contact_sheet import Cell, draw_contact_sheet
from peace_ros.recording.pictures import nice_length_m

GREY = 90


def scene(**changes) -> TrajectoryScene:
    track = tuple(TrackPoint(k, 0.4 * k, 0.0, 100.0 - 0.8 * k) for k in range(101))
    plain = TrajectoryScene(
        world_rgb=np.full((2000, 2000, 3), GREY, np.uint8),
        gsd_m=0.1,
        track=track,
        title='title',
    )
    return replace(plain, **changes)


def changed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(a.astype(int) - b).max(axis=-1) > 30


def test_the_trajectory_is_drawn_where_the_vehicle_was() -> None:
    picture = draw_trajectory(scene())
    assert picture.shape == (1000, 1400, 3)
    inked = np.abs(picture[:, :1000].astype(int) - GREY).max(axis=-1) > 40
    # 40 m of track in a view of 130 m: a horizontal band through the middle of the map.
    middle = inked[470:530]
    columns = np.flatnonzero(middle.any(axis=0))
    assert columns.min() == pytest.approx(500 - 154, abs=15)
    assert columns.max() == pytest.approx(500 + 154, abs=15)
    assert not inked[560:900].any()


def test_high_and_low_have_different_colours() -> None:
    picture = draw_trajectory(scene())
    begin, end = picture[500, 500 - 130], picture[500, 500 + 130]
    assert begin[0] > begin[2]
    assert end[2] > end[0]


def test_north_is_up_and_east_is_right() -> None:
    world = np.full((2000, 2000, 3), GREY, np.uint8)
    world[:1000, 1000:] = (250, 240, 0)
    picture = draw_trajectory(scene(world_rgb=world, track=(TrackPoint(0.0, 0.0, 0.0, 50.0),)))
    assert picture[300, 700].tolist() == [250, 240, 0]
    assert picture[700, 300].tolist() == [GREY] * 3


def test_sites_and_the_hand_over_point_are_marked() -> None:
    plain = draw_trajectory(scene())
    marked = draw_trajectory(scene(sites=(SiteMark(20.0, 25.0, 8.0),)))
    where = np.argwhere(changed(plain, marked)[:, :1000])
    assert len(where) > 100
    handed = draw_trajectory(
        scene(hand_over=(40.0, 0.0), safe=False, hand_over_clearance_m=5.0, engaged_at_s=10.0)
    )
    there = changed(plain, handed)[:, :1000]
    assert there[460:540, 610:700].any()
    reds = (handed[..., 0] > 200) & (handed[..., 1] < 110) & (handed[..., 2] < 110)
    assert reds[:, :1000].sum() > 50


def test_a_world_smaller_than_the_view_is_mirrored_and_framed() -> None:
    small = np.full((100, 100, 3), GREY, np.uint8)
    small[:, 50:] = (200, 30, 30)
    picture = draw_trajectory(
        scene(world_rgb=small, gsd_m=0.5, track=(TrackPoint(0.0, 0.0, 0.0, 50.0),))
    )
    assert picture[700, 960].tolist() == [GREY] * 3
    assert (picture[500, 500 + 208 - 3 : 500 + 208 + 4] == 255).all(axis=-1).any()


def test_without_a_pose_there_is_no_trajectory() -> None:
    with pytest.raises(RecordingError, match='no pose'):
        draw_trajectory(scene(track=()))


def moment(state: str, **changes) -> FilmMoment:
    frame = np.full((352, 352, 3), 120, np.uint8)
    heatmap = np.zeros((176, 176), np.uint8)
    heatmap[:, 88:] = 255
    plain = FilmMoment(state, 3.0, 80.0, 'A photo of {term}.', frame, heatmap)
    return replace(plain, **changes)


def test_the_filmstrip_shows_frame_heatmap_and_focus() -> None:
    strip = draw_filmstrip([moment('AIMING', focus_centre=(0.5, 0.5), focus_radius=0.25)])
    x, y = 96, 50 + 128
    camera = strip[y : y + 280, x : x + 280]
    assert (camera == 120).all()
    heat = strip[y + 292 : y + 572, x : x + 280]
    assert heat[140, 40, 0] > heat[140, 40, 1]
    assert heat[140, 240, 1] > heat[140, 240, 0]
    focus = strip[y + 584 : y + 864, x : x + 280]
    assert focus[140, 140].tolist() == [120] * 3
    assert focus[20, 20].tolist() == [30] * 3


def test_each_moment_has_its_column_and_seven_break_the_row() -> None:
    one = draw_filmstrip([moment('SEARCHING')])
    six = draw_filmstrip([moment('SEARCHING')] * 6)
    seven = draw_filmstrip([moment('SEARCHING')] * 7)
    assert six.shape[1] > one.shape[1]
    assert seven.shape[1] < six.shape[1]
    assert seven.shape[0] > six.shape[0]
    nothing = draw_filmstrip([moment('HOLD', frame_rgb=None, heatmap=None, altitude_agl_m=None)])
    assert nothing.shape == one.shape
    with pytest.raises(RecordingError):
        draw_filmstrip([])


def test_a_contact_sheet_holds_its_pictures() -> None:
    cells = [Cell(np.full((50, 50, 3), 40 * k, np.uint8), f'{k}', 'detail') for k in range(1, 7)]
    sheet = draw_contact_sheet(cells, 'six')
    for k, cell in enumerate(cells):
        row, column = divmod(k, 5)
        y, x = 50 + 62 + row * 372 + 150, 10 + column * 310 + 150
        assert sheet[y, x].tolist() == cell.image_rgb[0, 0].tolist()
    with pytest.raises(RecordingError):
        draw_contact_sheet([], 'none')


def test_pictures_are_saved_whole_or_not_at_all(tmp_path) -> None:
    picture = np.random.default_rng(1).integers(0, 255, (20, 30, 3), np.uint8)
    save_picture(picture, tmp_path / 'a.png')
    assert [each.name for each in tmp_path.iterdir()] == ['a.png']
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / 'a.png'))[:, :, ::-1], picture)
    (tmp_path / 'no').write_text('a file where the folder should be')
    with pytest.raises(RecordingError, match='cannot be written'):
        save_picture(picture, tmp_path / 'no' / 'a.png')


def test_scale_bars_have_round_lengths() -> None:
    assert [nice_length_m(m) for m in (0.7, 1.0, 4.9, 32.0, 99.0)] == [0.5, 1, 2, 20, 50]
