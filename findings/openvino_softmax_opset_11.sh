#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# A Softmax of ONNX opset 11 or 12 runs over the axis and all that follow it together. ONNX Runtime
# does that. OpenVINO and onnx's own reference run over the one axis, as opset 13 means it.
#
# Guess before looking: all three know the opset and agree, as the version of an operator is there
# for.
# Seen (openvino 2026.4.1, onnxruntime 1.32.0, onnx 1.23.2), eight equal values of shape 1 x 2 x 2 x 2,
# axis 1:
#   Softmax, opset 11      onnxruntime 1/8 everywhere; openvino 1/2; reference of onnx 1/2
#   LogSoftmax, opset 11   onnxruntime log 1/8; openvino log 1/8; reference of onnx log 1/2
#   Softmax, opset 13      1/2 from all three
# An old graph with scores of terms on axis 1 gives another heatmap in another engine, and a check
# against onnx's reference calls the wrong one right.
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
from onnx.reference import ReferenceEvaluator

core = openvino.Core()
values = np.zeros((1, 2, 2, 2), np.float32)


def of_all(operator, opset):
    graph = helper.make_graph(
        [helper.make_node(operator, ['x'], ['y'], axis=1)],
        'scores',
        [helper.make_tensor_value_info('x', TensorProto.FLOAT, values.shape)],
        [helper.make_tensor_value_info('y', TensorProto.FLOAT, values.shape)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', opset)], ir_version=7)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    session = onnxruntime.InferenceSession(data, providers=['CPUExecutionProvider'])
    compiled = core.compile_model(core.read_model(data), 'CPU', {'INFERENCE_PRECISION_HINT': 'f32'})
    found = [
        session.run(None, {'x': values})[0],
        compiled({'x': values})[0],
        ReferenceEvaluator(model).run(None, {'x': values})[0],
    ]
    assert all(np.ptp(each) < 1e-6 for each in found)  # equal values stay equal
    return [round(float(each.flat[0]), 3) for each in found]


stated = {
    ('Softmax', 11): [0.125, 0.5, 0.5],
    ('LogSoftmax', 11): [-2.079, -2.079, -0.693],
    ('Softmax', 13): [0.5, 0.5, 0.5],
}
seen = {case: of_all(*case) for case in stated}
for (operator, opset), (runtime, engine, reference) in seen.items():
    print(f'{operator}, opset {opset}: onnxruntime {runtime}, openvino {engine}, onnx {reference}')
if seen != stated:
    raise SystemExit('changed')
print('as stated')
PYTHON
