# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing node and a simulated autopilot over TCP: hand-over and landing, and no position."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from math import hypot

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from std_srvs.srv import Trigger

from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim, commands
from peace_ros.simulation.autopilot.faults import inject

SAFETY = np.full((88, 88), 0.97, np.float32)


@pytest.fixture
def autopilot() -> str:
    """Which autopilot flies; a test may say another."""
    return 'ardupilot'


@pytest.fixture
def hovering(autopilot) -> Iterator[AutopilotSim]:
    """A vehicle 26 m above home, in GUIDED or AUTO.LOITER, reached by TCP."""
    with socket.create_server(('127.0.0.1', 0)) as probe:
        tcp_port = probe.getsockname()[1]
    # PX4 leaves OFFBOARD when 0.5 s of its clock bring no set-point.
    speed = 2.0 if autopilot == 'px4' else 8.0
    parameters = AutopilotParameters(port=0, tcp_port=tcp_port, speed=speed, autopilot=autopilot)
    sim = AutopilotSim(parameters)
    sim.step(43.0)
    if autopilot == 'px4':
        sim.flight.take_off(26.0 + sim.parameters.home_altitude_msl_m)
        sim.flight.arm()
    else:
        sim.pilot_mode('GUIDED')
        sim.flight.arm()
        sim.flight.take_off(26.0)
    sim.step(25.0)
    with sim:
        yield sim


@pytest.fixture
def engaging(bench, hovering):
    """Start the node with some parameters; return how to see, how to engage, and the statuses."""
    statuses = bench.heard(DiagnosticArray, 'landing/status', qos.RESULT)
    client = bench.peer.create_client(Trigger, '/landing/engage')

    def start(**parameters):
        node = bench.run(LandingNode, mavlink=hovering.tcp_url, safe_altitude_m=20.5, **parameters)

        heatmaps = bench.offer_heatmaps()

        def see() -> None:
            heatmaps.publish(SAFETY, node.clock_ns())

        def engage() -> Trigger.Response:
            future = client.call_async(Trigger.Request())
            bench.until(future.done, see)
            return future.result()

        bench.until(client.service_is_ready)
        bench.until(lambda: bool(statuses), see)
        return see, engage, statuses

    return start


@pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])
def test_after_the_hand_over_the_autopilot_lands_and_disarms(
    bench, hovering, engaging, values_of
) -> None:
    see, engage, statuses = engaging(vehicle__after_handover='land')
    bench.until(lambda: engage().success, see)
    bench.until(lambda: values_of(statuses[-1])['state'] == 'HANDOVER', see)
    bench.until(lambda: hovering.mode_name in {'LAND', 'AUTO.LAND'}, see)
    bench.until(lambda: not hovering.flight.armed, see)
    assert hovering.truth().altitude_agl_m == 0.0
    assert hovering.flight.physics.touchdown_speed_m_s < 1.0
    assert values_of(statuses[-1])['state'] == 'HANDOVER'


@pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])
def test_a_landing_node_that_is_shut_down_lets_the_autopilot_hold(
    bench, hovering, engaging
) -> None:
    see, engage, _ = engaging()
    client = bench.peer.create_client(ChangeState, '/landing/change_state')
    bench.until(client.service_is_ready)
    bench.until(lambda: engage().success, see)
    assert hovering.mode_name in {'GUIDED', 'OFFBOARD'}
    future = client.call_async(ChangeState.Request(transition=Transition(label='shutdown')))
    bench.until(future.done, see)
    bench.until(lambda: hovering.mode_name in {'BRAKE', 'AUTO.LOITER'}, see, within_s=5.0)


def test_a_landing_that_ends_before_its_first_step_lets_the_autopilot_hold(
    bench, hovering, engaging
) -> None:
    see, *_ = engaging()
    (node,) = bench._nodes
    bench.until(lambda: not node.check_engagement(), see)
    assert hovering.mode_name == 'GUIDED'
    with node._lock:
        assert node.begin() == ''
        node.end_landing()
    bench.until(lambda: hovering.mode_name == 'BRAKE', see, within_s=8.0)


def test_after_the_hand_over_it_holds_where_nothing_else_was_asked_for(
    bench, hovering, engaging, values_of
) -> None:
    see, engage, statuses = engaging()
    bench.until(lambda: engage().success, see)
    assert hovering.mode_name in {'GUIDED', 'OFFBOARD'}
    bench.until(lambda: values_of(statuses[-1])['state'] == 'HANDOVER', see)
    bench.until(lambda: abs(hovering.flight.physics.velocity_ned_m_s[2]) < 0.05, see)
    setpoints, altitude_m = hovering.flight.setpoints, hovering.truth().altitude_agl_m
    end = time.monotonic() + 1.5
    bench.until(lambda: time.monotonic() > end, see)
    assert hovering.mode_name in {'GUIDED', 'OFFBOARD'}, 'zero velocity keeps flowing'
    assert hovering.flight.setpoints > setpoints + 10
    assert hovering.truth().altitude_agl_m == pytest.approx(altitude_m, abs=0.3)


def test_after_the_hand_over_the_site_is_told_to_the_next_stage(
    bench, hovering, engaging, values_of, monkeypatch
) -> None:
    told = []
    with monkeypatch.context() as patch:
        take = commands.run_message

        def keep(flight, message):
            if message.get_type() == 'LANDING_TARGET':
                told.append(message)
            return take(flight, message)

        patch.setattr('peace_ros.simulation.autopilot.server.run_message', keep)
        see, engage, statuses = engaging(vehicle__after_handover='landing_target')
        sites = bench.heard(PointStamped, 'landing/site', qos.RESULT)
        bench.until(lambda: engage().success, see)
        bench.until(lambda: values_of(statuses[-1])['state'] == 'LANDING', see)
        assert not told, 'not before the hand-over'
        bench.until(lambda: values_of(statuses[-1])['state'] == 'HANDOVER', see)
        bench.until(lambda: len(told) > 5 and bool(sites), see)
    assert hovering.mode_name in {'GUIDED', 'OFFBOARD'}
    assert told[-1].position_valid == 1
    pose = hovering.truth()
    north, east = sites[-1].point.y, sites[-1].point.x
    away_m = hypot(north - pose.north_m, east - pose.east_m, pose.altitude_agl_m)
    assert told[-1].distance == pytest.approx(away_m, abs=1.0)


class Tracker:
    """External navigation: tells the autopilot over MAVLink where it is, until it is stopped."""

    def __init__(self, sim: AutopilotSim) -> None:
        self._sim = sim
        self._to = ('127.0.0.1', int(sim.url.rpartition(':')[2]))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        codec = mavlink.MAVLink(None, 1, 197)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            origin = mavlink.MAVLink_set_gps_global_origin_message(1, 488580000, 23420000, 35000)
            line.sendto(origin.pack(codec), self._to)
            source = mavlink.MAVLink_command_long_message(1, 1, 42007, 0, 2, 0, 0, 0, 0, 0, 0)
            line.sendto(source.pack(codec), self._to)
            while not self._stop.wait(0.02):
                at = self._sim.truth()
                seen = mavlink.MAVLink_vision_position_estimate_message(
                    at.stamp_ns // 1000, at.north_m, at.east_m, at.down_m, 0.0, 0.0, 0.0
                )
                line.sendto(seen.pack(codec), self._to)

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


def test_lands_without_any_gnss_by_external_navigation(bench, hovering, engaging, values_of):
    see, engage, statuses = engaging()
    tracker = Tracker(hovering)
    bench.until(lambda: hovering.flight.estimator.source == 2 and hovering.flight.has_position, see)
    inject(hovering, 'gps_loss')
    try:
        bench.until(lambda: engage().success, see)
        bench.until(lambda: values_of(statuses[-1])['state'] == 'HANDOVER', see)
        # Eight times as fast as time, delays of this machine are eight times as long.
        assert hovering.truth().altitude_agl_m == pytest.approx(20.0, abs=3.0)
    finally:
        tracker.stop()
    bench.until(lambda: hovering.mode_name == 'LAND', see)


def test_without_a_position_it_says_so_and_holds_level(bench, hovering, engaging) -> None:
    see, engage, _ = engaging(vehicle__attitude_fallback=True)
    bench.until(lambda: engage().success, see)
    inject(hovering, 'gps_loss')
    bench.until(lambda: hovering.mode_name == 'LAND', see)
    bench.until(lambda: 'holds level' in (answer := engage()).message and not answer.success, see)
    assert hovering.mode_name == 'GUIDED_NOGPS'
    altitude_m = hovering.truth().altitude_agl_m
    time.sleep(1.0)
    assert abs(hovering.truth().altitude_agl_m - altitude_m) < 1.0
