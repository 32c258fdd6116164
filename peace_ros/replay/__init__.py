# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The prompt generator, segmentation and landing cores over a recording, without ROS."""

from peace_ros.replay.preset import DEFAULT_PRESET, Preset, load_preset, preset_names
from peace_ros.replay.report import ReplayReport
from peace_ros.replay.run import Replayer, ReplayOptions, replay
from peace_ros.replay.source import SourceOptions, open_source

__all__ = [
    'DEFAULT_PRESET',
    'Preset',
    'ReplayOptions',
    'ReplayReport',
    'Replayer',
    'SourceOptions',
    'load_preset',
    'open_source',
    'preset_names',
    'replay',
]
