# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion estimates as the messages that position filters take."""

from dataclasses import replace
from math import nan, radians

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import MotionEstimate, Pose, VehicleError
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.vision import check_motion

SECOND = 10**9
ANGLES = radians(5.0), radians(-10.0), radians(120.0)
POSE = Pose(7 * SECOND, 3.0, -4.0, -50.0, quaternion_from_euler(*ANGLES), 50.0)
ESTIMATE = MotionEstimate(
    pose=POSE,
    position_covariance_m2=np.array([[0.4, 0.1, 0.0], [0.1, 0.5, 0.2], [0.0, 0.2, 0.6]]),
    velocity_m_s=np.array([2.0, -1.0, 0.5]),
    velocity_stamp_ns=7 * SECOND - SECOND // 5,
    velocity_covariance_m2_s2=np.diag([0.01, 0.02, 0.03]),
    quality=0.83,
    resets=257,
)


def over_the_line(message):
    """Return a message as the other end reads it."""
    data = message.pack(mavlink.MAVLink(None, 1, 191))
    return mavlink.MAVLink(None).parse_buffer(bytearray(data))[0]


def test_ardupilot_gets_position_and_velocity_each_of_its_moment():
    place, speed = map(over_the_line, ArduPilot().motion_messages(ESTIMATE))
    assert place.get_type() == 'VISION_POSITION_ESTIMATE'
    assert (place.usec, place.x, place.y, place.z) == (7_000_000, 3.0, -4.0, -50.0)
    assert (place.roll, place.pitch, place.yaw) == pytest.approx(ANGLES)
    diagonal = [place.covariance[i] for i in (0, 6, 11)]
    assert diagonal == pytest.approx([0.4, 0.5, 0.6])
    assert (place.covariance[1], place.covariance[7]) == pytest.approx((0.1, 0.2))
    assert np.isfinite(place.covariance).all()
    assert speed.get_type() == 'VISION_SPEED_ESTIMATE'
    assert (speed.usec, speed.x, speed.y, speed.z) == (6_800_000, 2.0, -1.0, 0.5)
    assert (speed.covariance[0], speed.covariance[4]) == pytest.approx((0.01, 0.02))
    assert speed.covariance[8] > 10.0
    assert (place.reset_counter, speed.reset_counter) == (1, 1)


def test_px4_gets_both_at_the_moment_of_the_velocity_and_no_attitude():
    (told,) = map(over_the_line, Px4().motion_messages(ESTIMATE))
    assert told.get_type() == 'ODOMETRY'
    assert told.time_usec == 6_800_000
    assert (told.frame_id, told.child_frame_id) == (1, 1)
    assert (told.x, told.y, told.z) == pytest.approx((2.6, -3.8, -50.1))
    assert (told.vx, told.vy, told.vz) == (2.0, -1.0, 0.5)
    assert np.isnan(told.q).all()
    assert [told.pose_covariance[i] for i in (0, 6, 11)] == pytest.approx([0.4, 0.5, 0.6])
    variances = [told.velocity_covariance[i] for i in (0, 6)]
    assert variances == pytest.approx([0.01, 0.02])
    assert told.velocity_covariance[11] > 10.0
    assert (told.quality, told.reset_counter, told.estimator_type) == (83, 1, 3)


@pytest.mark.parametrize(
    'wrong',
    [
        {'pose': replace(POSE, down_m=nan)},
        {'pose': replace(POSE, quaternion_ned_frd=(nan, 0.0, 0.0, 0.0))},
        {'velocity_m_s': np.array([0.0, np.inf, 0.0])},
        {'position_covariance_m2': np.diag([1.0, nan, 1.0])},
        {'velocity_covariance_m2_s2': np.diag([1.0, 1.0, nan])},
    ],
)
def test_an_estimate_that_is_not_finite_is_refused(wrong):
    check_motion(ESTIMATE)
    with pytest.raises(VehicleError, match=r'(nan|inf).*finite'):
        check_motion(replace(ESTIMATE, **wrong))
