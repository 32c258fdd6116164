# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps and poses become a map of safe ground in the local frame."""

from peace_ros.core.mapping.layers import MapLayers
from peace_ros.core.mapping.parameters import MapParameters
from peace_ros.core.mapping.registration import Displacement, Mismatch, View, register, small_grey
from peace_ros.core.mapping.safety_map import RefusedLookError, SafetyMap
from peace_ros.core.mapping.scale import HeightChange, height_change

__all__ = [
    'Displacement',
    'HeightChange',
    'MapLayers',
    'MapParameters',
    'Mismatch',
    'RefusedLookError',
    'SafetyMap',
    'View',
    'height_change',
    'register',
    'small_grey',
]
