# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which labels a term means, to score it by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.core.word_lists import find_word_lists, read_word_lists

SHIPPED_NAME = 'term_labels.yaml'
_LABELS = tuple(label for label in Label if label != Label.UNLABELED)


def load_term_labels(path: Path | str = SHIPPED_NAME) -> dict[str, frozenset[Label]]:
    """Return word -> labels that it means; raises ConfigurationError."""
    lists = read_word_lists(find_word_lists(path), [label.name.lower() for label in _LABELS])
    words: dict[str, frozenset[Label]] = {}
    for label in _LABELS:
        for word in lists[label.name.lower()]:
            words[word] = words.get(word, frozenset()) | {label}
    return words


def meanings_of(terms: tuple[str, ...], words: dict[str, frozenset[Label]]) -> NDArray[np.bool_]:
    """Return [T, labels]: which labels each term means; a term of unknown words means none.

    A term of several words means what any of them means.
    """
    meanings = np.zeros((len(terms), len(Label)), bool)
    for row, term in enumerate(terms):
        for word in term.split(', '):
            for label in words.get(word, frozenset()):
                meanings[row, label] = True
    return meanings
