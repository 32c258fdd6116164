# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An autopilot dialect of your own: a copter that holds its position in POSHOLD.

``custom_dialect.py URL`` asks a vehicle that is there; without URL a simulated one. For the landing
node, register the dialect, then call ``peace_ros.nodes.landing.main`` with ``dialect:=poshold``.
"""

import sys
from dataclasses import dataclass

from peace_ros.core.vehicle import ArduPilot, open_vehicle, register_dialect
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim


@dataclass(frozen=True)
class PosHold(ArduPilot):
    """ArduCopter with another hold mode; other firmware implements the Protocol ``Dialect``."""

    name: str = 'poshold'
    hold_mode: str = 'POSHOLD'


register_dialect('poshold', lambda _hold_mode: PosHold())
with AutopilotSim(AutopilotParameters(port=0)) as simulated:
    link = open_vehicle(sys.argv[1] if sys.argv[1:] else simulated.url, dialect='poshold')
    print(link.dialect.name, link.request_hold(), link.telemetry().mode)
    link.close()
