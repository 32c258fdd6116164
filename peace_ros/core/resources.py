# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the shipped models and configuration lie, in a checkout and when installed."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _shipped(name: str) -> Path:
    """Find a folder beside the package (checkout, symlink install) or inside it (installed)."""
    beside = _PACKAGE.parent / name
    if (_PACKAGE.parent / 'package.xml').is_file() and beside.is_dir():
        return beside
    return _PACKAGE / name


def models_dir() -> Path:
    """Return the folder of the bundled models."""
    return _shipped('models')


def config_dir() -> Path:
    """Return the folder of the shipped configuration."""
    return _shipped('config')
