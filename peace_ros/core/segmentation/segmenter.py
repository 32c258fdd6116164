# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every open-vocabulary segmenter can do, what those over a bundle share, parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, Frame, Heatmap, Prompt
from peace_ros.core.domain.parameters import check, parameter
from peace_ros.core.inference import Bundle, TextEncoder, open_sessions
from peace_ros.core.inference.providers import Footprint, LoadMeter
from peace_ros.core.segmentation.fusion import FUSIONS
from peace_ros.core.segmentation.terms import Terms

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
    clipseg_max_looks: int = parameter(
        10,
        'Family clipseg: a frame of more pixels than the network takes is seen whole and closer in '
        'parts, in this many looks at most; each takes as long as a small frame. 1: whole only',
        low=1,
        high=101,
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

    @property
    def footprint(self) -> Footprint:
        """What its networks run on and take."""
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


class BundleSegmenter:
    """What the segmenters over a bundle share: networks, texts and the fusion of terms."""

    def __init__(
        self,
        bundle: Bundle,
        roles: tuple[str, ...],
        terms: Terms,
        parameters: SegmentationParameters,
    ) -> None:
        """Open the bundle's graphs of these roles; :meth:`_loaded` is due after their first run.

        Raises:
            BundleError: the graphs do not fit the bundle.
            ConfigurationError: an execution provider is not available.
        """
        self._meter = LoadMeter()
        self._manifest = bundle.manifest
        self._terms = terms
        self._parameters = parameters
        self._fusion = FUSIONS[parameters.fusion]
        self._sessions = open_sessions(
            bundle, roles, threads=parameters.threads, providers=parameters.providers
        )
        cache_dir = Path(parameters.cache_dir).expanduser() if parameters.cache_dir else None
        self._text = TextEncoder(bundle, self._sessions['text_encoder'], cache_dir)
        self._loaded()

    def _loaded(self) -> None:
        """Take stock of what the networks hold by now."""
        providers = dict.fromkeys(
            each for session in self._sessions.values() for each in session.providers
        )
        manifest = self._manifest
        self._footprint = self._meter.read(
            manifest.name, manifest.precision, tuple(providers), self._parameters.threads
        )

    @property
    def terms(self) -> Terms:
        """What it looks for."""
        return self._terms

    @property
    def unknown_terms(self) -> Mapping[str, tuple[str, ...]]:
        """Term -> its words that the model has never learned; it cannot see those."""
        return self._text.unknown_words(self._terms.all)

    @property
    def calls(self) -> Mapping[str, int]:
        """Role of a network -> how often it ran, without warm-ups."""
        return {role: session.calls for role, session in self._sessions.items()}

    @property
    def footprint(self) -> Footprint:
        """What its networks run on and take."""
        return self._footprint

    def prepare(self, prompt: Prompt) -> None:
        """Embed the prompt's texts ahead of the frame; may be called from another thread."""
        self._embeddings(prompt)

    def _embeddings(self, prompt: Prompt) -> NDArray[np.float32]:
        return self._text([prompt.text_for(term) for term in self._terms.all])

    def _unusable(self, role: str, what: str) -> BundleError:
        path = self._sessions[role].graph.path
        return BundleError(
            f'{path}: gave {what}, which cannot be used; the frame gets no heatmap, choose '
            'another bundle if this stays'
        )
