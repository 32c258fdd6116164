# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How often CLIP ranks the right condition word first: real frames under ten conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame
from peace_ros.core.inference import ClipEncoder
from peace_ros.simulation.drawing import apply_condition
from peace_ros.simulation.rasters import IMAGE_SUFFIXES, read_photo

CONDITIONS: dict[str, str] = {
    'clear': 'clear',
    'blurred': 'blurred',
    'noisy': 'noise',
    'night': 'night',
    'fog': 'fog',
    'rainy': 'rainy',
    'snowy': 'snowy',
    'rendered': 'rendered',
    'evening': 'evening',
    'cloudy': 'cloudy',
}
"""Word -> the condition of ``simulation.drawing`` for which it is the right one."""
FRAME_PX = 352
Image = NDArray[np.uint8]


@dataclass(frozen=True)
class WordFigures:
    """How often the right word came first."""

    words: tuple[str, ...]
    counts: NDArray[np.int64]
    """[drawn condition, word that came first]."""

    @property
    def right_by_word(self) -> dict[str, float]:
        """Word -> share of the frames under its condition for which it came first."""
        shares = np.diag(self.counts) / np.maximum(self.counts.sum(axis=1), 1)
        return dict(zip(self.words, shares.astype(float).tolist(), strict=True))

    @property
    def right(self) -> float:
        """Mean over the conditions."""
        return float(np.mean(list(self.right_by_word.values())))

    def as_json(self) -> dict[str, object]:
        """Return the figures as written by ``--json``."""
        return {
            'right': self.right,
            'right_by_word': self.right_by_word,
            'frames': int(self.counts.sum()),
            'first_words': {
                word: dict(zip(self.words, row.tolist(), strict=True))
                for word, row in zip(self.words, self.counts, strict=True)
            },
        }


def measure(
    images_rgb: Sequence[Image],
    encoder: ClipEncoder,
    *,
    seed: int = 0,
    strength: float | None = None,
    watch: Callable[[Sequence[Image]], Iterable[Image]] = iter,
) -> WordFigures:
    """Put every image under every condition and rank the ten words.

    Args:
        images_rgb: clear frames, uint8 [H, W, 3].
        encoder: CLIP.
        seed: of the conditions' variation.
        strength: of the conditions, 0 to 1; None varies it between 0.35 and 1.
        watch: yields the images, and may show the progress.
    """
    words = tuple(CONDITIONS)
    texts = encoder.text_embeddings(list(words))
    counts = np.zeros((len(words), len(words)), dtype=np.int64)
    for number, image in enumerate(watch(images_rgb)):
        for row, condition in enumerate(CONDITIONS.values()):
            rng = np.random.default_rng([seed, number, row])
            changed = apply_condition(image, condition, rng, strength=strength)
            embedding = encoder.image_embedding(Frame(changed, 0))
            counts[row, int(np.argmax(texts @ embedding))] += 1
    return WordFigures(words, counts)


def load_frames(folder: Path) -> list[NDArray[np.uint8]]:
    """Return the middle square of every image of a folder and those below, 352 x 352.

    Raises:
        ConfigurationError: there is no image.
        RasterError: an image cannot be read.
    """
    paths = sorted(path for path in folder.rglob('*') if path.suffix.lower() in IMAGE_SUFFIXES)
    if not paths:
        raise ConfigurationError(f'{folder}: no image ({", ".join(IMAGE_SUFFIXES)}) in it')
    return [_frame(path) for path in paths]


def _frame(path: Path) -> NDArray[np.uint8]:
    image = read_photo(path).rgb
    side = min(image.shape[:2])
    top, left = (image.shape[0] - side) // 2, (image.shape[1] - side) // 2
    square = image[top : top + side, left : left + side]
    small = cv2.resize(
        np.ascontiguousarray(square), (FRAME_PX, FRAME_PX), interpolation=cv2.INTER_AREA
    )
    return np.asarray(small, dtype=np.uint8)
