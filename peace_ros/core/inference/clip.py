# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CLIP: images and texts in one space, where the cosine tells how well they go together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, Frame
from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES
from peace_ros.core.inference.preprocess import Preprocessor
from peace_ros.core.inference.providers import Footprint, LoadMeter
from peace_ros.core.inference.session import DEFAULT_PROVIDERS, open_sessions
from peace_ros.core.inference.text_encoder import TextEncoder


class ClipEncoder:
    """The image and text encoders of a bundle of the family ``clip``."""

    def __init__(
        self,
        bundle: Bundle,
        *,
        threads: int = 2,
        providers: Sequence[str] = DEFAULT_PROVIDERS,
        cache_dir: Path | None = None,
    ) -> None:
        """Open the bundle's graphs and run the image encoder once.

        Args:
            bundle: of the family ``clip``.
            threads: CPU threads of one operator.
            providers: execution providers of ONNX Runtime, the preferred one first.
            cache_dir: where text embeddings are kept for the next process; None: nowhere.

        Raises:
            BundleError: the bundle is of another family or its graphs do not fit it.
            ConfigurationError: an execution provider is not available.
        """
        bundle.require_family('clip')
        meter = LoadMeter()
        self._sessions = open_sessions(
            bundle, ('image_encoder', 'text_encoder'), threads=threads, providers=providers
        )
        self._text = TextEncoder(bundle, self._sessions['text_encoder'], cache_dir)
        self._preprocess = Preprocessor(bundle.manifest.input)
        size = bundle.manifest.input
        blank = np.zeros((size.height, size.width, 3), np.uint8)
        image = self._sessions['image_encoder']
        image.warm_up([IMAGE_EMBEDDING], {PIXEL_VALUES: self._preprocess(blank)})
        self.footprint: Footprint = meter.read(
            bundle.manifest.name, bundle.manifest.precision, image.providers, threads
        )
        """What the networks run on and take."""

    @property
    def calls(self) -> Mapping[str, int]:
        """Role -> how often its graph ran, without warm-ups."""
        return {role: session.calls for role, session in self._sessions.items()}

    def image_embedding(self, frame: Frame) -> NDArray[np.float32]:
        """Return the embedding of a frame, (D,) float32 of unit length.

        Raises ImageError for an image that is too large, BundleError when the network's answer
        has no direction.
        """
        feeds = {PIXEL_VALUES: self._preprocess(frame.image_rgb)}
        session = self._sessions['image_encoder']
        (embedding,) = session.run([IMAGE_EMBEDDING], feeds)
        unit = _unit_length(embedding, f'{session.graph.path}: image embedding')
        return unit.reshape(-1)

    def text_embeddings(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Return the embeddings of texts, (T, D) float32 of unit length, from the cache if there.

        Raises ConfigurationError for an empty list or a blank text, BundleError as above.
        """
        where = f'{self._sessions["text_encoder"].graph.path}: text embedding'
        return _unit_length(self._text(texts), where)

    def unknown_words(self, texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
        """Return text -> its words that the model has never learned; other texts are left out."""
        return self._text.unknown_words(texts)


def _unit_length(vectors: NDArray[np.float32], where: str) -> NDArray[np.float32]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not (np.isfinite(lengths).all() and (lengths > 0.0).all()):
        raise BundleError(
            f'{where} of length {np.ravel(lengths).tolist()}: it must be finite and not zero; '
            'choose another bundle'
        )
    unit: NDArray[np.float32] = (vectors / lengths).astype(np.float32)
    return unit
