# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The odometry says how a vehicle moves, or why it does not know."""

from dataclasses import replace
from math import nan, radians

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Distortion, Frame, Heatmap, InertialSample, MotionEstimate
from peace_ros.core.domain.geometry import angle_between, mount_from_degrees
from peace_ros.core.odometry import (
    Doubt,
    OdometryParameters,
    VisualInertialOdometry,
)
from peace_ros.lab.evaluation.odometry.motion import Motion

CAMERA = Camera.from_degrees(320, 240, 73.0)
LENS = replace(CAMERA, distortion=Distortion('plumb_bob', (-0.12, 0.02, 0.001, 0.0)))
HARD = Motion(60.0, speed_m_s=4.0, course_rad=0.6, lean_deg=15.0, yaw_rate_deg_s=20.0)
HOVER = Motion(40.0, lean_deg=3.0)


@pytest.mark.parametrize(
    ('motion', 'limit_m_s'),
    [
        (HARD, 0.2),
        (replace(HARD, height_m=100.0), 0.3),
        (replace(HARD, height_m=25.0, speed_m_s=2.0), 0.12),
        (Motion(40.0, climb_m_s=-1.5, sway_m_s=1.0), 0.15),
        (HOVER, 0.1),
    ],
)
def test_velocity_and_position_are_right(fly, motion, limit_m_s):
    flight = fly(motion)
    results = flight.run(25)
    assert set(results[:4]) == {Doubt.BEGINNING}
    errors = [flight.velocity_error(each) for each in results[4:]]
    assert max(errors) < limit_m_s
    assert flight.position_error(results[-1]) < 0.005 * motion.height_m + 0.05
    assert results[-1].pose.altitude_agl_m == pytest.approx(
        motion.pose(flight.time_s).altitude_agl_m, rel=0.02
    )
    assert min(each.quality for each in results[4:]) > 0.7
    assert {each.resets for each in results[4:]} == {1}


@pytest.mark.parametrize('camera', [CAMERA, LENS])
def test_a_camera_that_is_mounted_askew_is_taken_into_account(fly, camera):
    mount = mount_from_degrees((4.0, 12.0, 70.0), (0.3, -0.2, 0.1))
    flight = fly(replace(HARD, height_m=40.0, speed_m_s=2.0), camera=camera, mount=mount)
    results = flight.run(15)
    assert max(flight.velocity_error(each) for each in results[4:]) < 0.2
    assert flight.position_error(results[-1]) < 0.25


def test_the_attitude_does_not_follow_a_bias_of_the_body_rates(fly):
    flight = fly(HOVER)
    true = flight.measured

    def biased(time_s):
        sample = true(time_s)
        p, q, r = sample.rates_rad_s
        return replace(sample, rates_rad_s=(p + radians(0.3), q, r))

    flight.measured = biased
    last = flight.run(40)[-1]
    at = flight.motion.pose(flight.time_s)
    assert flight.velocity_error(last) < 0.15
    off = angle_between(last.pose.quaternion_ned_frd, at.quaternion_ned_frd)
    assert off < radians(0.3), 'body rates alone are off by 1.2 degrees'


def test_hovering_does_not_drift(fly):
    flight = fly(HOVER)
    results = flight.run(60)
    errors = [flight.position_error(each) for each in results[4:]]
    assert max(errors) < 0.15
    covariances = [each.position_covariance_m2[0, 0] for each in results[4:]]
    assert covariances[-1] < 4.0 * covariances[0]


def test_an_altitude_that_is_wrong_scales_the_velocity_and_does_no_more(fly):
    flight = fly(replace(HARD, height_m=40.0, speed_m_s=3.0, lean_deg=5.0))
    for _ in range(20):
        altitude_m = 0.9 * flight.motion.pose(flight.time_s + 0.1).altitude_agl_m
        found = flight.step(altitude_m=altitude_m)
    true = flight.motion.velocity(flight.motion.time_s(found.velocity_stamp_ns))
    assert found.velocity_m_s == pytest.approx(0.9 * true, abs=0.12)


def test_the_covariance_covers_the_errors(fly):
    for seed, height_m in enumerate((25.0, 50.0, 100.0)):
        flight = fly(replace(HARD, height_m=height_m, speed_m_s=2.0, course_rad=1.7 * seed))
        for each in flight.run(20)[4:]:
            limit = 3.0 * np.sqrt(np.linalg.eigvalsh(each.velocity_covariance_m2_s2)[-1])
            assert flight.velocity_error(each) < limit


def test_nothing_is_said_before_it_is_aligned(town):
    odometry = VisualInertialOdometry(CAMERA)
    picture = np.zeros((240, 320, 3), np.uint8)
    assert odometry.add_frame(Frame(picture, 5), 30.0) is Doubt.UNALIGNED


@pytest.mark.parametrize(
    ('pose', 'velocity_m_s'),
    [
        ({'north_m': nan}, (0.0, 0.0, 0.0)),
        ({'down_m': nan}, (0.0, 0.0, 0.0)),
        ({'quaternion_ned_frd': (0.0, 0.0, 0.0, 0.0)}, (0.0, 0.0, 0.0)),
        ({}, (0.0, nan, 0.0)),
    ],
)
def test_what_is_not_known_aligns_nothing(fly, pose, velocity_m_s):
    flight = fly(HOVER)
    flight.run(6)
    unknown = replace(flight.motion.pose(flight.time_s), **pose)
    assert flight.odometry.align(unknown, velocity_m_s) is False
    assert flight.step().resets == 1


def test_an_old_frame_changes_nothing(fly):
    flight = fly(HOVER)
    flight.run(8)
    old = Frame(flight.seen(0.3), flight.motion.stamp_ns(0.3))
    assert flight.odometry.add_frame(old, 40.0) is Doubt.OLD
    assert flight.velocity_error(flight.step()) < 0.1


def test_a_frozen_camera_is_no_standstill(fly):
    flight = fly(HARD)
    flight.run(8)
    frozen = flight.seen(flight.time_s)
    results = [flight.step(frozen) for _ in range(5)]
    assert results[1:] == [Doubt.SAME] * 4


def test_without_body_rates_nothing_is_said_until_it_is_aligned_again(fly):
    flight = fly(HOVER)
    flight.run(8)
    flight.samples += 15
    assert flight.step() is Doubt.RATES
    assert set(flight.run(5)) == {Doubt.RATES}
    flight.odometry.align(flight.motion.pose(flight.time_s), (0.0, 0.0, 0.0))
    last = flight.run(6)[-1]
    assert flight.velocity_error(last) < 0.1
    assert last.resets == 2


@pytest.mark.parametrize('altitude_m', [nan, 0.9, -3.0])
def test_without_an_altitude_nothing_is_said(fly, altitude_m):
    flight = fly(HOVER)
    flight.run(6)
    assert flight.step(altitude_m=altitude_m) is Doubt.ALTITUDE
    assert flight.velocity_error(flight.step()) < 0.1


def test_ground_without_texture_says_nothing(fly):
    flight = fly(HOVER)
    for _ in range(5):
        blank = flight.random.normal(120.0, 3.0, (240, 320, 3)).astype(np.uint8)
        assert flight.step(blank) is Doubt.TEXTURE


def test_after_a_covered_lens_the_old_key_frame_is_found_again(fly):
    flight = fly(HOVER)
    flight.run(8)
    for _ in range(30):
        dark = flight.random.integers(0, 4, (240, 320, 3), np.uint8)
        assert flight.step(dark) is Doubt.DIFFERENT
    found = flight.run(6)[-1]
    assert flight.position_error(found) < 0.15
    assert found.resets == 1


def test_after_ground_that_was_not_seen_the_position_is_a_guess_and_says_so(fly):
    flight = fly(Motion(25.0, speed_m_s=3.0, north_m=-30.0))
    before = flight.run(8)[-1]
    for _ in range(90):
        dark = flight.random.integers(0, 4, (240, 320, 3), np.uint8)
        assert isinstance(flight.step(dark), Doubt)
    found = flight.run(12)[-1]
    assert found.resets == before.resets + 1
    assert flight.velocity_error(found) < 0.15
    error_m = np.sqrt(found.position_covariance_m2[0, 0])
    assert error_m > 3.0
    assert flight.position_error(found) < error_m


def test_pictures_that_turn_otherwise_than_the_body_rates_are_doubted(fly):
    flight = fly(replace(HARD, lean_deg=0.0, yaw_rate_deg_s=4.0))
    flight.run(6)
    true = flight.measured
    flight.measured = lambda time_s: replace(true(time_s), rates_rad_s=(0.0, 0.0, 0.0))
    assert flight.step() is Doubt.TURN


def test_near_the_ground_a_fast_velocity_is_too_uncertain(fly):
    flight = fly(replace(HARD, height_m=15.0, lean_deg=0.0, yaw_rate_deg_s=0.0))
    assert flight.run(6)[-1] is Doubt.UNCERTAIN
    sure = OdometryParameters(ground_error_m=0.1)
    flight = fly(flight.motion, parameters=sure)
    assert flight.velocity_error(flight.run(6)[-1]) < 0.15


def test_another_calibration_begins_a_new_key_frame(fly):
    flight = fly(HOVER)
    before = flight.run(8)[-1]
    flight.frames += 1
    narrow = replace(CAMERA, focal_xy_px=(300.0, 300.0))
    frame = Frame(flight.seen(flight.time_s), flight.motion.stamp_ns(flight.time_s), narrow)
    for step in range(11):
        flight.odometry.add_inertial(flight.measured(flight.time_s - 0.08 + 0.01 * step))
    assert flight.odometry.add_frame(frame, 40.0) is Doubt.BEGINNING
    assert flight.odometry.resets == before.resets + 1


class RollingFlight:
    """Rows of its pictures are read one after another."""

    SPAN_S = 0.06

    def __init__(self, flight):
        self.flight = flight
        flight.seen = self.seen

    def seen(self, time_s):
        flight, rows = self.flight, 240
        picture = np.empty((rows, 320, 3), np.uint8)
        for first in range(0, rows, 20):
            lag_s = self.SPAN_S * ((first + 9.5) / (rows - 1) - 0.5)
            view = flight.eye.view(flight.motion.pose(time_s + lag_s)).image_rgb
            picture[first : first + 20] = view[first : first + 20]
        return picture


def test_a_rolling_shutter_is_put_right_by_its_row_time(fly):
    motion = replace(HARD, height_m=40.0, speed_m_s=2.0)
    largest = []
    for row_time_s in (0.0, RollingFlight.SPAN_S / 240):
        flight = fly(motion, parameters=OdometryParameters(row_time_s=row_time_s))
        RollingFlight(flight)
        known = [each for each in flight.run(20)[4:] if isinstance(each, MotionEstimate)]
        largest.append(max((flight.velocity_error(each) for each in known), default=9.0))
    assert largest[1] < 0.25
    assert largest[1] < 0.5 * largest[0]


def test_a_sample_that_cannot_be_is_not_taken():
    odometry = VisualInertialOdometry(CAMERA)
    assert odometry.add_inertial(InertialSample(1, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8)))
    assert not odometry.add_inertial(InertialSample(1, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8)))


class MovingGround:
    """What a flight sees drifts to the east from a moment on."""

    def __init__(self, flight, *, speed_m_s, from_s, until_s=99.0):
        self.flight, self.speed_m_s, self.from_s, self.until_s = flight, speed_m_s, from_s, until_s
        flight.seen = self.seen

    def seen(self, time_s):
        pose = self.flight.motion.pose(time_s)
        moved_m = self.speed_m_s * max(0.0, min(time_s, self.until_s) - self.from_s)
        return self.flight.eye.view(replace(pose, east_m=pose.east_m - moved_m)).image_rgb


@pytest.mark.parametrize('speed_m_s', [1.0, 3.0])
@pytest.mark.parametrize('from_s', [0.0, 2.0])
def test_ground_that_moves_is_doubted(fly, speed_m_s, from_s):
    flight = fly(HOVER)
    MovingGround(flight, speed_m_s=speed_m_s, from_s=from_s)
    results = flight.run(70)
    known = [each for each in results if isinstance(each, MotionEstimate)]
    assert max((flight.velocity_error(each) for each in known), default=0.0) < 0.9
    late = results[round(from_s * 10) + 6 :]
    assert set(late) <= {Doubt.MOVING, Doubt.UNCERTAIN}
    assert late.count(Doubt.MOVING) > 0.9 * len(late)


def test_when_the_ground_stands_still_again_the_position_is_a_guess(fly):
    flight = fly(HOVER)
    MovingGround(flight, speed_m_s=2.0, from_s=1.0, until_s=3.0)
    found = flight.run(45)[-1]
    assert flight.velocity_error(found) < 0.2
    assert found.resets == 2
    error_m = np.sqrt(found.position_covariance_m2[1, 1])
    assert 2.0 < flight.position_error(found) < 2.0 * error_m


def heatmap_of(flight, safety):
    return Heatmap(safety, flight.motion.stamp_ns(flight.time_s))


class MovingHalf:
    """The western half of the picture shows water that drifts, whatever the vehicle does."""

    def __init__(self, flight):
        self.flight, self.still = flight, flight.seen
        flight.seen = self.seen

    def seen(self, time_s):
        picture = self.still(time_s).copy()
        pose = self.flight.motion.pose(time_s)
        wave = replace(pose, north_m=pose.north_m - 1.5 * time_s, east_m=pose.east_m + 60.0)
        picture[:, :190] = self.flight.eye.view(wave).image_rgb[:, :190]
        return picture


def test_corners_that_the_heatmap_calls_unsafe_do_not_count(fly):
    safety = np.full((60, 80), 0.9, np.float32)
    safety[:, :50] = 0.05
    largest = []
    for with_heatmap in (False, True):
        flight = fly(Motion(40.0, speed_m_s=1.0))
        MovingHalf(flight)
        results = []
        for _ in range(25):
            results.append(flight.step())
            if with_heatmap:
                assert flight.odometry.add_heatmap(heatmap_of(flight, safety))
        known = [each for each in results[6:] if isinstance(each, MotionEstimate)]
        largest.append(max((flight.velocity_error(each) for each in known), default=9.0))
        right = sum(flight.velocity_error(each) < 0.2 for each in known)
    assert largest[0] > 0.4
    assert largest[1] < 0.2
    assert right == 19


def test_where_all_ground_is_unsafe_nothing_is_said(fly):
    flight = fly(HOVER)
    flight.run(6)
    assert flight.odometry.add_heatmap(heatmap_of(flight, np.zeros((60, 80), np.float32)))
    assert set(flight.run(20)) == {Doubt.MOVABLE}
    assert flight.odometry.add_heatmap(heatmap_of(flight, np.ones((60, 80), np.float32))) is False


def test_a_heatmap_of_another_frame_is_not_used(fly):
    flight = fly(HOVER)
    flight.run(6)
    other = Heatmap(np.zeros((60, 80), np.float32), flight.motion.stamp_ns(0.55))
    assert not flight.odometry.add_heatmap(other)
    assert isinstance(flight.step(), MotionEstimate)
