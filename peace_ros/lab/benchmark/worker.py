# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each way is measured in a process of its own: memory and threads of one do not affect another."""

from __future__ import annotations

import importlib
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

from peace_ros.core.domain import PeaceError


class BenchmarkError(PeaceError):
    """A measurement that could not be made."""


def run_apart(function: str, **arguments: Any) -> Any:
    """Return what ``module:function`` returns in a new process, whose output is dropped.

    Raises BenchmarkError with the reason why it failed.
    """
    with ProcessPoolExecutor(1, get_context('spawn'), _be_quiet) as pool:
        try:
            return pool.submit(_call, function, arguments).result()
        except Exception as error:
            raise BenchmarkError(f'benchmark of {function} failed: {error}') from error


def _be_quiet() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


def _call(function: str, arguments: dict[str, Any]) -> Any:
    module, name = function.split(':')
    return getattr(importlib.import_module(module), name)(**arguments)
