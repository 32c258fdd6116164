# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames and type masks of SET_POSITION_TARGET_LOCAL_NED."""

from math import nan, pi

import pytest

from peace_ros.simulation.autopilot.guided import STOP, PositionTarget, understand

HOLD_HEADING, FREE_HEADING = 0x5C7, 0xDC7


@pytest.mark.parametrize(
    ('frame', 'expected'),
    [(1, (1, 2, 3)), (7, (1, 2, 3)), (8, (-2, 1, 3)), (9, (-2, 1, 3))],
)
def test_frames_mean_what_the_table_says(frame, expected):
    got = understand(PositionTarget(frame, HOLD_HEADING, (1, 2, 3)), heading_rad=pi / 2)
    assert (got.v_north_m_s, got.v_east_m_s, got.v_down_m_s) == pytest.approx(expected)


@pytest.mark.parametrize('frame', [0, 6, 12, 20, 255])
def test_an_unknown_frame_stops_the_vehicle(frame):
    assert understand(PositionTarget(frame, HOLD_HEADING, (1, 2, 3)), 0.0) is STOP


@pytest.mark.parametrize('mask', [0x5FF, 0x607, 0xDF8])
def test_a_mask_without_velocity_or_with_force_stops_the_vehicle(mask):
    assert understand(PositionTarget(1, mask, (1, 2, 3)), 0.0) is STOP


def test_a_force_whose_acceleration_is_ignored_does_not_count():
    assert understand(PositionTarget(1, 0x7C7, (1, 2, 3)), 0.0).v_north_m_s == 1


def test_velocity_alone_turns_the_nose_to_the_travel():
    assert understand(PositionTarget(1, FREE_HEADING, (0, 3, 0)), 0.0).yaw_rad == pi / 2
    assert understand(PositionTarget(1, FREE_HEADING, (0, 0, 1)), 0.0).yaw_rad is None


def test_a_yaw_rate_of_zero_holds_the_heading():
    got = understand(PositionTarget(1, HOLD_HEADING, (0, 3, 0), yaw_rate_rad_s=0.0), 0.0)
    assert (got.yaw_rad, got.yaw_rate_rad_s) == (None, 0.0)


@pytest.mark.parametrize('velocity', [(nan, 0, 0), (0, float('inf'), 0)])
def test_numbers_that_are_none_are_not_obeyed(velocity):
    assert understand(PositionTarget(1, HOLD_HEADING, velocity), 0.0) is None
