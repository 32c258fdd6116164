# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pose at a stamp is interpolated between near, believable poses, or there is none."""

from dataclasses import replace
from math import cos, degrees, nan, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import Pose
from peace_ros.core.domain.geometry import quaternion_from_euler, yaw_from_quaternion
from peace_ros.core.landing.poses import Miss, PoseHistory, jump_m

S = 1_000_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def pose_of(time_s, north_m=0.0, altitude_m=50.0, *, roll=0.0, yaw=0.0) -> Pose:
    attitude = quaternion_from_euler(radians(roll), 0.0, radians(yaw))
    return Pose(round(time_s * S), north_m, -north_m, -altitude_m, attitude, altitude_m)


def history_of(*poses, gap_limit_s=0.5) -> PoseHistory:
    history = PoseHistory(gap_limit_s)
    for pose in poses:
        assert history.add(pose)
    return history


def test_position_altitude_and_attitude_lie_between():
    history = history_of(pose_of(1.0, 2.0, 50.0, yaw=170.0), pose_of(1.4, 6.0, 48.0, yaw=-174.0))
    pose = history.at(round(1.1 * S))
    assert (pose.north_m, pose.east_m, pose.altitude_agl_m) == pytest.approx((3.0, -3.0, 49.5))
    assert degrees(yaw_from_quaternion(pose.quaternion_ned_frd)) == pytest.approx(174.0)
    assert pose.stamp_ns == round(1.1 * S)


@given(fraction=st.floats(0.0, 1.0), roll=st.floats(-9.0, 9.0), yaw=st.floats(-180.0, 180.0))
def test_every_pose_between_is_a_rotation_between(fraction, roll, yaw):
    history = history_of(pose_of(1.0, roll=roll, yaw=yaw), pose_of(1.2, roll=-roll, yaw=yaw))
    pose = history.at(S + round(fraction * 0.2 * S))
    _, x, y, _ = pose.quaternion_ned_frd
    assert sum(part**2 for part in pose.quaternion_ned_frd) == pytest.approx(1.0)
    assert 1.0 - 2.0 * (x * x + y * y) >= cos(radians(abs(roll))) - 1e-9


def test_the_way_of_an_accelerating_vehicle_is_met_at_the_rate_that_is_asked_for():
    def north_m(time_s):
        return 0.5 * 3.0 * time_s**2

    history = history_of(*(pose_of(k / 30.0, north_m(k / 30.0)) for k in range(1, 60)))
    at_s = 40.5 / 30.0
    assert history.at(round(at_s * S)).north_m == pytest.approx(north_m(at_s), abs=1e-3)


@pytest.mark.parametrize(
    ('time_s', 'miss'), [(0.9, Miss.TOO_OLD), (1.5, Miss.GAP), (2.001, Miss.NOT_YET)]
)
def test_nothing_is_extrapolated_nor_guessed_over_a_gap(time_s, miss):
    assert history_of(pose_of(1.0), pose_of(2.0)).at(round(time_s * S)) is miss


@pytest.mark.parametrize(
    ('after', 'miss'),
    [
        (pose_of(1.1, 20.0), Miss.JUMP),
        (pose_of(1.1, altitude_m=60.0), Miss.JUMP),
        (pose_of(1.1, altitude_m=-50.0), Miss.JUMP),
        (pose_of(1.1, yaw=25.0), Miss.TURN),
        (pose_of(1.1, roll=-25.0), Miss.TURN),
    ],
)
def test_what_no_vehicle_does_is_not_interpolated(after, miss):
    assert history_of(pose_of(1.0), after).at(round(1.05 * S)) is miss


@pytest.mark.parametrize(
    ('north_m', 'altitude_m', 'miss'),
    [
        # In 0.1 s: 2 m + 3 m along the ground, 1 m + 1.5 m up or down.
        (5.0, 50.0, None),
        (5.001, 50.0, Miss.JUMP),
        (0.0, 52.5, None),
        (0.0, 47.499, Miss.JUMP),
    ],
)
def test_a_jump_is_more_than_any_vehicle_flies(north_m, altitude_m, miss):
    after = replace(pose_of(1.1, altitude_m=altitude_m), north_m=north_m)
    pose = history_of(pose_of(1.0), after).at(round(1.05 * S))
    assert pose is miss if miss else pose.north_m == pytest.approx(north_m / 2.0)


def test_a_gap_is_longer_than_its_limit():
    for seconds, is_gap in ((0.5, False), (0.5 + 1e-9, True)):
        found = history_of(pose_of(1.0), pose_of(1.0 + seconds)).at(round(1.1 * S))
        assert (found is Miss.GAP) is is_gap


def test_what_a_vehicle_can_fly_is_no_jump():
    assert jump_m(pose_of(1.0), pose_of(1.2, 1.5)) == 0.0
    assert jump_m(pose_of(1.0), pose_of(5.0, 60.0)) == 0.0
    assert jump_m(pose_of(1.0), pose_of(1.2, 20.0)) == pytest.approx(28.28, abs=0.01)


@pytest.mark.parametrize(
    'pose',
    [
        pose_of(1.0, nan),
        pose_of(1.0, altitude_m=nan),
        Pose(S, 0.0, 0.0, 0.0, (0.5, 0.0, 0.0, 0.0), 50.0),
        Pose(S, 0.0, 0.0, 0.0, (nan, 0.0, 0.0, 0.0), 50.0),
    ],
)
def test_poses_that_are_none_are_not_kept(pose):
    history = PoseHistory(0.5)
    assert not history.add(pose)
    assert history.newest is None


def test_stamps_must_grow_and_old_poses_go():
    history = history_of(pose_of(1.0), pose_of(1.5))
    assert not history.add(pose_of(1.5))
    assert not history.add(pose_of(1.2))
    assert history.add(pose_of(30.0))
    assert history.at(round(1.2 * S)) is Miss.TOO_OLD
