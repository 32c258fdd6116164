# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of recordings: the builders make those of the rosbags type store (no rclpy needed)."""

from __future__ import annotations

import numpy as np

from peace_ros.core.messages import MessageBuilder
from peace_ros.recording.bag import TYPESTORE

IMAGE_TYPES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')
POSE_TYPES = (
    'geometry_msgs/msg/PoseStamped',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    'nav_msgs/msg/Odometry',
)

_BUILD = MessageBuilder(
    lambda package, name: TYPESTORE.types[f'{package}/msg/{name}'],
    lambda data: np.frombuffer(data, np.uint8),
)
header = _BUILD.header
image_message = _BUILD.image
heatmap_to_image = _BUILD.heatmap
jpeg_message = _BUILD.jpeg
diagnostic_array = _BUILD.diagnostic_array
pose_stamped = _BUILD.pose_stamped
