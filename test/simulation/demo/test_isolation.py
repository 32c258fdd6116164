# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A demo hears only itself, and its pictures have room."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from peace_ros.core.node_parameters import CameraOptions
from peace_ros.lab.faults.bench import CAMERA_HZ
from peace_ros.simulation.demo.isolation import PROFILE, isolate

NAMES = ('ROS_DOMAIN_ID', 'ROS_LOG_DIR', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS')


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*NAMES, PROFILE):
        monkeypatch.setenv(name, 'before')
        monkeypatch.delenv(name)


def test_it_gets_a_domain_of_its_own_on_this_machine(tmp_path: Path) -> None:
    domain = isolate(tmp_path)
    assert os.environ['ROS_DOMAIN_ID'] == str(domain)
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert 'ROS_STATIC_PEERS' not in os.environ


def test_its_shared_memory_holds_a_second_of_pictures(tmp_path: Path) -> None:
    isolate(tmp_path)
    text = Path(os.environ[PROFILE]).read_text(encoding='utf-8')
    sizes = [int(each) for each in re.findall(r'<segment_size>(\d+)<', text)]
    camera = CameraOptions().camera
    assert sizes[0] > 3 * camera.width_px * camera.height_px * CAMERA_HZ


def test_a_profile_of_the_user_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(PROFILE, '/theirs.xml')
    isolate(tmp_path)
    assert os.environ[PROFILE] == '/theirs.xml'
