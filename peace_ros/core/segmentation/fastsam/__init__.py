# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""FastSAM: segments once per frame, all of them scored by CLIP in one batch."""

from peace_ros.core.segmentation.fastsam.parameters import FastSamParameters
from peace_ros.core.segmentation.fastsam.segmenter import FastSamSegmenter

__all__ = ['FastSamParameters', 'FastSamSegmenter']
