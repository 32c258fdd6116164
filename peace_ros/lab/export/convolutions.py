# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The convolutions of a segmenter in int8."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static

from peace_ros.core.domain import BundleError


class _Samples(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, samples: Iterable[Mapping[str, NDArray[Any]]]) -> None:
        self._samples = iter(samples)

    def get_next(self) -> Any:
        return next(self._samples, None)


def to_int8_convolutions(path: Path, samples: Iterable[NDArray[np.float32]]) -> None:
    """Rewrite a graph: the convolutions inside it in int8, static, one scale per channel.

    The first one sees single colours and the last ones say boxes, confidences and coefficients;
    those stay fp32, as everything else does.

    Args:
        path: a graph with one input.
        samples: of that input, to measure activations on.

    Raises:
        BundleError: there is no convolution inside it.
    """
    graph = onnx.load(str(path), load_external_data=False).graph
    inner = _inner_convolutions(graph)
    if not inner:
        raise BundleError(f'{path}: no convolution to write in int8; export it in fp32')
    source = path.with_suffix('.fp32.onnx')
    path.rename(source)
    # The quantiser recommends a preparation that changes nothing here.
    logging.disable(logging.WARNING)
    try:
        quantize_static(
            str(source),
            str(path),
            _Samples({graph.input[0].name: each} for each in samples),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=['Conv'],
            nodes_to_quantize=inner,
        )
    finally:
        logging.disable(logging.NOTSET)
        source.unlink(missing_ok=True)


def _inner_convolutions(graph: onnx.GraphProto) -> list[str]:
    """Return the names of those that see an activation and feed one."""
    pixels = graph.input[0].name
    activations = ('Sigmoid', 'Relu', 'HardSwish', 'LeakyRelu')
    activated = {name for node in graph.node if node.op_type in activations for name in node.input}
    return [
        node.name
        for node in graph.node
        if node.op_type == 'Conv' and node.output[0] in activated and node.input[0] != pixels
    ]
