# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The small networks: pyramid encoder, bag-of-words text tower, FiLM decoder, ranker."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from peace_ros.lab.training.backbone import CHANNELS, Backbone

EMBEDDING_WIDTH = 64
FEATURE_CHANNELS = 48
PYRAMID_CHANNELS = 64
DECODER_HIDDEN = 8
CLASS_COUNT = 9
"""Labels without UNLABELED; class index = label - 1."""
_SCALES = 4
_TONES = 10
STRIDE = 4
"""Pixels of the image per cell of the feature map."""


class ConvBn(nn.Sequential):
    """Convolution, batch norm and optionally ReLU; folds into one convolution at export."""

    def __init__(
        self, inputs: int, outputs: int, *, kernel: int = 3, stride: int = 1,
        relu: bool = True,
    ) -> None:  # fmt: skip
        padding = kernel // 2
        layers: list[nn.Module] = [
            nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=False),
            nn.BatchNorm2d(outputs),
        ]
        if relu:
            layers.append(nn.ReLU(inplace=True))
        super().__init__(*layers)


class ImageEncoder(nn.Module):
    """RGB [B, 3, H, W] -> features [B, 48, H/4, W/4]; H and W are multiples of 32.

    A pretrained backbone, a global context vector, and a feature pyramid down to stride 4, into
    which the half-size map is folded for the sake of small things.
    """

    def __init__(self) -> None:
        super().__init__()
        self.backbone = Backbone()
        wide = PYRAMID_CHANNELS
        self.context = nn.Linear(CHANNELS[32], wide)
        self.lateral32 = ConvBn(CHANNELS[32], wide, kernel=1)
        self.lateral16 = ConvBn(CHANNELS[16], wide, kernel=1)
        self.lateral8 = ConvBn(CHANNELS[8], wide, kernel=1)
        self.lateral4 = ConvBn(CHANNELS[4], wide, kernel=1)
        self.fold2 = ConvBn(CHANNELS[2], wide, stride=2)
        self.smooth16 = ConvBn(wide, wide)
        self.smooth8 = ConvBn(wide, wide)
        self.smooth4 = ConvBn(wide, FEATURE_CHANNELS)

    def forward(self, pixels: Tensor) -> Tensor:
        """Encode normalised images."""
        at = self.backbone(pixels)
        context = self.context(at[32].mean(dim=(2, 3)))
        x = self.lateral32(at[32]) + context[:, :, None, None]
        x = self.smooth16(self.lateral16(at[16]) + double(x))
        x = self.smooth8(self.lateral8(at[8]) + double(x))
        return cast('Tensor', self.smooth4(self.lateral4(at[4]) + self.fold2(at[2]) + double(x)))


def double(x: Tensor) -> Tensor:
    """Grow maps [B, C, h, w] to twice the height and width."""
    return functional.interpolate(x, scale_factor=2.0, mode='bilinear', align_corners=False)


def unit(vectors: Tensor) -> Tensor:
    """Return vectors [B, D] of unit length."""
    return vectors / (vectors.square().sum(dim=1, keepdim=True) + 1e-8).sqrt()


class SmallTextTower(nn.Module):
    """Token ids and mask [B, L] -> unit-length embeddings [B, D].

    A bag of words: a gated mean says what the prompt is about, a maximum lets every word of a
    group count, two layers mix them. Word order carries nothing in these prompts.
    """

    def __init__(self, vocabulary_size: int, width: int = EMBEDDING_WIDTH) -> None:
        super().__init__()
        self.words = nn.Embedding(vocabulary_size, width)
        self.gates = nn.Embedding(vocabulary_size, 1)
        nn.init.normal_(self.words.weight, std=0.3)
        nn.init.zeros_(self.gates.weight)
        self.first = nn.Linear(2 * width, 2 * width)
        self.second = nn.Linear(2 * width, width)

    def forward(self, input_ids: Tensor, attention_mask: Tensor) -> Tensor:
        """Embed padded token ids (int64)."""
        mask = attention_mask.to(torch.float32)[:, :, None]
        words = self.words(input_ids)
        gates = torch.exp(self.gates(input_ids)) * mask
        mean = (words * gates).sum(dim=1) / gates.sum(dim=1)
        peak = (words - 1e4 * (1.0 - mask)).amax(dim=1)
        hidden = functional.relu(self.first(torch.cat([mean, peak], dim=1)))
        out = self.second(hidden) + mean
        return unit(out)


class Decoder(nn.Module):
    """Features and prompts -> one logit map per prompt.

    A soft class map is mixed by what a prompt means: the embedding says which of the nine labels
    it stands for, so that a prompt of several things is their union. FiLM refines it for words
    that cut across the labels: scale, shift and read-out weights come from the embedding, and the
    scale is folded into a shared 1 x 1 convolution, so that all prompts are one matrix product.
    """

    def __init__(self, width: int = EMBEDDING_WIDTH) -> None:
        super().__init__()
        self.classes = nn.Conv2d(FEATURE_CHANNELS, CLASS_COUNT, 1)
        self.meaning = nn.Linear(width, CLASS_COUNT)
        self.base = nn.Parameter(torch.randn(DECODER_HIDDEN, FEATURE_CHANNELS) * 0.2)
        self.condition = nn.Sequential(
            nn.Linear(width, 64), nn.ReLU(), nn.Linear(64, 3 * DECODER_HIDDEN + 1)
        )
        # At first the prompts are just their labels.
        last = cast('nn.Linear', self.condition[2])
        nn.init.normal_(last.weight, std=0.01)
        nn.init.zeros_(last.bias)

    def meaning_logits(self, embedding: Tensor) -> Tensor:
        """Return [..., 9]: which labels a prompt stands for."""
        return cast('Tensor', self.meaning(8.0 * embedding))

    def mix(self, class_logits: Tensor, features: Tensor, embedding: Tensor) -> Tensor:
        """[B, 9, h, w], [B, C, h, w] and [B, T, D] -> logits [B, T, h, w]."""
        batch, channels, height, width = features.shape
        terms, cells = embedding.shape[1], height * width
        label = torch.softmax(class_logits, dim=1).reshape(batch, CLASS_COUNT, cells)
        chance = torch.bmm(torch.sigmoid(self.meaning_logits(embedding)), label)
        chance = chance.clamp(1e-3, 1.0 - 1e-3)
        parts = self.condition(embedding * 8.0)
        scale, shift, read, bias = parts.split([DECODER_HIDDEN] * 3 + [1], dim=2)
        folded = (1.0 + scale)[..., None] * self.base
        folded = folded.reshape(batch, terms * DECODER_HIDDEN, channels)
        hidden = torch.bmm(folded, features.reshape(batch, channels, cells))
        hidden = hidden.reshape(batch, terms, DECODER_HIDDEN, cells)
        hidden = functional.relu(hidden + shift[..., None])
        refined = (read[..., None] * hidden).sum(dim=2) + bias
        logits = chance.log() - (1.0 - chance).log() + refined
        return cast('Tensor', logits.reshape(batch, terms, height, width))


class SegmenterNetwork(nn.Module):
    """Encoder, text tower and decoder."""

    def __init__(self, vocabulary_size: int) -> None:
        super().__init__()
        self.encoder = ImageEncoder()
        self.text = SmallTextTower(vocabulary_size)
        self.decoder = Decoder()


class RankerImage(nn.Module):
    """RGB [B, 3, 224, 224] -> embedding [B, D].

    Low-level features separate night from fog and blurred from sharp: the tower reads means and
    spreads of the shallow maps of a pretrained backbone, statistics of colour, and gradients at
    several scales.
    """

    def __init__(self, width: int = EMBEDDING_WIDTH) -> None:
        super().__init__()
        self.backbone = Backbone(deepest=8)
        shallow = sum(CHANNELS[stride] for stride in self.backbone.strides)
        statistics = 2 * shallow + 2 * 3 + _SCALES * 4 * 3 + 2 * _TONES
        self.norm = nn.BatchNorm1d(statistics)
        self.head = nn.Sequential(
            nn.Linear(statistics, 192), nn.ReLU(), nn.Dropout(0.1), nn.Linear(192, width)
        )

    def forward(self, pixels: Tensor) -> Tensor:
        """Embed normalised images."""
        parts = [*_moments(pixels), *_tones(pixels)]
        scaled = pixels
        for _ in range(_SCALES):
            right = (scaled[:, :, :, 1:] - scaled[:, :, :, :-1]).abs()
            down = (scaled[:, :, 1:, :] - scaled[:, :, :-1, :]).abs()
            for slope in (right, down):
                parts += [
                    slope.mean(dim=(2, 3)).clamp(min=1e-4).log(),
                    slope.square().mean(dim=(2, 3)).clamp(min=1e-8).log(),
                ]
            scaled = functional.avg_pool2d(scaled, 2)
        for level in self.backbone(pixels).values():
            parts += _moments(level)
        out = self.head(self.norm(torch.cat(parts, dim=1)))
        return unit(out)


def _tones(pixels: Tensor) -> tuple[Tensor, Tensor]:
    """Return soft histograms [B, tones] of brightness and of colourfulness."""
    brightness = pixels.mean(dim=1)
    colour = pixels.amax(dim=1) - pixels.amin(dim=1)
    histograms = []
    for values, low, high in ((brightness, -1.0, 1.0), (colour, 0.0, 1.0)):
        step = (high - low) / (_TONES - 1)
        parts = [
            (1.0 - (values - (low + tone * step)).abs() / step).clamp(min=0.0).mean(dim=(1, 2))
            for tone in range(_TONES)
        ]
        histograms.append(torch.stack(parts, dim=1))
    return histograms[0], histograms[1]


def _moments(x: Tensor) -> tuple[Tensor, Tensor]:
    mean = x.mean(dim=(2, 3))
    spread = (x - mean[:, :, None, None]).square().mean(dim=(2, 3)) + 1e-6
    return mean, spread.sqrt()


class Pair(nn.Module):
    """A CLIP-like pair: an image tower and a text tower of the same width."""

    def __init__(self, image: nn.Module, vocabulary_size: int, *, most_scale: float) -> None:
        super().__init__()
        self.image = image
        self.text = SmallTextTower(vocabulary_size)
        self.log_scale = nn.Parameter(torch.tensor(2.5))
        self._most_scale = most_scale

    def scale(self) -> Tensor:
        """Return what cosines are multiplied by before a softmax."""
        return self.log_scale.exp().clamp(max=self._most_scale)
