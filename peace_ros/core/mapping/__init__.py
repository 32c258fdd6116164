# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps and poses become a map of safe ground in the local frame."""

from peace_ros.core.mapping.layers import MapLayers
from peace_ros.core.mapping.parameters import MapParameters
from peace_ros.core.mapping.registration import Displacement, Mismatch, View, register, small_grey
from peace_ros.core.mapping.safety_map import RefusedLookError, SafetyMap

__all__ = [
    'Displacement',
    'MapLayers',
    'MapParameters',
    'Mismatch',
    'RefusedLookError',
    'SafetyMap',
    'View',
    'register',
    'small_grey',
]
