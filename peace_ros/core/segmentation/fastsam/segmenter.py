# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""FastSAM's segments of a frame, each scored by CLIP against every term."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame, Heatmap, Prompt
from peace_ros.core.inference import contract
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.segmentation.fastsam.crops import Cutter
from peace_ros.core.segmentation.fastsam.letterbox import Letterbox, Placement
from peace_ros.core.segmentation.fastsam.masks import Segment, assemble, detect
from peace_ros.core.segmentation.fastsam.parameters import FastSamParameters
from peace_ros.core.segmentation.fastsam.scoring import is_usable, term_shares
from peace_ros.core.segmentation.fastsam.selection import Selection, select
from peace_ros.core.segmentation.fusion import calibrated
from peace_ros.core.segmentation.segmenter import BundleSegmenter, SegmentationParameters
from peace_ros.core.segmentation.terms import Terms


class FastSamSegmenter(BundleSegmenter):
    """A Segmenter over a bundle of the family ``fastsam``."""

    FAMILY = 'fastsam'
    ROLES = ('segmenter', 'image_encoder', 'text_encoder')
    MEASURED_WITH = 'softmax'

    def _check_terms(self, terms: Terms, parameters: SegmentationParameters) -> None:  # noqa: ARG002
        if not terms.negative:
            raise ConfigurationError(
                'family fastsam without negative terms would call every segment safe, because '
                'the terms share each segment among them: name negative terms or choose clipseg'
            )

    def _warm_up(self, own: FastSamParameters | None) -> None:
        self._own = own or FastSamParameters()
        self._letterbox = Letterbox(self._manifest.input)
        self._cutter = Cutter(self._manifest.encoder_input, self._own.fastsam_max_segments)
        size = self._manifest.input
        pixels, _ = self._letterbox(np.zeros((size.height, size.width, 3), np.uint8))
        predictions, prototypes = self._sessions['segmenter'].warm_up(
            [contract.PREDICTIONS, contract.PROTOTYPES], {contract.PIXEL_VALUES: pixels}
        )
        self._cell_px = self._checked_cell_px(predictions, prototypes, size)
        # The largest batch: no later frame then waits for memory.
        crops = self._cutter.blank()
        self._sessions['image_encoder'].warm_up(
            [contract.IMAGE_EMBEDDING], {contract.PIXEL_VALUES: crops}
        )

    def _checked_cell_px(
        self, predictions: NDArray[np.float32], prototypes: NDArray[np.float32], size: InputSpec
    ) -> int:
        """Return the input pixels per prototype cell; refuse outputs that do not go together."""
        _, count, height, width = prototypes.shape
        cell_px: int = size.width // max(1, width)
        fits = (width * cell_px, height * cell_px) == (size.width, size.height)
        if predictions.shape[1] != 5 + count or not fits:
            raise self._unusable(
                'segmenter',
                f'{contract.PREDICTIONS} {predictions.shape} and {contract.PROTOTYPES} '
                f'{prototypes.shape} for an input of {size.width} x {size.height} px',
            )
        return cell_px

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the safety of each pixel at network resolution, with the frame's stamp.

        0.5 is the score from which the bundle recommends to call ground safe.

        Ground that no segment covers, or one that was not scored, is not known to be safe: 0.

        Raises ImageError for an image that cannot be used, BundleError for an answer of the
        networks that cannot be used.
        """
        labels, _, safety = self._paint(frame, prompt)
        return Heatmap(calibrated(safety, self.threshold)[labels], frame.stamp_ns)

    def term_maps(self, frame: Frame, prompt: Prompt) -> NDArray[np.float32]:
        """Return one map per term, [T, h, w] float32 0 to 1, in the order of ``terms.all``.

        Where segments overlap, all maps show the scores of the one that ``segment`` shows. On
        unknown ground every term is 0.
        """
        labels, shares, _ = self._paint(frame, prompt)
        return np.ascontiguousarray(shares.T)[:, labels]

    def segments(self, frame: Frame) -> Selection:
        """Return the segments of a frame without scoring them."""
        return self._find(frame)[0]

    def _find(self, frame: Frame) -> tuple[Selection, Placement]:
        pixels, place = self._letterbox(frame.image_rgb)
        predictions, prototypes = self._sessions['segmenter'].run(
            [contract.PREDICTIONS, contract.PROTOTYPES], {contract.PIXEL_VALUES: pixels}
        )
        if not (np.isfinite(predictions).all() and np.isfinite(prototypes).all()):
            raise self._unusable('segmenter', 'boxes or masks that are not finite')
        detections = detect(
            predictions[0],
            min_confidence=self._own.fastsam_min_confidence,
            max_overlap=self._own.fastsam_max_overlap,
        )
        segments = assemble(detections, prototypes[0], self._cell_px, place)
        frame_px = place.width_px * place.height_px
        return select(segments, frame_px, self._own), place

    def _paint(
        self, frame: Frame, prompt: Prompt
    ) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]:
        """Return the labels (see :meth:`Selection.paint`), and of each the terms and the safety.

        h x w; [1 + N, T]; [1 + N]: of unknown ground (label 0) both are zero.
        """
        selection, place = self._find(frame)
        terms = self._embeddings(prompt)
        shares = self._shares(frame, selection.scored, place, terms)
        safety = self._safety(shares)
        if self._own.fastsam_overlap == 'least_safe':
            order = np.argsort(-safety, kind='stable')
        else:
            order = np.arange(len(safety))  # largest first already
        labels = selection.paint(order.tolist(), place.height_px, place.width_px)
        return labels, np.pad(shares, ((1, 0), (0, 0))), np.pad(safety, (1, 0))

    def _shares(
        self, frame: Frame, segments: list[Segment], place: Placement, terms: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        if not segments:
            return np.zeros((0, len(self.terms)), np.float32)
        crops = self._cutter(frame.image_rgb, segments, place)
        (embeddings,) = self._sessions['image_encoder'].run(
            [contract.IMAGE_EMBEDDING], {contract.PIXEL_VALUES: crops}
        )
        if embeddings.shape != (len(segments), terms.shape[1]) or not is_usable(embeddings):
            raise self._unusable('image_encoder', f'embeddings of shape {embeddings.shape}')
        return term_shares(embeddings, terms, self._manifest.logit_scale)

    def _safety(self, shares: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the fused score of each segment, [N] float32, 0 to 1."""
        positive, negative = np.split(shares, [len(self.terms.positive)], axis=1)
        scores = {
            contract.POSITIVE: positive.max(axis=1),
            contract.NEGATIVE: negative.max(axis=1),
            contract.SOFTMAX_POSITIVE: positive.sum(axis=1),
        }
        fused = self._fusion.combine(*(scores[name] for name in self._fusion.outputs))
        return np.clip(fused, np.float32(0.0), np.float32(1.0))

    def _embeddings(self, prompt: Prompt) -> NDArray[np.float32]:
        texts = super()._embeddings(prompt)
        if not is_usable(texts):
            raise self._unusable('text_encoder', 'a text embedding of length zero')
        return texts
