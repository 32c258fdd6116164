# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated autopilot that already hovers, for flights in simulated time without MAVLink."""

from __future__ import annotations

from peace_ros.core.domain import Setpoint, VehicleError
from peace_ros.simulation.autopilot.estimate_errors import EstimateErrors, GnssAltitudeError
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.guided import PositionTarget
from peace_ros.simulation.autopilot.modes import Mode
from peace_ros.simulation.autopilot.personality import Personality
from peace_ros.simulation.autopilot.physics import Physics

_TICK_S = 0.01
_BOOT_S = 60.0
_SETTLE_S = 3.0
_VELOCITY_AND_RATE = 0x5C7
_LOCAL_NED = 1


def hovering(
    physics: Physics,
    altitude_m: float,
    personality: Personality | None = None,
    errors: EstimateErrors | None = None,
    gnss: GnssAltitudeError | None = None,
) -> Flight:
    """Return an autopilot that has hovered in this wind for a while, in GUIDED or OFFBOARD.

    Args:
        physics: Of the vehicle, at rest on the ground; its position becomes the local origin.
        altitude_m: Where it hovers, in metres above the ground.
        personality: Which autopilot; None: ArduPilot.
        errors: Of its estimates; None: none.
        gnss: Error of the GNSS altitude; None: none.

    Raises:
        VehicleError: It does not come into the air.
    """
    flight = Flight(physics, personality, errors=errors, gnss=gnss)
    while not flight.has_position:
        flight.step(_TICK_S)
    flight.set_mode(Mode.STABILIZE if flight.personality.is_px4 else Mode.GUIDED)
    flight.arm(force=True)
    flight.take_off(5.0)
    until_s = flight.time_s + _BOOT_S
    while flight.landed_state.name != 'IN_AIR':
        if flight.time_s > until_s:
            raise VehicleError(f'the simulated vehicle did not take off within {_BOOT_S:g} s')
        flight.step(_TICK_S)
    physics.north_m = physics.east_m = 0.0
    physics.down_m = -altitude_m
    for mode in (Mode.BRAKE, Mode.GUIDED):
        flight.take_velocity(velocity_target(Setpoint(0)))
        flight.set_mode(mode)
        for _ in range(round(_SETTLE_S / _TICK_S)):
            flight.take_velocity(velocity_target(Setpoint(0)))
            flight.step(_TICK_S)
    return flight


def velocity_target(setpoint: Setpoint) -> PositionTarget:
    """Return a set-point as SET_POSITION_TARGET_LOCAL_NED carries it; the heading is held."""
    velocity = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
    return PositionTarget(_LOCAL_NED, _VELOCITY_AND_RATE, velocity)
