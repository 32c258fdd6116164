# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Grounds of one colour can be told apart by what they are made of."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.grain import Grain, draw_grain, structure
from peace_ros.simulation.drawing.noise import Noise
from peace_ros.simulation.drawing.palette import Palette
from peace_ros.simulation.drawing.window import DrawnWindow


def _window(gsd_m: float, size_m: float = 16.0, left_m: float = -8.0) -> DrawnWindow:
    count = round(size_m / gsd_m)
    return DrawnWindow(left_m, -8.0, count, count, gsd_m)


def _drawn(grain: Grain, gsd_m: float = 0.05, left_m: float = -8.0) -> np.ndarray:
    window = _window(gsd_m, left_m=left_m)
    ids = np.zeros(window.shape, np.int16)
    return structure(window, Noise(window, 5), [grain], ids)


@pytest.mark.parametrize(
    'grain',
    [
        Grain(tufts=0.1),
        Grain(stones=0.1),
        Grain(cracks=0.2),
        Grain(slab_m=(0.8, 0.5), slab=0.05, joint=0.3, joint_m=0.04, angle_rad=0.4),
        Grain(ripple_m=1.0, ripple=0.05),
    ],
)
def test_each_structure_shows_near_and_fades_afar(grain: Grain) -> None:
    near, far = _drawn(grain), _drawn(grain, 3.2)
    assert near.std() > 0.01
    assert far.std() < 0.4 * near.std()


def test_ground_without_structure_is_left_alone() -> None:
    assert not _drawn(Grain()).any()


def test_joints_run_straight_and_are_dark() -> None:
    slabs = Grain(slab_m=(2.0, 2.0), joint=0.5, joint_m=0.1)
    drawn = _drawn(slabs)
    rows = drawn.mean(axis=1)
    assert rows.min() < 5.0 * rows.mean() < 0.0
    # A joint every two metres, 40 pixels of 5 cm.
    dark = np.flatnonzero(rows < 0.5 * rows.min())
    apart = np.diff(dark[np.diff(dark, prepend=-9) > 1])
    assert len(apart) >= 7
    assert set(apart.tolist()) <= {39, 40, 41}


def test_a_window_beside_shows_the_same_ground() -> None:
    grain = Grain(tufts=0.1, stones=0.1, slab_m=(2.0, 1.0), slab=0.1, joint=0.3, joint_m=0.05)
    here, aside = _drawn(grain), _drawn(grain, left_m=-4.0)
    shared = np.abs(here[:, 80:] - aside[:, :-80])
    assert shared.mean() < 0.2 * here.std()


def test_paved_and_bare_ground_of_one_colour_differ() -> None:
    palette = Palette(np.random.default_rng(1), 'summer')
    paving, soil = palette.material('paving').grain, palette.material('soil').grain
    assert paving.joint > 0.0 == paving.stones
    assert soil.stones > 0.0 == soil.joint

    def edges(grain: Grain) -> float:
        """Return how much of the structure lies in straight lines."""
        image = np.clip(128 + 400 * _drawn(grain), 0, 255).astype(np.uint8)
        lines = cv2.HoughLinesP(cv2.Canny(image, 60, 160), 1, np.pi / 180, 60, None, 60, 4)
        return 0.0 if lines is None else float(len(lines))

    slabs = Grain(slab_m=(2.0, 1.5), slab=0.05, joint=0.4, joint_m=0.06, angle_rad=0.5)
    assert edges(slabs) > 5.0 * edges(soil) + 5.0


def test_what_stands_on_the_ground_does_not_depend_on_what_it_is_made_of() -> None:
    with_grain, again = (Palette(np.random.default_rng(4), 'summer') for _ in range(2))
    first = with_grain.material('paving').grain, with_grain.crown()
    second = again.material('soil').grain, again.crown()
    assert first[1] == second[1]
    assert first[0] != second[0]


def test_every_paved_kind_has_a_structure() -> None:
    rng = np.random.default_rng(0)
    for kind in ('asphalt', 'new_asphalt', 'old_asphalt', 'concrete', 'paving', 'court'):
        assert draw_grain(rng, kind, Label.PAVED).slab_m > (0.0, 0.0)
