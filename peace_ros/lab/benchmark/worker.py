# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each way is measured in a process of its own: memory and threads of one never blur another."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from peace_ros.core.domain import PeaceError
from peace_ros.lab.benchmark.measure import Measured


class BenchmarkError(PeaceError):
    """A measurement that could not be made."""


def measure_apart(function: str, **arguments: Any) -> Measured:
    """Run ``module:function`` of this package in a new process and return what it measured.

    Raises BenchmarkError with the last line of what the process said.
    """
    result = run_apart(function, **arguments)
    return Measured.from_json(result)


def run_apart(function: str, **arguments: Any) -> Any:
    """Run ``module:function`` in a new process; what it takes and returns is plain JSON."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / 'answer.json'
        command = [
            sys.executable,
            '-m',
            __name__,
            function,
            json.dumps(arguments),
            str(answer),
        ]
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        if process.returncode or not answer.is_file():
            lines = process.stderr.strip().splitlines() or ['it said nothing']
            raise BenchmarkError(f'benchmark of {function} failed: {lines[-1]}')
        return json.loads(answer.read_text(encoding='utf-8'))


def _main(function: str, arguments: str, answer: str) -> None:
    module, name = function.split(':')
    result = getattr(importlib.import_module(module), name)(**json.loads(arguments))
    values = result.as_json() if isinstance(result, Measured) else result
    Path(answer).write_text(json.dumps(values), encoding='utf-8')


if __name__ == '__main__':
    _main(*sys.argv[1:])
