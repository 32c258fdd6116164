# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags and videos in, MCAP bags out, pictures of a run."""

from peace_ros.recording.bag import TYPESTORE, BagReader, BagWriter
from peace_ros.recording.canvas import save_picture
from peace_ros.recording.filmstrip import FilmMoment, draw_filmstrip
from peace_ros.recording.pictures import (
    SiteMark,
    TrackPoint,
    TrajectoryScene,
    draw_trajectory,
)
from peace_ros.recording.video import AltitudeProfile, VideoReader, VideoWriter

__all__ = [
    'TYPESTORE',
    'AltitudeProfile',
    'BagReader',
    'BagWriter',
    'FilmMoment',
    'SiteMark',
    'TrackPoint',
    'TrajectoryScene',
    'VideoReader',
    'VideoWriter',
    'draw_filmstrip',
    'draw_trajectory',
    'save_picture',
]
