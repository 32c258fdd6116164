# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a place to land on is worth: one list of criteria, multiplied, for every comparison.

In the spirit of DOVESEI's area / perimeter / (distance + 1) per contour: wide ground, in large and
compact pieces rather than small and thin ones, that is surely safe, and near.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.landing.parameters import LandingParameters

Values = float | NDArray[np.floating[Any]]
"""Of one place, or of many: arrays that broadcast to one shape."""


@dataclass(frozen=True)
class Merits:
    """What is known of a place; what is left out speaks neither for nor against it."""

    clearance_m: Values
    """Distance to the nearest ground that is not known to be safe."""
    confidence: Values = 1.0
    """Mean safety score around it, 0 to 1."""
    half_width_m: Values = np.inf
    """Area over perimeter of the connected ground."""
    compactness: Values = 1.0
    """Of the connected ground: 4 pi area over squared perimeter, 1 for a disc."""
    distance_m: Values = 0.0
    """Way to it over the ground."""


class Criterion(NamedTuple):
    """One factor of the worth."""

    name: str
    factor: Callable[[Merits, LandingParameters], Values]


CRITERIA: tuple[Criterion, ...] = (
    Criterion('clearance', lambda m, p: np.minimum(m.clearance_m, p.ample_clearance_m)),
    # 1/4 for ground without width, 1 for ground without end.
    Criterion('width', lambda m, _p: 1.0 - 3.0 / (m.half_width_m + 4.0)),
    # Compactness weighs little: a long lawn is as safe as a round one of its width.
    Criterion('compactness', lambda m, _p: 0.8 + 0.2 * m.compactness),
    # Squared: doubt costs more than distance.
    Criterion('confidence', lambda m, _p: m.confidence * m.confidence),
    Criterion('nearness', lambda m, p: 1.0 / (1.0 + m.distance_m / p.distance_scale_m)),
)


def worth(merits: Merits, parameters: LandingParameters) -> NDArray[np.float32]:
    """Return the product of all criteria: the more the better, 0 without clearance."""
    product: Values = 1.0
    for criterion in CRITERIA:
        product = product * criterion.factor(merits, parameters)
    return np.asarray(product, np.float32)
