# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What flies, without ROS: from a camera frame to the bytes for the autopilot."""
