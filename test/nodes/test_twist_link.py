# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A pose that comes again says nothing new: the age of the telemetry goes on growing."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import Pose
from peace_ros.nodes.twist_link import TwistLink

S = 1_000_000_000


def pose_at(stamp_ns: int) -> Pose:
    return Pose(stamp_ns, 0.0, 0.0, -30.0, (1.0, 0.0, 0.0, 0.0), 30.0)


@pytest.fixture
def link():
    link = TwistLink(lambda _twist: None)
    link.add_pose(pose_at(100 * S))
    return link


@pytest.mark.parametrize('late_ns', [0, 1, S])
def test_an_old_pose_that_comes_again_does_not_look_fresh(link, late_ns):
    before = link.telemetry()
    link.add_pose(pose_at(100 * S - late_ns))
    assert link.telemetry() == before
    assert link.take_poses() == [pose_at(100 * S)]


@pytest.mark.parametrize('stamp_ns', [100 * S + 1, 3 * S])
def test_a_new_pose_and_one_of_a_clock_that_was_restarted_count(link, stamp_ns):
    before = link.telemetry()
    link.add_pose(pose_at(stamp_ns))
    assert link.telemetry().pose == pose_at(stamp_ns)
    assert link.telemetry().received_ns > before.received_ns
