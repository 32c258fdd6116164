# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What several rooms' tests share: small real bundles and a frame."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import Frame

# A message takes any value otherwise, and sends a float32 of NumPy as zero without an error.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'

if 'PYTEST_XDIST_WORKER' in os.environ:
    # OpenMP's threads spin while they wait, which workers that share the cores pay for: torch took
    # three and a half times the processor time. Set before torch is loaded.
    os.environ.setdefault('OMP_NUM_THREADS', '1')


def _load_tiny_bundles() -> ModuleType:
    path = Path(__file__).with_name('tiny_bundles.py')
    spec = importlib.util.spec_from_file_location('tiny_bundles', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='session')
def tiny() -> ModuleType:
    """The module that writes bundles."""
    return _load_tiny_bundles()


@pytest.fixture
def clip_folder(tiny: Any, tmp_path: Path) -> Path:
    folder: Path = tiny.write_bundle(tmp_path / 'clip-tiny', 'clip')
    return folder


@pytest.fixture
def clipseg_folder(tiny: Any, tmp_path: Path) -> Path:
    folder: Path = tiny.write_bundle(tmp_path / 'clipseg-tiny', 'clipseg')
    return folder


@pytest.fixture
def frame() -> Frame:
    rng = np.random.default_rng(7)
    return Frame(rng.integers(0, 256, (96, 128, 3), np.uint8), 5_000)
