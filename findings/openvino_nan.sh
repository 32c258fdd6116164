#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The CPU plugin of OpenVINO turns "not a number" into ordinary numbers, and for two operators into
# the most confident answer there is.
#
# Guess before looking: like ONNX Runtime, NaN in gives NaN out of every operator that ONNX defines
# on numbers, and a comparison with NaN is false.
# Seen (openvino 2026.0.0, onnxruntime 1.32.0, x86_64): ONNX Runtime does that. OpenVINO gives
#   Relu, Clip(0, 1), Max(x, 0), Min(x, 0)   0       in place of NaN
#   HardSigmoid                              1       in place of NaN: a score of "certain"
#   x > 0                                    true    in place of false
#   MaxPool                                  the largest of the others
#   Softmax                                  0 for every number beside a NaN; the NaN stays
# while Sigmoid, LeakyRelu, ReduceMax and ReduceMean keep the NaN. So a network with one damaged
# weight ends in finite scores, and a check of the output alone cannot notice it: check weights when
# a model is loaded, and the values in front of the first of these operators.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    openvino==2026.0.0 onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import onnxruntime
import openvino
from onnx import TensorProto, helper

FLOAT = TensorProto.FLOAT
CONSTANTS = [helper.make_tensor(name, FLOAT, (), [value]) for name, value in (('zero', 0.0), ('one', 1.0))]
X = np.array([[[[np.nan, -1.0, 2.0, 0.5], [1.0, np.nan, 3.0, np.nan]]]], np.float32)
CASES = {  # operator -> inputs, attributes, what OpenVINO answers
    'Relu': (['x'], {}, [0, 0, 2, 0.5, 1, 0, 3, 0]),
    'Clip': (['x', 'zero', 'one'], {}, [0, 0, 1, 0.5, 1, 0, 1, 0]),
    'Max': (['x', 'zero'], {}, [0, 0, 2, 0.5, 1, 0, 3, 0]),
    'Min': (['x', 'zero'], {}, [0, -1, 0, 0, 0, 0, 0, 0]),
    'HardSigmoid': (['x'], {}, [1, 0.3, 0.9, 0.6, 0.7, 1, 1, 1]),
    'Greater': (['x', 'zero'], {}, [1, 0, 1, 1, 1, 1, 1, 1]),
    'MaxPool': (['x'], {'kernel_shape': [2, 2]}, [1, 3, 3]),
    'Softmax': (['x'], {'axis': -1}, [np.nan, 0, 0, 0, 0, np.nan, 0, np.nan]),
    'Sigmoid': (['x'], {}, [np.nan, 0.268941, 0.880797, 0.622459, 0.731059, np.nan, 0.952574, np.nan]),
}


def run(operator, inputs, attributes):
    nodes = [helper.make_node(operator, inputs, ['y'], **attributes)]
    if operator == 'Greater':
        nodes[0].output[0] = 'truth'
        nodes.append(helper.make_node('Cast', ['truth'], ['y'], to=FLOAT))
    graph = helper.make_graph(
        nodes,
        'one_operator',
        [helper.make_tensor_value_info('x', FLOAT, X.shape)],
        [helper.make_tensor_value_info('y', FLOAT, None)],
        [each for each in CONSTANTS if each.name in inputs],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 18)], ir_version=9)
    data = model.SerializeToString()
    session = onnxruntime.InferenceSession(data, providers=['CPUExecutionProvider'])
    core = openvino.Core()
    compiled = core.compile_model(core.read_model(data), 'CPU', {'INFERENCE_PRECISION_HINT': 'f32'})
    return session.run(None, {'x': X})[0].ravel(), np.asarray(compiled([X])[0]).ravel()


for operator, (inputs, attributes, expected) in CASES.items():
    theirs, ours = run(operator, inputs, attributes)
    print(f'{operator:12} ONNX Runtime {np.round(theirs, 2)}  OpenVINO {np.round(ours, 2)}')
    assert np.allclose(ours, expected, atol=1e-5, equal_nan=True), f'{operator}: OpenVINO has changed'
    if operator == 'Greater':
        assert theirs.tolist() == [0, 0, 1, 1, 1, 0, 1, 0], 'ONNX Runtime has changed'
    else:
        assert np.isnan(theirs).any(), f'{operator}: ONNX Runtime has changed'
print('as described')
PYTHON
