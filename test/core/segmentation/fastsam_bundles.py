# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A valid bundle of the family fastsam whose segments and colours a test chooses.

The segmenter finds the given segments in every image. The image encoder sums the colours it is
shown, so that its embedding is the colour of what was cut out; the text encoder knows colours of
words: grass and lawn are green, building is red, water is blue.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import helper

SIDE_PX, CELL_PX, CROP_PX = 64, 4, 16
GREEN, RED, BLUE, BLACK = (60, 220, 60), (220, 60, 60), (60, 60, 220), (0, 0, 0)
_DIRECTIONS = {
    'grass': (-1.0, 1.0, -1.0),
    'lawn': (-1.0, 0.98, -0.9),
    'building': (1.0, -1.0, -1.0),
    'water': (-1.0, -1.0, 1.0),
    'night': (0.1, -0.3, -0.2),
}


@dataclass(frozen=True)
class Patch:
    """A rectangle of prototype cells (16 x 16 cells of 4 px) that the segmenter finds."""

    left: int
    top: int
    right: int
    bottom: int
    confidence: float = 0.9
    logit: float = 8.0
    """Of the mask inside the rectangle; outside it is as much below zero."""


def write_fastsam(
    tiny: Any,
    folder: Path,
    patches: Sequence[Patch],
    *,
    poison: float = 0.0,
    batch: int | str = 'B',
    rows: int = 0,
    cells: int = SIDE_PX // CELL_PX,
    poisoned_crops: float = 0.0,
    **manifest: Any,
) -> Path:
    """Write a bundle and return its folder.

    poison is added to the predictions and poisoned_crops to the image embeddings; batch is the
    batch axis of the image encoder, rows are rows of the predictions too many; other keywords
    overwrite keys of the manifest.
    """
    folder.mkdir(parents=True, exist_ok=True)
    models = {
        'segmenter': _segmenter(tiny, patches, poison, rows, cells),
        'image_encoder': _image_encoder(tiny, batch, poisoned_crops),
        'text_encoder': _text_encoder(tiny),
    }
    for role, model in models.items():
        onnx.checker.check_model(model)
        onnx.save(model, str(folder / f'{role}.onnx'))
    tiny._tokenizer().save(str(folder / 'tokenizer.json'))
    roles = {role: f'{role}.onnx' for role in models} | {'tokenizer': 'tokenizer.json'}
    plain = {'resize': 'letterbox', 'mean': [0.0] * 3, 'std': [1.0] * 3}
    centred = {'resize': 'letterbox', 'mean': [0.5] * 3, 'std': [0.25] * 3}
    values = {
        'format': 1,
        'name': 'fastsam-tiny',
        'family': 'fastsam',
        'roles': roles,
        'input': {'width': SIDE_PX, 'height': SIDE_PX} | plain,
        'crop_input': {'width': CROP_PX, 'height': CROP_PX} | centred,
        'embedding_width': 3,
        'context_length': tiny.CONTEXT_LENGTH,
        'precision': 'fp32',
        'files': {name: tiny._entry(folder / name) for name in roles.values()},
        'licence': 'Apache-2.0',
        'provenance': 'made for tests',
        'logit_scale': 20.0,
    }
    values |= manifest
    kept = {key: value for key, value in values.items() if value is not None}
    (folder / 'manifest.json').write_text(json.dumps(kept))
    return folder


def _segmenter(tiny: Any, patches: Sequence[Patch], poison: float, rows: int, cells: int) -> Any:
    count = max(1, len(patches))
    predictions = np.zeros((1, 5 + count + rows, max(8, len(patches))), np.float32)
    prototypes = np.full((1, count, cells, cells), -8.0, np.float32)
    for index, patch in enumerate(patches):
        low = np.array([patch.left, patch.top]) * CELL_PX
        high = np.array([patch.right, patch.bottom]) * CELL_PX
        predictions[0, :2, index] = (low + high) / 2
        predictions[0, 2:4, index] = high - low
        predictions[0, 4, index] = patch.confidence
        predictions[0, 5 + index, index] = 1.0
        prototypes[0, index] = -patch.logit
        prototypes[0, index, patch.top : patch.bottom, patch.left : patch.right] = patch.logit
    node = helper.make_node
    nodes = [
        node('ReduceMean', ['pixel_values'], ['mean'], axes=[1, 2, 3], keepdims=0),
        node('Mul', ['mean', 'nothing'], ['zero']),
        node('Add', ['found', 'zero'], ['sound']),
        node('Add', ['sound', 'poison'], ['predictions']),
        node('Add', ['shapes', 'zero'], ['prototypes']),
    ]
    constants = [
        tiny._constant('nothing', np.float32(0.0)),
        tiny._constant('poison', np.float32(poison)),
        tiny._constant('found', predictions),
        tiny._constant('shapes', prototypes),
    ]
    inputs = [('pixel_values', tiny._FLOAT, [1, 3, SIDE_PX, SIDE_PX])]
    outputs = [
        ('predictions', tiny._FLOAT, list(predictions.shape)),
        ('prototypes', tiny._FLOAT, list(prototypes.shape)),
    ]
    return tiny._model('segmenter', nodes, inputs, outputs, constants)


def _image_encoder(tiny: Any, batch: int | str, poison: float) -> Any:
    nodes = [
        helper.make_node('ReduceSum', ['pixel_values', 'plane'], ['sum'], keepdims=0),
        helper.make_node('Add', ['sum', 'bias'], ['image_embedding']),
    ]
    constants = [
        tiny._constant('plane', np.array([2, 3], np.int64)),
        tiny._constant('bias', np.full(3, 1e-3 + poison, np.float32)),
    ]
    inputs = [('pixel_values', tiny._FLOAT, [batch, 3, CROP_PX, CROP_PX])]
    outputs = [('image_embedding', tiny._FLOAT, [batch, 3])]
    return tiny._model('image', nodes, inputs, outputs, constants)


def _text_encoder(tiny: Any) -> Any:
    table = np.zeros((len(tiny.WORDS) + 2, 3), np.float32)
    for word, direction in _DIRECTIONS.items():
        table[2 + tiny.WORDS.index(word)] = direction
    node = helper.make_node
    nodes = [
        node('Gather', ['table', 'input_ids'], ['words']),
        node('Cast', ['attention_mask'], ['mask'], to=tiny._FLOAT),
        node('Unsqueeze', ['mask', 'last'], ['mask3']),
        node('Mul', ['words', 'mask3'], ['masked']),
        node('ReduceSum', ['masked', 'one'], ['text_embedding'], keepdims=0),
    ]
    constants = [
        tiny._constant('table', table),
        tiny._constant('last', np.array([2], np.int64)),
        tiny._constant('one', np.array([1], np.int64)),
    ]
    inputs = [
        ('input_ids', tiny._INT64, ['B', 'L']),
        ('attention_mask', tiny._INT64, ['B', 'L']),
    ]
    outputs = [('text_embedding', tiny._FLOAT, ['B', 3])]
    return tiny._model('text', nodes, inputs, outputs, constants)
