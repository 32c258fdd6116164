# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: parameters, topics and callbacks that store; the cores do the work."""
