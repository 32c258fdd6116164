# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes activations easy to quantise, by arithmetic on the weights alone.

What enters a product is shifted by its mean and divided, channel by channel, so that no channel
stands out; the product's weights and bias take the inverse, and whatever came before (LayerNorm,
the value projection, the first product of a ReLU pair) gives the shifted and divided values right
away. The network computes what it did before. The division moves difficulty from activations to
weights, as in SmoothQuant (Xiao et al. 2023). How much of it, if any, is tried for every product: a
strong channel may be the one that matters. The shift comes first, since the outliers of vision
transformers lie mostly on one side of their channel.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from peace_ros.lab.export.activations import CalibrationInputs
from peace_ros.lab.export.towers import Layer

_LEAST = 1e-5
"""Of a channel's range: channels that are always zero are not amplified."""
_STRENGTHS = (0.0, 0.25, 0.5)
"""Exponents of the division; 0: none, 0.5: shared evenly between input and weights."""


class Evened(nn.Module):
    """``(x - shift) / divisor``, where nothing before can take it over."""

    def __init__(self, shift: Tensor, divisor: Tensor) -> None:
        super().__init__()
        self.gain = nn.Parameter(1.0 / divisor)
        self.offset = nn.Parameter(-shift / divisor)

    def forward(self, x: Tensor) -> Tensor:
        """Keep the shape [..., C]."""
        return x * self.gain + self.offset


@torch.no_grad()
def smooth(tower: nn.Module, seen: Mapping[str, CalibrationInputs]) -> None:
    """Rewrite the layers of a tower in place; it must own its weights.

    Args:
        tower: with :class:`~peace_ros.lab.export.towers.Layer` in it.
        seen: path of a product -> what enters it; products without an entry do not change.
    """
    for path, layer in tower.named_modules():
        if not isinstance(layer, Layer):
            continue
        into = f'{path}.attention.project_in'
        if layer.norm_first and into in seen:
            _through_norm(layer.norm1, layer.attention.project_in, seen[into])
        out = f'{path}.attention.project_out'
        if out in seen:
            _through_values(layer, seen[out])
        wide = f'{path}.widen'
        if wide in seen and layer.norm_first:
            _through_norm(layer.norm2, layer.widen, seen[wide])
        elif wide in seen:
            # The residual needs the unchanged output of the norm.
            layer.before_widen = Evened(*_absorb(layer.widen, seen[wide]))
        narrow = f'{path}.narrow'
        if narrow in seen and isinstance(layer.activation, nn.ReLU):
            _through_relu(layer, seen[narrow])


def _absorb(product: nn.Linear, inputs: CalibrationInputs) -> tuple[Tensor, Tensor]:
    """Let a product take ``(x - shift) / divisor`` instead of x; returns the two."""
    shift = inputs.mean
    reach = torch.maximum(inputs.high - shift, shift - inputs.low)
    divisor = _divisor(torch.cat(inputs.kept) - shift, reach, product, most=127.0)
    product.bias += product.weight @ shift
    product.weight *= divisor
    return shift, divisor


def _divisor(rows: Tensor, reach: Tensor, product: nn.Linear, *, most: float) -> Tensor:
    """Return the divisor of each channel with which the product loses least in int8.

    Args:
        rows: what enters, [n, C], already shifted.
        reach: largest magnitude of each channel, [C].
        product: with the weights that the rows meet.
        most: largest integer of an activation.
    """
    weights = product.weight.abs().amax(dim=0).clamp(min=_LEAST)
    ratio = (reach / weights).clamp(min=_LEAST)
    wanted = rows @ product.weight.T
    best, least = torch.ones_like(ratio), float('inf')
    for strength in _STRENGTHS:
        divisor = ratio**strength
        # The scale of all channels together is the quantiser's.
        divisor = divisor / divisor.log().mean().exp()
        step = (reach / divisor).max().clamp(min=_LEAST) / most
        weight = product.weight * divisor
        steps = weight.abs().amax(dim=1, keepdim=True).clamp(min=_LEAST) / 127.0
        found = _rounded(rows / divisor, step) @ _rounded(weight, steps).T
        error = float((found - wanted).square().mean())
        if error < least:
            best, least = divisor, error
    return best


def _rounded(values: Tensor, step: Tensor) -> Tensor:
    return torch.round(values / step) * step


def _through_norm(norm: nn.LayerNorm, product: nn.Linear, inputs: CalibrationInputs) -> None:
    shift, divisor = _absorb(product, inputs)
    norm.bias.copy_((norm.bias - shift) / divisor)
    norm.weight /= divisor


def _through_values(layer: Layer, inputs: CalibrationInputs) -> None:
    """Attention mixes values with weights that sum to one: shifts and divisors pass through."""
    attention = layer.attention
    shift, divisor = _absorb(attention.project_out, inputs)
    values = slice(2 * attention.width, None)
    bias, weight = attention.project_in.bias, attention.project_in.weight
    bias[values] = (bias[values] - shift) / divisor
    weight[values] /= divisor[:, None]


def _through_relu(layer: Layer, inputs: CalibrationInputs) -> None:
    divisor = _divisor(torch.cat(inputs.kept), inputs.high, layer.narrow, most=255.0)
    layer.narrow.weight *= divisor
    layer.widen.weight /= divisor[:, None]
    layer.widen.bias /= divisor
