# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ONNX files run by OpenVINO; the package is optional and imported when a file is opened."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.inference.contract import Graph, Tensor
from peace_ros.core.inference.providers import OPENVINO

_TYPES = {'f32': 'tensor(float)', 'i64': 'tensor(int64)'}
_REAL = {'f16', 'f32', 'f64'}
_MOST_COMPILED = 6
"""Sets of outputs and shapes that stay compiled."""


class OpenVinoEngine:
    """One graph, compiled for each set of outputs and shapes that is asked for.

    Nodes that other outputs need are removed, and fixed shapes let OpenVINO plan its memory
    once; the first run of a new kind therefore takes seconds.
    """

    def __init__(self, path: Path, threads: int) -> None:
        """Read a file.

        Raises:
            RuntimeError: It is not a graph, or one of its weights is not a number.
        """
        import openvino  # noqa: PLC0415 - optional

        self._openvino = openvino
        self._core = openvino.Core()
        self._model = self._core.read_model(str(path))
        self._refuse_damaged_weights()
        inputs, outputs = (
            tuple(map(_tensor, side)) for side in (self._model.inputs, self._model.outputs)
        )
        self.graph = Graph(path, inputs, outputs)
        self.providers = (OPENVINO,)
        self._compiled: dict[Any, Any] = {}
        self._lock = threading.Lock()
        has_bf16 = 'BF16' in self._core.get_property('CPU', 'OPTIMIZATION_CAPABILITIES')
        self._config = {
            'INFERENCE_NUM_THREADS': threads,
            'NUM_STREAMS': 1,
            'PERFORMANCE_HINT': 'LATENCY',
            'ENABLE_CPU_PINNING': False,
            # A graph of int8 products has given up more than bf16 takes from the rest of it.
            'INFERENCE_PRECISION_HINT': 'bf16' if has_bf16 and self._is_int8() else 'f32',
        }

    def _refuse_damaged_weights(self) -> None:
        """NaN must not enter: Relu, Clip and Max of OpenVINO turn it into an ordinary number."""
        for each in self._model.get_ops():
            if each.get_type_name() != 'Constant':
                continue
            kind = each.get_element_type().get_type_name()
            if kind in _REAL and np.isnan(each.get_data()).any():
                raise RuntimeError(
                    f'weight {each.get_friendly_name()} holds values that are not numbers: '
                    'export or fetch the model again'
                )

    def _is_int8(self) -> bool:
        return any(each.get_type_name() == 'FakeQuantize' for each in self._model.get_ops())

    def run(self, outputs: Sequence[str], feeds: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the named outputs in their order; raises RuntimeError."""
        with self._lock:
            request = self._request(tuple(outputs), feeds)
            results = request.infer(dict(feeds), share_inputs=True)
            return [results[index] for index in range(len(outputs))]

    def _request(self, outputs: tuple[str, ...], feeds: Mapping[str, NDArray[Any]]) -> Any:
        shapes = {name: array.shape for name, array in feeds.items()}
        is_text = any(array.dtype.kind == 'i' for array in feeds.values())
        key = (outputs, () if is_text else tuple(shapes.items()))
        request = self._compiled.pop(key, None)
        if request is None:
            model = self._part(outputs)
            if not is_text:
                # Texts have every length; all else keeps its shape from frame to frame.
                model.reshape(shapes)
            compiled = self._core.compile_model(model, 'CPU', self._config)
            request = compiled.create_infer_request()
        self._compiled[key] = request
        while len(self._compiled) > _MOST_COMPILED:
            self._compiled.pop(next(iter(self._compiled)))
        return request

    def _part(self, outputs: tuple[str, ...]) -> Any:
        """Return a copy of the graph that leads to these outputs alone."""
        model = self._model.clone()
        wanted = [model.output(name).get_node() for name in outputs]
        return self._openvino.Model(wanted, model.get_parameters(), 'part')


def _tensor(tensor: Any) -> Tensor:
    sizes = tuple(
        None if size.is_dynamic else int(size.get_length()) for size in tensor.partial_shape
    )
    kind = tensor.element_type.get_type_name()
    return Tensor(tensor.any_name, _TYPES.get(kind, kind), sizes)
