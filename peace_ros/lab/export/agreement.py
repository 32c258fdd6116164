# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How well an exported bundle and its reference agree, and what agreement is needed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError


@dataclass(frozen=True)
class Agreement:
    """Figures of a comparison; a subclass names them and their limits."""

    MOST: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Figure -> its largest value in fp32."""
    LEAST: ClassVar[Mapping[str, float]] = MappingProxyType({'cosine': 0.999, 'iou': 0.98})
    """Figure -> its least value in fp16 and int8."""

    def refuse_if_poor(self, precision: str, what: str) -> None:
        """Raise BundleError when the bundle must not be used."""
        figures = asdict(self)
        if precision == 'fp32':
            is_good = all(figures[name] <= most for name, most in self.MOST.items())
            limits = ', '.join(f'{_plain(name)} at most {most}' for name, most in self.MOST.items())
            remedy = 'export with other versions of torch and of what reads the checkpoint'
        else:
            is_good = all(figures[name] >= least for name, least in self.LEAST.items())
            limits = ', '.join(f'{_plain(name)} at least {low}' for name, low in self.LEAST.items())
            remedy = 'choose a higher precision, or more pictures like those of the flight'
        if not is_good:
            raise BundleError(
                f'{what} in {precision} does not agree with its reference: {self}; needed: '
                f'{limits}. Nothing was written; {remedy}'
            )

    def __str__(self) -> str:
        return ', '.join(f'{_plain(name)} {value:.5g}' for name, value in asdict(self).items())

    def as_numbers(self) -> dict[str, float]:
        """Return what a manifest keeps."""
        return {name: round(float(value), 7) for name, value in asdict(self).items()}


def _plain(name: str) -> str:
    return name.replace('_', ' ').replace('iou', 'IoU')


def cosine(one: NDArray[Any], other: NDArray[Any]) -> float:
    """Return the cosine similarity of two arrays of one shape."""
    flat, flat_other = one.ravel().astype(np.float64), other.ravel().astype(np.float64)
    norms = np.linalg.norm(flat) * np.linalg.norm(flat_other)
    return float(flat @ flat_other / max(norms, 1e-12))


def mask_iou(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Return the IoU of two masks; 1 where both are empty."""
    either = int(np.count_nonzero(one | other))
    return float(np.count_nonzero(one & other) / either) if either else 1.0
