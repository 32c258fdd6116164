# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the family fastsam."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class FastSamParameters(ParameterSet):
    """Parameters of the family fastsam."""

    fastsam_max_segments: int = parameter(
        50,
        'Family fastsam: segments that CLIP scores per frame, the largest ones; the ground under '
        'the others counts as unknown',
        low=1,
        high=300,
    )
    fastsam_min_confidence: float = parameter(
        0.4, 'Family fastsam: segments of lower confidence are ignored', low=0.0, high=1.0
    )
    fastsam_max_overlap: float = parameter(
        0.9,
        'Family fastsam: of two boxes with a larger intersection over union, the one of lower '
        'confidence is dropped',
        low=0.0,
        high=1.0,
    )
    fastsam_min_area: float = parameter(
        0.0005,
        'Family fastsam: share of the frame below which a segment is too small to be scored; its '
        'ground counts as unknown',
        low=0.0,
        high=1.0,
    )
    fastsam_min_stability: float = parameter(
        0.5,
        "Family fastsam: a segment whose area shrinks below this share of itself when the mask's "
        'logit moves from 1 below to 1 above its border is noise and ignored',
        low=0.0,
        high=1.0,
    )
    fastsam_overlap: str = parameter(
        'least_safe',
        'Family fastsam: which segment decides for a pixel that several cover, the least_safe or '
        'the smallest one',
        choices=('least_safe', 'smallest'),
    )
