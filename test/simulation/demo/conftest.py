# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pilot of the demo flies the simulated autopilots of the tests of the vehicle link."""

from __future__ import annotations

import importlib.util
from pathlib import Path

_PATH = Path(__file__).parents[2] / 'core' / 'vehicle' / 'conftest.py'
_SPEC = importlib.util.spec_from_file_location('shared_fixtures', _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_FIXTURES = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_FIXTURES)

eventually, mock_autopilot, free_port, hovering, flying = (
    getattr(_FIXTURES, name)
    for name in ('eventually', 'mock_autopilot', 'free_port', 'hovering', 'flying')
)
