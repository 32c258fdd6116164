#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# ReduceMax and MaxPool of ONNX Runtime keep a "not a number" at one place only, and beside a NaN
# ReduceMax may lose the true maximum.
#
# Guess before looking: NaN in gives NaN out wherever it stands, or is left out everywhere, as by
# numpy's max and nanmax.
# Seen (onnxruntime 1.32.0, CPU, x86_64):
#   ReduceMax over the last axis, 8 numbers 0 to 7   NaN at place 0: NaN
#     NaN at place 1 or 3                            6: no NaN, and 7 is lost (places depend on the processor)
#     NaN at place 2, 4, 5, 6                        7
#   ReduceMax over the first axis                    NaN in the first row: NaN; in any other: left out
#   MaxPool 2 x 2                                    NaN in the last corner: NaN; else left out
#   Max (two inputs), Relu, Clip                     NaN stays
# A union over terms is such a maximum: the term whose score is NaN is left out in silence, unless
# it is the first. Check the inputs of a maximum, not its result.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import onnxruntime
from onnx import TensorProto, helper


def run(kind, x, initial=(), **attributes):
    tensors = [helper.make_tensor('axes', TensorProto.INT64, [1], initial)] if initial else []
    node = helper.make_node(kind, ['x'] + [each.name for each in tensors], ['y'], **attributes)
    graph = helper.make_graph(
        [node],
        'one',
        [helper.make_tensor_value_info('x', TensorProto.FLOAT, x.shape)],
        [helper.make_tensor_value_info('y', TensorProto.FLOAT, None)],
        tensors,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 18)], ir_version=9)
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=['CPUExecutionProvider']
    )
    return session.run(None, {'x': x})[0]


last, first = [], []
for place in range(8):
    row = np.arange(8, dtype=np.float32)[None]
    row[0, place] = np.nan
    last.append(float(run('ReduceMax', row, [1], keepdims=0)[0]))
    rows = np.arange(8, dtype=np.float32)[:, None].repeat(16, axis=1)
    rows[place] = np.nan
    first.append(float(run('ReduceMax', rows, [0], keepdims=0)[0]))
pooled = []
for place in range(4):
    square = np.arange(4, dtype=np.float32)
    square[place] = np.nan
    pooled.append(float(run('MaxPool', square.reshape(1, 1, 2, 2), kernel_shape=[2, 2]).ravel()[0]))

print('ReduceMax of 0 to 7, NaN at each place in turn:', last)
print('ReduceMax over the first axis, NaN in each row in turn:', first)
print('MaxPool of 0 to 3, NaN in each corner in turn:', pooled)
# Which of the others are lost depends on how many numbers the processor compares at once.
lost = [each for each in last[1:7] if each < 7]
if not (np.isnan(last[0]) and np.isfinite(last[1:]).all() and lost):
    raise SystemExit(f'changed: ReduceMax over the last axis gives {last}')
if not (np.isnan(first[0]) and first[1:] == [7, 7, 7, 7, 7, 7, 6]):
    raise SystemExit(f'changed: ReduceMax over the first axis gives {first}')
if not np.array_equal(pooled, [3, 3, 3, np.nan], equal_nan=True):
    raise SystemExit(f'changed: MaxPool gives {pooled}')
print('as stated')
PYTHON
