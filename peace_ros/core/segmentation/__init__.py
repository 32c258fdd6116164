# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a frame and its prompt to the safety of each pixel."""

from peace_ros.core.segmentation.camera_watch import CameraWatch
from peace_ros.core.segmentation.clipseg import ClipSegSegmenter
from peace_ros.core.segmentation.fastsam import FastSamSegmenter
from peace_ros.core.segmentation.fusion import FUSIONS, Fusion, set_difference, soft_difference
from peace_ros.core.segmentation.overlay import draw_overlay
from peace_ros.core.segmentation.registry import FACTORIES, create_segmenter
from peace_ros.core.segmentation.segmenter import FAMILIES, SegmentationParameters, Segmenter
from peace_ros.core.segmentation.terms import Terms, load_terms

__all__ = [
    'FACTORIES',
    'FAMILIES',
    'FUSIONS',
    'CameraWatch',
    'ClipSegSegmenter',
    'FastSamSegmenter',
    'Fusion',
    'SegmentationParameters',
    'Segmenter',
    'Terms',
    'create_segmenter',
    'draw_overlay',
    'load_terms',
    'set_difference',
    'soft_difference',
]
