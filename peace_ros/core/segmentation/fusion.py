# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From scores for and against landing to one safety score per pixel."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


def set_difference(positive: Array, negative: Array) -> Array:
    """Return Sf = Sp without Sn, equation 2 of the PEACE paper, for fuzzy sets: min(Sp, 1 - Sn).

    All h x w float32, 0 to 1.
    """
    difference: Array = np.minimum(positive, np.float32(1.0) - negative)
    return difference


def soft_difference(positive: Array, negative: Array) -> Array:
    """Return Sp * (1 - Sn): the difference with the product for the intersection.

    Never above :func:`set_difference`; a doubt on either side lowers the score.
    """
    difference: Array = positive * (np.float32(1.0) - negative)
    return difference


def softmax_positive(score: Array) -> Array:
    """Return DOVESEI's score as the network gives it: softmax over all terms, positives summed."""
    return score


def calibrated(safety: Array, threshold: float) -> Array:
    """Return scores in which 0.5 stands where the threshold stood.

    A shift in log-odds: 0, 1 and the order of scores stay. A reader of the heatmap then
    does not need to know which model made it.

    Args:
        safety: h x w float32, 0 to 1.
        threshold: score from which the model's makers call ground safe, 0 < threshold < 1.
    """
    for_safe = safety * np.float32(1.0 - threshold)
    against = (np.float32(1.0) - safety) * np.float32(threshold)
    shifted: Array = for_safe / (for_safe + against)
    return shifted


@dataclass(frozen=True)
class Fusion:
    """A way to make one score, and the network outputs that it needs for that."""

    outputs: tuple[str, ...]
    combine: Callable[..., Array]
    """Takes those outputs in their order, each h x w float32, 0 to 1."""


FUSIONS: Mapping[str, Fusion] = MappingProxyType(
    {
        'set_difference': Fusion(('positive', 'negative'), set_difference),
        'soft': Fusion(('positive', 'negative'), soft_difference),
        'softmax': Fusion(('softmax_positive',), softmax_positive),
    }
)
