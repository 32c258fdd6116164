# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a frame and its prompt to the safety of each pixel."""

from peace_ros.core.segmentation.camera_watch import CameraWatch
from peace_ros.core.segmentation.clipseg import ClipSegParameters, ClipSegSegmenter
from peace_ros.core.segmentation.fastsam import FastSamParameters, FastSamSegmenter
from peace_ros.core.segmentation.fusion import FUSIONS, set_difference
from peace_ros.core.segmentation.overlay import draw_overlay
from peace_ros.core.segmentation.registry import FAMILIES, Family, Log, create_segmenter, family_of
from peace_ros.core.segmentation.segmenter import SegmentationParameters, Segmenter
from peace_ros.core.segmentation.terms import Terms, load_terms

__all__ = [
    'FAMILIES',
    'FUSIONS',
    'CameraWatch',
    'ClipSegParameters',
    'ClipSegSegmenter',
    'Family',
    'FastSamParameters',
    'FastSamSegmenter',
    'Log',
    'SegmentationParameters',
    'Segmenter',
    'Terms',
    'create_segmenter',
    'draw_overlay',
    'family_of',
    'load_terms',
    'set_difference',
]
