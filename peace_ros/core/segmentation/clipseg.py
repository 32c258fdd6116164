# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CLIPSeg: the image is encoded once per look and decoded once for all terms together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame, Heatmap, Prompt
from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.core.inference import Preprocessor
from peace_ros.core.inference.contract import IS_POSITIVE, PIXEL_VALUES, TERM_LOGITS, TEXT_EMBEDDING
from peace_ros.core.segmentation.fusion import calibrated
from peace_ros.core.segmentation.looks import joined, parts_of
from peace_ros.core.segmentation.segmenter import BundleSegmenter, SegmentationParameters
from peace_ros.core.segmentation.terms import Terms

Image = NDArray[np.uint8]
Scores = NDArray[np.float32]

_ROUNDING = 1e-3
"""How far beyond 0 and 1 a score may lie, from arithmetic in fp16 or int8."""


@dataclass(frozen=True)
class ClipSegParameters(ParameterSet):
    """Parameters of the family clipseg."""

    clipseg_max_looks: int = parameter(
        10,
        'Family clipseg: a frame of more pixels than the network takes is seen whole and closer in '
        'parts, in this many looks at most; each takes as long as a small frame. 1: whole only',
        low=1,
        high=101,
    )


class ClipSegSegmenter(BundleSegmenter):
    """A Segmenter over a bundle of the family ``clipseg``."""

    FAMILY = 'clipseg'
    ROLES = ('image_encoder', 'text_encoder', 'decoder')
    MEASURED_WITH = 'set_difference'

    def _check_terms(self, terms: Terms, parameters: SegmentationParameters) -> None:
        if parameters.fusion == 'softmax' and not terms.negative:
            raise ConfigurationError(
                'fusion softmax without negative terms would call everything safe: '
                'name negative terms or choose set_difference'
            )

    def _warm_up(self, own: ClipSegParameters | None) -> None:
        self._max_looks = (own or ClipSegParameters()).clipseg_max_looks
        self._preprocess = Preprocessor(self._manifest.input)
        self._features = [each.name for each in self._sessions['image_encoder'].graph.outputs]
        size = self._manifest.input
        blank = np.zeros((size.height, size.width, 3), np.uint8)
        encoder = self._sessions['image_encoder']
        features = encoder.warm_up(self._features, {PIXEL_VALUES: self._preprocess(blank)})
        texts = np.zeros((len(self.terms), self._manifest.embedding_width), np.float32)
        self._sessions['decoder'].warm_up(self._fusion.outputs, self._feeds(features, texts))

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the safety of each pixel, with the frame's stamp.

        It has the resolution of the network, times the parts that the frame is looked at in. 0.5
        is the score from which the bundle recommends to call ground safe.

        Raises ImageError for an image that cannot be used, BundleError for an answer of the
        network that cannot be used.
        """
        texts = self._embeddings(prompt)
        (safety,) = self._closely(frame, lambda image: self._safety(image, texts))
        return Heatmap(calibrated(safety, self.threshold), frame.stamp_ns)

    def term_maps(self, frame: Frame, prompt: Prompt) -> NDArray[np.float32]:
        """Return one map per term, [T, h, w] float32 0 to 1, in the order of ``terms.all``."""
        texts = self._embeddings(prompt)
        maps = self._closely(frame, lambda image: self._chances(image, texts))
        return np.stack(maps)

    def _closely(self, frame: Frame, see: Callable[[Image], list[Scores]]) -> list[Scores]:
        """Return the maps that are seen in the frame, each of the whole and of its parts."""
        image, size = frame.image_rgb, self._manifest.input
        parts = parts_of(
            (image.shape[1], image.shape[0]), (size.width, size.height), self._max_looks
        )
        whole = see(image)
        answers = [see(part.of(image)) for part in parts]
        return [
            joined(each, [answer[index] for answer in answers], parts)
            for index, each in enumerate(whole)
        ]

    def _safety(self, image_rgb: Image, texts: Scores) -> list[Scores]:
        maps = self._decode(image_rgb, texts, self._fusion.outputs)
        return [self._fusion.combine(*(self._checked(each) for each in maps))]

    def _chances(self, image_rgb: Image, texts: Scores) -> list[Scores]:
        (logits,) = self._decode(image_rgb, texts, [TERM_LOGITS])
        if logits.ndim != 3 or logits.shape[0] != len(self.terms):
            raise self._unusable('decoder', f'{TERM_LOGITS} of shape {logits.shape}')
        if not np.isfinite(logits).all():
            raise self._unusable('decoder', f'{TERM_LOGITS} that are not finite')
        # tanh never overflows, where exp would.
        maps: Scores = 0.5 * np.tanh(0.5 * logits) + 0.5
        return list(maps)

    def _decode(self, image_rgb: Image, texts: Scores, outputs: Sequence[str]) -> list[Scores]:
        feeds = {PIXEL_VALUES: self._preprocess(image_rgb)}
        features = self._sessions['image_encoder'].run(self._features, feeds)
        return self._sessions['decoder'].run(outputs, self._feeds(features, texts))

    def _feeds(self, features: Sequence[Scores], texts: Scores) -> dict[str, Scores]:
        feeds = dict(zip(self._features, features, strict=True))
        feeds[TEXT_EMBEDDING] = texts
        positive, negative = len(self.terms.positive), len(self.terms.negative)
        feeds[IS_POSITIVE] = np.array([1.0] * positive + [0.0] * negative, np.float32)
        return feeds

    def _checked(self, scores: Scores) -> Scores:
        """Return scores h x w clipped to 0..1; refuse values that cannot be scores."""
        if scores.ndim != 2 or scores.size == 0:
            raise self._unusable('decoder', f'scores of shape {scores.shape}')
        low, high = float(scores.min()), float(scores.max())
        # A comparison with NaN is false, so NaN is refused here too.
        if not (low >= -_ROUNDING and high <= 1.0 + _ROUNDING):
            raise self._unusable('decoder', f'scores from {low} to {high} where 0 to 1 is due')
        return np.clip(scores, np.float32(0.0), np.float32(1.0))
