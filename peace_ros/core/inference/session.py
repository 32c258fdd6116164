# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ONNX Runtime sessions that count their calls and copy only what was asked for."""

from __future__ import annotations

import mmap
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray
from onnxruntime.capi import onnxruntime_pybind11_state as ort_state

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.contract import Graph, Tensor, check_graphs
from peace_ros.core.inference.openvino_engine import OpenVinoEngine
from peace_ros.core.inference.providers import (
    CPU,
    OPENVINO,
    TENSORRT,
    check_providers,
    with_options,
)

DEFAULT_PROVIDERS = (CPU,)
OPTIMISATIONS = MappingProxyType(
    {
        'none': ort.GraphOptimizationLevel.ORT_DISABLE_ALL,
        'basic': ort.GraphOptimizationLevel.ORT_ENABLE_BASIC,
        'extended': ort.GraphOptimizationLevel.ORT_ENABLE_EXTENDED,
        'all': ort.GraphOptimizationLevel.ORT_ENABLE_ALL,
    }
)
"""Of a graph, before it runs; from the least to the most."""

_HINDER_INT8 = ('MatMulAddFusion', 'CommonSubexpressionElimination')
"""Optimisations that leave a quantised product nothing to be fused with: it runs in fp32 then,
three times as slow, its weights unpacked again for every frame."""

# ONNX Runtime's errors have no common base of their own.
_ORT_ERRORS: tuple[type[Exception], ...] = (
    ValueError,
    RuntimeError,
    *(
        each
        for each in vars(ort_state).values()
        if isinstance(each, type) and issubclass(each, Exception)
    ),
)


class Session:
    """One ONNX file, ready to run on the asked-for execution providers."""

    def __init__(
        self,
        path: Path,
        *,
        threads: int = 2,
        providers: Sequence[str] = DEFAULT_PROVIDERS,
        checksum: str = '',
        optimisation: str = 'all',
    ) -> None:
        """Open a file.

        Args:
            path: the ONNX file.
            threads: CPU threads of one operator; they sleep between frames instead of spinning,
                because the other nodes share the same cores.
            providers: names of execution providers, the preferred one first.
            checksum: SHA-256 of the file, the key of engines that a provider builds and keeps.
            optimisation: of graphs by ONNX Runtime, one of :data:`OPTIMISATIONS`.

        Raises:
            ConfigurationError: a provider is not installed or none of them starts.
            BundleError: ONNX Runtime cannot run the file.
        """
        check_providers(providers)
        self._engine: OpenVinoEngine | _OnnxRuntimeEngine
        if providers[0] == OPENVINO:
            self._engine = _openvino(path, threads)
        else:
            options = _options(threads, optimisation)
            self._engine = _OnnxRuntimeEngine(path, options, with_options(providers, checksum))
        self.graph: Graph = self._engine.graph
        self.providers: tuple[str, ...] = self._engine.providers
        """Those in use; ONNX Runtime adds the CPU as the last."""
        self.calls = 0
        """Runs since it was opened, without warm-ups."""

    def run(
        self, outputs: Sequence[str], feeds: Mapping[str, NDArray[Any]]
    ) -> list[NDArray[np.float32]]:
        """Run once and return the named outputs in their order. Raises BundleError."""
        self.calls += 1
        return self.warm_up(outputs, feeds)

    def warm_up(
        self, outputs: Sequence[str], feeds: Mapping[str, NDArray[Any]]
    ) -> list[NDArray[np.float32]]:
        """Run once without counting, so that the first frame waits for no allocation."""
        try:
            arrays = self._engine.run(list(outputs), feeds)
        except _ORT_ERRORS as error:
            shapes = {name: array.shape for name, array in feeds.items()}
            raise BundleError(
                f'{self.graph.path}: the graph failed on inputs of shape {shapes} ({error}); '
                'export the model again'
            ) from error
        return cast('list[NDArray[np.float32]]', arrays)


def open_sessions(
    bundle: Bundle,
    roles: Sequence[str],
    *,
    threads: int = 2,
    providers: Sequence[str] = DEFAULT_PROVIDERS,
) -> Mapping[str, Session]:
    """Open the graphs of these roles and hold them against the family's tensors; all or none.

    Raises BundleError or ConfigurationError.
    """
    sessions = {
        role: Session(
            bundle.paths[role],
            threads=threads,
            providers=providers_of_role(bundle.manifest.family, role, providers),
            checksum=bundle.manifest.files[bundle.manifest.roles[role]].sha256,
        )
        for role in roles
    }
    check_graphs(bundle.manifest, {role: each.graph for role, each in sessions.items()})
    return MappingProxyType(sessions)


def providers_of_role(family: str, role: str, providers: Sequence[str]) -> tuple[str, ...]:
    """Return those of the providers that a network is opened with.

    TensorRT would build another engine, for minutes and in flight, whenever the number of texts or
    segments is new.
    """
    if role == 'text_encoder' or (family, role) == ('fastsam', 'image_encoder'):
        return tuple(each for each in providers if each != TENSORRT) or (CPU,)
    return tuple(providers)


class _OnnxRuntimeEngine:
    """ONNX Runtime, running only what the asked-for outputs need."""

    def __init__(self, path: Path, options: ort.SessionOptions, providers: Sequence[Any]) -> None:
        try:
            self._session = ort.InferenceSession(
                str(path),
                options,
                providers=list(providers),
                disabled_optimizers=_HINDER_INT8 if _is_quantised(path) else None,
            )
        except _ORT_ERRORS as error:
            raise BundleError(
                f'{path}: ONNX Runtime {ort.__version__} cannot open it ({error}); '
                'export the model again'
            ) from error
        self.providers = tuple(self._session.get_providers())
        names = [each if isinstance(each, str) else each[0] for each in providers]
        if not set(names) & set(self.providers):
            raise ConfigurationError(
                f'execution provider {", ".join(names)} did not start for {path}, only '
                f'{", ".join(self.providers)}; check its driver or add CPUExecutionProvider'
            )
        inputs, outputs = (
            tuple(Tensor(each.name, each.type, tuple(each.shape or ())) for each in side)
            for side in (self._session.get_inputs(), self._session.get_outputs())
        )
        self.graph = Graph(path, inputs, outputs)
        self._options = ort.RunOptions()
        self._options.only_execute_path_to_fetches = True

    def run(self, outputs: list[str], feeds: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        arrays = self._session.run(outputs, dict(feeds), self._options)
        return cast('list[NDArray[Any]]', arrays)


def _openvino(path: Path, threads: int) -> OpenVinoEngine:
    try:
        return OpenVinoEngine(path, threads)
    except RuntimeError as error:
        raise BundleError(
            f'{path}: OpenVINO cannot open it ({error}); export the model again'
        ) from error


def _options(threads: int, optimisation: str) -> ort.SessionOptions:
    options = ort.SessionOptions()
    options.graph_optimization_level = OPTIMISATIONS[optimisation]
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    options.log_severity_level = 3  # errors: warnings about unused initialisers are of no use
    return options


def _is_quantised(path: Path) -> bool:
    try:
        with path.open('rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as held:
            return held.find(b'DequantizeLinear') >= 0
    except (OSError, ValueError):
        return False  # ONNX Runtime says what is wrong with the file
