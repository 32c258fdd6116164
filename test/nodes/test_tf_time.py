# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a look-up in tf costs when it fails: it is made in the step of the landing."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from peace_ros.core.domain import Pose
from peace_ros.nodes.tf import TfMounts

FRAMES = """camera:
  parent: 'arm'
"""


class TransformError(Exception):
    pass


class UntimelyError(TransformError):
    pass


class Buffer:
    """Fails as it is told to, and counts how often all frames are read."""

    def __init__(self) -> None:
        self.error: Exception = TransformError('not connected')
        self.asked = self.read = 0

    def lookup_transform(self, *_args: object) -> None:
        self.asked += 1
        raise self.error

    def all_frames_as_yaml(self) -> str:
        self.read += 1
        return FRAMES


@pytest.fixture
def buffer(monkeypatch) -> Buffer:
    buffer = Buffer()
    module = SimpleNamespace(
        TransformException=TransformError,
        ExtrapolationException=UntimelyError,
        Buffer=lambda: buffer,
        TransformListener=lambda *_args, **_options: None,
    )
    monkeypatch.setitem(sys.modules, 'tf2_ros', module)
    return buffer


def poses(count: int) -> list[Pose]:
    return [
        Pose(10**9 + k * 10**7, 0.0, 0.0, -40.0, (1.0, 0.0, 0.0, 0.0), 40.0) for k in range(count)
    ]


def test_a_missing_frame_is_looked_for_once_and_not_for_each_pose_that_waits(buffer) -> None:
    mounts = TfMounts(None, 'base_link')
    assert list(mounts.of(poses(200))) == []
    mounts.see('camera')
    assert list(mounts.of(())) == []
    assert 'upwards it ends at arm' in mounts.problem
    assert (buffer.asked, buffer.read) == (1, 1)


def test_a_transform_that_is_a_little_late_does_not_read_all_frames(buffer) -> None:
    mounts = TfMounts(None, 'base_link')
    mounts.see('camera')
    mounts.problem = ''
    buffer.error = UntimelyError('into the future')
    assert list(mounts.of(poses(3))) == []
    assert mounts.problem == '', 'it may still come'
    assert list(mounts.of(poses(100)[60:])) == []
    assert 'into the future' in mounts.problem
    assert buffer.read == 0
