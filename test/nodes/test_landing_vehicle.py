# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing node and a simulated autopilot over TCP: hand-over and landing, and no position."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from peace_ros.domain import Heatmap
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.messages import heatmap_to_image
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.autopilot.faults import inject

SAFETY = np.full((88, 88), 0.97, np.float32)


@pytest.fixture
def hovering() -> Iterator[AutopilotSim]:
    """A vehicle 26 m above home in GUIDED, reached by TCP."""
    with socket.create_server(('127.0.0.1', 0)) as probe:
        tcp_port = probe.getsockname()[1]
    sim = AutopilotSim(AutopilotParameters(port=0, tcp_port=tcp_port, speed=8.0))
    sim.step(43.0)
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

        heatmaps = bench.offer(Image, 'heatmap', qos.IMAGE_OUT)

        def see() -> None:
            heatmaps.publish(heatmap_to_image(Heatmap(SAFETY, node.clock_ns())))

        def engage() -> Trigger.Response:
            future = client.call_async(Trigger.Request())
            bench.until(future.done, see)
            return future.result()

        bench.until(client.service_is_ready)
        bench.until(lambda: bool(statuses), see)
        return see, engage, statuses

    return start


def test_after_the_hand_over_the_autopilot_lands(bench, hovering, engaging, values_of) -> None:
    see, engage, statuses = engaging(vehicle__after_handover='land')
    bench.until(lambda: engage().success, see)
    bench.until(lambda: values_of(statuses[-1])['state'] == 'HANDOVER', see)
    bench.until(lambda: hovering.mode_name == 'LAND', see)
    bench.until(lambda: hovering.truth().altitude_agl_m == 0.0, see)
    assert values_of(statuses[-1])['state'] == 'HANDOVER'


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
