# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures that do not change while the vehicle moves, and heatmaps without any contrast."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Heatmap, Pose
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.landing.picture_watch import EVEN, STUCK, PictureWatch

PICTURE = np.random.default_rng(0).uniform(0.2, 0.9, (40, 40)).astype(np.float32)


def at(altitude_m: float, north_m: float = 0.0, yaw_rad: float = 0.0) -> Pose:
    turn = quaternion_from_euler(0.0, 0.0, yaw_rad)
    return Pose(1, north_m, 0.0, -altitude_m, turn, altitude_m)


@pytest.mark.parametrize(
    'later', [at(39.3), at(40.7), at(40.0, north_m=0.6), at(40.0, yaw_rad=0.1)]
)
def test_the_same_picture_from_elsewhere_is_stuck(later: Pose) -> None:
    watch = PictureWatch()
    assert watch.problem(Heatmap(PICTURE, 1), at(40.0)) == ''
    assert watch.problem(Heatmap(PICTURE.copy(), 2), at(40.1)) == ''
    assert watch.problem(Heatmap(PICTURE.copy(), 3), later) == STUCK


def test_slow_motion_adds_up() -> None:
    watch = PictureWatch()
    told = [watch.problem(Heatmap(PICTURE, n), at(40.0 - 0.1 * n)) for n in range(20)]
    assert told[:5] == [''] * 5
    assert told[-1] == STUCK


def test_a_picture_that_changes_is_believed_again() -> None:
    watch = PictureWatch()
    watch.problem(Heatmap(PICTURE, 1), at(40.0))
    assert watch.problem(Heatmap(PICTURE, 2), at(38.0)) == STUCK
    other = PICTURE.copy()
    other[3, 3] += 1.0 / 255.0
    assert watch.problem(Heatmap(other, 3), at(37.9)) == ''


def test_a_hovering_vehicle_may_see_the_same_for_ever() -> None:
    watch = PictureWatch()
    assert all(watch.problem(Heatmap(PICTURE, n), at(40.0)) == '' for n in range(100))


def test_nothing_that_calls_the_ground_unsafe_is_refused() -> None:
    watch = PictureWatch()
    dark = np.zeros((40, 40), np.float32)
    assert [watch.problem(Heatmap(dark, n), at(40.0 - n)) for n in range(5)] == [''] * 5


def test_surely_safe_everywhere_is_no_picture() -> None:
    even = np.ones((40, 40), np.float32)
    assert PictureWatch().problem(Heatmap(even, 1), at(40.0)) == EVEN
    assert PictureWatch().problem(Heatmap(even * np.float32(0.9), 1), at(40.0)) == ''
