#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# OpenVINO reads a Resize of ONNX that asks for antialiasing, or to keep the aspect, and leaves both
# out without a word: another picture, or another size of it.
#
# Guess before looking: it does what is asked, or it refuses the graph as it does with
# half_pixel_symmetric.
# Seen (openvino 2026.4.1 beside onnxruntime 1.32.0; ONNX opset 19):
#   linear, 16 -> 4 values, antialias=1     onnxruntime 1.156 1.5 1.5 1.844, the reference of onnx too
#                                           openvino    1.5   1.5 1.5 1.5, as without antialias
#   cubic, the same                         differs in the same way
#   sizes 8 x 8 of 2 x 4 with keep_aspect_ratio_policy=not_larger
#                                           onnxruntime 4 x 8, openvino 8 x 8
# A graph that makes its own input smaller (a picture for CLIP) sees other pixels with OpenVINO.
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
exact = {'INFERENCE_PRECISION_HINT': 'f32'}


def resize(values, sizes, **attributes):
    """Return what onnx's reference, ONNX Runtime and OpenVINO make of one Resize."""
    node = helper.make_node('Resize', ['x', '', '', 'sizes'], ['y'], **attributes)
    graph = helper.make_graph(
        [node],
        'resize',
        [helper.make_tensor_value_info('x', TensorProto.FLOAT, values.shape)],
        [helper.make_tensor_value_info('y', TensorProto.FLOAT, [None] * 4)],
        [onnx.numpy_helper.from_array(np.array(sizes), 'sizes')],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 19)], ir_version=9)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    session = onnxruntime.InferenceSession(data, providers=['CPUExecutionProvider'])
    compiled = core.compile_model(core.read_model(data), 'CPU', exact)
    return (
        ReferenceEvaluator(model).run(None, {'x': values})[0],
        session.run(None, {'x': values})[0],
        compiled({'x': values})[0],
    )


changed = []
row = (np.arange(16, dtype=np.float32) % 4).reshape(1, 1, 1, 16)
for mode in ('linear', 'cubic'):
    reference, runtime, engine = resize(row, (1, 1, 1, 4), mode=mode, antialias=1)
    without = resize(row, (1, 1, 1, 4), mode=mode)[2]
    print(f'{mode}, antialias=1: onnxruntime {runtime.ravel()}, openvino {engine.ravel()}')
    as_stated = np.allclose(reference, runtime, atol=1e-5) and np.allclose(engine, without)
    if not as_stated or np.abs(runtime - engine).max() < 0.1:
        changed.append(mode)
small = np.arange(8, dtype=np.float32).reshape(1, 1, 2, 4)
reference, runtime, engine = resize(
    small, (8, 8), mode='nearest', axes=[2, 3], keep_aspect_ratio_policy='not_larger'
)
print(f'not_larger: onnxruntime {runtime.shape}, openvino {engine.shape}')
if (reference.shape, runtime.shape, engine.shape) != ((1, 1, 4, 8), (1, 1, 4, 8), (1, 1, 8, 8)):
    changed.append('not_larger')
if changed:
    raise SystemExit(f'changed: {", ".join(changed)}')
print('as stated')
PYTHON
