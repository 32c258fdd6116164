# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing node stands still without data, engages only in the air, and never insists."""

from __future__ import annotations

import socket
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, Twist, TwistStamped
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from peace_ros.core.domain import Camera, ConfigurationError, Pose
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.messages import pose_to_message

LEVEL = (1.0, 0.0, 0.0, 0.0)


class Flight:
    """A simulator of one pose and one picture, both repeated; it ignores velocities."""

    def __init__(self, bench, node, safety=0.97):
        self.node = node
        self.poses = bench.offer(PoseStamped, 'pose', qos.POSE)
        self.heatmaps = bench.offer_heatmaps()
        self.safety = np.full((88, 88), safety, np.float32)
        self.altitude_m = 100.0
        self.has_heatmaps = True

    def __call__(self):
        at_ns = self.node.clock_ns()
        pose = Pose(at_ns, 0.0, 0.0, -self.altitude_m, LEVEL, self.altitude_m)
        self.poses.publish(pose_to_message(pose))
        if self.has_heatmaps:
            self.heatmaps.publish(self.safety, at_ns)


def call(bench, name, doing=None):
    client = bench.peer.create_client(Trigger, f'/landing/{name}')
    bench.until(client.service_is_ready, doing)
    future = client.call_async(Trigger.Request())
    bench.until(future.done, doing)
    return future.result()


def listen(bench):
    return bench.heard(DiagnosticArray, 'landing/status', qos.RESULT)


def state_of(statuses, values_of):
    return values_of(statuses[-1])['state'] if statuses else ''


def silent_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def test_a_silent_port_is_a_hold_with_a_reason_and_nothing_engages(bench, values_of):
    statuses = listen(bench)
    port = silent_port()
    bench.run(LandingNode, mavlink=f'udpin:127.0.0.1:{port}', vehicle__connect_timeout_s=0.2)
    bench.until(lambda: bool(statuses) and 'HEARTBEAT' in statuses[-1].status[0].message)
    values = values_of(statuses[-1])
    assert values['state'] == 'HOLD'
    assert f'udpin:127.0.0.1:{port}' in values['reason']
    answer = call(bench, 'engage')
    assert not answer.success
    assert 'HEARTBEAT' in answer.message


def test_refuses_to_engage_without_telemetry_and_without_heatmaps(bench):
    node = bench.run(LandingNode, interface='twist')
    assert 'no telemetry' in call(bench, 'engage').message
    flight = Flight(bench, node)
    flight.has_heatmaps = False
    for _ in range(3):
        flight()
    messages = []

    def ask():
        flight()
        messages.append(call(bench, 'engage', flight).message)

    bench.until(lambda: any('no heatmap yet' in each for each in messages), ask)


def test_lands_by_twist_once_engaged_and_stops_when_disengaged(bench, values_of):
    statuses = listen(bench)
    setpoints = bench.heard(TwistStamped, 'landing/setpoint', qos.RESULT)
    sites = bench.heard(PointStamped, 'landing/site', qos.RESULT)
    commands = bench.heard(Twist, 'cmd_vel', qos.COMMAND)
    node = bench.run(LandingNode, interface='twist')
    flight = Flight(bench, node)
    bench.until(lambda: state_of(statuses, values_of) == 'IDLE' and bool(sites), flight)
    assert not commands
    assert not setpoints
    bench.until(lambda: call(bench, 'engage', flight).success, flight)
    bench.until(lambda: any(each.linear.z < -0.3 for each in commands), flight)
    assert state_of(statuses, values_of) in {'AIMING', 'LANDING'}
    assert float(values_of(statuses[-1])['altitude_agl_m']) == pytest.approx(100.0)
    assert any(each.twist.linear.z < -0.3 for each in setpoints)
    assert not call(bench, 'engage', flight).success
    assert call(bench, 'disengage', flight).success
    commands.clear()
    bench.until(lambda: len(commands) > 4 and state_of(statuses, values_of) == 'IDLE', flight)
    assert all(each.linear.z == 0.0 for each in commands[2:])


def test_holds_with_zero_velocity_when_the_heatmaps_stop(bench, values_of):
    statuses = listen(bench)
    commands = bench.heard(Twist, 'cmd_vel', qos.COMMAND)
    node = bench.run(
        LandingNode,
        interface='twist',
        heatmap_age_limit_s=0.6,
        descent_heatmap_age_limit_s=0.5,
    )
    flight = Flight(bench, node)
    bench.until(lambda: call(bench, 'engage', flight).success, flight)
    bench.until(lambda: any(each.linear.z < -0.3 for each in commands), flight)
    flight.has_heatmaps = False
    bench.until(lambda: state_of(statuses, values_of) == 'HOLD', flight)
    assert 'heatmap' in values_of(statuses[-1])['reason']
    commands.clear()
    bench.until(lambda: len(commands) > 5, flight)
    still = [(each.linear.x, each.linear.y, each.linear.z) for each in commands[1:]]
    assert set(still) == {(0.0, 0.0, 0.0)}


@pytest.mark.parametrize('topic', ['heatmap', 'prompt'])
def test_holds_while_a_second_publisher_may_say_what_is_safe(bench, values_of, topic):
    statuses = listen(bench)
    commands = bench.heard(Twist, 'cmd_vel', qos.COMMAND)
    node = bench.run(LandingNode, interface='twist')
    flight = Flight(bench, node)
    kind = Image if topic == 'heatmap' else DiagnosticArray
    first = None if topic == 'heatmap' else bench.peer.create_publisher(kind, topic, 1)
    bench.until(lambda: call(bench, 'engage', flight).success, flight)
    bench.until(lambda: any(each.linear.z < -0.3 for each in commands), flight)
    intruder = bench.peer.create_publisher(kind, topic, 1)
    bench.until(lambda: state_of(statuses, values_of) == 'HOLD', flight)
    assert f'2 publishers of /{topic}' in values_of(statuses[-1])['reason']
    commands.clear()
    bench.until(lambda: len(commands) > 5, flight)
    still = [(each.linear.x, each.linear.y, each.linear.z) for each in commands[1:]]
    assert set(still) == {(0.0, 0.0, 0.0)}
    bench.peer.destroy_publisher(intruder)
    bench.until(lambda: any(each.linear.z < -0.3 for each in commands), flight)
    assert first is None or bench.peer.count_publishers(f'/{topic}') == 1


def test_engages_by_itself_only_when_told_so(bench, values_of):
    statuses = listen(bench)
    node = bench.run(LandingNode, interface='twist', auto_engage=True)
    flight = Flight(bench, node)
    bench.until(lambda: state_of(statuses, values_of) in {'SEARCHING', 'AIMING'}, flight)


def test_tf_needs_the_package_that_the_wheels_lack(bench):
    pytest.importorskip('rclpy')
    try:
        import tf2_msgs  # noqa: F401
    except ImportError:
        with pytest.raises(ConfigurationError, match='tf2_ros'):
            bench.run(LandingNode, interface='twist', pose_source='tf')


def test_a_node_that_fails_stops_the_vehicle_and_says_so_last(bench, values_of):
    statuses = listen(bench)
    velocities = bench.heard(Twist, 'cmd_vel', qos.COMMAND)
    node = bench.run(LandingNode, interface='twist')
    flight = Flight(bench, node)
    bench.until(lambda: call(bench, 'engage', flight).success, flight)

    def moves():
        last = velocities[-1].linear if velocities else None
        return last is not None and (last.x, last.y, last.z) != (0.0, 0.0, 0.0)

    bench.until(moves, flight)
    node.fail(ZeroDivisionError('by nothing'))
    node.fail(RuntimeError('a second one is not told'))
    until_s = time.monotonic() + 1.0
    while time.monotonic() < until_s:
        flight()
        time.sleep(0.02)
    values = values_of(statuses[-1])
    assert values['state'] == 'FAILED'
    assert 'ZeroDivisionError: by nothing' in values['reason']
    last = velocities[-1].linear
    assert (last.x, last.y, last.z) == (0.0, 0.0, 0.0)
    assert not call_failed(bench, flight).success


def call_failed(bench, doing):
    """Engage a node that has failed, at which the bench would raise."""
    client = bench.peer.create_client(Trigger, '/landing/engage')
    future = client.call_async(Trigger.Request())
    until_s = time.monotonic() + 10.0
    while not future.done() and time.monotonic() < until_s:
        doing()
        time.sleep(0.02)
    return future.result()


@pytest.mark.parametrize(
    ('size_px', 'reason'),
    [
        ((640, 360), ('640 x 360 px', '352 x 352 px', 'camera_info')),
        (None, ('heatmap/frame_info',)),
    ],
)
def test_engages_only_when_it_is_known_what_took_the_frames(bench, size_px, reason):
    node = bench.run(LandingNode, interface='twist')
    flight = Flight(bench, node)
    flight.heatmaps.frame_size_px = size_px
    bench.until(
        lambda: 'rejected' in node.check_engagement(),
        flight,
    )
    answer = call(bench, 'engage', flight)
    assert not answer.success
    for words in reason:
        assert words in answer.message
    flight.heatmaps.frame_size_px = (640, 360)
    flight.heatmaps.camera = Camera.from_degrees(640, 360, 90.0)
    bench.until(lambda: call(bench, 'engage', flight).success, flight)
