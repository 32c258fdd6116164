# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An autopilot dialect of your own: a copter that holds its position in POSHOLD.

Start an autopilot (``peace_autopilot_sim``) and give its address; for the landing node call
``register()`` and then ``peace_ros.nodes.landing.main()`` with ``-p dialect:=poshold``.
"""

import sys
from dataclasses import dataclass

from peace_ros.core.vehicle import ArduPilot, open_vehicle, register_dialect


@dataclass(frozen=True)
class PosHold(ArduPilot):
    """Everything as in ArduCopter but the mode for holding position.

    A firmware with its own modes or messages implements the Protocol
    ``peace_ros.core.vehicle.Dialect`` instead.
    """

    name: str = 'poshold'
    hold_mode: str = 'POSHOLD'


def register() -> None:
    """Make the dialect known; its parameter ``vehicle.hold_mode`` is not used."""
    register_dialect('poshold', lambda _hold_mode: PosHold())


if __name__ == '__main__':
    register()
    link = open_vehicle(sys.argv[1], dialect='poshold')
    print(link.dialect.name, link.request_hold(), link.telemetry().mode)
    link.close()
