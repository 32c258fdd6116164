# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Valid model bundles of both families with random weights, a few kilobytes each."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import tokenizers
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

_LEARNED = (
    'a an in of photo bird eye view game screenshot bad graphics shade shadows s '
    'rendered blurred 3d picture image drawing winter summer spring night fog '
    'grass lawn park field water building road tree car person fence'
)
WORDS = _LEARNED.split()
CONTEXT_LENGTH = 16
_FLOAT, _INT64 = TensorProto.FLOAT, TensorProto.INT64


def write_bundle(
    folder: Path,
    family: str,
    *,
    width: int = 40,
    height: int = 32,
    embedding_width: int = 8,
    resize: str = 'stretch',
    seed: int = 0,
    poison: float = 0.0,
    output_names: dict[str, str] | None = None,
) -> Path:
    """Write a bundle and return its folder.

    ``poison`` is added to the positive score map (NaN makes a network that has gone wrong);
    ``output_names`` renames graph outputs (to make bundles that break the contract).
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    graphs = {'text_encoder': _text_encoder(rng, embedding_width)}
    if family == 'clip':
        graphs['image_encoder'] = _clip_image_encoder(rng, width, height, embedding_width)
    else:
        graphs['image_encoder'] = _clipseg_image_encoder(rng, width, height)
        graphs['decoder'] = _decoder(rng, width // 4, height // 4, embedding_width, poison)
    for role, model in graphs.items():
        for output in model.graph.output:
            new = (output_names or {}).get(output.name)
            if new:
                model.graph.node.append(helper.make_node('Identity', [output.name], [new]))
                output.name = new
        onnx.checker.check_model(model)
        onnx.save(model, str(folder / f'{role}.onnx'))
    _tokenizer().save(str(folder / 'tokenizer.json'))
    roles = {role: f'{role}.onnx' for role in graphs} | {'tokenizer': 'tokenizer.json'}
    manifest = {
        'format': 1,
        'name': f'{family}-tiny',
        'family': family,
        'roles': roles,
        'input': {
            'width': width,
            'height': height,
            'resize': resize,
            'mean': [0.45, 0.46, 0.41],
            'std': [0.27, 0.26, 0.28],
        },
        'embedding_width': embedding_width,
        'context_length': CONTEXT_LENGTH,
        'precision': 'fp32',
        'files': {name: _entry(folder / name) for name in roles.values()},
        'licence': 'Apache-2.0',
        'provenance': 'random weights for tests',
        'recommended': {'threshold': 0.5},
    }
    (folder / 'manifest.json').write_text(json.dumps(manifest))
    return folder


def edit_manifest(folder: Path, **changes: Any) -> None:
    """Overwrite top-level keys of a manifest; None removes a key."""
    path = folder / 'manifest.json'
    manifest = json.loads(path.read_text()) | changes
    path.write_text(json.dumps({key: each for key, each in manifest.items() if each is not None}))


def resign(folder: Path) -> None:
    """Bring the manifest's sizes and checksums up to the files."""
    manifest = json.loads((folder / 'manifest.json').read_text())
    edit_manifest(folder, files={name: _entry(folder / name) for name in manifest['files']})


def _entry(path: Path) -> dict[str, Any]:
    raw = path.read_bytes()
    return {'sha256': hashlib.sha256(raw).hexdigest(), 'bytes': len(raw)}


def _tokenizer() -> tokenizers.Tokenizer:
    vocabulary = {word: index for index, word in enumerate(['[PAD]', '[UNK]', *WORDS])}
    tokenizer = tokenizers.Tokenizer(
        tokenizers.models.WordLevel(vocabulary, unk_token='[UNK]')  # noqa: S106 - no password
    )
    tokenizer.normalizer = tokenizers.normalizers.Sequence(
        [
            tokenizers.normalizers.Lowercase(),
            tokenizers.normalizers.Replace(tokenizers.Regex('[^a-z0-9]'), ' '),
        ]
    )
    tokenizer.pre_tokenizer = tokenizers.pre_tokenizers.WhitespaceSplit()
    return tokenizer


def _weights(rng: np.random.Generator, name: str, *shape: int, gain: float = 1.0) -> Any:
    values = rng.normal(0.0, gain, shape).astype(np.float32)
    return numpy_helper.from_array(values, name)


def _constant(name: str, values: Any) -> Any:
    array: NDArray[Any] = np.asarray(values)
    return numpy_helper.from_array(array, name)


def _model(name: str, nodes: list[Any], inputs: Any, outputs: Any, constants: list[Any]) -> Any:
    def infos(tensors: Any) -> list[Any]:
        return [helper.make_tensor_value_info(*tensor) for tensor in tensors]

    graph = helper.make_graph(nodes, name, infos(inputs), infos(outputs), constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 17)])
    model.ir_version = 8
    return model


def _text_encoder(rng: np.random.Generator, d: int) -> Any:
    node = helper.make_node
    nodes = [
        node('Gather', ['table', 'input_ids'], ['words']),
        node('Cast', ['attention_mask'], ['mask'], to=_FLOAT),
        node('Unsqueeze', ['mask', 'last'], ['mask3']),
        node('Mul', ['words', 'mask3'], ['masked']),
        node('ReduceSum', ['masked', 'one'], ['sum'], keepdims=0),
        node('Tanh', ['sum'], ['bent']),
        node('MatMul', ['bent', 'out'], ['text_embedding']),
    ]
    constants = [
        _weights(rng, 'table', len(WORDS) + 2, 6),
        _weights(rng, 'out', 6, d),
        _constant('last', np.array([2], np.int64)),
        _constant('one', np.array([1], np.int64)),
    ]
    inputs = [('input_ids', _INT64, ['B', 'L']), ('attention_mask', _INT64, ['B', 'L'])]
    return _model('text', nodes, inputs, [('text_embedding', _FLOAT, ['B', d])], constants)


def _clip_image_encoder(rng: np.random.Generator, width: int, height: int, d: int) -> Any:
    node = helper.make_node
    nodes = [
        node('Conv', ['pixel_values', 'kernel'], ['conv'], strides=[4, 4]),
        node('Relu', ['conv'], ['relu']),
        node('GlobalAveragePool', ['relu'], ['pool']),
        node('Flatten', ['pool'], ['flat']),
        node('MatMul', ['flat', 'out'], ['image_embedding']),
    ]
    constants = [_weights(rng, 'kernel', 10, 3, 4, 4), _weights(rng, 'out', 10, d)]
    inputs = [('pixel_values', _FLOAT, [1, 3, height, width])]
    return _model('image', nodes, inputs, [('image_embedding', _FLOAT, [1, d])], constants)


def _clipseg_image_encoder(rng: np.random.Generator, width: int, height: int) -> Any:
    node = helper.make_node
    h, w = height // 4, width // 4
    nodes = [
        node('Conv', ['pixel_values', 'kernel'], ['fine'], strides=[4, 4]),
        node('Conv', ['fine', 'wide'], ['coarse'], pads=[1, 1, 1, 1]),
    ]
    constants = [_weights(rng, 'kernel', 6, 3, 4, 4, gain=0.2), _weights(rng, 'wide', 6, 6, 3, 3)]
    outputs = [('fine', _FLOAT, [1, 6, h, w]), ('coarse', _FLOAT, [1, 6, h, w])]
    inputs = [('pixel_values', _FLOAT, [1, 3, height, width])]
    return _model('image', nodes, inputs, outputs, constants)


def _decoder(rng: np.random.Generator, w: int, h: int, d: int, poison: float) -> Any:
    node = helper.make_node
    nodes = [
        node('Add', ['fine', 'coarse'], ['features']),
        node('Reshape', ['features', 'flat'], ['columns']),
        node('MatMul', ['text_embedding', 'film'], ['queries']),
        node('MatMul', ['queries', 'columns'], ['dots']),
        node('Reshape', ['dots', 'maps'], ['term_logits']),
        node('Sigmoid', ['term_logits'], ['scores']),
        node('Unsqueeze', ['is_positive', 'spatial'], ['side']),
        node('Mul', ['scores', 'side'], ['for']),
        node('ReduceMax', ['for'], ['union_for'], axes=[0], keepdims=0),
        node('Add', ['union_for', 'poison'], ['positive']),
        node('Sub', ['scores', 'for'], ['against']),
        node('ReduceMax', ['against'], ['negative'], axes=[0], keepdims=0),
        node('Softmax', ['term_logits'], ['shares'], axis=0),
        node('Mul', ['shares', 'side'], ['shares_for']),
        node('ReduceSum', ['shares_for', 'terms'], ['softmax_positive'], keepdims=0),
    ]
    constants = [
        _weights(rng, 'film', d, 6, gain=0.08),
        _constant('flat', np.array([6, h * w], np.int64)),
        _constant('maps', np.array([-1, h, w], np.int64)),
        _constant('spatial', np.array([1, 2], np.int64)),
        _constant('terms', np.array([0], np.int64)),
        _constant('poison', np.float32(poison)),
    ]
    inputs = [
        ('fine', _FLOAT, [1, 6, h, w]),
        ('coarse', _FLOAT, [1, 6, h, w]),
        ('text_embedding', _FLOAT, ['T', d]),
        ('is_positive', _FLOAT, ['T']),
    ]
    outputs = [(name, _FLOAT, [h, w]) for name in ('positive', 'negative', 'softmax_positive')]
    outputs.append(('term_logits', _FLOAT, ['T', h, w]))
    return _model('decoder', nodes, inputs, outputs, constants)
