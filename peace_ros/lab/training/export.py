# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From trained networks to bundles: ONNX files, tokenizer, manifest with checksums."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from peace_ros.core.domain import Label
from peace_ros.core.inference import contract
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.lab.export.graphs import write_decoder, write_graph, write_text_encoder
from peace_ros.lab.export.staging import write_manifest
from peace_ros.lab.training import networks
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.batches import encode
from peace_ros.lab.training.sources import FRAME_PX
from peace_ros.lab.training.text import CONTEXT_LENGTH, build_tokenizer

RANKER_PX = 224
_HALF_FROM_ELEMENTS = 64
PEOPLE_TILT = 1.5
"""Added to the logit of people before prompts are read: missed ones cost more than false ones."""
_PEOPLE = slice(Label.PERSON - 1, Label.PERSON)


class DecoderGraph(nn.Module):
    """The decoder with everything that the contract wants computed in the graph."""

    def __init__(self, decoder: networks.Decoder) -> None:
        super().__init__()
        self.decoder = decoder

    def forward(
        self, features: Tensor, text_embedding: Tensor, is_positive: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return positive, negative, softmax_positive [h, w] and term_logits [T, h, w]."""
        classes = widen_people(self.decoder.classes(features))
        coarse = self.decoder.mix(classes, features, text_embedding[None])
        chance = torch.sigmoid(coarse[0])
        side = is_positive[:, None, None]
        positive = (chance * side).amax(dim=0)
        negative = (chance * (1.0 - side)).amax(dim=0)
        softmax_positive = (torch.softmax(coarse[0], dim=0) * side).sum(dim=0)
        # Three maps grow to the size of the image instead of one per term.
        maps = _grow(torch.stack([positive, negative, softmax_positive])[None])[0]
        return maps[0], maps[1], maps[2], _grow(coarse)[0]


def widen_people(class_logits: Tensor) -> Tensor:
    """Tilt class logits [B, 9, h, w] towards people, and let these reach a cell around them."""
    people = functional.max_pool2d(class_logits[:, _PEOPLE], 3, stride=1, padding=1) + PEOPLE_TILT
    before, after = class_logits[:, : _PEOPLE.start], class_logits[:, _PEOPLE.stop :]
    return torch.cat([before, people, after], dim=1)


def _grow(maps: Tensor) -> Tensor:
    return functional.interpolate(
        maps, scale_factor=float(networks.STRIDE), mode='bilinear', align_corners=False
    )


def halve_weights(model: onnx.ModelProto) -> None:
    """Store large weights as float16 with a cast to float32 before their use.

    The runtime folds the casts when it loads the graph, so that only the file is smaller.
    """
    graph = model.graph
    casts = []
    for index, tensor in enumerate(graph.initializer):
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < _HALF_FROM_ELEMENTS:
            continue
        name = tensor.name
        half = numpy_helper.from_array(values.astype(np.float16), f'{name}_half')
        graph.initializer[index].CopyFrom(half)
        casts.append(helper.make_node('Cast', [half.name], [name], to=TensorProto.FLOAT))
    for offset, node in enumerate(casts):
        graph.node.insert(offset, node)


def finish_bundle(
    folder: Path, text: nn.Module, family: str, inputs: dict[str, InputSpec], *, halve: bool,
    **values: Any,
) -> None:  # fmt: skip
    """Add text tower, tokenizer and manifest to the graphs of a bundle that was trained here.

    ``halve`` stores the large weights of all graphs in half the bytes.
    """
    write_text_encoder(text, encode(['grass', 'a road']), folder)
    build_tokenizer().save(str(folder / 'tokenizer.json'))
    for path in folder.glob('*.onnx'):
        graph = onnx.load(str(path))
        if halve:
            halve_weights(graph)
        onnx.checker.check_model(graph)
        onnx.save(graph, str(path))
    write_manifest(
        folder, folder.name, family, inputs, **values, embedding_width=networks.EMBEDDING_WIDTH,
        context_length=CONTEXT_LENGTH, precision='fp32', licence='Apache-2.0',
    )  # fmt: skip


def export_segmenter(
    model: networks.SegmenterNetwork, folder: Path, *, provenance: str,
    recommended: dict[str, float] | None = None, halve: bool = True,
) -> None:  # fmt: skip
    """Write the clipseg bundle."""
    folder.mkdir(parents=True, exist_ok=True)
    pixels = torch.zeros(1, 3, FRAME_PX, FRAME_PX)
    path = folder / 'image_encoder.onnx'
    write_graph(model.encoder, (pixels,), path, (contract.PIXEL_VALUES,), ('features',))
    side = FRAME_PX // networks.STRIDE
    features = torch.zeros(1, networks.FEATURE_CHANNELS, side, side)
    texts, sides = torch.zeros(3, networks.EMBEDDING_WIDTH), torch.tensor([1.0, 0.0, 0.0])
    write_decoder(DecoderGraph(model.decoder), (features, texts, sides), folder, ['features'])
    spec = InputSpec(FRAME_PX, FRAME_PX, 'stretch', MEAN, STD)
    finish_bundle(
        folder, model.text, 'clipseg', {'input': spec}, halve=halve, provenance=provenance,
        recommended=recommended or {},
    )  # fmt: skip


def export_ranker(
    model: networks.Pair, folder: Path, *, provenance: str, halve: bool = True
) -> None:
    """Write the clip bundle."""
    folder.mkdir(parents=True, exist_ok=True)
    pixels = torch.zeros(1, 3, RANKER_PX, RANKER_PX)
    path, names = folder / 'image_encoder.onnx', (contract.PIXEL_VALUES,)
    write_graph(model.image, (pixels,), path, names, (contract.IMAGE_EMBEDDING,))
    spec = InputSpec(RANKER_PX, RANKER_PX, 'stretch', MEAN, STD)
    finish_bundle(
        folder, model.text, 'clip', {'input': spec}, halve=halve, provenance=provenance,
        recommended={},
    )  # fmt: skip
