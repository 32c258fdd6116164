# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fly the landing core over a list of heatmaps: the ground is safe 6 m east of the start and on."""

import numpy as np

from peace_ros.core.domain import Camera, Heatmap, Pose, Telemetry
from peace_ros.core.landing import LandingCore, LandingParameters

camera = Camera.from_degrees(100, 100, 73.0)
right = (np.arange(100) - camera.centre_px[0]) / camera.focal_px
core = LandingCore(LandingParameters(), camera)
core.engage()
north_m, east_m, down_m, state = 0.0, 0.0, -60.0, None
for now_ns in range(0, 120_000_000_000, 100_000_000):  # two minutes in steps of 0.1 s
    pose = Pose(now_ns, north_m, east_m, down_m, (1.0, 0.0, 0.0, 0.0), -down_m)
    safety = np.where(east_m - down_m * right > 6.0, 0.95, 0.05).astype(np.float32)
    core.add_pose(pose)
    core.add_heatmap(Heatmap(np.tile(safety, (100, 1)), now_ns))
    decision = core.step(now_ns, Telemetry(now_ns, pose, armed=True, in_control=True), 0.0)
    if decision.state is not state:
        state = decision.state
        print(f'{now_ns / 1e9:5.1f} s {-down_m:5.1f} m {state.value}: {decision.reason}')
    north_m += 0.1 * decision.setpoint.v_north_m_s
    east_m += 0.1 * decision.setpoint.v_east_m_s
    down_m += 0.1 * decision.setpoint.v_down_m_s
print(f'east {east_m:.1f} m, altitude {-down_m:.1f} m')
