# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two vehicles on one machine: each landing node commands its own, by namespace and port."""

from __future__ import annotations

import threading
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger

from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim, Mode

CLIMB_M = 30.0
DRONES = ('drone_1', 'drone_2')


def test_each_landing_commands_its_own_vehicle(bench, values_of, take_off):
    parameters = AutopilotParameters(port=0, speed=5.0)
    with AutopilotSim(parameters) as first, AutopilotSim(parameters) as second:
        sims = dict(zip(DRONES, (first, second), strict=True))
        statuses, heatmaps, services = {}, {}, {}
        for drone, sim in sims.items():
            statuses[drone] = bench.heard(DiagnosticArray, f'{drone}/landing/status', qos.RESULT)
            create = partial(LandingNode, namespace=f'/{drone}')
            node = bench.run(create, mavlink=sim.url, safe_altitude_m=20.5)
            heatmaps[drone] = bench.offer_heatmaps(drone)
            services[drone] = bench.peer.create_client(Trigger, f'/{drone}/landing/engage')
        safety = np.full((32, 32), 0.97, np.float32)

        def see() -> None:
            for publisher in heatmaps.values():
                publisher.publish(safety, node.clock_ns())

        def engage(drone: str) -> bool:
            future = services[drone].call_async(Trigger.Request())
            bench.until(future.done, see)
            return future.result().success

        climbs = [
            threading.Thread(target=take_off, args=(sim.url, CLIMB_M)) for sim in sims.values()
        ]
        for climb in climbs:
            climb.start()
        bench.until(lambda: not any(climb.is_alive() for climb in climbs), see)
        assert all(sim.pilot_mode('LOITER') for sim in sims.values())

        bench.until(lambda: engage('drone_1'), see)
        bench.until(lambda: first.truth().altitude_agl_m < CLIMB_M - 2.0, see)
        assert first.flight.mode is Mode.GUIDED
        assert second.flight.mode is Mode.LOITER
        assert abs(second.truth().altitude_agl_m - CLIMB_M) < 1.0
        assert values_of(statuses['drone_2'][-1])['state'] == 'IDLE'

        bench.until(lambda: engage('drone_2'), see)
        bench.until(lambda: second.truth().altitude_agl_m < CLIMB_M - 2.0, see)
