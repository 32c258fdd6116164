# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ``autopilot_sim`` node that can also be put into the air: ``fault_port`` knows ``place``.

A matrix of faults cannot wait for the boot and the climb before each of them.
"""

from __future__ import annotations

import sys

from peace_ros.core.domain import VehicleError
from peace_ros.simulation.autopilot import AutopilotSim, Mode
from peace_ros.simulation.autopilot.faults import FAULTS, clear
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.modes import Result
from peace_ros.simulation.nodes import autopilot_sim

_STEP_S = 0.01
_BOOT_S = 60.0
_CLIMB_S = 20.0
_SETTLE_S = 8.0
_OFF_THE_GROUND_M = 2.0
_FLOAT_M = 5.0


def place(
    sim: AutopilotSim, *, north_m: float = 0.0, east_m: float = 0.0, altitude_m: float = 50.0
) -> None:
    """Let the vehicle stand in the air in GUIDED, armed, undisturbed, without wind.

    PX4 stands in AUTO.LOITER: without set-points it does not stay in OFFBOARD. The simulated clock
    runs ahead by the time that boot and take-off take.
    """
    clear(sim)
    flight = sim.flight
    flight.physics.set_wind((0.0, 0.0), 0.0)
    flight.battery_remaining = 1.0
    if not flight.armed or flight.landed:
        _take_off(sim, flight)
    for _ in range(2):
        # Twice: the first time it may still have been moving.
        physics = flight.physics
        physics.north_m, physics.east_m, physics.down_m = north_m, east_m, -altitude_m
        for mode in (Mode.BRAKE,) if flight.personality.is_px4 else (Mode.BRAKE, Mode.GUIDED):
            if flight.set_mode(mode) is not Result.ACCEPTED:
                raise VehicleError(f'the simulated autopilot refuses {mode.name}: start it anew')
        _advance(flight, _SETTLE_S)


def _take_off(sim: AutopilotSim, flight: Flight) -> None:
    waited_s = 0.0
    while not flight.has_position or flight.prearm_problem():
        if waited_s > _BOOT_S:
            raise VehicleError(f'no position after {_BOOT_S} s: {flight.prearm_problem()}')
        _advance(flight, 1.0)
        waited_s += 1.0
    if flight.personality.is_px4:
        flight.take_off(_FLOAT_M + sim.parameters.home_altitude_msl_m)
        flight.arm(force=True)
    else:
        flight.set_mode(Mode.GUIDED)
        flight.arm(force=True)
        flight.take_off(_FLOAT_M)
    waited_s = 0.0
    while flight.landed or flight.physics.down_m > -_OFF_THE_GROUND_M:
        if waited_s > _CLIMB_S:
            raise VehicleError(f'no take-off within {_CLIMB_S} s: start the autopilot anew')
        _advance(flight, 1.0)
        waited_s += 1.0


def _advance(flight: Flight, seconds: float) -> None:
    for _ in range(round(seconds / _STEP_S)):
        flight.step(_STEP_S)


FAULTS['place'] = place

if __name__ == '__main__':
    sys.exit(autopilot_sim.main())
