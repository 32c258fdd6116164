# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rooms below the nodes must load on machines without ROS, torch or an autopilot's library."""

from __future__ import annotations

import importlib.util
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

NOT_ON_A_VEHICLE = [
    *(f'peace_ros.{room}' for room in ('lab', 'simulation', 'recording', 'cli')),
    *('torch', 'transformers', 'onnx', 'rosbags', 'tifffile', 'rich', 'typer'),
]

PROGRAM = """
import importlib, pkgutil, sys
room, blocked = sys.argv[1], set(sys.argv[2:])

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if blocked & {name, name.split('.')[0]}:
            raise ImportError(f'{name} is blocked')

sys.meta_path.insert(0, Blocker())
package = importlib.import_module(f'peace_ros.{room}')
if room in ('core', 'nodes'):
    for each in pkgutil.walk_packages(package.__path__, package.__name__ + '.'):
        importlib.import_module(each.name)
        print(each.name)
"""


def load(room: str, *blocked: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, '-c', PROGRAM, room, *blocked]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize('room', BLOCKED_IN)
def test_room_loads_without_what_it_may_not_know(room: str) -> None:
    result = load(room, *BLOCKED_IN[room])
    assert result.returncode == 0, result.stderr


def test_every_module_of_the_core_loads_without_ros_and_without_the_lab() -> None:
    result = load('core', 'rclpy', *NOT_ON_A_VEHICLE)
    assert result.returncode == 0, result.stderr
    assert {'peace_ros.core.landing.core', 'peace_ros.core.vehicle.mavlink'} <= set(
        result.stdout.split()
    )


@pytest.mark.skipif(importlib.util.find_spec('rclpy') is None, reason='ROS 2 is not installed')
def test_every_module_of_the_nodes_loads_without_the_lab() -> None:
    result = load('nodes', *NOT_ON_A_VEHICLE)
    assert result.returncode == 0, result.stderr
    assert 'peace_ros.nodes.landing' in result.stdout.split()


def test_what_is_blocked_stops_an_import() -> None:
    result = load('core', 'numpy')
    assert result.returncode == 1
    assert 'numpy is blocked' in result.stderr
