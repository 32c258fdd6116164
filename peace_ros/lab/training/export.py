# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From trained networks to bundles: ONNX files, tokenizer, manifest with checksums."""

from __future__ import annotations

import json
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from peace_ros.core.domain import Label
from peace_ros.core.inference.bundle import file_entry
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.networks import (
    EMBEDDING_WIDTH,
    FEATURE_CHANNELS,
    STRIDE,
    Decoder,
    Ranker,
    SegmenterNetwork,
)
from peace_ros.lab.training.sources import FRAME_PX
from peace_ros.lab.training.text import CONTEXT_LENGTH, build_tokenizer, save_tokenizer

if TYPE_CHECKING:
    from pathlib import Path

OPSET = 17
RANKER_PX = 224
_HALF_FROM_ELEMENTS = 64
_BATCH_AND_LENGTH = {0: 'B', 1: 'L'}
PEOPLE_TILT = 1.5
"""Added to the logit of people before prompts are read: missed ones cost more than false ones."""
_PEOPLE = slice(Label.PERSON - 1, Label.PERSON)


class DecoderGraph(nn.Module):
    """The decoder with everything that the contract wants computed in the graph."""

    def __init__(self, decoder: Decoder) -> None:
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
        maps, scale_factor=float(STRIDE), mode='bilinear', align_corners=False
    )


def _export(
    module: nn.Module, inputs: tuple[Tensor, ...], path: Path, names: tuple[str, ...],
    outputs: tuple[str, ...], axes: dict[str, dict[int, str]], *, halve: bool,
) -> None:  # fmt: skip
    with warnings.catch_warnings():
        # The newer exporter needs one more package and unrolls the dynamic axes differently.
        warnings.simplefilter('ignore')
        torch.onnx.export(
            module.eval(),
            inputs,
            str(path),
            dynamo=False,
            opset_version=OPSET,
            input_names=list(names),
            output_names=list(outputs),
            dynamic_axes=axes,
        )
    graph = onnx.load(str(path))
    if halve:
        halve_weights(graph)
    onnx.checker.check_model(graph)
    onnx.save(graph, str(path))


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


def export_text(text: nn.Module, path: Path, *, halve: bool = True) -> None:
    """Write a text tower."""
    encoded = build_tokenizer().encode_batch(['grass', 'a road'])
    ids = torch.tensor([each.ids for each in encoded])
    mask = torch.tensor([each.attention_mask for each in encoded])
    _export(
        text,
        (ids, mask),
        path,
        ('input_ids', 'attention_mask'),
        ('text_embedding',),
        {
            'input_ids': _BATCH_AND_LENGTH,
            'attention_mask': _BATCH_AND_LENGTH,
            'text_embedding': {0: 'B'},
        },
        halve=halve,
    )


def export_segmenter(
    model: SegmenterNetwork, folder: Path, *, provenance: str, recommended: dict[str, float],
    halve: bool = True,
) -> None:  # fmt: skip
    """Write the clipseg bundle; ``halve`` stores the weights in half the bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    pixels = torch.zeros(1, 3, FRAME_PX, FRAME_PX)
    _export(model.encoder, (pixels,), folder / 'image_encoder.onnx', ('pixel_values',),
            ('features',), {}, halve=halve)  # fmt: skip
    export_text(model.text, folder / 'text_encoder.onnx', halve=halve)
    side = FRAME_PX // STRIDE
    _export(
        DecoderGraph(model.decoder),
        (
            torch.zeros(1, FEATURE_CHANNELS, side, side),
            torch.zeros(3, EMBEDDING_WIDTH),
            torch.tensor([1.0, 0.0, 0.0]),
        ),
        folder / 'decoder.onnx',
        ('features', 'text_embedding', 'is_positive'),
        ('positive', 'negative', 'softmax_positive', 'term_logits'),
        {'text_embedding': {0: 'T'}, 'is_positive': {0: 'T'}, 'term_logits': {0: 'T'}},
        halve=halve,
    )
    roles = {
        'image_encoder': 'image_encoder.onnx',
        'text_encoder': 'text_encoder.onnx',
        'decoder': 'decoder.onnx',
        'tokenizer': 'tokenizer.json',
    }
    write_manifest(folder, 'clipseg', roles, FRAME_PX, provenance, recommended)


def export_ranker(
    model: Ranker, folder: Path, *, provenance: str, recommended: dict[str, float],
    halve: bool = True,
) -> None:  # fmt: skip
    """Write the clip bundle; ``halve`` stores the weights in half the bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    pixels = torch.zeros(1, 3, RANKER_PX, RANKER_PX)
    _export(model.image, (pixels,), folder / 'image_encoder.onnx', ('pixel_values',),
            ('image_embedding',), {}, halve=halve)  # fmt: skip
    export_text(model.text, folder / 'text_encoder.onnx', halve=halve)
    roles = {
        'image_encoder': 'image_encoder.onnx',
        'text_encoder': 'text_encoder.onnx',
        'tokenizer': 'tokenizer.json',
    }
    write_manifest(folder, 'clip', roles, RANKER_PX, provenance, recommended)


def write_manifest(
    folder: Path, family: str, roles: dict[str, str], side_px: int, provenance: str,
    recommended: dict[str, float],
) -> None:  # fmt: skip
    """Write tokenizer and manifest; the manifest comes last and vouches for every file."""
    save_tokenizer(folder / roles['tokenizer'])
    files = {name: file_entry(folder / name) for name in roles.values()}
    manifest: dict[str, Any] = {
        'format': 1,
        'name': folder.name,
        'family': family,
        'roles': roles,
        'input': {
            'width': side_px,
            'height': side_px,
            'resize': 'stretch',
            'mean': list(MEAN),
            'std': list(STD),
        },
        'embedding_width': EMBEDDING_WIDTH,
        'context_length': CONTEXT_LENGTH,
        'precision': 'fp32',
        'files': files,
        'licence': 'Apache-2.0',
        'provenance': provenance,
        'recommended': recommended,
    }
    text = json.dumps(manifest, indent=2) + '\n'
    (folder / 'manifest.json').write_text(text, encoding='utf-8')


def with_weights(model: nn.Module, state: dict[str, Tensor]) -> nn.Module:
    """Load averaged weights and return the model ready to export (contiguous memory)."""
    model.load_state_dict(state)
    model.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    return model.eval()
