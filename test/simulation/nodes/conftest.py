# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulators' nodes are tested on the same bench as the nodes that fly."""

from __future__ import annotations

import importlib.util
from pathlib import Path

_PATH = Path(__file__).parents[2] / 'nodes' / 'conftest.py'
_SPEC = importlib.util.spec_from_file_location('shared_fixtures', _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_FIXTURES = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_FIXTURES)

ros, bench, picture, values_of, take_off = (
    getattr(_FIXTURES, name) for name in ('ros', 'bench', 'picture', 'values_of', 'take_off')
)
