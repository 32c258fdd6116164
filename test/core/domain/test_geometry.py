# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frame conversions, each against what a person can check by hand."""

from math import degrees, isfinite, pi, radians, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import NADIR, Camera, Pose
from peace_ros.core.domain.geometry import (
    angle_between,
    attitude_enu_flu_to_ned_frd,
    attitude_ned_frd_to_enu_flu,
    camera_pose,
    camera_pose_on_gimbal,
    enu_to_ned,
    footprint_m,
    ground_to_image,
    interpolate,
    lean_acceleration,
    mount_from_degrees,
    mount_from_optical,
    ned_to_enu,
    optical_from_mount,
    quaternion_from_euler,
    rotation_matrix,
    slerp,
    yaw_from_quaternion,
)

CAMERA = Camera.from_degrees(352, 352, 73.0)
ANGLES = st.floats(-3.1, 3.1)
TILTS = st.floats(-0.5, 0.5)


def pose(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, altitude: float = 100.0) -> Pose:
    return Pose(0, 0.0, 0.0, -altitude, quaternion_from_euler(roll, pitch, yaw), altitude)


def pixel_of(north: float, east: float, at: Pose) -> tuple[float, float]:
    u, v, depth = ground_to_image(CAMERA, at) @ [north, east, 1.0]
    return u / depth, v / depth


def centre_looks_at(at: Pose) -> tuple[float, float]:
    n, e, scale = np.linalg.inv(ground_to_image(CAMERA, at)) @ [*CAMERA.centre_px, 1.0]
    return n / scale, e / scale


def test_axes_swap_and_up_turns_down() -> None:
    assert ned_to_enu(1.0, 2.0, 3.0) == (2.0, 1.0, -3.0)
    assert enu_to_ned(2.0, 1.0, -3.0) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ('yaw_ned_deg', 'yaw_enu_deg'), [(0, 90), (90, 0), (-90, 180), (45, 45), (135, -45)]
)
def test_heading_is_counted_from_north_in_ned_and_from_east_in_enu(
    yaw_ned_deg: float, yaw_enu_deg: float
) -> None:
    enu = attitude_ned_frd_to_enu_flu(quaternion_from_euler(0, 0, radians(yaw_ned_deg)))
    difference = degrees(yaw_from_quaternion(enu)) - yaw_enu_deg
    assert (difference + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-9)


@given(ANGLES, TILTS, ANGLES)
def test_attitude_survives_the_way_there_and_back(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    back = attitude_enu_flu_to_ned_frd(attitude_ned_frd_to_enu_flu(q))
    assert np.allclose(rotation_matrix(back), rotation_matrix(q), atol=1e-9)


@given(TILTS, TILTS, ANGLES)
def test_a_body_vector_points_to_the_same_place_in_both_worlds(
    roll: float, pitch: float, yaw: float
) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    in_ned = rotation_matrix(q) @ [1.0, 2.0, 3.0]
    in_enu = rotation_matrix(attitude_ned_frd_to_enu_flu(q)) @ [1.0, -2.0, -3.0]
    assert np.allclose(ned_to_enu(*in_ned), in_enu, atol=1e-9)


def test_level_camera_sees_north_up_and_east_right() -> None:
    metres_per_pixel = footprint_m(CAMERA, 100.0)[0] / 352
    assert pixel_of(0, 0, pose()) == pytest.approx(CAMERA.centre_px)
    assert pixel_of(10, 0, pose()) == pytest.approx((175.5, 175.5 - 10 / metres_per_pixel))
    assert pixel_of(0, 10, pose()) == pytest.approx((175.5 + 10 / metres_per_pixel, 175.5))


def test_a_vehicle_heading_east_has_east_at_the_top() -> None:
    u, v = pixel_of(0, 10, pose(yaw=radians(90)))
    assert u == pytest.approx(175.5)
    assert v < 175.5


def test_a_tilted_camera_looks_elsewhere_by_altitude_times_tangent() -> None:
    north, east = centre_looks_at(pose(pitch=radians(16)))
    assert north == pytest.approx(100 * tan(radians(16)))  # nose up sees ahead
    assert east == pytest.approx(0.0)
    north, east = centre_looks_at(pose(roll=radians(16)))
    assert east == pytest.approx(-100 * tan(radians(16)))  # right wing down sees to the left
    assert north == pytest.approx(0.0)


@given(TILTS, TILTS, ANGLES, st.floats(-30, 30), st.floats(-30, 30))
def test_image_and_ground_are_inverse(
    roll: float, pitch: float, yaw: float, north: float, east: float
) -> None:
    at = pose(roll, pitch, yaw)
    ground = np.linalg.inv(ground_to_image(CAMERA, at)) @ [*pixel_of(north, east, at), 1.0]
    assert np.allclose(ground[:2] / ground[2], [north, east], atol=1e-6)


def test_footprint_is_the_field_of_view_on_the_ground() -> None:
    across, along = footprint_m(Camera.from_degrees(640, 480, 90.0), 50.0)
    assert across == pytest.approx(100.0)
    assert along == pytest.approx(75.0)


def test_poses_interpolate_halfway() -> None:
    before = Pose(0, 0.0, 0.0, -100.0, quaternion_from_euler(0, 0, 0), 100.0)
    after = Pose(100, 4.0, 2.0, -90.0, quaternion_from_euler(0, 0, 1.0), 90.0)
    middle = interpolate(before, after, 50)
    assert (middle.stamp_ns, middle.north_m, middle.altitude_agl_m) == (50, 2.0, 95.0)
    assert yaw_from_quaternion(middle.quaternion_ned_frd) == pytest.approx(0.5)


def test_slerp_takes_the_shorter_arc() -> None:
    a = quaternion_from_euler(0, 0, radians(170))
    b = quaternion_from_euler(0, 0, radians(-170))
    assert abs(degrees(yaw_from_quaternion(slerp(a, b, 0.5)))) == pytest.approx(180.0)


@pytest.mark.parametrize(
    ('roll', 'pitch', 'yaw', 'north', 'east'),
    [
        (0.0, 0.0, 1.0, 0.0, 0.0),
        (0.0, -0.3, 0.0, 9.80665 * tan(0.3), 0.0),
        (0.3, 0.0, 0.0, 0.0, 9.80665 * tan(0.3)),
        (0.3, 0.0, pi / 2.0, -9.80665 * tan(0.3), 0.0),
    ],
)
def test_the_thrust_of_a_multicopter_accelerates_it_to_where_it_leans(
    roll: float, pitch: float, yaw: float, north: float, east: float
) -> None:
    lean = lean_acceleration(quaternion_from_euler(roll, pitch, yaw))
    assert lean == pytest.approx((north, east), abs=1e-9)
    assert all(isfinite(each) for each in lean_acceleration(quaternion_from_euler(pi, pitch, yaw)))


NOWHERE = (0.0, 0.0, 0.0)


def test_a_mounted_camera_looks_where_a_person_would_say() -> None:
    """Heading north, 100 m up: pitch ahead, roll to the left, yaw turns the picture."""
    for turns, (north, east) in (
        ((0.0, 15.0, 0.0), (100 * tan(radians(15)), 0.0)),
        ((15.0, 0.0, 0.0), (0.0, -100 * tan(radians(15)))),
        ((0.0, 15.0, 90.0), (0.0, 100 * tan(radians(15)))),
    ):
        seen = centre_looks_at(camera_pose(mount_from_degrees(turns, NOWHERE), pose()))
        assert seen == pytest.approx((north, east), abs=1e-9)


def test_a_camera_turned_by_90_deg_has_the_right_side_at_the_top() -> None:
    turned = camera_pose(mount_from_degrees((0.0, 0.0, 90.0), NOWHERE), pose())
    u, v = pixel_of(0, 10, turned)  # 10 m east of a vehicle that heads north
    assert u == pytest.approx(175.5)
    assert v < 175.5


def test_the_place_of_the_camera_turns_with_the_vehicle() -> None:
    mount = mount_from_degrees((0.0, 0.0, 0.0), (2.0, 1.0, 0.5))
    east = camera_pose(mount, pose(yaw=radians(90)))
    assert (east.north_m, east.east_m) == pytest.approx((-1.0, 2.0))
    assert (east.down_m, east.altitude_agl_m) == pytest.approx((-99.5, 99.5))


@pytest.mark.parametrize('in_earth', [False, True])
def test_a_camera_on_a_gimbal_looks_where_the_gimbal_points_however_the_vehicle_leans(
    in_earth: bool,
) -> None:
    leaning = pose(roll=0.2, pitch=-0.3, yaw=radians(90))
    turned = quaternion_from_euler(0.0, radians(-75.0), radians(90) if in_earth else 0.0)
    seen = centre_looks_at(camera_pose_on_gimbal(NADIR, leaning, turned, in_earth=in_earth))
    assert seen == pytest.approx((0.0, 100 * tan(radians(15))), abs=1e-6)


def test_a_gimbal_that_points_down_is_a_nadir_camera() -> None:
    down = quaternion_from_euler(0.0, radians(-90.0), 0.0)
    placed = camera_pose_on_gimbal(NADIR, pose(yaw=0.7), down, in_earth=False)
    assert pixel_of(12.0, -5.0, placed) == pytest.approx(pixel_of(12.0, -5.0, pose(yaw=0.7)))


def test_a_camera_is_turned_on_its_gimbal_and_its_place_is_on_the_vehicle() -> None:
    mount = mount_from_degrees((0.0, 15.0, 0.0), (2.0, 0.0, 0.5))
    down = quaternion_from_euler(0.0, radians(-90.0), 0.0)
    placed = camera_pose_on_gimbal(mount, pose(), down, in_earth=False)
    assert (placed.north_m, placed.down_m) == pytest.approx((2.0, -99.5))
    north, east = centre_looks_at(placed)
    assert (north, east) == pytest.approx((2.0 + 99.5 * tan(radians(15)), 0.0), abs=1e-6)


def test_a_mount_survives_the_way_to_its_optical_frame_and_back() -> None:
    for turns in ((0.0, 0.0, 0.0), (10.0, -20.0, 130.0)):
        mount = mount_from_degrees(turns, (0.5, -0.2, 0.1))
        back = mount_from_optical(*optical_from_mount(mount))
        assert angle_between(back.quaternion, mount.quaternion) < 1e-6
        assert back.offset_frd_m == pytest.approx(mount.offset_frd_m)


def test_the_mount_by_parameters_and_by_an_optical_frame_are_the_same() -> None:
    """In base_link (forward, left, up) a nadir picture has its right at -y, its down at -x."""
    half = 0.5**0.5
    assert rotation_matrix((0.0, half, -half, 0.0)) == pytest.approx(
        np.array([[0, -1, 0], [-1, 0, 0], [0, 0, -1]]), abs=1e-9
    )
    nadir = mount_from_optical((0.0, half, -half, 0.0), (1.0, 2.0, 3.0))
    assert nadir.quaternion == pytest.approx(NADIR.quaternion)
    assert nadir.offset_frd_m == (1.0, -2.0, -3.0)
    # Looking straight ahead with the top up: right is -y, down is -z, the view is x.
    ahead = mount_from_optical((0.5, -0.5, 0.5, -0.5), NOWHERE)
    by_parameters = mount_from_degrees((0.0, 90.0, 0.0), NOWHERE)
    assert ahead.quaternion == pytest.approx(by_parameters.quaternion)
