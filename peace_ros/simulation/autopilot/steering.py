# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each flight mode asks of the physics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import atan2, hypot

import numpy as np

from peace_ros.simulation.autopilot.datum import Vector
from peace_ros.simulation.autopilot.guided import (
    GUID_TIMEOUT_S,
    STOP,
    GuidedVelocity,
    PlaceTarget,
    PositionTarget,
    understand,
)
from peace_ros.simulation.autopilot.modes import Mode
from peace_ros.simulation.autopilot.physics import Physics, VelocityCommand, approach_speed_m_s

TAKE_OFF_SPEED_M_S = 2.5
TAKE_OFF_DONE_M = 0.1
LAND_FAST_M_S = 1.5
LAND_SLOW_M_S = 0.5
LAND_SLOW_BELOW_M = 10.0
RTL_SPEED_M_S = 5.0
RTL_NEAR_M = 1.0
LATERAL_BRAKING_M_S2 = 1.5
VERTICAL_BRAKING_M_S2 = 1.0
STANDING_M_S = 0.05
CLIMB_SPEED_M_S = 2.5
"""To a place, and of a full throttle stick (measured, ArduCopter 4.7-dev)."""
TURNS_BEYOND_M = 5.0
"""The nose turns to a place that is farther away."""
FALLING = VelocityCommand(v_down_m_s=30.0, lean_rad=(0.0, 0.0))
DOWN = VelocityCommand(v_down_m_s=LAND_SLOW_M_S)

THRUST = (0.0, 0.25, 0.5, 0.75, 1.0)
THRUST_CLIMB_M_S = (-1.5, -0.7, 0.0, 1.2, 2.4)
"""Climb rate in GUIDED_NOGPS over thrust."""


class Steering:
    """Keeps what a mode must remember: targets, hold point, age of set-points.

    Args:
        physics: Of the vehicle.
        holds_point: In GUIDED, zero velocity means to come back when something pushes.
    """

    def __init__(self, physics: Physics, *, holds_point: bool = True) -> None:
        self._physics = physics
        self._holds_point = holds_point
        self.stick_yaw_rate_rad_s = 0.0
        self.throttle_stick = 0.0
        """-1 (down) to 1 (up); in the middle the height is held."""
        self.cruise_m_s = 10.0
        """Speed over the ground to a place."""
        self.rtl_altitude_m = 15.0
        self.place: PlaceTarget | None = None
        """Where GUIDED, or AUTO.LOITER of PX4, flies to."""
        self.turn_to_rad: float | None = None
        """Heading that CONDITION_YAW asked for."""
        self._take_off_m: float | None = None
        self._spool_up_s = 0.0
        self._velocity = STOP
        self._velocity_age_s = 0.0
        self._attitude: VelocityCommand | None = None
        self._attitude_age_s = 0.0
        self._hold: tuple[float, float, float] | None = None
        """Where it stands, as the filter estimates it."""
        self.height_error_m = 0.0
        """Estimated minus true height."""
        self._home = (physics.north_m, physics.east_m)
        self._home_reached = False
        self._level_landing = False

    @property
    def taking_off(self) -> bool:
        """A take-off is under way."""
        return self._take_off_m is not None

    def landing(self, mode: Mode) -> bool:
        """The mode is about to touch the ground by itself.

        RTL stays RTL until the vehicle is disarmed (measured, ArduCopter 4.7-dev).
        """
        return mode is Mode.LAND or (mode is Mode.RTL and self._home_reached)

    def enter(self, mode: Mode, *, has_position: bool) -> None:
        """Forget what belonged to the mode before."""
        self._take_off_m = None
        self._velocity, self._attitude = STOP, None
        self._hold = self.place = self.turn_to_rad = None
        self._home_reached = False
        self._level_landing = mode is Mode.LAND and not has_position

    def take_off(self, altitude_m: float, spool_up_s: float) -> None:
        """Climb to an altitude above the ground after the motors have spooled up."""
        self._home = (self._physics.north_m, self._physics.east_m)
        self._take_off_m = altitude_m
        self._spool_up_s = spool_up_s

    def take_velocity(self, target: PositionTarget) -> None:
        """Obey a set-point until it is GUID_TIMEOUT_S old; a take-off ends."""
        understood = understand(target, self._physics.yaw_rad)
        if understood is None:
            return
        self._take_off_m = self.place = self.turn_to_rad = None
        self._velocity, self._velocity_age_s = understood, 0.0

    def take_place(self, place: PlaceTarget) -> None:
        """Fly to a place and stay there; a take-off ends."""
        self._take_off_m = self._hold = self.turn_to_rad = None
        self.place = place

    def stop(self) -> None:
        """Forget every target of GUIDED and hover."""
        self._take_off_m = self.place = self.turn_to_rad = None
        self._velocity = STOP

    def take_attitude(
        self, lean_rad: tuple[float, float], yaw_rad: float | None, thrust: float
    ) -> None:
        """Lean and climb as GUIDED_NOGPS is told."""
        climb = float(np.interp(thrust, THRUST, THRUST_CLIMB_M_S))
        self._attitude = VelocityCommand(v_down_m_s=-climb, lean_rad=lean_rad, yaw_rad=yaw_rad)
        self._attitude_age_s = 0.0

    def command(
        self,
        dt_s: float,
        mode: Mode,
        position_m: Vector,
        *,
        armed: bool,
        landed: bool,
        has_position: bool,
    ) -> VelocityCommand:
        """Return what the mode asks of the physics in this step; the position is estimated."""
        self._velocity_age_s += dt_s
        self._attitude_age_s += dt_s
        if not armed:
            return DOWN if landed else FALLING
        if self._take_off_m is not None:
            return self._with_stick(self._climb_out(dt_s, self._take_off_m))
        if landed:
            return DOWN
        return self._with_stick(self._of_mode(mode, position_m, has_position=has_position))

    def _of_mode(self, mode: Mode, position_m: Vector, *, has_position: bool) -> VelocityCommand:
        if self.place is not None and mode in {Mode.GUIDED, Mode.BRAKE}:
            return self._fly_to(self.place, position_m)
        if mode is Mode.GUIDED_NOGPS:
            fresh = self._attitude_age_s < GUID_TIMEOUT_S
            return self._attitude if self._attitude and fresh else _drift(0.0)
        if mode is Mode.LAND:
            return self._land(has_position=has_position)
        with_position: dict[Mode, Callable[[], VelocityCommand]] = {
            Mode.GUIDED: self._guided,
            Mode.RTL: self._return_home,
            Mode.LOITER: self._loiter,
            Mode.POSHOLD: self._loiter,
            Mode.BRAKE: self._hold_point,
            Mode.TAKEOFF: self._hold_point,
        }
        steer = with_position.get(mode)
        return steer() if steer is not None else _drift(self._stick_down_m_s)

    def _land(self, *, has_position: bool) -> VelocityCommand:
        speed = self._landing_speed_m_s()
        if self._level_landing or not has_position:
            return _drift(speed)
        return replace(self._hold_point(), v_down_m_s=speed)

    def target(self) -> VelocityCommand:
        """Return the velocity that GUIDED follows, zero once the set-point is too old."""
        v = self._velocity if self._velocity_age_s < GUID_TIMEOUT_S else STOP
        return VelocityCommand(v.v_north_m_s, v.v_east_m_s, v.v_down_m_s)

    def _guided(self) -> VelocityCommand:
        v: GuidedVelocity = self._velocity
        if self._velocity_age_s >= GUID_TIMEOUT_S:
            v = STOP
        if self._holds_point and v.v_north_m_s == v.v_east_m_s == v.v_down_m_s == 0.0:
            yaw_rad = v.yaw_rad if self.turn_to_rad is None else self.turn_to_rad
            return replace(self._hold_point(), yaw_rad=yaw_rad, yaw_rate_rad_s=v.yaw_rate_rad_s)
        self._hold = None
        return VelocityCommand(
            v.v_north_m_s,
            v.v_east_m_s,
            v.v_down_m_s,
            yaw_rad=v.yaw_rad,
            yaw_rate_rad_s=v.yaw_rate_rad_s,
        )

    def _hold_point(self) -> VelocityCommand:
        """Stop; once standing, come back to that point whenever the wind pushes."""
        p, down_m = self._physics, self._physics.down_m - self.height_error_m
        if self._hold is None:
            v_north, v_east, v_down = p.velocity_ned_m_s
            if hypot(v_north, v_east, v_down) < STANDING_M_S:
                self._hold = (p.north_m, p.east_m, down_m)
            return VelocityCommand()
        north, east, down = self._hold
        return VelocityCommand(
            approach_speed_m_s(north - p.north_m, 1.0, LATERAL_BRAKING_M_S2),
            approach_speed_m_s(east - p.east_m, 1.0, LATERAL_BRAKING_M_S2),
            approach_speed_m_s(down - down_m, 0.5, VERTICAL_BRAKING_M_S2),
        )

    @property
    def _stick_down_m_s(self) -> float:
        return -CLIMB_SPEED_M_S * self.throttle_stick

    def _loiter(self) -> VelocityCommand:
        if self.throttle_stick == 0.0:
            return self._hold_point()
        self._hold = None
        return VelocityCommand(v_down_m_s=self._stick_down_m_s)

    def _fly_to(self, target: PlaceTarget, position_m: Vector) -> VelocityCommand:
        north, east, down = (target.place_m[i] - position_m[i] for i in range(3))
        away_m = hypot(north, east)
        speed = approach_speed_m_s(away_m, self.cruise_m_s, LATERAL_BRAKING_M_S2)
        share = speed / away_m if away_m > 0.0 else 0.0
        yaw_rad = target.yaw_rad if self.turn_to_rad is None else self.turn_to_rad
        if yaw_rad is None and away_m > TURNS_BEYOND_M:
            yaw_rad = atan2(east, north)
        return VelocityCommand(
            share * north,
            share * east,
            approach_speed_m_s(down, CLIMB_SPEED_M_S, VERTICAL_BRAKING_M_S2),
            yaw_rad=yaw_rad,
        )

    def _climb_out(self, dt_s: float, altitude_m: float) -> VelocityCommand:
        if self._spool_up_s > 0.0:
            self._spool_up_s -= dt_s
            return DOWN
        missing = altitude_m + self._physics.down_m
        if missing < TAKE_OFF_DONE_M:
            self._take_off_m = None
            self._hold = (self._physics.north_m, self._physics.east_m, -altitude_m)
        speed = approach_speed_m_s(missing, TAKE_OFF_SPEED_M_S, VERTICAL_BRAKING_M_S2)
        return VelocityCommand(v_down_m_s=-speed)

    def _landing_speed_m_s(self) -> float:
        above = -self._physics.down_m - LAND_SLOW_BELOW_M
        if above <= 0.0:
            return LAND_SLOW_M_S
        fast = approach_speed_m_s(above, LAND_FAST_M_S, VERTICAL_BRAKING_M_S2)
        return max(LAND_SLOW_M_S, fast)

    def _return_home(self) -> VelocityCommand:
        p = self._physics
        away = hypot(self._home[0] - p.north_m, self._home[1] - p.east_m)
        missing = self.rtl_altitude_m + p.down_m
        if self._home_reached:
            return replace(self._hold_point(), v_down_m_s=self._landing_speed_m_s())
        if away > RTL_NEAR_M and missing > 1.0:
            return VelocityCommand(
                v_down_m_s=-approach_speed_m_s(missing + 0.5, 2.5, VERTICAL_BRAKING_M_S2)
            )
        if away <= RTL_NEAR_M:
            self._home_reached = True
            return VelocityCommand()
        course = atan2(self._home[1] - p.east_m, self._home[0] - p.north_m)
        speed = approach_speed_m_s(away, RTL_SPEED_M_S, LATERAL_BRAKING_M_S2)
        north = speed * (self._home[0] - p.north_m) / away
        east = speed * (self._home[1] - p.east_m) / away
        return VelocityCommand(north, east, yaw_rad=course if away > 5.0 else None)

    def _with_stick(self, command: VelocityCommand) -> VelocityCommand:
        if self.stick_yaw_rate_rad_s == 0.0:
            return command
        return replace(command, yaw_rad=None, yaw_rate_rad_s=self.stick_yaw_rate_rad_s)


def _drift(v_down_m_s: float) -> VelocityCommand:
    return VelocityCommand(v_down_m_s=v_down_m_s, lean_rad=(0.0, 0.0))
