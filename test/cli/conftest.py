# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line in the test process."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest
from typer.testing import CliRunner

from peace_ros.cli.main import app


@pytest.fixture
def peace() -> Callable[..., Any]:
    """Run ``peace`` with these words; standard error is apart, also with click 8.1."""
    apart = inspect.signature(CliRunner.__init__).parameters.keys() & {'mix_stderr'}
    runner = CliRunner(**dict.fromkeys(apart, False))
    return lambda *words, **options: runner.invoke(app, list(words), **options)
