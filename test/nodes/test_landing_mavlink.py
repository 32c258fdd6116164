# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Over MAVLink: control is asked for once, and a pilot who takes over keeps the vehicle."""

from __future__ import annotations

import threading

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger

from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim, Mode

CLIMB_M = 30.0


def test_a_landing_from_refusal_to_takeover(bench, values_of, take_off):
    statuses = bench.heard(DiagnosticArray, 'landing/status', qos.RESULT)
    with AutopilotSim(AutopilotParameters(port=0, speed=25.0)) as sim:
        node = bench.run(LandingNode, mavlink=sim.url, safe_altitude_m=20.5)
        heatmaps = bench.offer_heatmaps()
        safety = np.full((88, 88), 0.97, np.float32)
        client = bench.peer.create_client(Trigger, '/landing/engage')

        def see() -> None:
            heatmaps.publish(safety, node.clock_ns())

        def engage() -> Trigger.Response:
            future = client.call_async(Trigger.Request())
            bench.until(future.done, see)
            return future.result()

        def now() -> dict[str, str]:
            return values_of(statuses[-1]) if statuses else {}

        bench.until(client.service_is_ready)
        bench.until(lambda: now().get('north_m') is not None, see)
        assert 'not armed' in engage().message
        flying = threading.Thread(target=take_off, args=(sim.url, CLIMB_M))
        flying.start()
        bench.until(lambda: not flying.is_alive(), see)
        assert abs(sim.truth().altitude_agl_m - CLIMB_M) < 2.0

        assert sim.pilot_mode('LOITER')
        bench.until(lambda: now()['mode'] == 'LOITER', see)
        bench.until(lambda: engage().success, see)
        assert sim.flight.mode is Mode.GUIDED
        bench.until(lambda: sim.truth().altitude_agl_m < CLIMB_M - 2.0, see)

        assert sim.pilot_mode('LOITER')
        changes = sim.flight.mode_changes
        bench.until(lambda: now()['state'] == 'ABORTED', see)
        assert now()['outcome'] == 'aborted'
        bench.until(lambda: now()['sender'] == 'nothing submitted yet', see)
        seen = len(statuses)
        bench.until(lambda: len(statuses) > seen + 10, see)
        assert sim.flight.mode is Mode.LOITER
        assert sim.flight.mode_changes == changes
        assert now()['sender'] == 'nothing submitted yet'
