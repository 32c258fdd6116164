# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds, the nadir camera over them, and (in ``simulation.autopilot``) something to fly with."""

from peace_ros.simulation.camera import CameraView, NadirCamera
from peace_ros.simulation.world import World, draw_world, load_world

__all__ = ['NadirCamera', 'CameraView', 'World', 'draw_world', 'load_world']
