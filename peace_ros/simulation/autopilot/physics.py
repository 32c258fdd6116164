# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a multicopter under velocity control: pure, deterministic, stepped.

The constants were fitted to the measured response of ArduCopter 4.7: rise times, stop distances,
peak tilt and overshoot after a descent. Local frame NED relative to home, flat ground at down = 0.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import atan2, copysign, cos, exp, hypot, pi, radians, sin, sqrt, tan
from random import Random

from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import quaternion_from_euler

GRAVITY_M_S2 = 9.80665
DRAG_PER_M = GRAVITY_M_S2 * tan(radians(22.0)) / 8.0**2
"""Quadratic drag over mass: holding against 8 m/s of wind takes 22 degrees of tilt."""
YAW_SLEW_RAD_S = radians(60.0)
YAW_TIME_S = 0.4
GUST_TIME_S = 2.0
GUST_REACTION_S = 0.4
MAX_STEP_S = 0.01


@dataclass(frozen=True)
class Response:
    """How velocity follows its set-point along one direction."""

    delay_s: float
    gain_per_s: float
    lag_s: float
    acceleration_m_s2: float
    """Acceleration that large errors approach."""
    softness: float
    """Exponent of the passage between the linear range and the limit."""
    jerk_m_s3: float


LATERAL = Response(0.171, 4.119, 0.08, 4.713, 1.167, 4.276)
VERTICAL = Response(0.218, 1.815, 0.05, 6.299, 5.649, 22.254)


@dataclass(frozen=True)
class VelocityCommand:
    """What the flight modes ask of the physics, local NED."""

    v_north_m_s: float = 0.0
    v_east_m_s: float = 0.0
    v_down_m_s: float = 0.0
    lean_rad: tuple[float, float] | None = None
    """Hold this (roll, pitch) instead of a lateral velocity; (0, 0) drifts with the wind."""
    yaw_rad: float | None = None
    """Turn to this heading; None holds it, or turns with ``yaw_rate_rad_s``."""
    yaw_rate_rad_s: float = 0.0


class _Axes:
    """Velocity control along one or two perpendicular directions."""

    def __init__(self, response: Response, count: int) -> None:
        self._response = response
        self._zero = (0.0,) * count
        self.velocity_m_s = self._zero
        self.acceleration_m_s2 = self._zero
        self._pending: deque[tuple[float, tuple[float, ...]]] = deque()
        self._newest = self._delayed = self._zero
        self._time_s = 0.0

    def rest(self) -> None:
        """Stand still, with nothing left of earlier commands."""
        self.velocity_m_s = self._zero
        self.release()

    def release(self) -> None:
        """Forget the commands that are still under way."""
        self.acceleration_m_s2 = self._zero
        self._newest = self._delayed = self.velocity_m_s
        self._pending.clear()

    def step(self, dt_s: float, command: tuple[float, ...]) -> None:
        r = self._response
        self._time_s += dt_s
        if command != self._newest:
            self._newest = command
            self._pending.append((self._time_s, command))
        while self._pending and self._time_s - self._pending[0][0] >= r.delay_s - 1e-9:
            self._delayed = self._pending.popleft()[1]
        asked = [
            r.gain_per_s * (wanted - v - 0.5 * r.lag_s * a)
            for wanted, v, a in zip(
                self._delayed, self.velocity_m_s, self.acceleration_m_s2, strict=True
            )
        ]
        size = _norm(asked)
        soft = (1.0 + (size / r.acceleration_m_s2) ** r.softness) ** (-1.0 / r.softness)
        change = [
            (soft * want - a) / r.lag_s
            for want, a in zip(asked, self.acceleration_m_s2, strict=True)
        ]
        jerk = _norm(change)
        limited = min(1.0, r.jerk_m_s3 / jerk) if jerk > 0.0 else 1.0
        self.acceleration_m_s2 = tuple(
            a + limited * each * dt_s
            for a, each in zip(self.acceleration_m_s2, change, strict=True)
        )
        self.push(dt_s, self.acceleration_m_s2)

    def push(self, dt_s: float, acceleration_m_s2: tuple[float, ...]) -> None:
        self.velocity_m_s = tuple(
            v + a * dt_s for v, a in zip(self.velocity_m_s, acceleration_m_s2, strict=True)
        )


class Physics:
    """Position, velocity and attitude of the vehicle."""

    def __init__(
        self,
        north_m: float = 0.0,
        east_m: float = 0.0,
        heading_rad: float = 0.0,
        *,
        wind_to_m_s: tuple[float, float] = (0.0, 0.0),
        gust_m_s: float = 0.0,
        seed: int = 0,
    ) -> None:
        self.north_m = north_m
        self.east_m = east_m
        self.down_m = 0.0
        self.yaw_rad = heading_rad
        self.yaw_rate_rad_s = 0.0
        self.roll_rad = 0.0
        self.pitch_rad = 0.0
        self.touchdown_speed_m_s = 0.0
        self._wind = wind_to_m_s
        self._gust_m_s = gust_m_s
        self._gust = (0.0, 0.0)
        self._felt_gust = (0.0, 0.0)
        self._random = Random(seed)
        self._lateral = _Axes(LATERAL, 2)
        self._vertical = _Axes(VERTICAL, 1)

    def set_wind(self, wind_to_m_s: tuple[float, float], gust_m_s: float) -> None:
        """Change the wind from now on."""
        self._wind, self._gust_m_s = wind_to_m_s, gust_m_s
        if gust_m_s == 0.0:
            self._gust = self._felt_gust = (0.0, 0.0)

    @property
    def velocity_ned_m_s(self) -> tuple[float, float, float]:
        """North, east, down."""
        north, east = self._lateral.velocity_m_s
        return north, east, self._vertical.velocity_m_s[0]

    @property
    def on_ground(self) -> bool:
        """The landing gear touches the ground."""
        return self.down_m >= 0.0

    @property
    def quaternion_ned_frd(self) -> Quaternion:
        """Attitude (w, x, y, z)."""
        return quaternion_from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)

    @property
    def tilt_rad(self) -> float:
        """Angle between body-down and down."""
        return atan2(sqrt(tan(self.roll_rad) ** 2 + tan(self.pitch_rad) ** 2), 1.0)

    def step(self, dt_s: float, command: VelocityCommand) -> None:
        """Advance by dt_s, in parts of at most 10 ms."""
        parts = max(1, round(dt_s / MAX_STEP_S + 0.499))
        for _ in range(parts):
            self._step_once(dt_s / parts, command)

    def _step_once(self, dt: float, command: VelocityCommand) -> None:
        if self.on_ground and command.v_down_m_s >= 0.0:
            self._stand()
            return
        self._blow(dt)
        air = (self._wind[0] + self._gust[0], self._wind[1] + self._gust[1])
        if command.lean_rad is not None:
            thrust = self._thrust_of(command.lean_rad)
            drag = _drag(air, self._lateral.velocity_m_s)
            self._lateral.push(dt, (thrust[0] + drag[0], thrust[1] + drag[1]))
            self._lateral.release()
        else:
            self._lateral.step(dt, (command.v_north_m_s, command.v_east_m_s))
            thrust = self._thrust_against(dt, air)
        self._vertical.step(dt, (command.v_down_m_s,))
        v_north, v_east, v_down = self.velocity_ned_m_s
        self.north_m += v_north * dt
        self.east_m += v_east * dt
        self.down_m += v_down * dt
        self._turn(dt, command)
        self._lean(dt, thrust)
        if self.down_m >= 0.0 and v_down > 0.0:
            self.touchdown_speed_m_s = v_down
            self._stand()

    def _stand(self) -> None:
        self.down_m = 0.0
        self.roll_rad = self.pitch_rad = self.yaw_rate_rad_s = 0.0
        self._lateral.rest()
        self._vertical.rest()

    def _blow(self, dt: float) -> None:
        """Gusts as an Ornstein-Uhlenbeck process, felt by the controller a moment later."""
        if self._gust_m_s == 0.0:
            return
        keep = exp(-dt / GUST_TIME_S)
        spread = self._gust_m_s * sqrt(1.0 - keep * keep)
        north, east = (keep * each + self._random.gauss(0.0, spread) for each in self._gust)
        self._gust = (north, east)
        follow = 1.0 - exp(-dt / GUST_REACTION_S)
        self._felt_gust = (
            self._felt_gust[0] + follow * (north - self._felt_gust[0]),
            self._felt_gust[1] + follow * (east - self._felt_gust[1]),
        )

    def _thrust_against(self, dt: float, air: tuple[float, float]) -> tuple[float, float]:
        """Lean against the drag that the controller knows; what it does not know yet pushes."""
        velocity = self._lateral.velocity_m_s
        known = (self._wind[0] + self._felt_gust[0], self._wind[1] + self._felt_gust[1])
        felt, real = _drag(known, velocity), _drag(air, velocity)
        if felt != real:
            self._lateral.push(dt, (real[0] - felt[0], real[1] - felt[1]))
        accelerating = self._lateral.acceleration_m_s2
        return accelerating[0] - felt[0], accelerating[1] - felt[1]

    def _thrust_of(self, lean_rad: tuple[float, float]) -> tuple[float, float]:
        """Lateral acceleration (north, east) of a vehicle that leans and keeps its height."""
        roll, pitch = lean_rad
        forward = -GRAVITY_M_S2 * tan(pitch)
        right = GRAVITY_M_S2 * tan(roll) / cos(pitch)
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        return forward * c - right * s, forward * s + right * c

    def _turn(self, dt: float, command: VelocityCommand) -> None:
        if command.yaw_rad is None:
            wanted = command.yaw_rate_rad_s
        else:
            error = (command.yaw_rad - self.yaw_rad + pi) % (2.0 * pi) - pi
            wanted = error / YAW_TIME_S
        wanted = max(-YAW_SLEW_RAD_S, min(YAW_SLEW_RAD_S, wanted))
        self.yaw_rate_rad_s += (wanted - self.yaw_rate_rad_s) * min(1.0, dt / 0.15)
        self.yaw_rad = (self.yaw_rad + self.yaw_rate_rad_s * dt + pi) % (2.0 * pi) - pi

    def _lean(self, dt: float, thrust: tuple[float, float]) -> None:
        """Attitude that gives the lateral thrust; a level command returns within half a second."""
        north, east = thrust
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        forward, right = north * c + east * s, east * c - north * s
        pitch = atan2(-forward, GRAVITY_M_S2)
        roll = atan2(right * cos(pitch), GRAVITY_M_S2)
        follow = min(1.0, dt / 0.05)
        self.pitch_rad += follow * (pitch - self.pitch_rad)
        self.roll_rad += follow * (roll - self.roll_rad)


def approach_speed_m_s(distance_m: float, cruise_m_s: float, acceleration_m_s2: float) -> float:
    """Signed speed towards a point that still allows stopping there."""
    linear = 0.7 * abs(distance_m)
    braking = sqrt(2.0 * acceleration_m_s2 * abs(distance_m))
    return copysign(min(cruise_m_s, linear, braking), distance_m)


def _drag(air: tuple[float, float], velocity: tuple[float, ...]) -> tuple[float, float]:
    north, east = air[0] - velocity[0], air[1] - velocity[1]
    size = DRAG_PER_M * hypot(north, east)
    return size * north, size * east


def _norm(vector: list[float]) -> float:
    return abs(vector[0]) if len(vector) == 1 else hypot(vector[0], vector[1])
