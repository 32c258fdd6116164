# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a model's towers to int8 graphs: measured, smoothed, scaled, rewritten."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from peace_ros.core.domain import Frame
from peace_ros.core.inference.preprocess import Preprocessor
from peace_ros.core.inference.tokenizer import Tokens
from peace_ros.lab.export import pictures
from peace_ros.lab.export.activations import CalibrationInputs, best_scale, products_of, watch
from peace_ros.lab.export.precision import EVERY, MLP, Scale, to_int8
from peace_ros.lab.export.smoothing import smooth
from peace_ros.lab.export.sources import ModelSource
from peace_ros.lab.export.towers import TextTower

_PRODUCTS = {'image_encoder': EVERY, 'decoder': MLP}
"""The decoder's attention is 64 wide: in int8 it gains no time and costs agreement."""
_LARGEST = 127.0


class Quantiser:
    """Prepares towers before they are written, then rewrites their graphs."""

    def __init__(self, source: ModelSource, frames: Sequence[Frame], tokens: Tokens) -> None:
        """Take what the activations are measured on.

        Args:
            source: the reference model.
            frames: images.
            tokens: of the sentences of :mod:`pictures`, for the decoder.
        """
        preprocess = Preprocessor(source.input)
        self._pixels = [torch.from_numpy(preprocess(frame.image_rgb).copy()) for frame in frames]
        self._source = source
        self._tokens = tokens
        self._encoder: nn.Module | None = None
        self._scales: dict[str, dict[str, Scale]] = {}

    def prepare(self, role: str, tower: nn.Module) -> nn.Module:
        """Return a copy of a tower that computes the same and loses less in int8.

        The image encoder must come before the decoder, which is measured on its features.
        """
        if role not in _PRODUCTS:
            return tower
        if role == 'image_encoder':
            self._encoder = tower
        samples = self._samples(role)
        # The weights belong to the reference, which must not change.
        own = copy.deepcopy(tower)
        products = products_of(own, _PRODUCTS[role])
        smooth(own, watch(own, products, samples))
        seen = watch(own, products, samples)
        for path, product in products.items():
            _centre_rounding(product, seen[path])
        self._scales[role] = {path: best_scale(inputs) for path, inputs in seen.items()}
        return own

    def rewrite(self, folder: Path) -> None:
        """Rewrite the graphs of the prepared towers, named by their roles."""
        for role, scales in self._scales.items():
            to_int8(folder / f'{role}.onnx', scales)

    def _samples(self, role: str) -> list[tuple[Tensor, ...]]:
        if role == 'image_encoder' or self._encoder is None:
            return [(pixels,) for pixels in self._pixels]
        tokens, source = self._tokens, self._source
        text = TextTower(source.model.clip, source.vocabulary.end_of_text)
        sides = torch.tensor(pictures.IS_POSITIVE, dtype=torch.float32)
        with torch.no_grad():
            embeddings = text(
                torch.from_numpy(tokens.input_ids), torch.from_numpy(tokens.attention_mask)
            )
            return [(*self._encoder(pixels), embeddings, sides) for pixels in self._pixels]


@torch.no_grad()
def _centre_rounding(product: nn.Linear, inputs: CalibrationInputs) -> None:
    """Let the bias make up for what rounded weights do to the mean of the input."""
    weight = product.weight
    steps = weight.abs().amax(dim=1, keepdim=True).clamp(min=1e-30) / _LARGEST
    lost = weight - torch.round(weight / steps) * steps
    product.bias += lost @ inputs.mean
