# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A graph that was exported for one image -> the same graph for any number of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from peace_ros.core.inference.contract import PIXEL_VALUES


def free_batch(model: onnx.ModelProto) -> None:
    """Let a graph that was exported for one image take any number of them, in place.

    Reshapes copy their first axis instead of naming it, and constants that are joined to the
    images' arrays (the class token) are repeated. Whether that was enough is for a check of the
    result against single images to say.
    """
    graph = model.graph
    shapes = _shapes(graph)
    constants = _constants(graph)
    ranks = _ranks(model)
    batch = [
        helper.make_node('Shape', [PIXEL_VALUES], ['batch_shape']),
        helper.make_node('Slice', ['batch_shape', 'batch_from', 'batch_to'], ['batch_size']),
    ]
    nodes = []
    for node in graph.node:
        if node.op_type == 'Reshape' and node.input[0] not in constants:
            _copy_first_axis(graph, node, shapes)
        axis = next((each.i for each in node.attribute if each.name == 'axis'), 0)
        if node.op_type == 'Concat' and axis != 0 and not constants.issuperset(node.input):
            for index, name in enumerate(node.input):
                if name in constants:
                    nodes += _repeat(graph, node, index, ranks[node.output[0]])
        nodes.append(node)
    for name, value in (('batch_from', [0]), ('batch_to', [1])):
        graph.initializer.append(numpy_helper.from_array(np.array(value, np.int64), name))
    del graph.node[:]
    graph.node.extend(batch + nodes)
    del graph.value_info[:]
    for tensor in (*graph.input, *graph.output):
        tensor.type.tensor_type.shape.dim[0].dim_param = 'B'


def _constants(graph: onnx.GraphProto) -> set[str]:
    """Return the names of arrays that do not depend on the input."""
    names = {tensor.name for tensor in graph.initializer}
    for node in graph.node:
        if all(name in names or not name for name in node.input):
            names.update(node.output)
    return names


def _ranks(model: onnx.ModelProto) -> dict[str, int]:
    inferred = onnx.shape_inference.infer_shapes(model)
    return {each.name: len(each.type.tensor_type.shape.dim) for each in inferred.graph.value_info}


def _shapes(graph: onnx.GraphProto) -> dict[str, NDArray[Any]]:
    """Return the vectors of whole numbers that the graph holds, by name."""
    tensors = [(each.name, each) for each in graph.initializer]
    tensors += [
        (node.output[0], node.attribute[0].t)
        for node in graph.node
        if node.op_type == 'Constant' and node.attribute[0].name == 'value'
    ]
    return {
        name: numpy_helper.to_array(each)
        for name, each in tensors
        if each.data_type == onnx.TensorProto.INT64 and len(each.dims) == 1
    }


def _copy_first_axis(
    graph: onnx.GraphProto, node: onnx.NodeProto, shapes: dict[str, NDArray[Any]]
) -> None:
    shape = shapes.get(node.input[1])
    if shape is not None and shape.size > 1 and shape[0] == 1:
        name = f'{node.output[0]}_batched'
        first_as_in_input = np.concatenate([np.zeros(1, np.int64), shape[1:]])
        graph.initializer.append(numpy_helper.from_array(first_as_in_input, name))
        node.input[1] = name


def _repeat(
    graph: onnx.GraphProto, node: onnx.NodeProto, index: int, rank: int
) -> list[onnx.NodeProto]:
    """Make a constant of a concatenation as long as the batch; return the nodes for that."""
    name = node.input[index]
    ones, shape, repeated = f'{name}_ones', f'{name}_shape', f'{name}_repeated'
    graph.initializer.append(numpy_helper.from_array(np.ones(rank - 1, np.int64), ones))
    node.input[index] = repeated
    return [
        helper.make_node('Concat', ['batch_size', ones], [shape], axis=0),
        helper.make_node('Expand', [name, shape], [repeated]),
    ]
