#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# OpenVINO does not see the axes of three reductions in graphs of ONNX opset 13 to 17, and reduces
# everything to one number: ReduceL1, ReduceLogSum and ReduceLogSumExp.
#
# Guess before looking: reductions are the simplest of operators, and all engines agree on them.
# Seen (openvino 2026.4.1 beside onnxruntime 1.32.0), values [[1 2] [3 4] [5 6]], axes=[1]:
#   ReduceLogSumExp   opset 13 and 17: onnxruntime 2.313 4.313 6.313; openvino 6.456, of shape 1 x 1
#   ReduceLogSum      opset 13 and 17: onnxruntime 1.099 1.946 2.398; openvino 3.045
#   ReduceL1          opset 13 and 17: onnxruntime 3 7 11;            openvino 21
#   the three at opset 11 and 18, and the other reductions at 13: the same from both
# torch.logsumexp exported at opset 17 is such a node. Where the result is added to an array, the
# one number is broadcast and the graph runs on.
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
values = np.array([[1, 2], [3, 4], [5, 6]], np.float32)


def agree(operator, opset):
    """Say what both engines give, and return whether it is the same."""
    constants, names, attributes = [], ['x'], {'axes': [1]}
    if opset >= 18:  # axes are an input since then
        constants = [onnx.numpy_helper.from_array(np.array([1]), 'axes')]
        names, attributes = ['x', 'axes'], {}
    graph = helper.make_graph(
        [helper.make_node(operator, names, ['y'], **attributes)],
        'reduction',
        [helper.make_tensor_value_info('x', TensorProto.FLOAT, values.shape)],
        [helper.make_tensor_value_info('y', TensorProto.FLOAT, [None, None])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', opset)], ir_version=8)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    session = onnxruntime.InferenceSession(data, providers=['CPUExecutionProvider'])
    runtime = session.run(None, {'x': values})[0]
    engine = core.compile_model(core.read_model(data), 'CPU')({'x': values})[0]
    print(f'{operator}, opset {opset}: {runtime.ravel()} and {engine.ravel()}')
    return runtime.shape == engine.shape and np.allclose(runtime, engine, atol=1e-3)


lost = ('ReduceL1', 'ReduceLogSum', 'ReduceLogSumExp')
kept = ('ReduceL2', 'ReduceSumSquare', 'ReduceMean', 'ReduceMax', 'ReduceProd')
changed = [
    f'{operator} at opset {opset}'
    for operator in lost
    for opset, same in ((11, True), (13, False), (17, False), (18, True))
    if agree(operator, opset) != same
]
changed += [f'{operator} at opset 13' for operator in kept if not agree(operator, 13)]
if changed:
    raise SystemExit(f'changed: {", ".join(changed)}')
print('as stated')
PYTHON
