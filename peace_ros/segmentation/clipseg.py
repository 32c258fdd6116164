# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CLIPSeg: the image is encoded once per frame and decoded once for all terms together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from peace_ros.domain import BundleError, ConfigurationError, Frame, Heatmap, Prompt
from peace_ros.inference import Bundle, Preprocessor
from peace_ros.inference.contract import IS_POSITIVE, PIXEL_VALUES, TERM_LOGITS, TEXT_EMBEDDING
from peace_ros.segmentation.fusion import calibrated
from peace_ros.segmentation.segmenter import BundleSegmenter, SegmentationParameters
from peace_ros.segmentation.terms import Terms

_ROUNDING = 1e-3
"""How far beyond 0 and 1 a score may lie, from arithmetic in fp16 or int8."""


class ClipSegSegmenter(BundleSegmenter):
    """A Segmenter over a bundle of the family ``clipseg``."""

    def __init__(self, bundle: Bundle, terms: Terms, parameters: SegmentationParameters) -> None:
        """Open the bundle's graphs and run them once.

        Args:
            bundle: of the family ``clipseg``.
            terms: what to look for.
            parameters: of the segmentation; its bundle and terms are those given here.

        Raises:
            BundleError: the bundle is of another family or its graphs do not fit it.
            ConfigurationError: an execution provider is not available, or softmax is asked for
                without a negative term.
        """
        if parameters.fusion == 'softmax' and not terms.negative:
            raise ConfigurationError(
                'fusion softmax without negative terms would call everything safe: '
                'name negative terms or choose set_difference'
            )
        bundle.require_family('clipseg')
        self._threshold = _threshold(bundle, parameters.fusion)
        super().__init__(bundle, ('image_encoder', 'text_encoder', 'decoder'), terms, parameters)
        self._preprocess = Preprocessor(bundle.manifest.input)
        self._features = [each.name for each in self._sessions['image_encoder'].graph.outputs]
        self._is_positive = np.array(
            [1.0] * len(terms.positive) + [0.0] * len(terms.negative), np.float32
        )
        self._warm_up(bundle)
        self._loaded()

    def _warm_up(self, bundle: Bundle) -> None:
        size = bundle.manifest.input
        blank = np.zeros((size.height, size.width, 3), np.uint8)
        encoder = self._sessions['image_encoder']
        features = encoder.warm_up(self._features, {PIXEL_VALUES: self._preprocess(blank)})
        texts = np.zeros((len(self._terms), bundle.manifest.embedding_width), np.float32)
        self._sessions['decoder'].warm_up(self._fusion.outputs, self._feeds(features, texts))

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the safety of each pixel at network resolution, with the frame's stamp.

        0.5 is the score from which the bundle recommends to call ground safe.

        Raises ImageError for an image that cannot be used, BundleError for an answer of the
        network that cannot be used.
        """
        maps = self._decode(frame, prompt, self._fusion.outputs)
        safety = self._fusion.combine(*(self._checked(each) for each in maps))
        return Heatmap(calibrated(safety, self._threshold), frame.stamp_ns)

    def term_maps(self, frame: Frame, prompt: Prompt) -> NDArray[np.float32]:
        """Return one map per term, [T, h, w] float32 0 to 1, in the order of ``terms.all``."""
        (logits,) = self._decode(frame, prompt, [TERM_LOGITS])
        if logits.ndim != 3 or logits.shape[0] != len(self._terms):
            raise self._unusable('decoder', f'{TERM_LOGITS} of shape {logits.shape}')
        if not np.isfinite(logits).all():
            raise self._unusable('decoder', f'{TERM_LOGITS} that are not finite')
        # tanh never overflows, where exp would.
        maps: NDArray[np.float32] = 0.5 * np.tanh(0.5 * logits) + 0.5
        return maps

    def _decode(
        self, frame: Frame, prompt: Prompt, outputs: Sequence[str]
    ) -> list[NDArray[np.float32]]:
        texts = self._embeddings(prompt)
        pixels = self._preprocess(frame.image_rgb)
        features = self._sessions['image_encoder'].run(self._features, {PIXEL_VALUES: pixels})
        return self._sessions['decoder'].run(outputs, self._feeds(features, texts))

    def _feeds(
        self, features: Sequence[NDArray[np.float32]], texts: NDArray[np.float32]
    ) -> dict[str, NDArray[np.float32]]:
        feeds = dict(zip(self._features, features, strict=True))
        feeds[TEXT_EMBEDDING] = texts
        feeds[IS_POSITIVE] = self._is_positive
        return feeds

    def _checked(self, scores: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return scores h x w clipped to 0..1; refuse what is no score at all."""
        if scores.ndim != 2 or scores.size == 0:
            raise self._unusable('decoder', f'scores of shape {scores.shape}')
        low, high = float(scores.min()), float(scores.max())
        # A comparison with NaN is false, so NaN is refused here too.
        if not (low >= -_ROUNDING and high <= 1.0 + _ROUNDING):
            raise self._unusable('decoder', f'scores from {low} to {high} where 0 to 1 is due')
        return np.clip(scores, np.float32(0.0), np.float32(1.0))


def _threshold(bundle: Bundle, fusion: str) -> float:
    """Return the bundle's recommendation, which was measured with the set difference."""
    if fusion != 'set_difference':
        return 0.5
    threshold = float(bundle.manifest.recommended.get('threshold', 0.5))
    if not 0.0 < threshold < 1.0:
        raise BundleError(
            f'{bundle.folder / "manifest.json"}: recommended threshold {threshold} must lie '
            'between 0 and 1, both excluded: correct the manifest or export the bundle anew'
        )
    return threshold
