# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The quality-of-service profiles, by what flows through them.

Images are keep-last 1: a slow model loses frames and adds no latency. We offer images
reliably and request them best-effort, which matches every camera driver. Fast DDS loses
best-effort images larger than its shared-memory segment (about 549 kB); ``config/fastdds.xml``
enlarges the segment of the process that publishes them.
"""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# A profile with a depth is keep-last, reliable and volatile where it does not say otherwise.

IMAGE_OUT = QoSProfile(depth=1)
"""Frames, heatmaps and overlays that we publish."""

IMAGE_IN = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Frames and heatmaps that we take; the oldest is dropped."""

POSE = QoSProfile(depth=20)
"""Poses: each counts, since a heatmap is projected with the pose at its stamp."""

POSE_IN = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Poses that we subscribe to, whatever reliability they are offered with."""

RESULT = QoSProfile(depth=10)
"""Prompts, status, sites, set-points, diagnostics."""

COMMAND = QoSProfile(depth=1)
"""Velocity commands: only the newest has a meaning."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Maps: who comes late gets the last one."""

CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""/clock, as rclpy subscribes to it."""
