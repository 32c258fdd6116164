# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the demo says while it waits."""

from __future__ import annotations

import pytest

from peace_ros.simulation.demo.run import awaited

NO_POSITION = 'the autopilot tells no position because GNSS has lost its fix'


@pytest.mark.parametrize(
    ('images', 'waited_s', 'problem', 'sentence'),
    [
        (0, 2.9, NO_POSITION, 'waiting for the camera and the networks'),
        (0, 3.0, NO_POSITION, f'waiting for the camera: {NO_POSITION}'),
        (0, 3.0, '', 'waiting for the camera: its first picture has not come'),
        (1, 3.0, NO_POSITION, 'waiting for the networks'),
    ],
)
def test_the_reason_of_a_camera_that_shows_nothing_is_said_after_3_s(
    images: int, waited_s: float, problem: str, sentence: str
) -> None:
    assert awaited(images, waited_s, problem) == sentence
