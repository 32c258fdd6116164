# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nouns survive the way through messages, with their stamps."""

from __future__ import annotations

from array import array
from math import cos, pi, radians, sin

import numpy as np
import pytest
from geometry_msgs.msg import Point, PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage, Image

from peace_ros.core import messages as readers
from peace_ros.core.domain import (
    ConfigurationError,
    Heatmap,
    ImageError,
    Pose,
    Prompt,
    RankedWord,
    Setpoint,
    Site,
    VehicleError,
)
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.nodes import messages

STAMP = 1_700_000_123_456_789_012


def test_a_frame_keeps_pixels_and_stamp_through_dds_bytes():
    pixels = np.random.default_rng(1).integers(0, 256, (7, 5, 3), np.uint8)
    message = messages.image_message(pixels, 'rgb8', STAMP)
    assert isinstance(message.data, array)
    frame = readers.frame_from_message(deserialize_message(serialize_message(message), Image))
    np.testing.assert_array_equal(frame.image_rgb, pixels)
    assert frame.stamp_ns == STAMP


def test_a_jpeg_keeps_its_stamp():
    message = messages.jpeg_message(np.full((8, 9, 3), 90, np.uint8), STAMP, 90)
    assert isinstance(message, CompressedImage)
    frame = readers.frame_from_message(message)
    assert frame.image_rgb.shape == (8, 9, 3)
    assert frame.stamp_ns == STAMP


@given(st.lists(st.floats(0.0, 1.0, width=32), min_size=1, max_size=40))
def test_a_heatmap_comes_back_within_half_a_grey_level(scores):
    heatmap = Heatmap(np.array([scores], np.float32), STAMP)
    message = messages.heatmap_to_image(heatmap)
    assert message.encoding == 'mono8'
    back = readers.heatmap_from_image(message)
    assert back.stamp_ns == STAMP
    assert np.abs(back.safety - heatmap.safety).max() <= 0.5 / 255 + 1e-6


def test_what_is_not_a_number_is_never_safe():
    safety = np.array([[np.nan, np.inf, -np.inf, 2.0, -1.0, 1.0]], np.float32)
    message = messages.heatmap_to_image(Heatmap(safety, STAMP))
    assert list(message.data) == [0, 0, 0, 255, 0, 255]


def test_a_heatmap_of_another_encoding_is_refused():
    message = messages.image_message(np.zeros((2, 2, 3), np.uint8), 'rgb8', STAMP)
    with pytest.raises(ImageError, match='mono8'):
        readers.heatmap_from_image(message)


def depth_message(depth: np.ndarray, pad: int = 0, order: str = '<f4') -> Image:
    rows = np.ascontiguousarray(depth.astype(order)).view(np.uint8)
    padded = np.pad(rows, ((0, 0), (0, pad)), constant_values=255)
    message = messages.image_message(np.zeros((1, 1), np.uint8), 'mono8', STAMP)
    message.encoding, message.is_bigendian = '32FC1', int(order == '>f4')
    message.height, message.width, message.step = *depth.shape, padded.shape[1]
    message.data = array('B', padded.tobytes())
    return message


@pytest.mark.parametrize(('pad', 'order'), [(0, '<f4'), (8, '<f4'), (0, '>f4')])
def test_a_depth_image_keeps_metres_and_stamp(pad, order):
    depth = np.array([[1.5, 20.0, np.inf], [0.0, np.nan, 3.25]], np.float32)
    back = readers.depth_from_image(depth_message(depth, pad, order))
    np.testing.assert_array_equal(back.depth_m, depth)
    assert back.depth_m.dtype == np.float32
    assert back.stamp_ns == STAMP


@pytest.mark.parametrize('order', ['<u2', '>u2'])
def test_a_depth_image_of_millimetres_comes_out_in_metres(order):
    message = depth_message(np.array([[1500, 0, 65535]]), 2, order)
    message.encoding, message.is_bigendian = '16UC1', int(order == '>u2')
    back = readers.depth_from_image(message)
    np.testing.assert_allclose(back.depth_m, [[1.5, np.nan, 65.535]])
    assert back.depth_m.dtype == np.float32


def test_a_depth_image_of_another_encoding_or_with_bytes_missing_is_refused():
    colours = depth_message(np.ones((2, 2), np.float32))
    colours.encoding = 'rgb8'
    with pytest.raises(ImageError, match='32FC1 or 16UC1'):
        readers.depth_from_image(colours)
    cut = depth_message(np.ones((2, 2), np.float32))
    cut.data = cut.data[:8]
    with pytest.raises(ImageError, match='8 bytes in place of 16'):
        readers.depth_from_image(cut)


def test_a_prompt_keeps_template_scores_and_stamp():
    ranking = {
        'environment': (RankedWord('heat-map', 0.31), RankedWord('next to/on top of', -0.25)),
        'frame': (RankedWord('image', 0.5),),
    }
    prompt = Prompt('A {term} in heat-map.', STAMP, ranking)
    message = messages.prompt_to_message(prompt)
    assert message.status[0].message == prompt.template
    assert readers.diagnostic_values(message)['best/environment'] == 'heat-map'
    assert readers.prompt_from_message(message) == prompt


def test_a_message_without_a_template_is_no_prompt():
    empty = messages.diagnostic_array(STAMP, 'prompt', messages.OK, '', ())
    with pytest.raises(ConfigurationError, match='template'):
        readers.prompt_from_message(empty)


def test_a_score_that_is_no_number_is_refused():
    pairs = (('template', '{term}'), ('score/frame/image', 'high'))
    with pytest.raises(ConfigurationError, match='high'):
        readers.prompt_from_message(
            messages.diagnostic_array(STAMP, 'prompt', messages.OK, '', pairs)
        )


angles = st.floats(-1.4, 1.4)


@given(angles, angles, st.floats(-3.0, 3.0), st.floats(-500, 500), st.floats(-500, 500))
def test_a_pose_comes_back(roll, pitch, yaw, north, east):
    pose = Pose(STAMP, north, east, -42.0, quaternion_from_euler(roll, pitch, yaw), 42.0)
    back = readers.pose_from_message(messages.pose_to_message(pose))
    assert (back.stamp_ns, back.north_m, back.east_m) == (STAMP, north, east)
    assert back.altitude_agl_m == pytest.approx(42.0)
    dot = sum(a * b for a, b in zip(back.quaternion_ned_frd, pose.quaternion_ned_frd, strict=True))
    assert abs(dot) == pytest.approx(1.0)


def test_a_vehicle_that_looks_north_has_a_yaw_of_90_degrees_in_ros():
    message = messages.pose_to_message(Pose(STAMP, 1.0, 2.0, -3.0, (1.0, 0.0, 0.0, 0.0), 3.0))
    at, turn = message.pose.position, message.pose.orientation
    assert (at.x, at.y, at.z) == (2.0, 1.0, 3.0)
    assert turn.w == pytest.approx(cos(pi / 4))
    assert turn.z == pytest.approx(sin(pi / 4))


@pytest.mark.parametrize('change', ['nan', 'zero', 'long'])
def test_a_pose_that_is_none_is_refused(change):
    message = PoseStamped()
    message.pose.position.z = float('nan') if change == 'nan' else 10.0
    message.pose.orientation.w = {'nan': 1.0, 'zero': 0.0, 'long': 2.0}[change]
    with pytest.raises(VehicleError, match='quaternion'):
        readers.pose_from_message(message)


def test_a_setpoint_is_enu_with_the_stamp_of_its_frame():
    message = messages.setpoint_to_twist_stamped(Setpoint(STAMP, 1.0, 2.0, 3.0), 5)
    linear = message.twist.linear
    assert (linear.x, linear.y, linear.z) == (2.0, 1.0, -3.0)
    assert readers.stamp_ns_of(message) == STAMP
    assert readers.stamp_ns_of(messages.setpoint_to_twist_stamped(Setpoint(0), 5)) == 5


@pytest.mark.parametrize(
    ('heading_deg', 'forward', 'left'), [(0, 1.0, -2.0), (90, 2.0, 1.0), (180, -1.0, 2.0)]
)
def test_a_twist_goes_along_the_image(heading_deg, forward, left):
    pose = Pose(0, 0.0, 0.0, -9.0, quaternion_from_euler(0.0, 0.0, radians(heading_deg)), 9.0)
    twist = messages.setpoint_to_body_twist(Setpoint(0, 1.0, 2.0, 0.5), pose)
    assert twist.linear.x == pytest.approx(forward)
    assert twist.linear.y == pytest.approx(left)
    assert twist.linear.z == -0.5


def test_a_site_is_a_point_on_the_ground():
    message = messages.site_to_message(Site(3.0, 4.0, 8.0, 200.0, 0.9, 0.1), STAMP, 1.5)
    assert (message.point.x, message.point.y, message.point.z) == (4.0, 3.0, -1.5)


def test_the_tests_refuse_a_message_field_of_another_type() -> None:
    with pytest.raises(AssertionError, match='float'):
        Point().x = np.float32(1.5)
