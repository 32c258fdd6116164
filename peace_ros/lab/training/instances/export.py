# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From trained networks to a bundle of the family fastsam."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import onnx
import torch
from torch import Tensor, nn

from peace_ros.core.inference.bundle import MANIFEST_NAME, file_entry
from peace_ros.core.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.core.inference.manifest import FORMAT, ROLES_BY_FAMILY
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.export import OPSET, export_text, halve_weights
from peace_ros.lab.training.instances.networks import (
    CROP_PX,
    INPUT_PX,
    InstanceNetwork,
    Matcher,
    anchor_points,
    decode_boxes,
    widen,
)
from peace_ros.lab.training.networks import EMBEDDING_WIDTH
from peace_ros.lab.training.text import CONTEXT_LENGTH, save_tokenizer

if TYPE_CHECKING:
    from pathlib import Path


GROWTH = (0.35, 4.0)
"""Of the boxes: share of their size, and pixels. Masks learn to stop within more than that."""


class SegmenterGraph(nn.Module):
    """The instance network with boxes decoded, as the contract wants it."""

    anchors: Tensor

    def __init__(self, network: InstanceNetwork, shift: float, side_px: int = INPUT_PX) -> None:
        """``shift`` is added to the confidence in log-odds, so that 0.4 is where to cut it."""
        super().__init__()
        self.network = network
        self.shift = shift
        self.register_buffer('anchors', anchor_points(side_px))

    def forward(self, pixels: Tensor) -> tuple[Tensor, Tensor]:
        """Return predictions [1, 5 + K, A] and prototypes [1, K, h, w]."""
        raw = self.network(pixels)
        boxes = widen(decode_boxes(raw.boxes, self.anchors), *GROWTH)
        confidence = (raw.logits + self.shift).sigmoid()[..., None]
        predictions = torch.cat([boxes, confidence, raw.coefficients], dim=2)
        return predictions.transpose(1, 2), raw.prototypes


@dataclass(frozen=True)
class Description:
    """What the manifest says beside the files."""

    provenance: str
    recommended: dict[str, float]
    shift: float = 0.0
    """Of the confidence, in log-odds."""


def export_bundle(
    network: InstanceNetwork, matcher: Matcher, folder: Path, description: Description, *,
    halve: bool = True,
) -> None:  # fmt: skip
    """Write the bundle; ``halve`` stores the weights in half the bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    _export(
        SegmenterGraph(network, description.shift),
        torch.zeros(1, 3, INPUT_PX, INPUT_PX),
        folder / 'segmenter.onnx',
        (PREDICTIONS, PROTOTYPES),
        {},
        halve=halve,
    )
    _export(
        matcher.image,
        torch.zeros(2, 3, CROP_PX, CROP_PX),
        folder / 'image_encoder.onnx',
        (IMAGE_EMBEDDING,),
        {PIXEL_VALUES: {0: 'B'}, IMAGE_EMBEDDING: {0: 'B'}},
        halve=halve,
    )
    export_text(matcher.text, folder / 'text_encoder.onnx', halve=halve)
    save_tokenizer(folder / 'tokenizer.json')
    _write_manifest(folder, float(matcher.scale().detach()), description)


def _export(
    module: nn.Module, pixels: Tensor, path: Path, outputs: tuple[str, ...],
    axes: dict[str, dict[int, str]], *, halve: bool,
) -> None:  # fmt: skip
    with torch.no_grad(), warnings.catch_warnings():
        # The newer exporter needs one more package and unrolls the dynamic axes differently.
        warnings.simplefilter('ignore')
        torch.onnx.export(
            module.eval(),
            (pixels,),
            str(path),
            dynamo=False,
            opset_version=OPSET,
            input_names=[PIXEL_VALUES],
            output_names=list(outputs),
            dynamic_axes=axes,
        )
    graph = onnx.load(str(path))
    if halve:
        halve_weights(graph)
    onnx.checker.check_model(graph)
    onnx.save(graph, str(path))


def _write_manifest(folder: Path, logit_scale: float, description: Description) -> None:
    """The manifest comes last and vouches for every file."""
    roles = {
        role: f'{role}.json' if role == 'tokenizer' else f'{role}.onnx'
        for role in ROLES_BY_FAMILY['fastsam']
    }
    look = {'resize': 'letterbox', 'mean': list(MEAN), 'std': list(STD)}
    values = {
        'format': FORMAT,
        'name': folder.name,
        'family': 'fastsam',
        'roles': roles,
        'input': {'width': INPUT_PX, 'height': INPUT_PX} | look,
        'crop_input': {'width': CROP_PX, 'height': CROP_PX} | look,
        'logit_scale': logit_scale,
        'embedding_width': EMBEDDING_WIDTH,
        'context_length': CONTEXT_LENGTH,
        'precision': 'fp32',
        'files': {name: file_entry(folder / name) for name in roles.values()},
        'licence': 'Apache-2.0',
        'provenance': description.provenance,
        'recommended': description.recommended,
    }
    text = json.dumps(values, indent=2) + '\n'
    (folder / MANIFEST_NAME).write_text(text, encoding='utf-8')
