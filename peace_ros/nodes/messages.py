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

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped, PoseStamped, Twist, TwistStamped
from sensor_msgs.msg import CameraInfo

from peace_ros.core.domain import Camera, Pose, Prompt, Setpoint, Site
from peace_ros.core.domain.geometry import (
    attitude_ned_frd_to_enu_flu,
    ned_to_enu,
    yaw_from_quaternion,
)
from peace_ros.core.messages import MessageBuilder
from peace_ros.core.prompting.pairs import prompt_pairs

LOCAL_FRAME = 'map'
"""ENU, origin of the autopilot's local frame."""

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


def _class_of(package: str, name: str) -> Any:
    return getattr(import_module(f'{package}.msg'), name)


# rclpy takes an array as it is and copies anything else element by element.
_BUILD = MessageBuilder(_class_of, lambda data: array('B', data))
time_from_ns = _BUILD.time
header = _BUILD.header
image_message = _BUILD.image
jpeg_message = _BUILD.jpeg
heatmap_to_image = _BUILD.heatmap
diagnostic_array = _BUILD.diagnostic_array


def prompt_to_message(prompt: Prompt) -> DiagnosticArray:
    """Return a prompt as diagnostics, its template as the sentence."""
    pairs = prompt_pairs(prompt).items()
    return diagnostic_array(prompt.stamp_ns, 'prompt', OK, prompt.template, pairs)


def camera_info(
    size_px: tuple[int, int], camera: Camera | None, at_ns: int, frame_id: str
) -> CameraInfo:
    """Return the CameraInfo of pictures of a size; K is 0 where their camera is not calibrated."""
    message = CameraInfo(header=header(at_ns, frame_id), width=size_px[0], height=size_px[1])
    if camera is not None:
        if camera.distortion is not None:
            message.distortion_model = camera.distortion.model
            message.d = list(camera.distortion.coefficients)
        else:
            message.distortion_model = 'plumb_bob'
        message.k = camera.matrix.ravel()
        message.r = list(camera.rectification)
        message.p = np.hstack((camera.matrix, np.zeros((3, 1)))).ravel()
    return message


def pose_to_message(pose: Pose, frame_id: str = LOCAL_FRAME) -> PoseStamped:
    """Return the PoseStamped (ENU, FLU) of a pose (NED, FRD)."""
    position = ned_to_enu(pose.north_m, pose.east_m, pose.down_m)
    attitude = attitude_ned_frd_to_enu_flu(pose.quaternion_ned_frd)
    return _BUILD.pose_stamped(pose.stamp_ns, position, attitude, frame_id)


def setpoint_to_twist_stamped(setpoint: Setpoint, at_ns: int) -> TwistStamped:
    """Return the set-point in ENU, with the stamp of its frame, or ``at_ns`` without a frame."""
    message = TwistStamped()
    message.header = header(setpoint.stamp_ns or at_ns, LOCAL_FRAME)
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
    message.header = header(at_ns, LOCAL_FRAME)
    at = message.point
    at.x, at.y, at.z = ned_to_enu(site.north_m, site.east_m, ground_down_m)
    return message
