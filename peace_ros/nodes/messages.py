# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nouns of the domain -> standard ROS messages of rclpy; their readers are in the core.

Local positions and velocities are NED inside and REP-103 ENU on topics, attitudes FRD in NED
inside and FLU in ENU on topics; the conversions themselves are those of ``domain/geometry.py``.
"""

from __future__ import annotations

from array import array
from importlib import import_module
from math import cos, sin
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped, PoseStamped, TransformStamped, Twist, TwistStamped
from sensor_msgs.msg import CameraInfo

from peace_ros.core.domain import Camera, Pose, Prompt, Setpoint, Site
from peace_ros.core.domain.geometry import (
    attitude_ned_frd_to_enu_flu,
    ned_to_enu,
    yaw_from_quaternion,
)
from peace_ros.core.messages import CAMERA_FRAME, MessageBuilder
from peace_ros.core.prompting.pairs import prompt_pairs

LOCAL_FRAME = 'map'
"""ENU, origin of the autopilot's local frame."""
BODY_FRAME = 'base_link'

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


def _class_of(package: str, name: str) -> Any:
    return getattr(import_module(f'{package}.msg'), name)


# rclpy takes an array as it is and copies anything else element by element.
_BUILD = MessageBuilder(_class_of, lambda data: array('B', data))
time_from_ns = _BUILD.time
image_message = _BUILD.image
jpeg_message = _BUILD.jpeg
heatmap_to_image = _BUILD.heatmap
diagnostic_array = _BUILD.diagnostic_array


def prompt_to_message(prompt: Prompt) -> DiagnosticArray:
    """Return a prompt as diagnostics, its template as the sentence."""
    pairs = prompt_pairs(prompt).items()
    return diagnostic_array(prompt.stamp_ns, 'prompt', OK, prompt.template, pairs)


def pose_to_message(pose: Pose, frame_id: str = LOCAL_FRAME) -> PoseStamped:
    """Return the PoseStamped (ENU, FLU) of a pose (NED, FRD)."""
    position = ned_to_enu(pose.north_m, pose.east_m, pose.down_m)
    attitude = attitude_ned_frd_to_enu_flu(pose.quaternion_ned_frd)
    return _BUILD.pose_stamped(pose.stamp_ns, position, attitude, frame_id)


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
    message.header = _BUILD.header(setpoint.stamp_ns or at_ns, LOCAL_FRAME)
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
    message.header = _BUILD.header(at_ns, LOCAL_FRAME)
    at = message.point
    at.x, at.y, at.z = ned_to_enu(site.north_m, site.east_m, ground_down_m)
    return message


def camera_info(camera: Camera, at_ns: int, frame_id: str = CAMERA_FRAME) -> CameraInfo:
    """Return the CameraInfo of a pinhole camera without distortion."""
    message = CameraInfo()
    message.header = _BUILD.header(at_ns, frame_id)
    message.width, message.height = camera.width_px, camera.height_px
    message.distortion_model = 'plumb_bob'
    message.d = [0.0] * 5
    f, (u, v) = camera.focal_px, camera.centre_px
    message.k = [f, 0.0, u, 0.0, f, v, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [f, 0.0, u, 0.0, 0.0, f, v, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message
