# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person sees at a glance what is safe, and still sees the ground."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Frame, Heatmap
from peace_ros.core.segmentation import draw_overlay

GREY = Frame(np.full((120, 160, 3), 128, np.uint8), 3)


def halves() -> Heatmap:
    safety = np.zeros((12, 16), np.float32)
    safety[:, 8:] = 1.0
    return Heatmap(safety, 3)


def test_safe_is_green_and_unsafe_is_red_at_frame_size() -> None:
    picture = draw_overlay(GREY, halves())
    assert picture.shape == GREY.image_rgb.shape
    assert picture.dtype == np.uint8
    red, green, _ = picture[60, 20].astype(int)
    assert red > green + 40
    red, green, _ = picture[60, 140].astype(int)
    assert green > red + 40


def test_a_bright_line_with_a_dark_rim_runs_along_the_threshold() -> None:
    across = draw_overlay(GREY, halves())[60, 60:100].astype(int)
    assert (across.min(axis=1) > 200).any()
    assert (across.max(axis=1) < 60).any()


def test_the_threshold_moves_the_border() -> None:
    ramp = Heatmap(np.tile(np.linspace(0, 1, 64, dtype=np.float32), (8, 1)), 0)

    def green_share(threshold: float) -> float:
        picture = draw_overlay(GREY, ramp, threshold).astype(int)
        return float((picture[..., 1] > picture[..., 0] + 10).mean())

    assert green_share(0.2) > green_share(0.5) > green_share(0.9) > 0.0


@pytest.mark.parametrize('score', [0.0, 1.0])
@pytest.mark.parametrize('threshold', [0.0, 0.5, 1.0])
def test_uniform_maps_and_extreme_thresholds_draw(score: float, threshold: float) -> None:
    heatmap = Heatmap(np.full((4, 4), score, np.float32), 0)
    assert draw_overlay(GREY, heatmap, threshold).shape == (120, 160, 3)


def test_no_line_runs_along_the_edge_of_the_picture() -> None:
    picture = draw_overlay(GREY, Heatmap(np.ones((4, 4), np.float32), 0)).astype(int)
    assert np.ptp(picture.reshape(-1, 3), axis=0).max() <= 1


def test_the_frame_stays_as_it_was() -> None:
    before = GREY.image_rgb.copy()
    draw_overlay(GREY, halves())
    np.testing.assert_array_equal(GREY.image_rgb, before)


def test_the_ground_still_shows_through() -> None:
    rng = np.random.default_rng(0)
    frame = Frame(rng.integers(0, 256, (120, 160, 3), np.uint8), 0)
    picture = draw_overlay(frame, halves())
    for channel in range(3):
        left = np.s_[20:100, 10:60, channel]
        similarity = np.corrcoef(frame.image_rgb[left].ravel(), picture[left].ravel())[0, 1]
        assert similarity > 0.95
