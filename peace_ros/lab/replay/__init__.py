# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The prompt generator, segmentation and landing cores over a recording, without ROS."""

from peace_ros.lab.replay.report import ReplayReport
from peace_ros.lab.replay.run import Replayer, ReplayOptions, replay
from peace_ros.lab.replay.source import open_source
from peace_ros.lab.replay.source_options import SourceOptions

__all__ = [
    'ReplayOptions',
    'ReplayReport',
    'Replayer',
    'SourceOptions',
    'open_source',
    'replay',
]
