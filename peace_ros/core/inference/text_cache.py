# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Text embeddings that were computed before, by (bundle checksum, text)."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import zipfile
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_LOG = logging.getLogger(__name__)

_DAMAGE = (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile)
"""All that numpy.load and zipfile say of a file that is cut short or overwritten."""


class TextCache:
    """Keeps embeddings in memory and, given a folder, on disk for the next process.

    A file holds the text beside its embedding, and the zip container's CRC is checked on
    reading: a damaged file is ignored. The cache never stops the work: when a folder cannot
    be written, that is reported once, and embeddings are kept in memory only.
    """

    def __init__(
        self, checksum: str, width: int, folder: Path | None = None, *, most_in_memory: int = 8192
    ) -> None:
        """Open a cache.

        Args:
            checksum: of the bundle; embeddings of another model are never returned.
            width: D, length of an embedding.
            folder: where files go, below a folder of the checksum; None keeps memory only.
            most_in_memory: number of texts; the one that was unused for longest is dropped first.
        """
        self._width = width
        self._folder = None if folder is None else folder / checksum[:32]
        self._most = most_in_memory
        self._memory: OrderedDict[str, NDArray[np.float32]] = OrderedDict()

    def get(self, text: str) -> NDArray[np.float32] | None:
        """Return the embedding of a text, (D,) float32, or None when it must be computed."""
        embedding = self._memory.get(text)
        if embedding is not None:
            self._memory.move_to_end(text)
            return embedding
        embedding = self._read(text)
        if embedding is not None:
            self._remember(text, embedding)
        return embedding

    def put(self, text: str, embedding: NDArray[np.float32]) -> None:
        """Keep the embedding (D,) of a text."""
        embedding = np.array(embedding, np.float32)
        self._remember(text, embedding)
        if self._folder is None:
            return
        try:
            self._write(self._folder, text, embedding)
        except OSError as error:
            _LOG.warning(
                'text cache %s cannot be written (%s): embeddings are kept in memory only; '
                'choose another cache folder',
                self._folder,
                error.strerror,
            )
            self._folder = None

    def _remember(self, text: str, embedding: NDArray[np.float32]) -> None:
        embedding.setflags(write=False)
        self._memory[text] = embedding
        while len(self._memory) > self._most:
            self._memory.popitem(last=False)

    def _read(self, text: str) -> NDArray[np.float32] | None:
        if self._folder is None:
            return None
        path = self._folder / _file_name(text)
        try:
            with np.load(path, allow_pickle=False) as file:
                embedding = file['embedding']
                same_text = str(file['text']) == text
        except FileNotFoundError:
            return None
        except _DAMAGE as error:
            _LOG.warning('text cache file %s is damaged (%s): computed again', path, error)
            return None
        fits = embedding.shape == (self._width,) and embedding.dtype == np.float32
        if not (same_text and fits and np.isfinite(embedding).all()):
            _LOG.warning('text cache file %s is not for %r: computed again', path, text)
            return None
        return np.asarray(embedding, np.float32)

    @staticmethod
    def _write(folder: Path, text: str, embedding: NDArray[np.float32]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        # Renaming within a folder is atomic: readers see the old file or the whole new one.
        handle, name = tempfile.mkstemp(dir=folder, suffix='.part')
        try:
            with os.fdopen(handle, 'wb') as file:
                np.savez(file, embedding=embedding, text=np.array(text))
            Path(name).replace(folder / _file_name(text))
        except OSError:
            with suppress(OSError):
                Path(name).unlink()
            raise


def _file_name(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest() + '.npz'
