# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated autopilot that has booted, in a process: ``python vehicle.py ardupilot|px4 SPEED``.

Prints the UDP port that it listens on.
"""

import sys

from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim

BOOTED_S = 45.0

if __name__ == '__main__':
    parameters = AutopilotParameters(autopilot=sys.argv[1], port=0, speed=float(sys.argv[2]))
    with AutopilotSim(parameters) as sim:
        sim.step(BOOTED_S)
        print(sim.url.rpartition(':')[2], flush=True)
        sys.stdin.read()
