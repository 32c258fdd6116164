# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The presets of a replay are those of the package."""

from peace_ros.presets import DEFAULT_PRESET, Preset, load_preset, preset_names

__all__ = ['DEFAULT_PRESET', 'Preset', 'load_preset', 'preset_names']
