# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace faults`` at the command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from peace_ros.cli import faults as command
from peace_ros.cli.main import app
from peace_ros.lab.faults import worlds


@pytest.mark.parametrize('passed', [True, False])
def test_the_exit_status_tells_whether_all_passed(
    passed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worlds, 'prepare', lambda _folder: None)
    monkeypatch.setattr(command, '_matrix', lambda *_given: passed)
    result = CliRunner().invoke(app, ['faults', '--run-dir', str(tmp_path)])
    assert result.exit_code == (0 if passed else 1), result.output
