# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that only the simulated camera publishes: its CameraInfo and the pose in tf."""

from __future__ import annotations

from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.messages import CAMERA_FRAME
from peace_ros.nodes.messages import LOCAL_FRAME, header, pose_to_message

BODY_FRAME = 'base_link'


def transform_from_pose(pose: Pose, child: str, parent: str = LOCAL_FRAME) -> TransformStamped:
    """Return the tf transform parent -> child of a pose."""
    stamped = pose_to_message(pose, parent)
    message = TransformStamped(header=stamped.header, child_frame_id=child)
    at = stamped.pose.position
    to = message.transform.translation
    to.x, to.y, to.z = at.x, at.y, at.z
    message.transform.rotation = stamped.pose.orientation
    return message


def camera_info(camera: Camera, at_ns: int, frame_id: str = CAMERA_FRAME) -> CameraInfo:
    """Return the CameraInfo of a pinhole camera without distortion."""
    message = CameraInfo()
    message.header = header(at_ns, frame_id)
    message.width, message.height = camera.width_px, camera.height_px
    message.distortion_model = 'plumb_bob'
    message.d = [0.0] * 5
    f, (u, v) = camera.focal_px, camera.centre_px
    message.k = [f, 0.0, u, 0.0, f, v, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [f, 0.0, u, 0.0, 0.0, f, v, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message
