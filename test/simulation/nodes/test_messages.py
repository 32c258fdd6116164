# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the simulated camera says of itself."""

from __future__ import annotations

import pytest

from peace_ros.core import messages as readers
from peace_ros.core.domain import Pose
from peace_ros.core.domain.geometry import quaternion_from_euler

pytest.importorskip('rclpy')

from peace_ros.simulation.nodes import messages

STAMP = 1_700_000_000_123_456_789


def test_a_transform_is_read_as_a_pose():
    pose = Pose(STAMP, 5.0, -6.0, -70.0, quaternion_from_euler(0.1, 0.0, 2.0), 70.0)
    transform = messages.transform_from_pose(pose, 'flying_sensor')
    assert (transform.header.frame_id, transform.child_frame_id) == ('map', 'flying_sensor')
    assert readers.pose_from_transform(transform).north_m == pytest.approx(5.0)
