# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rooms below the nodes must load on machines without ROS, torch or an autopilot's library."""

import subprocess
import sys

import pytest

BLOCKED_IN = {
    'core.domain': ['rclpy', 'torch', 'pymavlink', 'onnxruntime', 'cv2'],
    'core.prompting': ['rclpy', 'torch', 'pymavlink', 'onnxruntime', 'cv2'],
    'core.inference': ['rclpy', 'torch', 'pymavlink'],
    'core.segmentation': ['rclpy', 'torch', 'pymavlink'],
    'core.mapping': ['rclpy', 'torch', 'pymavlink', 'onnxruntime'],
    'core.landing': ['rclpy', 'torch', 'pymavlink', 'onnxruntime'],
    'core.vehicle': ['rclpy', 'torch', 'onnxruntime', 'cv2'],
    'simulation': ['rclpy', 'torch', 'pymavlink', 'onnxruntime'],
    'simulation.autopilot': ['rclpy', 'torch', 'onnxruntime'],
    'recording': ['rclpy', 'torch', 'pymavlink', 'onnxruntime'],
    'lab.replay': ['rclpy', 'torch', 'pymavlink'],
    'cli.main': ['rclpy', 'torch', 'pymavlink', 'onnxruntime', 'cv2'],
}

PROGRAM = """
import importlib, pkgutil, sys
room, blocked = sys.argv[1], set(sys.argv[2:])

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in blocked:
            raise ImportError(f'{name} is blocked')

sys.meta_path.insert(0, Blocker())
importlib.import_module(f'peace_ros.{room}')
"""


@pytest.mark.parametrize('room', BLOCKED_IN)
def test_room_loads_without_what_it_may_not_know(room: str) -> None:
    result = subprocess.run(
        [sys.executable, '-c', PROGRAM, room, *BLOCKED_IN[room]],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
