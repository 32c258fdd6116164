# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ONNX Runtime sessions that count their calls and copy only what was asked for."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as ort_state

from peace_ros.domain import BundleError, ConfigurationError
from peace_ros.inference.contract import Graph, Tensor, check_graphs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from peace_ros.inference.bundle import Bundle

DEFAULT_PROVIDERS = ('CPUExecutionProvider',)

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
        self, path: Path, *, threads: int = 2, providers: Sequence[str] = DEFAULT_PROVIDERS
    ) -> None:
        """Open a file.

        Args:
            path: the ONNX file.
            threads: CPU threads of one operator; they sleep between frames instead of spinning,
                because the other nodes share the same cores.
            providers: names of execution providers, the preferred one first.

        Raises:
            ConfigurationError: a provider is not installed or none of them starts.
            BundleError: the file is no graph that ONNX Runtime can run.
        """
        check_providers(providers)
        options = ort.SessionOptions()
        options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_ENABLE_ALL
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.add_session_config_entry('session.intra_op.allow_spinning', '0')
        options.log_severity_level = 3  # errors: warnings about unused initialisers help nobody
        try:
            self._session = ort.InferenceSession(str(path), options, providers=list(providers))
        except _ORT_ERRORS as error:
            raise BundleError(
                f'{path}: ONNX Runtime {ort.__version__} cannot open it ({error}); '
                'export the model again'
            ) from error
        self.providers: tuple[str, ...] = tuple(self._session.get_providers())
        """The execution providers in use; ONNX Runtime adds the CPU as the last."""
        if not set(providers) & set(self.providers):
            raise ConfigurationError(
                f'execution provider {", ".join(providers)} did not start for {path}, only '
                f'{", ".join(self.providers)}; check its driver or add CPUExecutionProvider'
            )
        self.calls = 0
        """Runs since it was opened, without warm-ups."""
        self.graph = Graph(
            path,
            tuple(_tensor(each) for each in self._session.get_inputs()),
            tuple(_tensor(each) for each in self._session.get_outputs()),
        )

    def run(
        self, outputs: Sequence[str], feeds: Mapping[str, NDArray[Any]]
    ) -> list[NDArray[np.float32]]:
        """Run once and return the named outputs in their order. Raises BundleError."""
        self.calls += 1
        return self._run(outputs, feeds)

    def warm_up(
        self, outputs: Sequence[str], feeds: Mapping[str, NDArray[Any]]
    ) -> list[NDArray[np.float32]]:
        """Run once without counting, so that the first frame waits for no allocation."""
        return self._run(outputs, feeds)

    def _run(
        self, outputs: Sequence[str], feeds: Mapping[str, NDArray[Any]]
    ) -> list[NDArray[np.float32]]:
        try:
            arrays = self._session.run(list(outputs), dict(feeds))
        except _ORT_ERRORS as error:
            shapes = {name: array.shape for name, array in feeds.items()}
            raise BundleError(
                f'{self.graph.path}: the graph failed on inputs of shape {shapes} ({error}); '
                'export the model again'
            ) from error
        return cast('list[NDArray[np.float32]]', arrays)


def check_providers(providers: Sequence[str]) -> None:
    """Raise ConfigurationError when an execution provider is not part of this ONNX Runtime."""
    available = ort.get_available_providers()
    missing = [name for name in providers if name not in available]
    if missing or not providers:
        raise ConfigurationError(
            f'execution provider {", ".join(missing) or "list is empty"}: this ONNX Runtime '
            f'{ort.__version__} has {", ".join(available)}; choose among them or install a build '
            'that has it'
        )


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
        role: Session(bundle.paths[role], threads=threads, providers=providers) for role in roles
    }
    check_graphs(bundle.manifest, {role: each.graph for role, each in sessions.items()})
    return MappingProxyType(sessions)


def _tensor(node: Any) -> Tensor:
    sizes = node.shape or ()
    return Tensor(node.name, node.type, tuple(sizes))
