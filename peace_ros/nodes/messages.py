# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nouns of the domain <-> standard ROS messages; stamps are carried over, never renewed.

Local positions and velocities are NED inside and REP-103 ENU on topics, attitudes FRD in NED
inside and FLU in ENU on topics; the conversions themselves are those of ``domain/geometry.py``.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from math import cos, sin
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, PoseStamped, TransformStamped, Twist, TwistStamped
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import (
    Camera,
    DepthImage,
    Frame,
    Heatmap,
    ImageError,
    Pose,
    Prompt,
    Setpoint,
    Site,
)
from peace_ros.core.domain.geometry import (
    attitude_ned_frd_to_enu_flu,
    ned_to_enu,
    yaw_from_quaternion,
)
from peace_ros.core.images import jpeg_from_rgb, pixels_from_raw, rgb_from_message
from peace_ros.core.poses import pose_from_enu_flu
from peace_ros.core.prompting.pairs import prompt_from_pairs, prompt_pairs

NANOSECONDS = 1_000_000_000
_FLOAT_BYTES = 4
LOCAL_FRAME = 'map'
"""ENU, origin of the autopilot's local frame."""
BODY_FRAME = 'base_link'
CAMERA_FRAME = 'camera'

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


def time_from_ns(stamp_ns: int) -> Time:
    """Return the message of a stamp in nanoseconds."""
    seconds, rest = divmod(stamp_ns, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def ns_from_time(stamp: Time) -> int:
    """Return the nanoseconds of a stamp message."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp_ns(message: Any) -> int:
    """Return the nanoseconds of a message's header stamp."""
    return ns_from_time(message.header.stamp)


def frame_from_message(message: Image | CompressedImage) -> Frame:
    """Return the RGB frame of a raw or compressed image; ImageError says what is wrong with it."""
    return Frame(rgb_from_message(message), stamp_ns(message))


def image_message(
    pixels: NDArray[np.uint8], encoding: str, at_ns: int, frame_id: str = CAMERA_FRAME
) -> Image:
    """Return the Image of a height x width (mono8) or height x width x 3 (rgb8) array."""
    message = Image()
    message.header.stamp = time_from_ns(at_ns)
    message.header.frame_id = frame_id
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.step = pixels.size // pixels.shape[0]
    # rclpy takes an array as it is and copies anything else element by element.
    message.data = array('B', pixels.tobytes())
    return message


def jpeg_message(
    image_rgb: NDArray[np.uint8], at_ns: int, quality: int, frame_id: str = CAMERA_FRAME
) -> CompressedImage:
    """Return the JPEG CompressedImage of a height x width x 3 RGB array."""
    message = CompressedImage()
    message.header.stamp = time_from_ns(at_ns)
    message.header.frame_id = frame_id
    message.format = 'rgb8; jpeg compressed bgr8'
    message.data = array('B', jpeg_from_rgb(image_rgb, quality))
    return message


def heatmap_to_image(heatmap: Heatmap, frame_id: str = CAMERA_FRAME) -> Image:
    """Return the mono8 Image of a heatmap: 255 is surely safe; what is not a number becomes 0."""
    safety = np.nan_to_num(heatmap.safety, nan=0.0, posinf=0.0, neginf=0.0)
    levels = np.rint(np.clip(safety, 0.0, 1.0) * 255.0).astype(np.uint8)
    return image_message(levels, 'mono8', heatmap.stamp_ns, frame_id)


def heatmap_from_image(message: Image) -> Heatmap:
    """Return the heatmap of a mono8 Image; any other encoding is an ImageError."""
    if message.encoding != 'mono8':
        raise ImageError(f'heatmap encoding {message.encoding!r}: publish it as mono8')
    levels = pixels_from_raw(
        message.encoding, message.width, message.height, message.step, message.data
    )
    return Heatmap(levels[:, :, 0].astype(np.float32) / np.float32(255.0), stamp_ns(message))


def depth_from_image(message: Image) -> DepthImage:
    """Return the depth image of a 32FC1 Image (metres); any other encoding is an ImageError."""
    if message.encoding != '32FC1':
        raise ImageError(f'depth encoding {message.encoding!r}: publish it as 32FC1, in metres')
    row_bytes, size = message.width * _FLOAT_BYTES, message.height * message.step
    if message.width < 1 or message.step < row_bytes or len(message.data) != size:
        raise ImageError(
            f'depth image {message.width} x {message.height}, {message.step} bytes per row: '
            f'{len(message.data)} bytes came, {size} fit'
        )
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    order = '>f4' if message.is_bigendian else '<f4'
    depth = np.ascontiguousarray(rows[:, :row_bytes]).view(order).astype(np.float32)
    return DepthImage(depth, stamp_ns(message))


def diagnostic_array(
    at_ns: int, name: str, level: bytes, sentence: str, values: Iterable[tuple[str, str]]
) -> DiagnosticArray:
    """Return a DiagnosticArray of one status: a sentence and key/value pairs."""
    message = DiagnosticArray()
    message.header.stamp = time_from_ns(at_ns)
    pairs = [KeyValue(key=key, value=value) for key, value in values]
    message.status = [DiagnosticStatus(level=level, name=name, message=sentence, values=pairs)]
    return message


def diagnostic_values(message: DiagnosticArray) -> dict[str, str]:
    """Return the key/value pairs of all statuses of a DiagnosticArray."""
    return {pair.key: pair.value for status in message.status for pair in status.values}


def prompt_to_message(prompt: Prompt) -> DiagnosticArray:
    """Return a prompt as diagnostics, its template as the sentence."""
    pairs = prompt_pairs(prompt).items()
    return diagnostic_array(prompt.stamp_ns, 'prompt', OK, prompt.template, pairs)


def prompt_from_message(message: DiagnosticArray) -> Prompt:
    """Return the prompt of its diagnostics; ConfigurationError when it holds none."""
    return prompt_from_pairs(diagnostic_values(message), stamp_ns(message))


def pose_to_message(pose: Pose, frame_id: str = LOCAL_FRAME) -> PoseStamped:
    """Return the PoseStamped (ENU, FLU) of a pose (NED, FRD)."""
    message = PoseStamped()
    message.header.stamp = time_from_ns(pose.stamp_ns)
    message.header.frame_id = frame_id
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = ned_to_enu(pose.north_m, pose.east_m, pose.down_m)
    turn.w, turn.x, turn.y, turn.z = attitude_ned_frd_to_enu_flu(pose.quaternion_ned_frd)
    return message


def pose_from_message(message: PoseStamped) -> Pose:
    """Return the pose (NED, FRD) of a PoseStamped (ENU, FLU); the ground is at z = 0.

    Raises:
        VehicleError: a value is not finite or the quaternion is not of unit length.

    """
    return pose_from_enu_flu(stamp_ns(message), message.pose.position, message.pose.orientation)


def pose_from_transform(transform: TransformStamped) -> Pose:
    """Return the pose of a tf transform local frame -> vehicle, as :func:`pose_from_message`."""
    body = transform.transform
    return pose_from_enu_flu(stamp_ns(transform), body.translation, body.rotation)


def transform_from_pose(pose: Pose, child: str, parent: str = LOCAL_FRAME) -> TransformStamped:
    """Return the tf transform parent -> child of a pose."""
    stamped = pose_to_message(pose, parent)
    message = TransformStamped(header=stamped.header, child_frame_id=child)
    at = stamped.pose.position
    to = message.transform.translation
    to.x, to.y, to.z = at.x, at.y, at.z
    message.transform.rotation = stamped.pose.orientation
    return message


def setpoint_to_twist_stamped(setpoint: Setpoint, at_ns: int) -> TwistStamped:
    """Return the set-point in ENU, with the stamp of its frame, or ``at_ns`` without a frame."""
    message = TwistStamped()
    message.header.stamp = time_from_ns(setpoint.stamp_ns or at_ns)
    message.header.frame_id = LOCAL_FRAME
    linear = message.twist.linear
    linear.x, linear.y, linear.z = ned_to_enu(
        setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s
    )
    return message


def setpoint_to_body_twist(setpoint: Setpoint, pose: Pose) -> Twist:
    """Return the set-point along the axes of the image: x up in it (forward), y left, z up."""
    yaw_ned_rad = yaw_from_quaternion(pose.quaternion_ned_frd)
    c, s = cos(yaw_ned_rad), sin(yaw_ned_rad)
    message = Twist()
    message.linear.x = c * setpoint.v_north_m_s + s * setpoint.v_east_m_s
    message.linear.y = s * setpoint.v_north_m_s - c * setpoint.v_east_m_s
    message.linear.z = -setpoint.v_down_m_s
    return message


def site_to_message(site: Site, at_ns: int, ground_down_m: float) -> PointStamped:
    """Return the site as an ENU point on the ground (``ground_down_m`` of the local frame)."""
    message = PointStamped()
    message.header.stamp = time_from_ns(at_ns)
    message.header.frame_id = LOCAL_FRAME
    at = message.point
    at.x, at.y, at.z = ned_to_enu(site.north_m, site.east_m, ground_down_m)
    return message


def camera_info(camera: Camera, at_ns: int, frame_id: str = CAMERA_FRAME) -> CameraInfo:
    """Return the CameraInfo of a pinhole camera without distortion."""
    message = CameraInfo()
    message.header.stamp = time_from_ns(at_ns)
    message.header.frame_id = frame_id
    message.width, message.height = camera.width_px, camera.height_px
    message.distortion_model = 'plumb_bob'
    message.d = [0.0] * 5
    f, (u, v) = camera.focal_px, camera.centre_px
    message.k = [f, 0.0, u, 0.0, f, v, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [f, 0.0, u, 0.0, 0.0, f, v, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message
