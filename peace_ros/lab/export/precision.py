# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""fp32 graphs -> fp16 and int8."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import GraphProto, NodeProto, helper, numpy_helper
from onnxruntime.transformers.float16 import DEFAULT_OP_BLOCK_LIST, convert_float_to_float16

from peace_ros.core.domain import BundleError

_KEEP_FP32 = ('LayerNormalization', 'Softmax', 'ArgMax')
"""Sums over hundreds of squares overflow in fp16; TensorRT fuses these as they stand."""


def require_finite(arrays: Iterable[NDArray[Any]], precision: str, what: str) -> None:
    """Raise BundleError when a network answers with numbers that its precision cannot hold.

    Call it before such answers are compared: the maximum of a number and NaN may be either.
    """
    for array in arrays:
        if not np.isfinite(array).all():
            raise BundleError(
                f'{what} in {precision} answers with infinite numbers or NaN on a '
                'picture. Nothing was written; choose another precision, fp32 if this is not it'
            )


def to_fp16(path: Path) -> None:
    """Rewrite a graph: fp16 inside, float32 inputs and outputs, LayerNorm and softmax in fp32."""
    model = convert_float_to_float16(
        onnx.load(str(path)),
        keep_io_types=True,
        op_block_list=[*DEFAULT_OP_BLOCK_LIST, *_KEEP_FP32],
    )
    onnx.save(model, str(path))


MLP = ('widen', 'narrow')
EVERY = ('project_in', 'project_out', *MLP)
"""Names of the products in :class:`~peace_ros.lab.export.towers.Layer`."""


@dataclass(frozen=True)
class Scale:
    """``real = integer * step``: a zero point elsewhere costs OpenVINO more than it gains."""

    step: float
    is_unsigned: bool
    """uint8, 0 to 255, for what follows a ReLU; else int8, -127 to 127."""

    @property
    def limits(self) -> tuple[int, int]:
        """The least and the largest integer."""
        return (0, 255) if self.is_unsigned else (-127, 127)


def to_int8(path: Path, scales: Mapping[str, Scale]) -> None:
    """Rewrite a graph: the products that have a scale in int8, static; all else stays fp32.

    Weights get one scale per output channel. Written as quantise/dequantise pairs, which ONNX
    Runtime, OpenVINO and TensorRT all fuse.

    Args:
        path: of a graph whose nodes are named by the modules they came from.
        scales: path of the module of a product -> the scale of what enters it. Several products
            of one input have a pair each: ONNX Runtime would not fuse a shared one.
    """
    model = onnx.load(str(path))
    graph = model.graph
    constants = {tensor.name: tensor for tensor in graph.initializer}
    nodes: list[NodeProto] = []
    for node in graph.node:
        key, _, which = node.name.strip('/').replace('/', '.').rpartition('.MatMul')
        if node.op_type == 'MatMul' and key in scales and node.input[1] in constants:
            nodes += _quantised_input(graph, node, key + which, scales[key])
            nodes += _quantised_weights(graph, node, key + which, constants[node.input[1]])
        nodes.append(node)
    del graph.node[:]
    graph.node.extend(nodes)
    used = {name for node in nodes for name in node.input}
    for name, tensor in constants.items():
        if name not in used:
            graph.initializer.remove(tensor)
    onnx.save(model, str(path))


def _quantised_input(
    graph: GraphProto, node: NodeProto, key: str, scale: Scale
) -> tuple[NodeProto, NodeProto]:
    kind = np.uint8 if scale.is_unsigned else np.int8
    parts = [
        _constant(graph, f'{key}.input_step', np.array(scale.step, np.float32)),
        _constant(graph, f'{key}.input_zero', np.array(0, kind)),
    ]
    whole, again = f'{key}.input_int8', f'{key}.input'
    pair = (
        helper.make_node('QuantizeLinear', [node.input[0], *parts], [whole], f'{key}.quantise'),
        helper.make_node('DequantizeLinear', [whole, *parts], [again], f'{key}.dequantise'),
    )
    node.input[0] = again
    return pair


def _quantised_weights(
    graph: GraphProto, node: NodeProto, key: str, tensor: onnx.TensorProto
) -> tuple[NodeProto]:
    weights = numpy_helper.to_array(tensor)
    steps = np.maximum(np.abs(weights).max(axis=0), np.finfo(np.float32).tiny) / 127.0
    whole = np.rint(weights / steps).astype(np.int8)
    again = f'{key}.weights'
    back = helper.make_node(
        'DequantizeLinear',
        [
            _constant(graph, f'{key}.weights_int8', whole),
            _constant(graph, f'{key}.weights_step', steps.astype(np.float32)),
            _constant(graph, f'{key}.weights_zero', np.zeros(len(steps), np.int8)),
        ],
        [again],
        f'{key}.weights_dequantise',
        axis=1,
    )
    node.input[1] = again
    return (back,)


def _constant(graph: GraphProto, name: str, value: np.ndarray[Any, Any]) -> str:
    graph.initializer.append(numpy_helper.from_array(value, name))
    return name
