# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the relay does to images on their way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import Camera, ImageError, Pose
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.messages import frame_from_message, stamp_ns_of
from peace_ros.lab.faults import tamper
from peace_ros.lab.faults.walker import Walker
from peace_ros.nodes.messages import image_message

SECOND = 1_000_000_000
START_NS = 100 * SECOND


def picture(number: int = 0) -> Any:
    pixels = np.random.default_rng(number).integers(0, 256, (40, 48, 3), dtype=np.uint8)
    return image_message(pixels, 'rgb8', START_NS + number * SECOND)


def passed(what: tamper.Tamper, count: int = 3) -> list[Any]:
    return [message for n in range(count) for _, message in what(picture(n))]


def test_nothing_comes_through_and_untouched_is_untouched() -> None:
    assert passed(tamper.nothing) == []
    assert passed(tamper.untouched) == [picture(n) for n in range(3)]


def test_a_late_message_says_how_late() -> None:
    ((delay_s, message),) = tamper.late(3.0)(picture())
    assert (delay_s, message) == (3.0, picture())


def test_rare_lets_one_through_per_period() -> None:
    now_s = [0.0]
    what = tamper.rare(2.0, lambda: now_s[0])
    seen = []
    for step in range(10):
        now_s[0] = 0.5 * step
        seen.append(len(list(what(picture()))))
    assert seen == [1, 0, 0, 0, 1, 0, 0, 0, 1, 0]


@pytest.mark.parametrize('new_stamps', [True, False])
def test_a_frozen_camera_repeats_its_first_picture(new_stamps: bool) -> None:
    seen = passed(tamper.frozen(new_stamps=new_stamps))
    assert all(message.data == picture(0).data for message in seen)
    stamps = [(stamp_ns_of(message) - START_NS) // SECOND for message in seen]
    assert stamps == ([0, 1, 2] if new_stamps else [0, 0, 0])


def test_fills_and_flickers() -> None:
    (black,) = passed(tamper.filled(0), 1)
    assert not frame_from_message(black).image_rgb.any()
    levels = [int(frame_from_message(m).image_rgb.max()) for m in passed(tamper.flickering(), 4)]
    assert levels == [255, 0, 255, 0]


def test_noise_is_new_each_time() -> None:
    first, second = passed(tamper.noisy(), 2)
    assert first.data != second.data
    assert len(first.data) == len(picture().data)


@pytest.mark.parametrize('what', [tamper.cut_short, tamper.of_encoding('rgb99')])
def test_what_is_corrupt_is_refused_by_the_nodes(what: tamper.Tamper) -> None:
    (message,) = passed(what, 1)
    with pytest.raises(ImageError):
        frame_from_message(message)


def test_another_size_is_a_window_of_that_shape() -> None:
    (small,) = passed(tamper.resized(24, 20), 1)
    assert frame_from_message(small).image_rgb.shape == (20, 24, 3)
    (flat,) = passed(tamper.resized(48, 20), 1)
    assert np.array_equal(
        frame_from_message(flat).image_rgb, frame_from_message(picture()).image_rgb[10:30]
    )
    assert stamp_ns_of(flat) == START_NS


def test_stamps_shift_stand_and_run_back() -> None:
    def seconds(what: tamper.Tamper) -> list[int]:
        return [(stamp_ns_of(message) - START_NS) // SECOND for message in passed(what)]

    assert seconds(tamper.shifted(10.0)) == [10, 11, 12]
    assert seconds(tamper.shifted(-5.0)) == [-5, -4, -3]
    assert seconds(tamper.equal_stamps()) == [0, 0, 0]
    assert seconds(tamper.running_back()) == [0, -1, -2]
    assert [stamp_ns_of(message) for message in passed(tamper.shifted(-4e9))] == [0, 0, 0]


CAMERA = Camera.from_degrees(176, 176, 73.0)


def above(north_m: float, east_m: float, altitude_m: float, stamp: int = START_NS) -> Pose:
    level = quaternion_from_euler(0.0, 0.0, 0.4)
    return Pose(stamp, north_m, east_m, -altitude_m, level, altitude_m)


def test_a_walker_arrives_and_stays() -> None:
    walker = Walker(START_NS, (8.0, 0.0), (0.0, 0.0), 2.0)
    assert walker.place(START_NS - SECOND) == (8.0, 0.0)
    assert walker.place(START_NS + 2 * SECOND) == pytest.approx((4.0, 0.0))
    assert walker.place(START_NS + 60 * SECOND) == (0.0, 0.0)
    pose = above(0.0, 3.0, 20.0)
    assert walker.distance_m(pose, START_NS + 60 * SECOND) == pytest.approx(3.0)


def test_a_walker_is_painted_where_the_camera_sees_the_place() -> None:
    walker = Walker(START_NS, (12.0, -5.0), (12.0, -5.0))
    pose = above(12.0, -5.0, 15.0)
    grass = np.full((176, 176, 3), 120, np.uint8)
    painted = walker.paint(grass, CAMERA, pose, START_NS)
    changed = np.argwhere((painted != grass).any(axis=2))
    assert 4 < len(changed) < 200
    assert np.abs(changed.mean(axis=0) - 87.5).max() < 5.0
    assert grass.min() == 120
    beside = walker.paint(grass, CAMERA, above(100.0, 0.0, 15.0), START_NS)
    assert np.array_equal(beside, grass)


def test_both_walkers_go_through_messages() -> None:
    walker = Walker(START_NS, (0.0, 0.0), (0.0, 0.0))
    pose = above(0.0, 0.0, 15.0)
    grass = image_message(np.full((176, 176, 3), 120, np.uint8), 'rgb8', START_NS)
    ((_, painted),) = tamper.with_walker(walker, CAMERA, lambda _: pose)(grass)
    assert stamp_ns_of(painted) == START_NS
    assert painted.data != grass.data
    safe = image_message(np.full((88, 88), 230, np.uint8), 'mono8', START_NS)
    ((_, seen),) = tamper.with_walker_seen(walker, CAMERA, lambda _: pose)(safe)
    levels = tamper.pixels_of(seen)[:, :, 0]
    assert levels[44, 44] == 0
    assert levels[0, 0] == 230
    ((_, same),) = tamper.with_walker_seen(walker, CAMERA, lambda _: None)(safe)
    assert same is safe


def test_a_walker_who_is_seen_makes_the_heatmap_unsafe_there_alone() -> None:
    walker = Walker(START_NS, (0.0, 0.0), (0.0, 0.0))
    levels = np.full((176, 176), 230, np.uint8)
    walker.darken(levels, CAMERA, above(0.0, 0.0, 30.0), START_NS)
    assert levels[87, 87] == 0
    # 0.8 m around the person are 3.2 pixels at 30 m: a disc of about 32.
    assert 20 < int((levels == 0).sum()) < 80
