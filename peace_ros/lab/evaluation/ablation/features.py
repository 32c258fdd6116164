# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame encoded once, for any number of prompts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Prompt
from peace_ros.core.inference.contract import NEGATIVE, PIXEL_VALUES, POSITIVE, SOFTMAX_POSITIVE
from peace_ros.core.prompting.generator import Encoder
from peace_ros.core.segmentation import FUSIONS, ClipSegSegmenter

_OUTPUTS = (POSITIVE, NEGATIVE, SOFTMAX_POSITIVE)
_Scores = NDArray[np.float32]


class FeatureSegmenter(ClipSegSegmenter):
    """CLIPSeg that encodes a frame once for all prompts, and answers for every fusion."""

    _frame: Frame | None = None

    def scores(self, frame: Frame, prompt: Prompt) -> dict[str, _Scores]:
        """Return fusion -> scores h x w float32, 0 to 1, as the network gives them."""
        if frame is not self._frame:
            self._frame, self._features_of_looks = frame, list[list[_Scores]]()
        self._look = 0
        texts = self._embeddings(prompt)
        maps = self._closely(frame, lambda image: self._fused(image, texts))
        return dict(zip(FUSIONS, maps, strict=True))

    def _fused(self, image_rgb: NDArray[np.uint8], texts: _Scores) -> list[_Scores]:
        answers = self._decode(image_rgb, texts, _OUTPUTS)
        maps = {name: self._checked(each) for name, each in zip(_OUTPUTS, answers, strict=True)}
        return [
            np.asarray(fusion.combine(*(maps[each] for each in fusion.outputs)), np.float32)
            for fusion in FUSIONS.values()
        ]

    def _decode(
        self, image_rgb: NDArray[np.uint8], texts: _Scores, outputs: Sequence[str]
    ) -> list[_Scores]:
        # The looks at a frame are the same ones in the same order for every prompt.
        if self._look == len(self._features_of_looks):
            feeds = {PIXEL_VALUES: self._preprocess(image_rgb)}
            features = self._sessions['image_encoder'].run(self._features, feeds)
            self._features_of_looks.append(features)
        feeds = self._feeds(self._features_of_looks[self._look], texts)
        self._look += 1
        return self._sessions['decoder'].run(outputs, feeds)


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
    """Negates image embeddings, so that the words that fit least come first."""

    def __init__(self, encoder: Encoder) -> None:
        self._encoder = encoder
        self.text_embeddings = encoder.text_embeddings

    def image_embedding(self, frame: Frame) -> NDArray[np.float32]:
        """Return (D,) float32 of unit length, opposite to the image's."""
        return -self._encoder.image_embedding(frame)
