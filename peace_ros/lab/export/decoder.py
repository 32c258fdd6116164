# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CLIPSeg's decoder for all terms in one batch, with unions and softmax inside the graph."""

from __future__ import annotations

from math import prod
from typing import Any

import torch
from torch import Tensor, nn

from peace_ros.core.domain import BundleError
from peace_ros.lab.export.towers import Layer

_NOT_THIS_SIDE = -1e4
"""Logit of a term that does not belong to the side in question; its sigmoid is 0 in fp16 too."""


class PatchPainter(nn.Module):
    """Decoder tokens -> the logits of each token's patch of pixels.

    CLIPSeg's transposed convolutions have strides as long as their kernels, so every token paints
    a patch of its own: a matrix product. All that follows pixel by pixel (unions, softmax) is then
    done on patches, and only the small result is put in the order of an image.
    """

    def __init__(self, reference: nn.Module, rows: int) -> None:
        """Take the weights of ``transposed_convolution`` for rows x rows tokens."""
        super().__init__()
        self.rows = rows
        steps = list(reference) if isinstance(reference, nn.Sequential) else [reference]
        transposed = [step for step in steps if isinstance(step, nn.ConvTranspose2d)]
        for step in transposed:
            if step.kernel_size != step.stride or any(step.padding):
                raise BundleError(
                    f'transposed convolution with kernel {step.kernel_size} and stride '
                    f'{step.stride}: CLIPSeg has them equal; give a CLIPSeg checkpoint'
                )
        self.blend = steps[0] if len(steps) > 1 else None
        """The 3 x 3 convolution of the refined decoder."""
        self.factors = [int(step.stride[0]) for step in transposed]
        self.paints = nn.ModuleList([_as_linear(step) for step in transposed])

    def forward(self, tokens: Tensor) -> Tensor:
        """[T, rows * rows, C] -> [T, pixels], in the order that :meth:`in_order` undoes."""
        rows, channels = self.rows, int(tokens.shape[2])
        if self.blend is not None:
            grid = tokens.transpose(1, 2).reshape(-1, channels, rows, rows)
            tokens = torch.relu(self.blend(grid)).flatten(2).transpose(1, 2)
        x = tokens
        positions = rows * rows
        for index, (factor, paint) in enumerate(zip(self.factors, self.paints, strict=True)):
            x = paint(torch.relu(x) if index else x)
            positions *= factor * factor
            x = x.reshape(-1, positions, paint.out_features // factor**2)
        return x[:, :, 0]

    def in_order(self, patches: Tensor) -> Tensor:
        """[N, pixels] -> [N, height, width]."""
        sizes = [self.rows, self.rows]
        for factor in self.factors:
            sizes += [factor, factor]
        axes = range(1, 1 + len(sizes))
        side = prod(sizes[::2])
        turned = patches.reshape(-1, *sizes).permute(0, *axes[::2], *axes[1::2])
        return turned.reshape(-1, side, side)


def _as_linear(step: nn.ConvTranspose2d) -> nn.Linear:
    """[in, out, k, k] -> a linear layer whose output runs over (ky, kx, out)."""
    inputs, outputs, height, width = step.weight.shape
    linear = nn.Linear(inputs, height * width * outputs)
    with torch.no_grad():
        linear.weight.copy_(step.weight.permute(2, 3, 1, 0).reshape(-1, inputs))
        bias = torch.zeros(outputs) if step.bias is None else step.bias
        linear.bias.copy_(bias.repeat(height * width))
    return linear


class ClipSegDecoderGraph(nn.Module):
    """Reduced features and text embeddings -> unions, softmax score and the terms' logits."""

    def __init__(self, reference: Any, rows: int) -> None:
        """Take the weights of a CLIPSeg model that sees rows x rows patches."""
        super().__init__()
        decoder = reference.decoder
        self.conditional_layer = int(decoder.conditional_layer)
        self.film_mul = decoder.film_mul
        self.film_add = decoder.film_add
        self.layers = nn.ModuleList([Layer(each, norm_first=False) for each in decoder.layers])
        self.painter = PatchPainter(decoder.transposed_convolution, rows)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Decode.

        Args:
            inputs: the features, shallowest first, each [1, L, C]; text_embedding [T, D];
                is_positive [T].

        Returns:
            positive, negative, softmax_positive [h, w] and term_logits [T, h, w].
        """
        *features, text_embedding, is_positive = inputs
        tokens = self._tokens(features[::-1], text_embedding)
        logits = self.painter(tokens[:, 1:])
        side = is_positive[:, None]
        # Of rising functions the maximum may be taken first: one sigmoid instead of one per term.
        positive = torch.sigmoid((logits + _NOT_THIS_SIDE * (1.0 - side)).amax(dim=0))
        negative = torch.sigmoid((logits + _NOT_THIS_SIDE * side).amax(dim=0))
        softmax_positive = (torch.softmax(logits, dim=0) * side).sum(dim=0)
        first, second, third = (
            self.painter.in_order(each[None])[0] for each in (positive, negative, softmax_positive)
        )
        return first, second, third, self.painter.in_order(logits)

    def _tokens(self, deepest_first: list[Tensor], text_embedding: Tensor) -> Tensor:
        scale = self.film_mul(text_embedding)[:, None, :]
        shift = self.film_add(text_embedding)[:, None, :]
        x: Tensor | None = None
        for index, (features, layer) in enumerate(zip(deepest_first, self.layers, strict=True)):
            x = features if x is None else x + features
            if index == self.conditional_layer:
                x = x * scale + shift
            x = layer(x)
        if x is None:
            raise BundleError('CLIPSeg decoder without layers; give a CLIPSeg checkpoint')
        return x
