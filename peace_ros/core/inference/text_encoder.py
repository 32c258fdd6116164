# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Texts -> embeddings as the network gives them, each text computed once."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.contract import ATTENTION_MASK, INPUT_IDS, TEXT_EMBEDDING
from peace_ros.core.inference.session import Session
from peace_ros.core.inference.text_cache import TextCache
from peace_ros.core.inference.tokenizer import Tokenizer


class TextEncoder:
    """The tokenizer, text encoder and text cache of a bundle; may be called from any thread."""

    def __init__(self, bundle: Bundle, session: Session, cache_dir: Path | None = None) -> None:
        """Read the tokenizer; raises BundleError."""
        manifest = bundle.manifest
        self._session = session
        self._width = manifest.embedding_width
        self._tokenizer = Tokenizer(bundle.paths['tokenizer'], manifest.context_length)
        self._cache = TextCache(bundle.checksum, manifest.embedding_width, cache_dir)
        self._lock = threading.Lock()

    def __call__(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Return (T, D) float32, not scaled; all texts that are new go through in one batch.

        Raises ConfigurationError for an empty list or a blank text, BundleError when the
        network's answer is not finite.
        """
        with self._lock:
            found = {text: self._cache.get(text) for text in texts}
            missing = [text for text, embedding in found.items() if embedding is None]
            if missing or not texts:
                for text, embedding in zip(missing, self._encode(missing), strict=True):
                    self._cache.put(text, embedding)
                    found[text] = embedding
        return np.stack([np.asarray(found[text], np.float32) for text in texts])

    def unknown_words(self, texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
        """Return text -> its words that the model has never learned; other texts are left out."""
        words = {text: self._tokenizer.unknown_words(text) for text in texts}
        return {text: unknown for text, unknown in words.items() if unknown}

    def _encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        tokens = self._tokenizer(texts)
        feeds = {INPUT_IDS: tokens.input_ids, ATTENTION_MASK: tokens.attention_mask}
        (embeddings,) = self._session.run([TEXT_EMBEDDING], feeds)
        shape = (len(texts), self._width)
        if embeddings.shape != shape or not np.isfinite(embeddings).all():
            raise BundleError(
                f'{self._session.graph.path}: text embeddings of shape {embeddings.shape} for '
                f'{list(texts)}: they must be finite and of shape {shape}; choose another bundle'
            )
        return embeddings
