# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated autopilots of the tests of the vehicle link, and findings by their outcome."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from peace_ros.lab.doctor.finding import CheckResult

_PATH = Path(__file__).parents[2] / 'core' / 'vehicle' / 'conftest.py'
_SPEC = importlib.util.spec_from_file_location('shared_fixtures', _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_FIXTURES = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_FIXTURES)

mock_autopilot, free_port, hovering = (
    getattr(_FIXTURES, name) for name in ('mock_autopilot', 'free_port', 'hovering')
)


@pytest.fixture
def to_mend():
    """Return what must be mended among findings, as found and remedy."""
    return lambda findings: [
        (each.found, each.remedy) for each in findings if each.outcome is CheckResult.MEND
    ]
