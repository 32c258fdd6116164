# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame encoded once, for any number of prompts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Prompt
from peace_ros.core.inference import Preprocessor, TextEncoder, open_sessions
from peace_ros.core.inference.contract import (
    IS_POSITIVE,
    NEGATIVE,
    PIXEL_VALUES,
    POSITIVE,
    SOFTMAX_POSITIVE,
    TEXT_EMBEDDING,
)
from peace_ros.core.segmentation import FUSIONS
from peace_ros.core.segmentation.looks import Part, joined, parts_of

if TYPE_CHECKING:
    from peace_ros.core.inference import Bundle
    from peace_ros.core.prompting.generator import Encoder
    from peace_ros.core.segmentation import Terms

_OUTPUTS = (POSITIVE, NEGATIVE, SOFTMAX_POSITIVE)
_Maps = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class Features:
    """What the decoder needs of a frame."""

    whole: _Maps
    of_parts: tuple[_Maps, ...]
    parts: tuple[Part, ...]


class FeatureSegmenter:
    """CLIPSeg in two steps: the image once, then the terms of each prompt, for every fusion."""

    def __init__(self, bundle: Bundle, terms: Terms, threads: int, max_looks: int) -> None:
        """Open the graphs; raises BundleError."""
        bundle.require_family('clipseg')
        self._terms = terms
        self._sessions = open_sessions(
            bundle, ('image_encoder', 'text_encoder', 'decoder'), threads=threads
        )
        self._text = TextEncoder(bundle, self._sessions['text_encoder'])
        self._size, self._max_looks = bundle.manifest.input, max_looks
        self._preprocess = Preprocessor(self._size)
        self._names = [each.name for each in self._sessions['image_encoder'].graph.outputs]
        positive = [1.0] * len(terms.positive)
        self._is_positive = np.array(positive + [0.0] * len(terms.negative), np.float32)

    @property
    def encodings(self) -> int:
        """How many looks were encoded."""
        return self._sessions['image_encoder'].calls

    def encode(self, frame: Frame) -> Features:
        """Return what the decoder needs of a frame, seen as closely as the segmenter sees it."""
        image = frame.image_rgb
        parts = parts_of(
            (image.shape[1], image.shape[0]), (self._size.width, self._size.height), self._max_looks
        )
        of_parts = tuple(self._encoded(part.of(image)) for part in parts)
        return Features(self._encoded(image), of_parts, parts)

    def _encoded(self, image_rgb: NDArray[np.uint8]) -> _Maps:
        pixels = self._preprocess(image_rgb)
        arrays = self._sessions['image_encoder'].run(self._names, {PIXEL_VALUES: pixels})
        return dict(zip(self._names, arrays, strict=True))

    def scores(
        self, features: Features, prompt: Prompt, fusions: Sequence[str]
    ) -> dict[str, NDArray[np.float32]]:
        """Return fusion -> scores h x w float32, 0 to 1, as the network gives them."""
        texts = self._text([prompt.text_for(term) for term in self._terms.all])
        whole = self._fused(features.whole, texts, fusions)
        answers = [self._fused(each, texts, fusions) for each in features.of_parts]
        return {
            name: joined(whole[name], [answer[name] for answer in answers], features.parts)
            for name in fusions
        }

    def _fused(
        self, features: _Maps, texts: NDArray[np.float32], fusions: Sequence[str]
    ) -> dict[str, NDArray[np.float32]]:
        feeds = {**features, TEXT_EMBEDDING: texts, IS_POSITIVE: self._is_positive}
        maps = dict(zip(_OUTPUTS, self._sessions['decoder'].run(_OUTPUTS, feeds), strict=True))
        clipped = {name: np.clip(each, 0.0, 1.0) for name, each in maps.items()}
        return {
            name: np.asarray(
                FUSIONS[name].combine(*(clipped[each] for each in FUSIONS[name].outputs)),
                np.float32,
            )
            for name in fusions
        }


class SharedEncoder:
    """A CLIP whose image embedding is computed once per frame, for all prompt generators."""

    def __init__(self, encoder: Encoder) -> None:
        self._encoder = encoder
        self.text_embeddings = encoder.text_embeddings
        self._frame: Frame | None = None
        self._embedding: NDArray[np.float32] | None = None

    def image_embedding(self, frame: Frame) -> NDArray[np.float32]:
        """Return (D,) float32 of unit length; the last frame's is kept."""
        if self._embedding is None or frame is not self._frame:
            self._frame, self._embedding = frame, self._encoder.image_embedding(frame)
        return self._embedding


class OppositeEncoder:
    """Turns images about, so that the words that fit least come first."""

    def __init__(self, encoder: Encoder) -> None:
        self._encoder = encoder
        self.text_embeddings = encoder.text_embeddings

    def image_embedding(self, frame: Frame) -> NDArray[np.float32]:
        """Return (D,) float32 of unit length, opposite to the image's."""
        return -self._encoder.image_embedding(frame)
