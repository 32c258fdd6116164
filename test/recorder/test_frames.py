# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which frames are recorded."""

from __future__ import annotations

from peace_ros.recorder.frames import FrameChoice


def engaged(rate_hz: float = 5.0) -> FrameChoice:
    choice = FrameChoice(rate_hz)
    choice.is_engaged = True
    choice.image(1, b'first', 0.0)
    return choice


def test_a_frame_is_recorded_with_its_heatmap() -> None:
    choice = engaged()
    assert not choice.image(2, b'a', 0.3)
    assert not choice.image(3, b'b', 0.35)
    assert choice.heatmap(2, 0.5) == (True, b'a')
    assert choice.heatmap(2, 0.5) == (True, None), 'once'


def test_a_frame_may_come_after_its_heatmap() -> None:
    choice = engaged()
    assert choice.heatmap(2, 0.5) == (True, None)
    assert choice.image(2, b'a', 0.51)
    assert not choice.image(3, b'b', 0.52)


def test_no_more_than_the_rate_is_recorded_and_a_camera_that_is_a_little_fast_is_followed() -> None:
    def recorded(period_s: float) -> int:
        choice, count = engaged(), 0
        for number in range(2, 200):
            now_s = number * period_s
            choice.image(number, b'x', now_s)
            count += choice.heatmap(number, now_s)[0]
        return count

    assert recorded(1 / 30) <= 6.6 * 5.6
    assert recorded(0.19) == 198


def test_frames_are_recorded_although_no_heatmap_comes() -> None:
    choice = engaged()
    chosen = [number for number in range(2, 100) if choice.image(number, b'x', 0.1 * number)]
    assert 8 <= len(chosen) <= 10
    assert choice.heatmap(chosen[-1], 10.0) == (True, None), 'a late heatmap belongs to it'


def test_few_frames_are_recorded_while_nothing_is_engaged() -> None:
    choice, count = FrameChoice(5.0), 0
    for number in range(1, 300):
        now_s = 0.1 * number
        count += choice.image(number, b'x', now_s)
        wanted, frame = choice.heatmap(number, now_s)
        count += wanted and frame is not None
    assert 5 <= count <= 7


def test_frames_that_wait_are_bounded() -> None:
    choice = engaged()
    for number in range(2, 12):
        assert not choice.image(number, bytes(10_000_000), 0.5)
    assert choice.heatmap(2, 0.6) == (True, None), 'dropped, 64 MB were exceeded'
    assert choice.heatmap(11, 0.9)[1] is not None


def test_a_camera_that_repeats_its_stamp_is_recorded_and_bounded() -> None:
    choice = engaged()
    for _ in range(10):
        assert not choice.image(2, bytes(10_000_000), 0.5)
    assert choice.heatmap(2, 0.6) == (True, bytes(10_000_000))
