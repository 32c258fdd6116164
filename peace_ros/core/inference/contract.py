# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tensors that the graphs of each bundle family must have, and the check against them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.manifest import Manifest

PIXEL_VALUES = 'pixel_values'
IMAGE_EMBEDDING = 'image_embedding'
INPUT_IDS = 'input_ids'
ATTENTION_MASK = 'attention_mask'
TEXT_EMBEDDING = 'text_embedding'
IS_POSITIVE = 'is_positive'
POSITIVE = 'positive'
NEGATIVE = 'negative'
SOFTMAX_POSITIVE = 'softmax_positive'
TERM_LOGITS = 'term_logits'
PREDICTIONS = 'predictions'
PROTOTYPES = 'prototypes'

_FLOAT = 'tensor(float)'
_INT64 = 'tensor(int64)'

Size = int | str | None
"""A whole number, a symbol (free when the session runs), or None (unknown)."""


@dataclass(frozen=True)
class Tensor:
    """Name, ONNX Runtime type and shape of a graph's input or output."""

    name: str
    dtype: str
    shape: tuple[Size, ...]


@dataclass(frozen=True)
class Graph:
    """The inputs and outputs of one ONNX file, in the file's order."""

    path: Path
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]


def check_graphs(manifest: Manifest, graphs: Mapping[str, Graph]) -> None:
    """Raise BundleError when a graph (role -> graph) lacks a tensor or has it in another shape."""
    width = manifest.embedding_width
    if 'text_encoder' in graphs:
        text = graphs['text_encoder']
        tokens = [Tensor(name, _INT64, ('B', 'L')) for name in (INPUT_IDS, ATTENTION_MASK)]
        _match(text, 'input', text.inputs, tokens)
        _match(text, 'output', text.outputs, [_tensor(TEXT_EMBEDDING, 'B', width)])
    if 'image_encoder' in graphs:
        image = graphs['image_encoder']
        size = manifest.encoder_input
        # All segments of a frame go through CLIP together, and their number varies.
        batch: Size = 'B' if manifest.family == 'fastsam' else 1
        pixels = _tensor(PIXEL_VALUES, batch, 3, size.height, size.width)
        _match(image, 'input', image.inputs, [pixels])
        if manifest.family != 'clipseg':
            _match(image, 'output', image.outputs, [_tensor(IMAGE_EMBEDDING, batch, width)])
    if 'segmenter' in graphs:
        _check_segmenter(graphs['segmenter'], manifest)
    if 'decoder' in graphs and 'image_encoder' in graphs:
        _check_decoder(graphs['decoder'], graphs['image_encoder'].outputs, width)


def _check_segmenter(segmenter: Graph, manifest: Manifest) -> None:
    size = manifest.input
    wanted = [_tensor(PIXEL_VALUES, 1, 3, size.height, size.width)]
    _match(segmenter, 'input', segmenter.inputs, wanted)
    masks = next((each.shape[1:2] for each in segmenter.outputs if each.name == PROTOTYPES), ())
    rows: Size = 5 + masks[0] if masks and isinstance(masks[0], int) else None
    outputs = [_tensor(PREDICTIONS, 1, rows, None), _tensor(PROTOTYPES, 1, None, None, None)]
    _match(segmenter, 'output', segmenter.outputs, outputs)


def _check_decoder(decoder: Graph, features: Sequence[Tensor], width: int) -> None:
    wanted = [*features, _tensor(TEXT_EMBEDDING, 'T', width), _tensor(IS_POSITIVE, 'T')]
    _match(decoder, 'input', decoder.inputs, wanted)
    outputs = [_tensor(name, None, None) for name in (POSITIVE, NEGATIVE, SOFTMAX_POSITIVE)]
    outputs.append(_tensor(TERM_LOGITS, 'T', None, None))
    _match(decoder, 'output', decoder.outputs, outputs)


def _tensor(name: str, *shape: Size) -> Tensor:
    return Tensor(name, _FLOAT, shape)


def _match(graph: Graph, side: str, have: Sequence[Tensor], wanted: Sequence[Tensor]) -> None:
    by_name = {tensor.name: tensor for tensor in have}
    for want in wanted:
        tensor = by_name.pop(want.name, None)
        if tensor is None:
            raise BundleError(
                f'{graph.path}: no {side} {want.name!r} among {[each.name for each in have]}; '
                f'export it as {_text(want)}'
            )
        if tensor.dtype != want.dtype or not _fits(tensor.shape, want.shape, side):
            raise BundleError(
                f'{graph.path}: {side} {_text(tensor)} must be {_text(want)}; '
                'export the model again or correct the manifest'
            )
    if by_name and side == 'input':
        raise BundleError(
            f'{graph.path}: nothing to feed to input {", ".join(by_name)}; '
            f'its inputs must be {", ".join(_text(want) for want in wanted)}'
        )


def _fits(shape: tuple[Size, ...], wanted: tuple[Size, ...], side: str) -> bool:
    if len(shape) != len(wanted):
        return False
    for size, want in zip(shape, wanted, strict=True):
        if isinstance(want, int):
            # An exporter may leave a fixed axis open; a run then settles it.
            if isinstance(size, int) and size != want:
                return False
        elif isinstance(want, str) and side == 'input' and isinstance(size, int):
            # A number of terms or tokens that is frozen in the file could never vary.
            return False
    return True


def _text(tensor: Tensor) -> str:
    sizes = ', '.join('?' if size is None else str(size) for size in tensor.shape)
    return f'{tensor.name} {tensor.dtype} [{sizes}]'
