# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every open-vocabulary segmenter of the project can do, and its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from peace_ros.domain import Frame, Heatmap, Prompt
from peace_ros.domain.parameters import check, parameter
from peace_ros.segmentation.fusion import FUSIONS
from peace_ros.segmentation.terms import Terms

FAMILIES = ('clipseg', 'fastsam')


@dataclass(frozen=True)
class SegmentationParameters:
    """Parameters of the segmentation."""

    family: str = parameter('clipseg', 'Family of the segmentation model', choices=FAMILIES)
    bundle: str = parameter(
        'clipseg-small', 'Model bundle of that family: a folder or the name of a shipped one'
    )
    terms: str = parameter(
        'terms.yaml', 'YAML file of the terms: a path or the name of a shipped one'
    )
    fusion: str = parameter(
        'set_difference',
        'How terms become one score: set_difference min(Sp, 1 - Sn), soft Sp * (1 - Sn), '
        'softmax over all terms',
        choices=tuple(FUSIONS),
    )
    threads: int = parameter(2, 'CPU threads of the networks', low=1, high=64)
    providers: tuple[str, ...] = parameter(
        ('CPUExecutionProvider',), 'ONNX Runtime execution providers, the preferred one first'
    )
    cache_dir: str = parameter(
        '', 'Folder that keeps text embeddings for the next start; empty keeps them in memory only'
    )
    fastsam_max_segments: int = parameter(
        50,
        'Family fastsam: segments that CLIP scores per frame, the largest ones; the ground under '
        'the others counts as unknown',
        low=1,
        high=300,
    )
    fastsam_min_confidence: float = parameter(
        0.4, 'Family fastsam: less sure segments do not count', low=0.0, high=1.0
    )
    fastsam_max_overlap: float = parameter(
        0.9,
        'Family fastsam: of two boxes with a larger intersection over union the less sure one goes',
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
        'logit moves from 1 below to 1 above its border is noise and does not count',
        low=0.0,
        high=1.0,
    )
    fastsam_overlap: str = parameter(
        'least_safe',
        'Family fastsam: which segment speaks for a pixel that several cover, the least_safe or '
        'the smallest one',
        choices=('least_safe', 'smallest'),
    )

    def __post_init__(self) -> None:
        check(self)


class Segmenter(Protocol):
    """Frame + Prompt -> Heatmap."""

    @property
    def terms(self) -> Terms:
        """What it looks for."""
        ...

    @property
    def unknown_terms(self) -> Mapping[str, tuple[str, ...]]:
        """Term -> its words that the model has never learned; it cannot see those."""
        ...

    @property
    def calls(self) -> Mapping[str, int]:
        """Role of a network -> how often it ran, without warm-ups."""
        ...

    def prepare(self, prompt: Prompt) -> None:
        """Embed the prompt's texts ahead of the frame; may be called from another thread."""
        ...

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the safety of each pixel, with the frame's stamp.

        Raises ImageError for an image that cannot be used, BundleError for an answer of the
        network that cannot be used.
        """
        ...

    def term_maps(self, frame: Frame, prompt: Prompt) -> NDArray[np.float32]:
        """Return one map per term, [T, h, w] float32 0 to 1, in the order of ``terms.all``."""
        ...
