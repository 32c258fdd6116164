# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A network of FastSAM's true size with random weights: same speed, no download.

Written after the published description of YOLOv8's instance segmentation (three strides, split
blocks, distributional boxes, mask prototypes), with batch normalisation folded into the
convolutions, as every exporter leaves it. For benchmarks and tests; it reads no checkpoint.
"""

from __future__ import annotations

from math import ceil

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.export.pictures import draw_pictures, plain_pixels

MASKS = 32
STRIDES_PX = (8, 16, 32)
_CELL_PX = 4
_BINS = 16
_SIZES = {'s': (1 / 3, 0.5, 1024), 'x': (1.0, 1.25, 512)}
"""Depth and width factors, and the widest layer before the factor."""
_CALM = 0.25
"""Size of what a step adds and of what a head gives; everything else is about one."""
_FAINT = 1e-30
"""Too small to change a planted value, but not zero: an optimiser must not remove the product."""


def random_fastsam(size: str = 's', *, side_px: int = 640, planted: int = 0, seed: int = 0) -> Yolo:
    """Return the network of FastSAM-s or FastSAM-x.

    Args:
        size: ``s`` or ``x``.
        side_px: of the square input.
        planted: random weights find nothing, so this many ellipses can replace the answer of the
            network; it is computed all the same.
        seed: of the weights and the ellipses.
    """
    if size not in _SIZES:
        raise ConfigurationError(f'FastSAM {size!r}: choose one of {", ".join(_SIZES)}')
    torch.manual_seed(seed)
    network = Yolo(*_SIZES[size], side_px).eval()
    with torch.no_grad():
        draw_weights(network)
    if planted:
        network.plant(*plant_ellipses(planted, side_px, seed))
    return network


def draw_weights(network: Yolo) -> None:
    """Draw the weights so that the output of every layer is about one, as in trained networks.

    Layer by layer, while a picture runs through (D. Mishkin, J. Matas, All you need is a good init,
    ICLR 2016). Otherwise the deeper network exceeds the range of fp16. Steps that add to
    what passes are smaller, or a network this deep would amplify rounding errors.
    """
    sizes: dict[nn.Module, float] = {}
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
            sizes.setdefault(module, 1.0)
            module.weight.normal_()
            if module.bias is not None:
                module.bias.zero_()
        elif isinstance(module, _SplitBlock) and module.add:
            sizes |= {step[-1][0]: _CALM for step in module.steps}
    sizes |= {head[-1]: _CALM for each in network.head_lists for head in each}

    def level(layer: nn.Conv2d, _: tuple[torch.Tensor, ...], answer: torch.Tensor) -> torch.Tensor:
        factor = sizes[layer] / (answer.square().mean().sqrt() + 1e-6)
        layer.weight.mul_(factor)
        return answer * factor

    hooks = [layer.register_forward_hook(level) for layer in sizes]
    (pixels,) = plain_pixels(draw_pictures(1), network.side_px)
    network(torch.from_numpy(pixels))
    for hook in hooks:
        hook.remove()


class Yolo(nn.Module):
    """Float [1, 3, side, side], RGB 0 to 1 -> predictions and prototypes of the contract."""

    def __init__(self, depth: float, width: float, widest: int, side_px: int) -> None:
        super().__init__()
        w1, w2, w3, w4, w5 = (
            ceil(min(each, widest) * width / 8) * 8 for each in (64, 128, 256, 512, 1024)
        )
        few, many = max(1, round(3 * depth)), max(1, round(6 * depth))
        self.side_px = side_px
        self.start = nn.Sequential(
            _conv(3, w1, 3, 2),
            _conv(w1, w2, 3, 2),
            _SplitBlock(w2, w2, few, add=True),
            _conv(w2, w3, 3, 2),
            _SplitBlock(w3, w3, many, add=True),
        )
        self.middle = nn.Sequential(_conv(w3, w4, 3, 2), _SplitBlock(w4, w4, many, add=True))
        self.end = nn.Sequential(
            _conv(w4, w5, 3, 2), _SplitBlock(w5, w5, few, add=True), _Pyramid(w5)
        )
        self.up_middle = _SplitBlock(w5 + w4, w4, few)
        self.up_start = _SplitBlock(w4 + w3, w3, few)
        self.down_start = _conv(w3, w3, 3, 2)
        self.down_middle = _SplitBlock(w3 + w4, w4, few)
        self.down_end = _conv(w4, w4, 3, 2)
        self.last = _SplitBlock(w4 + w5, w5, few)
        levels = (w3, w4, w5)
        self.boxes = _heads(levels, max(16, w3 // 4, 4 * _BINS), 4 * _BINS)
        self.confidences = _heads(levels, w3, 1)
        self.coefficients = _heads(levels, max(w3 // 4, MASKS), MASKS)
        self.head_lists = (self.boxes, self.confidences, self.coefficients)
        self.prototypes = nn.Sequential(
            _conv(w3, w3, 3), nn.ConvTranspose2d(w3, w3, 2, 2), _conv(w3, w3, 3), _conv(w3, MASKS)
        )
        self.register_buffer('bins', torch.arange(_BINS, dtype=torch.float32).view(1, 1, -1, 1))
        centres, strides = _anchors(side_px)
        self.register_buffer('centres', torch.from_numpy(centres))
        self.register_buffer('strides', torch.from_numpy(strides))
        self.is_planted = False

    def plant(self, predictions: NDArray[np.float32], prototypes: NDArray[np.float32]) -> None:
        """Give this answer for every image."""
        self.register_buffer('planted_predictions', torch.from_numpy(predictions))
        self.register_buffer('planted_prototypes', torch.from_numpy(prototypes))
        self.is_planted = True

    def forward(self, pixels: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return predictions [1, 5 + MASKS, A] and prototypes [1, MASKS, h, w]."""
        fine = self.start(pixels)
        medium = self.middle(fine)
        coarse = self.end(medium)
        up = self.up_middle(torch.cat([_twice(coarse), medium], 1))
        first = self.up_start(torch.cat([_twice(up), fine], 1))
        second = self.down_middle(torch.cat([self.down_start(first), up], 1))
        third = self.last(torch.cat([self.down_end(second), coarse], 1))
        levels = (first, second, third)
        boxes = self._decoded(_flat(self.boxes, levels))
        confidences = _flat(self.confidences, levels).sigmoid()
        predictions = torch.cat([boxes, confidences, _flat(self.coefficients, levels)], 1)
        prototypes = self.prototypes(first)
        if self.is_planted:
            predictions = predictions * _FAINT + self.planted_predictions
            prototypes = prototypes * _FAINT + self.planted_prototypes
        return predictions, prototypes

    def _decoded(self, logits: torch.Tensor) -> torch.Tensor:
        """Turn distributions of the distances to the four sides into boxes [1, 4, A], pixels."""
        distances = (logits.view(1, 4, _BINS, -1).softmax(2) * self.bins).sum(2)
        low, high = distances.chunk(2, 1)
        centre = self.centres + (high - low) / 2
        return torch.cat([centre, low + high], 1) * self.strides


class _SplitBlock(nn.Module):
    """Half of the channels pass, half go through steps; the output of each step is kept."""

    def __init__(self, inputs: int, outputs: int, steps: int, *, add: bool = False) -> None:
        super().__init__()
        half = outputs // 2
        self.enter = _conv(inputs, outputs)
        self.steps = nn.ModuleList(
            nn.Sequential(_conv(half, half, 3), _conv(half, half, 3)) for _ in range(steps)
        )
        self.leave = _conv((2 + steps) * half, outputs)
        self.add = add

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        parts = list(self.enter(features).chunk(2, 1))
        for step in self.steps:
            made = step(parts[-1])
            parts.append(parts[-1] + made if self.add else made)
        return self.leave(torch.cat(parts, 1))


class _Pyramid(nn.Module):
    """Maxima over ever larger surroundings, beside each other."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.enter, self.leave = _conv(width, width // 2), _conv(2 * width, width)
        self.pool = nn.MaxPool2d(5, 1, 2)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        parts = [self.enter(features)]
        for _ in range(3):
            parts.append(self.pool(parts[-1]))
        return self.leave(torch.cat(parts, 1))


def _conv(inputs: int, outputs: int, kernel: int = 1, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2), nn.SiLU())


def _heads(levels: tuple[int, ...], width: int, outputs: int) -> nn.ModuleList:
    return nn.ModuleList(
        nn.Sequential(_conv(each, width, 3), _conv(width, width, 3), nn.Conv2d(width, outputs, 1))
        for each in levels
    )


def _flat(heads: nn.ModuleList, levels: tuple[torch.Tensor, ...]) -> torch.Tensor:
    parts = [head(each).flatten(2) for head, each in zip(heads, levels, strict=True)]
    return torch.cat(parts, 2)


def _twice(features: torch.Tensor) -> torch.Tensor:
    return nn.functional.interpolate(features, scale_factor=2.0, mode='nearest')


def _anchors(side_px: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the cells' centres [1, 2, A] in cells and their strides [1, 1, A] in pixels."""
    centres, strides = [], []
    for stride in STRIDES_PX:
        cells = np.arange(side_px // stride, dtype=np.float32) + np.float32(0.5)
        grid = np.stack(np.meshgrid(cells, cells), 0).reshape(2, -1)
        centres.append(grid)
        strides.append(np.full(grid.shape[1], stride, np.float32))
    return np.concatenate(centres, 1)[None], np.concatenate(strides)[None, None]


def plant_ellipses(
    count: int, side_px: int, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return predictions [1, 5 + MASKS, A] and prototypes [1, MASKS, h, w] of ellipses.

    They lie in the middle three quarters of the rows, where a frame of 4 : 3 is.
    """
    rng = np.random.default_rng(seed)
    cells = side_px // _CELL_PX
    along = (np.arange(cells, dtype=np.float32) + np.float32(0.5)) / cells * 2 - 1
    x, y = np.meshgrid(along, along)
    prototypes = np.zeros((1, MASKS, cells, cells), np.float32)
    prototypes[0, :5] = np.stack([np.ones_like(x), x, y, x**2, y**2])
    anchors = sum((side_px // stride) ** 2 for stride in STRIDES_PX)
    predictions = np.zeros((1, 5 + MASKS, anchors), np.float32)
    for index in rng.choice(anchors, count, replace=False):
        half = rng.uniform(0.1, 0.35, 2)
        centre = rng.uniform(-1.0, 1.0, 2) * ((1.0, 0.75) - half)
        steepness = 8.0
        bend = -steepness / half**2
        offset = steepness + (bend * centre**2).sum()
        coefficients = [offset, *(-2.0 * bend * centre), *bend]
        box = [*((centre + 1.0) * side_px / 2), *(half * side_px)]
        predictions[0, :10, index] = [*box, rng.uniform(0.5, 0.95), *coefficients]
    return predictions, prototypes
