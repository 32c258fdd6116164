# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Towers -> ONNX files that honour the contract, in fp32."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from peace_ros.core.inference import contract
from peace_ros.lab.export.decoder import ClipSegDecoderGraph
from peace_ros.lab.export.towers import ClipImageTower, ClipSegImageTower, TextTower

Prepare = Callable[[str, nn.Module], nn.Module]

OPSET = 17
"""The first with LayerNormalization, which keeps fp16 from collapsing."""

_BATCH_AND_LENGTH = {0: 'B', 1: 'L'}
_PER_TERM = {0: 'T'}


def as_it_is(role: str, tower: nn.Module) -> nn.Module:  # noqa: ARG001 - a Prepare
    """Write a tower without change."""
    return tower


def write_clip_graphs(
    reference: Any, folder: Path, *, side_px: int, end_of_text: int, prepare: Prepare = as_it_is
) -> None:
    """Write image_encoder.onnx and text_encoder.onnx of a CLIP model.

    ``prepare`` takes a role and its tower and returns the tower to write instead.
    """
    write_graph(
        prepare('image_encoder', ClipImageTower(reference, side_px)),
        (torch.zeros(1, 3, side_px, side_px),),
        folder / 'image_encoder.onnx',
        (contract.PIXEL_VALUES,),
        (contract.IMAGE_EMBEDDING,),
    )
    _write_text(TextTower(reference, end_of_text), folder)


def write_clipseg_graphs(
    reference: Any, folder: Path, *, side_px: int, end_of_text: int, prepare: Prepare = as_it_is
) -> None:
    """Write image_encoder.onnx, text_encoder.onnx and decoder.onnx of a CLIPSeg model.

    ``prepare`` as above; the image encoder comes first.
    """
    tower = ClipSegImageTower(reference, side_px)
    names = tuple(f'layer_{layer}' for layer in tower.trunk.read_after)
    pixels = torch.zeros(1, 3, side_px, side_px)
    encoder = prepare('image_encoder', tower)
    write_graph(encoder, (pixels,), folder / 'image_encoder.onnx', (contract.PIXEL_VALUES,), names)
    _write_text(TextTower(reference.clip, end_of_text), folder)
    with torch.no_grad():
        features = tower(pixels)
    width = int(reference.config.projection_dim)
    decoder = prepare('decoder', ClipSegDecoderGraph(reference, tower.rows))
    sides = torch.tensor([1.0, 1.0, 0.0])
    write_decoder(decoder, (*features, torch.zeros(3, width), sides), folder, names)


def _write_text(tower: TextTower, folder: Path) -> None:
    ids = torch.full((2, 5), tower.end_of_text)
    write_text_encoder(tower, (ids, torch.ones_like(ids)), folder)


def write_text_encoder(tower: nn.Module, tokens: tuple[Tensor, Tensor], folder: Path) -> None:
    """Write text_encoder.onnx for any number of texts; ``tokens``: ids and mask of some."""
    write_graph(
        tower,
        tokens,
        folder / 'text_encoder.onnx',
        (contract.INPUT_IDS, contract.ATTENTION_MASK),
        (contract.TEXT_EMBEDDING,),
        {
            contract.INPUT_IDS: _BATCH_AND_LENGTH,
            contract.ATTENTION_MASK: _BATCH_AND_LENGTH,
            contract.TEXT_EMBEDDING: {0: 'B'},
        },
    )


def write_decoder(
    decoder: nn.Module, inputs: tuple[Tensor, ...], folder: Path, features: Sequence[str]
) -> None:
    """Write decoder.onnx for any number of terms; the first inputs are called ``features``."""
    write_graph(
        decoder,
        inputs,
        folder / 'decoder.onnx',
        (*features, contract.TEXT_EMBEDDING, contract.IS_POSITIVE),
        (contract.POSITIVE, contract.NEGATIVE, contract.SOFTMAX_POSITIVE, contract.TERM_LOGITS),
        dict.fromkeys(
            (contract.TEXT_EMBEDDING, contract.IS_POSITIVE, contract.TERM_LOGITS), _PER_TERM
        ),
    )


def write_graph(
    module: nn.Module,
    inputs: tuple[Tensor, ...],
    path: Path,
    input_names: Sequence[str],
    output_names: Sequence[str],
    dynamic_axes: Mapping[str, Mapping[int, str]] | None = None,
) -> None:
    """Write a module in evaluation mode as an ONNX graph.

    ``dynamic_axes`` names the axes that may change, by input or output.
    """
    with torch.no_grad(), warnings.catch_warnings():
        # The newer exporter of torch needs one more package and names the axes its own way.
        warnings.simplefilter('ignore')
        torch.onnx.export(
            module.eval(),
            inputs,
            str(path),
            dynamo=False,
            opset_version=OPSET,
            input_names=list(input_names),
            output_names=list(output_names),
            dynamic_axes=dict(dynamic_axes or {}),
        )
