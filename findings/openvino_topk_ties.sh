#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Where values are equal, TopK of ONNX puts the lower index first. OpenVINO keeps to that until all
# values are asked for (k is the length of the axis): then the order among equals is its own.
#
# Guess before looking: the lower index first for every k, as the operator's page says.
# Seen (openvino 2026.4.1 beside onnxruntime 1.32.0):
#   [1 3 3 2 3 1 3], k = 6     both 1 2 4 6 3 0
#   the same, k = 7            onnxruntime 1 2 4 6 3 0 5, openvino 2 6 1 4 3 5 0
#   twenty equal values, k 20  onnxruntime 0 1 2 ... 19, openvino 1 2 ... 19 0
# A ranking of words that ends with all of them changes its first word with the engine.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    openvino==2026.4.1 onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import onnx
import onnxruntime
import openvino
from onnx import TensorProto, helper

core = openvino.Core()


def orders(values, most):
    """Return the indices that ONNX Runtime and OpenVINO give."""
    values = np.array([values], np.float32)
    graph = helper.make_graph(
        [helper.make_node('TopK', ['x', 'k'], ['best', 'order'], axis=1, sorted=1)],
        'ranking',
        [helper.make_tensor_value_info('x', TensorProto.FLOAT, values.shape)],
        [
            helper.make_tensor_value_info('best', TensorProto.FLOAT, [1, most]),
            helper.make_tensor_value_info('order', TensorProto.INT64, [1, most]),
        ],
        [onnx.numpy_helper.from_array(np.array([most]), 'k')],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 17)], ir_version=8)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    session = onnxruntime.InferenceSession(data, providers=['CPUExecutionProvider'])
    found = core.compile_model(core.read_model(data), 'CPU')({'x': values})
    return session.run(['order'], {'x': values})[0][0].tolist(), found['order'][0].tolist()


mixed = [1, 3, 3, 2, 3, 1, 3]
changed = []
for values, most, differs in ((mixed, 6, False), (mixed, 7, True), ([0.5] * 20, 20, True)):
    runtime, engine = orders(values, most)
    print(f'{most} of {len(values)}: onnxruntime {runtime}\n    openvino {engine}')
    # The lower index first: a stable sort from the largest.
    lower_first = np.argsort(-np.array(values, np.float32), kind='stable')[:most].tolist()
    if runtime != lower_first or (engine != lower_first) != differs:
        changed.append(f'{most} of {len(values)}')
if changed:
    raise SystemExit(f'changed: {", ".join(changed)}')
print('as stated')
PYTHON
