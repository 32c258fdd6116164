# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Execution providers: which there are, what each needs, and the options it gets.

CPU and OpenVINO are tested; the options for CUDA and TensorRT follow ONNX Runtime's documentation
and have not been run on such a machine.
"""

from __future__ import annotations

import importlib.util
import os
import resource
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any

import onnxruntime as ort

from peace_ros.core.domain import ConfigurationError

CPU = 'CPUExecutionProvider'
CUDA = 'CUDAExecutionProvider'
TENSORRT = 'TensorrtExecutionProvider'
OPENVINO = 'OpenVINOExecutionProvider'
"""Run by the ``openvino`` package beside ONNX Runtime; the fastest on x86 CPUs."""

_INSTALL: Mapping[str, str] = MappingProxyType(
    {
        OPENVINO: 'run: pip install openvino',
        CUDA: 'install onnxruntime-gpu and CUDA in place of onnxruntime',
        TENSORRT: 'install onnxruntime-gpu and TensorRT in place of onnxruntime',
    }
)
_CACHE = Path('~/.cache/peace_ros/tensorrt')
_DEVICE_FILES = (Path('/proc/device-tree/model'), Path('/proc/driver/nvidia/version'))


def available_providers() -> tuple[str, ...]:
    """Return the providers that can be asked for on this machine."""
    known = [each for each in ort.get_available_providers() if each != OPENVINO]
    if importlib.util.find_spec('openvino') is not None:
        known.append(OPENVINO)
    return tuple(known)


def check_providers(providers: Sequence[str]) -> None:
    """Raise ConfigurationError when a provider is not installed, or OpenVINO is not the first."""
    available = available_providers()
    missing = [name for name in providers if name not in available]
    if missing or not providers:
        remedies = [_INSTALL[name] for name in missing if name in _INSTALL]
        raise ConfigurationError(
            f'execution provider {", ".join(missing) or "list is empty"}: this ONNX Runtime '
            f'{ort.__version__} has {", ".join(available)}; '
            f'{"; ".join([*remedies, "or choose among them"])}'
        )
    if OPENVINO in providers[1:]:
        raise ConfigurationError(
            f'execution providers {", ".join(providers)}: {OPENVINO} runs whole graphs; '
            'name it first or not at all'
        )


@dataclass(frozen=True)
class Footprint:
    """Memory and time that a bundle's networks need, measured when they were loaded."""

    bundle: str
    precision: str
    providers: tuple[str, ...]
    """Those in use."""
    threads: int
    memory_mb: float
    """Growth of the process's resident memory (10^6 bytes), graphs, arrays and provider; what a
    provider holds on a device of its own is not in it."""
    ready_s: float
    """From opening the files to the end of the first run."""

    def __str__(self) -> str:
        threads = f'{self.threads} thread{"s" if self.threads > 1 else ""}'
        return (
            f'{self.bundle} {self.precision} on {", ".join(self.providers)}, {threads}, '
            f'{self.memory_mb:.0f} MB, warmed up in {self.ready_s:.1f} s'
        )


class LoadMeter:
    """Measures memory and time from its creation; other loading at the same time counts too."""

    def __init__(self) -> None:
        self._began_s, self._before_mb = time.perf_counter(), resident_mb()

    def read(
        self, bundle: str, precision: str, providers: Sequence[str], threads: int
    ) -> Footprint:
        """Return what was taken since this meter was made."""
        grown_mb = max(0.0, resident_mb() - self._before_mb)
        taken_s = time.perf_counter() - self._began_s
        return Footprint(bundle, precision, tuple(providers), threads, grown_mb, taken_s)


def resident_mb() -> float:
    """Return the resident memory of this process, 10^6 bytes; without /proc, its peak."""
    try:
        pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
    except OSError:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak * (1 if sys.platform == 'darwin' else 1024) / 1e6
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def with_options(providers: Sequence[str], checksum: str) -> list[Any]:
    """Return what ONNX Runtime's session takes: names, or (name, options).

    Args:
        providers: names, the preferred one first.
        checksum: of the ONNX file; an engine that TensorRT built for another file is never used.
    """
    return [(name, _tensorrt_options(checksum)) if name == TENSORRT else name for name in providers]


def engine_folder(checksum: str) -> Path:
    """Return where TensorRT keeps the engines of a file; they fit one version and one device."""
    return _CACHE.expanduser() / f'{checksum[:16]}-{_tensorrt_version()}-{_device()}'


def _tensorrt_options(checksum: str) -> dict[str, str]:
    folder = engine_folder(checksum)
    folder.mkdir(parents=True, exist_ok=True)
    return {
        'trt_engine_cache_enable': 'True',
        'trt_engine_cache_path': str(folder),
        'trt_timing_cache_enable': 'True',
        'trt_timing_cache_path': str(folder),
        # Without this an fp16 vision transformer collapses silently.
        'trt_layer_norm_fp32_fallback': 'True',
        'trt_fp16_enable': 'True',
    }


def _tensorrt_version() -> str:
    try:
        return metadata.version('tensorrt')
    except metadata.PackageNotFoundError:
        return f'ort{ort.__version__}'


def _device() -> str:
    for file in _DEVICE_FILES:
        if file.is_file():
            words = file.read_text(errors='replace').replace('\0', '').split()
            return '-'.join(word for word in words if word.isalnum())[:48]
    return 'device'
