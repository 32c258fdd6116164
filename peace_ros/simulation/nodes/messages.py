# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The message that only the simulated camera publishes: its pose in tf."""

from __future__ import annotations

from geometry_msgs.msg import TransformStamped

from peace_ros.core.domain import Pose
from peace_ros.nodes.messages import LOCAL_FRAME, pose_to_message

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
