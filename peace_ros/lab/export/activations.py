# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What enters the products of a network's layers, and the 8-bit scale that fits it best."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from peace_ros.lab.export.precision import Scale

_ROWS_PER_RUN = 64
"""Of what enters a product, per sample; on these, scales are tried."""
_TIGHTER = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.5)
"""Shares of the range that are tried: cutting off a few far values makes the step finer."""
_LEAST = 1e-6
"""Of a range: what is always zero gets a scale too."""


@dataclass
class CalibrationInputs:
    """What entered one product, over all samples; each range has an entry per channel."""

    low: Tensor
    high: Tensor
    total: Tensor
    rows: int
    kept: list[Tensor] = field(default_factory=list)
    """Some of the rows, [n, C] per sample."""

    @property
    def mean(self) -> Tensor:
        """Mean of each channel."""
        return self.total / self.rows

    def add(self, x: Tensor) -> None:
        """Take in activations [..., C]."""
        flat = x.detach().reshape(-1, x.shape[-1])
        self.low = torch.minimum(self.low, flat.amin(dim=0))
        self.high = torch.maximum(self.high, flat.amax(dim=0))
        self.total = self.total + flat.sum(dim=0)
        self.rows += len(flat)
        # The first row is a picture's class token, which differs most from the rest.
        self.kept.append(flat[:: max(1, len(flat) // _ROWS_PER_RUN)].clone())


def products_of(tower: nn.Module, names: Collection[str]) -> dict[str, nn.Linear]:
    """Return path -> product for those inside the transformer layers that have these names."""
    return {
        path: module
        for path, module in tower.named_modules()
        if isinstance(module, nn.Linear) and 'layers.' in path and path.rpartition('.')[2] in names
    }


def watch(
    tower: nn.Module, products: Mapping[str, nn.Linear], samples: Iterable[Sequence[Tensor]]
) -> dict[str, CalibrationInputs]:
    """Run the samples through the tower and return path -> what entered that product."""
    seen = {}
    with ExitStack() as hooks, torch.no_grad():
        for path, product in products.items():
            blank = torch.zeros(product.in_features)
            inputs = seen[path] = CalibrationInputs(blank + torch.inf, blank - torch.inf, blank, 0)

            def take(
                _: nn.Module, given: tuple[Any, ...], inputs: CalibrationInputs = inputs
            ) -> None:
                inputs.add(given[0])

            hooks.callback(product.register_forward_pre_hook(take).remove)
        for sample in samples:
            tower(*sample)
    return seen


def best_scale(inputs: CalibrationInputs) -> Scale:
    """Return the scale with the least squared error over the values that were kept."""
    values = torch.cat(inputs.kept).flatten()
    low, high = float(inputs.low.min()), float(inputs.high.max())
    is_unsigned = low >= 0.0
    reach = max(-low, high, _LEAST) / (255 if is_unsigned else 127)
    scales = [Scale(share * reach, is_unsigned) for share in _TIGHTER]
    return min(scales, key=lambda scale: _squared_error(values, scale))


def _squared_error(values: Tensor, scale: Scale) -> float:
    again = torch.round(values / scale.step).clamp(*scale.limits) * scale.step
    return float((again - values).square().mean())
