# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An encoder whose similarities a test dictates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from peace_ros.core.domain import Frame
from peace_ros.core.prompting import Vocabularies


class DictatedEncoder:
    """One axis per word; the next frame's similarities are what the test says."""

    def __init__(self, vocabularies: Vocabularies) -> None:
        every = vocabularies.resolution + vocabularies.frame + vocabularies.environment
        self.axis = {word: index for index, word in enumerate(every)}
        self.scores: Mapping[str, float] = {}
        self.asked: list[list[str]] = []
        self.images = 0

    def text_embeddings(self, texts: Sequence[str]) -> NDArray[np.float32]:
        self.asked.append(list(texts))
        return np.eye(len(self.axis), dtype=np.float32)[[self.axis[text] for text in texts]]

    def image_embedding(self, frame: Frame) -> NDArray[np.float32]:
        self.images += 1
        embedding = np.zeros(len(self.axis), np.float32)
        for word, score in self.scores.items():
            embedding[self.axis[word]] = score
        return embedding


@pytest.fixture
def vocabularies() -> Vocabularies:
    return Vocabularies(
        resolution=('3D', 'rendered', 'blurred'),
        frame=('picture', 'image', 'view'),
        environment=('summer', 'winter', 'spring', 'night'),
    )


@pytest.fixture
def encoder(vocabularies: Vocabularies) -> DictatedEncoder:
    return DictatedEncoder(vocabularies)


@pytest.fixture(scope='session')
def dictate() -> type[DictatedEncoder]:
    """The class itself, for tests that make many."""
    return DictatedEncoder
