# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""fp32 graphs -> fp16 and int8."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import onnx
from onnxruntime.quantization import (
    CalibrationDataReader,
    QuantFormat,
    QuantType,
    quantize_static,
)
from onnxruntime.transformers.float16 import DEFAULT_OP_BLOCK_LIST, convert_float_to_float16

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    Feeds = Mapping[str, NDArray[np.generic]]

_KEEP_FP32 = ('LayerNormalization', 'Softmax', 'ArgMax')
"""Sums over hundreds of squares overflow in fp16; TensorRT fuses these as they stand."""


def to_fp16(path: Path) -> None:
    """Rewrite a graph: fp16 inside, float32 inputs and outputs, LayerNorm and softmax in fp32."""
    model = convert_float_to_float16(
        onnx.load(str(path)),
        keep_io_types=True,
        op_block_list=[*DEFAULT_OP_BLOCK_LIST, *_KEEP_FP32],
    )
    onnx.save(model, str(path))


NARROW = ('narrow',)
EVERY = ('project_in', 'project_out', 'widen', *NARROW)
"""Names of the products in :class:`~peace_ros.inference.export.towers.Layer`."""


class _Samples(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, samples: Iterable[Feeds]) -> None:
        self._samples = iter(samples)

    def get_next(self) -> Any:
        return next(self._samples, None)


def to_int8(path: Path, samples: Iterable[Feeds], products: Collection[str]) -> None:
    """Rewrite a graph: the named products inside the transformer layers in int8, static.

    Weights have one scale per output channel; activations one per tensor, measured on samples,
    symmetric but for those after a ReLU, which spend no bit on a sign. All else stays fp32.
    Of the decoder only the narrowing product is taken: it is the costliest, and quantising the
    others, 64 wide, costs most of the agreement. Written as quantise/dequantise pairs, which ONNX
    Runtime, OpenVINO and TensorRT all fuse.
    """
    graph = onnx.load(str(path), load_external_data=False).graph
    constants = {tensor.name for tensor in graph.initializer}
    wide = [
        node
        for node in graph.node
        if node.op_type == 'MatMul'
        and '/layers.' in node.name
        and constants & set(node.input)
        and node.name.split('/')[-2] in products
    ]
    unsigned = {node.output[0] for node in graph.node if node.op_type == 'Relu'}
    overrides = {
        name: [{'quant_type': QuantType.QUInt8, 'symmetric': False}]
        for node in wide
        for name in node.input
        if name in unsigned
    }
    source = path.with_suffix('.fp32.onnx')
    path.rename(source)
    logging.getLogger().addFilter(_no_advice)
    try:
        quantize_static(
            str(source),
            str(path),
            _Samples(samples),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=['MatMul'],
            nodes_to_quantize=[node.name for node in wide],
            extra_options={'ActivationSymmetric': True, 'TensorQuantOverrides': overrides},
        )
    finally:
        logging.getLogger().removeFilter(_no_advice)
        source.unlink(missing_ok=True)


def _no_advice(record: logging.LogRecord) -> bool:
    return 'pre-processing before quantization' not in record.getMessage()
