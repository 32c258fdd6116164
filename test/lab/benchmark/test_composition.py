# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What one process for perception saves, and what it cannot save."""

from __future__ import annotations

import pytest
import rclpy
from geometry_msgs.msg import TwistStamped

from peace_ros.lab.benchmark.composition import Load, _HoveringCamera, median_of, network_share
from peace_ros.nodes.messages import header


def test_each_figure_has_its_own_median():
    rounds = [Load(0.1, 5.0, 1.0, 0.3, 9.0), Load(0.2, 4.0, 2.0, 0.2, 7.0)]
    assert median_of([*rounds, Load(0.9, 9.0, 9.0, 0.1, 8.0)]) == Load(0.2, 5.0, 2.0, 0.2, 8.0)


def test_the_networks_are_a_part_of_what_a_frame_takes():
    frame_s, networks_s = network_share((64, 48), frames=2)
    assert 0.0 < networks_s < frame_s


@pytest.fixture
def world():
    context = rclpy.Context()
    context.init(args=[])
    node = _HoveringCamera(64, 48, 5.0, context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_only_the_first_setpoint_that_rests_on_a_frame_counts(world):
    world._show()
    (frame_ns,) = world._frames_ns
    world._on_setpoint(TwistStamped(header=header(frame_ns)))
    (latency_s,) = world.setpoint_latencies_s.values()
    assert 0.0 < latency_s < 10.0
    world._on_setpoint(TwistStamped(header=header(frame_ns)))
    world._on_setpoint(TwistStamped(header=header(frame_ns + 1)))
    assert world.setpoint_latencies_s == {frame_ns: latency_s}
    world.begin()
    world._on_setpoint(TwistStamped(header=header(frame_ns)))
    assert world.setpoint_latencies_s == {}
