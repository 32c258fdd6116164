# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The quality-of-service profiles, by what flows through them.

Images are keep-last 1: a slow model loses frames and adds no latency. We offer images
reliably and request them best-effort, which matches every camera driver. Fast DDS loses
best-effort images larger than its shared-memory segment (about 549 kB); ``config/fastdds.xml``
enlarges the segment of the process that publishes them.
"""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

IMAGE_OUT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.RELIABLE
)
"""Frames, heatmaps and overlays that we publish."""

IMAGE_IN = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)
"""Frames and heatmaps that we take; the oldest is dropped."""

POSE = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=20, reliability=ReliabilityPolicy.RELIABLE)
"""Poses: each counts, since a heatmap is projected with the pose at its stamp."""

POSE_IN = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=20, reliability=ReliabilityPolicy.BEST_EFFORT
)
"""Poses that we subscribe to, whatever reliability they are offered with."""

RESULT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.RELIABLE
)
"""Prompts, status, sites, set-points, diagnostics."""

COMMAND = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.RELIABLE
)
"""Velocity commands: only the newest has a meaning."""

CLOCK = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
"""/clock, as rclpy subscribes to it."""
