# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity is the slope of the last positions, with its error, or nothing."""

import numpy as np
import pytest

from peace_ros.core.odometry.velocity import PositionTrack

NS = 1_000_000_000
VARIANCE = np.array([0.01, 0.04, 0.09])


def track_of(times_s, velocity=(1.0, -2.0, 0.5), noise=0.0):
    track, random = PositionTrack(0.4), np.random.default_rng(1)
    for time_s in times_s:
        position = time_s * np.array(velocity) + random.normal(0.0, 1.0, 3) * noise
        track.add(round((7.0 + time_s) * NS), position, VARIANCE)
    return track


def test_a_constant_velocity_is_found_at_the_middle_of_the_window():
    found = track_of(np.arange(0.0, 2.05, 0.1)).velocity()
    assert found.mean_m_s == pytest.approx((1.0, -2.0, 0.5))
    assert found.stamp_ns == pytest.approx(8.8 * NS, abs=1e6)


def test_frames_that_are_late_still_give_the_slope():
    found = track_of((0.0, 0.13, 0.19, 0.34, 0.4)).velocity()
    assert found.mean_m_s == pytest.approx((1.0, -2.0, 0.5))


@pytest.mark.parametrize('times_s', [(), (0.0,), (0.0, 0.3), (0.0, 0.1, 0.2)])
def test_too_few_or_too_near_positions_give_none(times_s):
    assert track_of(times_s).velocity() is None


def test_five_frames_a_second_are_enough():
    assert track_of((0.0, 0.2, 0.4)).velocity() is not None


def test_the_variance_is_that_of_many_trials():
    slopes = []
    for seed in range(400):
        track, random = PositionTrack(0.4), np.random.default_rng(seed)
        for step in range(5):
            track.add(step * NS // 10, random.normal(0.0, np.sqrt(VARIANCE)), VARIANCE)
        slopes.append(track.velocity().mean_m_s)
    assert np.var(slopes, axis=0) == pytest.approx(track.velocity().variance_m2_s2, rel=0.25)


def test_what_was_before_a_reset_does_not_count():
    track = track_of((0.0, 0.1, 0.2, 0.3, 0.4))
    track.clear()
    assert track.velocity() is None
