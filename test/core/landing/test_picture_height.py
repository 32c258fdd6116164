# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The height by pictures: ratios multiplied, keys, gaps; the comparison of two is given."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.landing import picture_height
from peace_ros.core.landing.picture_height import PictureHeight
from peace_ros.core.mapping import HeightChange, Mismatch, View

S = 1_000_000_000
CAMERA = Camera.from_degrees(256, 256, 73.0)


class Pictures:
    """Shows a camera at a true height to the measurement, with another altitude reported."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.height = PictureHeight(CAMERA)
        self.compared: list[tuple[float, float]] = []
        self.moved = 0.0
        self.blind: set[float] = set()
        """True heights of key pictures that nothing can be compared with."""
        self._truths_m: list[float] = []
        self._at_s = 10.0
        monkeypatch.setattr(picture_height, 'height_change', self._change)

    def _change(self, before: View, after: View, camera: Camera) -> HeightChange | Mismatch:
        assert camera is CAMERA
        pair = tuple(self._truths_m[int(each.grey[0, 0])] for each in (before, after))
        self.compared.append(pair)
        if self.blind & set(pair):
            return Mismatch.DIFFERENT
        return HeightChange(pair[1] / pair[0], self.moved)

    def take(self, true_m: float, reported_m: float, later_s: float = 0.4) -> float | None:
        """Return the height by pictures, None while there is none."""
        self._at_s += later_s
        self._truths_m.append(true_m)
        pose = Pose(round(self._at_s * S), 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), reported_m)
        number = len(self._truths_m) - 1
        self.height.take(View(np.full((8, 8), number, np.uint8), pose))
        if self.height.stamp_ns is None:
            return None
        return reported_m + self.height.above_reported_m


@pytest.fixture
def pictures(monkeypatch: pytest.MonkeyPatch) -> Pictures:
    return Pictures(monkeypatch)


def test_the_first_picture_gives_no_height(pictures: Pictures) -> None:
    assert pictures.take(60.0, 60.0) is None
    assert pictures.take(54.0, 54.0) == pytest.approx(54.0)


def test_the_height_goes_on_from_the_first_altitude(pictures: Pictures) -> None:
    for true_m in (60.0, 50.0, 40.0, 31.0, 25.0):
        told_m = pictures.take(true_m, true_m)
    assert told_m == pytest.approx(25.0)
    assert pictures.take(20.0, 28.0) == pytest.approx(20.0), 'a barometer that is 8 m too high'


def test_an_error_that_was_there_before_shows_on_the_way_down(pictures: Pictures) -> None:
    for true_m in (52.0, 40.0, 30.0, 22.0, 16.0, 12.0):
        told_m = pictures.take(true_m, true_m + 8.0)
    assert told_m == pytest.approx(60.0 * 12.0 / 52.0)


def test_a_key_stays_while_the_picture_hardly_changes(pictures: Pictures) -> None:
    for true_m in (60.0, 59.0, 58.0, 57.0):
        pictures.take(true_m, true_m)
    assert {before for before, _ in pictures.compared} == {60.0}
    pictures.take(50.0, 50.0)
    pictures.take(49.0, 49.0)
    assert pictures.compared[-1] == (50.0, 49.0)


def test_a_way_over_ground_makes_a_new_key(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    pictures.moved = 0.3
    pictures.take(59.0, 59.0)
    pictures.take(58.0, 58.0)
    assert pictures.compared[-1] == (59.0, 58.0)


def test_a_key_out_of_view_is_replaced_by_the_last_picture(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    pictures.take(58.0, 58.0)
    pictures.blind = {60.0}
    assert pictures.take(56.0, 56.0) == pytest.approx(56.0)
    assert pictures.compared[-2:] == [(60.0, 56.0), (58.0, 56.0)]


def test_over_a_gap_the_difference_stays(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    assert pictures.take(56.0, 60.0) == pytest.approx(56.0)
    pictures.blind = {50.0, 49.0, 48.0}
    stamp_ns = pictures.height.stamp_ns
    for true_m in (50.0, 49.0, 48.0):
        pictures.take(true_m, true_m + 4.0)
    assert pictures.height.stamp_ns == stamp_ns, 'nothing was measured'
    pictures.take(45.0, 49.0, later_s=0.4)
    pictures.blind = set()
    assert pictures.take(44.0, 48.0) == pytest.approx(44.0)


def test_pictures_in_quick_succession_are_skipped(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    pictures.take(59.0, 59.0, later_s=0.2)
    assert pictures.compared == []
    pictures.take(58.0, 58.0, later_s=0.2)
    assert pictures.compared == [(60.0, 58.0)]


def test_a_new_engagement_begins_with_its_own_altitude(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    pictures.take(50.0, 60.0)
    pictures.height.begin()
    assert pictures.height.stamp_ns is None
    assert pictures.take(50.0, 60.0) is None
    assert pictures.take(25.0, 35.0) == pytest.approx(30.0)


def test_an_altitude_below_the_ground_is_skipped(pictures: Pictures) -> None:
    assert pictures.take(60.0, -1.0) is None
    assert pictures.take(59.0, 59.0) is None
    assert pictures.take(58.0, 58.0) == pytest.approx(58.0)


def test_half_a_metre_above_the_ground_is_measured(pictures: Pictures) -> None:
    pictures.take(0.6, 0.6)
    assert pictures.take(0.5, 0.5) == pytest.approx(0.5)


def test_pictures_are_measured_from_the_first_moment_of_a_clock(pictures: Pictures) -> None:
    pictures._at_s = 0.0
    pictures.take(60.0, 60.0, later_s=0.1)
    assert pictures.take(58.0, 58.0, later_s=0.3) == pytest.approx(58.0), 'the period is 0.3 s'


def test_one_picture_that_shows_nothing_makes_no_new_key(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    pictures.take(59.0, 59.0)
    pictures.blind = {58.0}
    pictures.take(58.0, 58.0)
    pictures.take(57.0, 57.0)
    assert pictures.compared[-1] == (60.0, 57.0)


def test_a_second_without_a_measurement_is_no_gap_yet(pictures: Pictures) -> None:
    pictures.take(60.0, 60.0)
    pictures.take(59.0, 59.0)
    pictures.blind = {58.0}
    pictures.take(58.0, 58.0, later_s=1.0)
    pictures.take(57.0, 57.0)
    assert pictures.compared[-1] == (60.0, 57.0)


@pytest.mark.parametrize(('true_m', 'moved', 'key_m'), [(69.0, 0.0, 60.0), (60.0, 0.25, 60.0)])
def test_at_its_limits_a_key_stays(
    pictures: Pictures, true_m: float, moved: float, key_m: float
) -> None:
    pictures.take(60.0, 60.0)
    pictures.moved = moved
    pictures.take(true_m, true_m)
    pictures.take(61.0, 61.0)
    assert pictures.compared[-1] == (key_m, 61.0)


def test_another_camera_is_used_from_the_next_picture_on(monkeypatch: pytest.MonkeyPatch) -> None:
    used = []

    def change(before: View, after: View, camera: Camera) -> Mismatch:
        used.append(camera)
        return Mismatch.DIFFERENT

    monkeypatch.setattr(picture_height, 'height_change', change)
    height = PictureHeight(CAMERA)
    other = Camera.from_degrees(640, 480, 60.0)
    height.change_camera(other)
    for at_s in (1, 2):
        pose = Pose(at_s * S, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 30.0)
        height.take(View(np.zeros((8, 8), np.uint8), pose))
    assert {id(each) for each in used} == {id(other)}
