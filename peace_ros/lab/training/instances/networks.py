# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The networks: anchor-free instances with prototype masks, and an encoder of cut-out segments.

Prototypes and coefficients are those of YOLACT (Bolya et al., ICCV 2019), as in YOLOv8-seg and so
in FastSAM.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from peace_ros.lab.training.backbone import CHANNELS, Backbone
from peace_ros.lab.training.networks import CLASS_COUNT, EMBEDDING_WIDTH, ConvBn, double, unit

INPUT_PX = 320
CROP_PX = 64
STRIDES = (8, 16, 32)
"""Pixels per anchor, finest first; anchors are listed row by row, level by level."""
COEFFICIENTS = 32
CELL_PX = 4
"""Pixels per cell of the prototypes."""
_NECK = 64
_DEEP = 96
_MOST_LOG_SIZE = 4.0
_CROPS_DEEPEST = 16
"""Stride of the deepest map of a segment: 4 x 4 cells of it."""
_FROZEN_STAGES = 2
"""Of the backbone: what it learned about edges and colours from ImageNet needs no change."""


def anchor_points(side_px: int) -> Tensor:
    """Return float32 [A, 3]: centre x, y in pixels and stride of each anchor of a square input."""
    rows = []
    for stride in STRIDES:
        centres = (torch.arange(side_px // stride) + 0.5) * stride
        y, x = torch.meshgrid(centres, centres, indexing='ij')
        rows.append(torch.stack([x.flatten(), y.flatten(), torch.full((x.numel(),), stride)], 1))
    return torch.cat(rows).to(torch.float32)


@dataclass(frozen=True)
class Raw:
    """The output of the network for a batch, before it is decoded."""

    boxes: Tensor
    """[B, A, 4]: offset of the centre and logarithm of the size, in strides."""
    logits: Tensor
    """[B, A]: that this anchor predicts an instance."""
    coefficients: Tensor
    """[B, A, K]."""
    prototypes: Tensor
    """[B, K, h, w]."""
    classes: Tensor
    """[B, 9, h, w]: labels; they only teach the features and are not exported."""

    def to_float(self) -> Raw:
        """Leave bfloat16."""
        return Raw(*(getattr(self, field.name).float() for field in fields(self)))


def widen(boxes: Tensor, share: float, pixels: float) -> Tensor:
    """Return boxes (centre x, y, width, height) of sizes grown by a share and by pixels.

    The border of a meadow is hard to predict from its middle, while its mask ends by itself: a box
    that is too large cuts off less.
    """
    return torch.cat([boxes[..., :2], boxes[..., 2:] * (1.0 + share) + pixels], dim=-1)


def decode_boxes(raw: Tensor, anchors: Tensor) -> Tensor:
    """Turn raw boxes [B, A, 4] into centre x, y, width, height in pixels, the sizes positive."""
    points, strides = anchors[:, :2], anchors[:, 2:]
    centres = points + raw[..., :2] * strides
    sizes = raw[..., 2:].clamp(-_MOST_LOG_SIZE, _MOST_LOG_SIZE).exp() * strides
    return torch.cat([centres, sizes], dim=-1)


class Residual(nn.Module):
    """Two 3 x 3 convolutions around a skip."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = ConvBn(channels, channels)
        self.second = ConvBn(channels, channels, relu=False)

    def forward(self, x: Tensor) -> Tensor:
        """Keep the shape."""
        return functional.relu(x + self.second(self.first(x)))


class Trunk(nn.Module):
    """RGB [B, 3, S, S] -> feature maps of 64 channels at the strides 4, 8, 16, 32."""

    def __init__(self) -> None:
        super().__init__()
        self.backbone = Backbone(deepest=16)
        self.freeze(_FROZEN_STAGES)
        self.deep = nn.Sequential(ConvBn(CHANNELS[16], _DEEP, stride=2), Residual(_DEEP))
        self.context = nn.Linear(_DEEP, _DEEP)
        self.lateral32 = ConvBn(_DEEP, _NECK, kernel=1)
        self.lateral16 = ConvBn(CHANNELS[16], _NECK, kernel=1)
        self.lateral8 = ConvBn(CHANNELS[8], _NECK, kernel=1)
        self.lateral4 = ConvBn(CHANNELS[4], _NECK, kernel=1)
        self.smooth8 = ConvBn(_NECK, _NECK)
        self.smooth4 = ConvBn(_NECK, _NECK)

    def freeze(self, stages: int) -> None:
        """Do not train the stem and this many stages of the backbone."""
        self.frozen = (self.backbone.stem, *self.backbone.stages[:stages])
        for part in self.frozen:
            part.requires_grad_(False)

    def train(self, mode: bool = True) -> Trunk:
        """Keep the statistics of the frozen part."""
        super().train(mode)
        for part in self.frozen:
            part.eval()
        return self

    def forward(self, pixels: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Encode normalised images."""
        maps = self.backbone(pixels)
        deep = self.deep(maps[16])
        context = self.context(deep.mean(dim=(2, 3)))
        at32 = self.lateral32(functional.relu(deep + context[:, :, None, None]))
        at16 = self.lateral16(maps[16]) + double(at32)
        at8 = self.smooth8(self.lateral8(maps[8]) + double(at16))
        at4 = self.smooth4(self.lateral4(maps[4]) + double(at8))
        return at4, at8, at16, at32


class InstanceNetwork(nn.Module):
    """RGB [B, 3, S, S], S a multiple of 32 -> :class:`Raw`."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk = Trunk()
        self.box_tower = nn.Sequential(ConvBn(_NECK, _NECK), ConvBn(_NECK, _NECK))
        self.mask_tower = nn.Sequential(ConvBn(_NECK, _NECK), ConvBn(_NECK, _NECK))
        self.box = nn.Conv2d(_NECK, 4, 1)
        self.logit = nn.Conv2d(_NECK, 1, 1)
        self.coefficient = nn.Conv2d(_NECK, COEFFICIENTS, 1)
        self.prototype = nn.Conv2d(_NECK, COEFFICIENTS, 1)
        self.classes = nn.Conv2d(_NECK, CLASS_COUNT, 1)
        # At first one anchor in fifty predicts an instance, two strides wide.
        nn.init.constant_(cast('Tensor', self.logit.bias), -4.0)
        nn.init.constant_(cast('Tensor', self.box.bias)[2:], 0.7)

    def forward(self, pixels: Tensor) -> Raw:
        """Find the instances of normalised images."""
        at4, *levels = self.trunk(pixels)
        boxes, logits, coefficients = [], [], []
        for level in levels:
            place, look = self.box_tower(level), self.mask_tower(level)
            boxes.append(self.box(place).flatten(2))
            logits.append(self.logit(place).flatten(2))
            coefficients.append(self.coefficient(look).flatten(2))
        return Raw(
            torch.cat(boxes, dim=2).transpose(1, 2),
            torch.cat(logits, dim=2)[:, 0],
            torch.cat(coefficients, dim=2).transpose(1, 2),
            self.prototype(at4),
            self.classes(at4),
        )


class CropEncoder(nn.Module):
    """Cut-out segments [B, 3, 64, 64], zero around them -> embeddings [B, D] of unit length.

    A backbone that knows the ground from above looks at them. Means, spreads and maxima of its
    maps are taken over the segment alone, beside its own colours and shape.
    """

    def __init__(self, width: int = EMBEDDING_WIDTH) -> None:
        super().__init__()
        self.backbone = Backbone(deepest=_CROPS_DEEPEST)
        channels = sum(CHANNELS[stride] for stride in self.backbone.strides)
        statistics = 6 + 1 + 2 * channels + CHANNELS[_CROPS_DEEPEST]
        self.norm = nn.BatchNorm1d(statistics)
        self.head = nn.Sequential(
            nn.Linear(statistics, 128), nn.ReLU(), nn.Dropout(0.1), nn.Linear(128, width)
        )

    def forward(self, pixels: Tensor) -> Tensor:
        """Embed segments, at least one pixel each."""
        return self.describe(pixels, self.backbone(pixels).values())

    def describe(self, pixels: Tensor, maps: Iterable[Tensor]) -> Tensor:
        """Embed segments whose maps of the backbone, finest first, are known."""
        shown = (pixels.abs().sum(dim=1, keepdim=True) > 0.0).to(pixels.dtype)
        parts = [*_moments(pixels, shown), shown.mean(dim=(2, 3))]
        for x in maps:
            shown = functional.max_pool2d(shown, 2)
            parts += _moments(x, shown)
        # What shows in one place only: a car in a yard.
        parts.append((x - 1e4 * (1.0 - shown)).amax(dim=(2, 3)))
        out = self.head(self.norm(torch.cat(parts, dim=1)))
        return unit(out)


def _moments(x: Tensor, shown: Tensor) -> tuple[Tensor, Tensor]:
    """Return mean and spread of each channel where the segment is shown."""
    count = shown.sum(dim=(2, 3)).clamp(min=1.0)
    mean = (x * shown).sum(dim=(2, 3)) / count
    variance = ((x - mean[:, :, None, None]).square() * shown).sum(dim=(2, 3)) / count
    return mean, (variance + 1e-6).sqrt()
