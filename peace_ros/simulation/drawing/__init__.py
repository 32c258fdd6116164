# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws nadir aerial scenes with exact labels, in metres, at any resolution."""

from peace_ros.simulation.drawing.conditions import CONDITIONS, apply_condition
from peace_ros.simulation.drawing.layouts import LAYOUTS
from peace_ros.simulation.drawing.palette import SEASONS
from peace_ros.simulation.drawing.scene import Scene, draw_scene

__all__ = ['CONDITIONS', 'LAYOUTS', 'SEASONS', 'Scene', 'apply_condition', 'draw_scene']
