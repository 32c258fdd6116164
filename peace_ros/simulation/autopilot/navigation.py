# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A position filter that flies by external navigation: what it is wrong about, and for how long.

Position, velocity and tilt are estimated together. So a position that is wrong tilts the vehicle,
and a companion that turns its pictures back by that tilt feeds its own error. The constants are
those of ArduPilot's EKF3 where it has them; times were measured (ArduCopter 4.7-dev).
"""

from __future__ import annotations

from collections import deque
from math import cos, isfinite, sin, sqrt
from random import Random

import numpy as np
from numpy.typing import NDArray

GRAVITY_M_S2 = 9.80665
RECKONS_S = 7.1
"""How long ArduPilot bridges a lost source; the failsafe comes 0.8 s later."""
RECKONS_BY_VELOCITY_S = 10.2
"""The same while only velocities come: they alone do not keep the position."""
ADOPTS_S, ADOPTS_WITH_VELOCITY_S = 7.0, 10.0
"""A position that is rejected for so long is adopted; the latter while velocities come."""
GATE = 5.0
"""Standard deviations beyond which a measurement is rejected (EK3_POS_I_GATE, EK3_VEL_I_GATE)."""
POSITION_ERROR_M, VELOCITY_ERROR_M_S = 0.3, 0.3
"""VISO_POS_M_NSE and VISO_VEL_M_NSE."""
ACCELERATION_NOISE, TURN_NOISE = 0.35, 0.008
"""Of the filter, per square root of a second. The former is EK3_ACC_P_NSE. The latter was fitted:
with pictures that are turned back by its own tilt, ArduCopter landed after 4 s at 100 m, 11 s at
50 m and 23 s at 20 m; this filter after about 4, 5, and 20 to 40 s."""
BIAS_M_S2, TURN_RAD_S = 0.03, 0.0003
"""Standard deviations of the real constant errors of the inertial unit, along each axis."""
UNSURE, UNSURE_S = 0.8, 1.0
"""Share of a gate above which a measurement speaks for a failsafe (FS_EKF_THRESH), and for how
long it does."""
FRESH_S = 0.6
REMEMBERED_S = 0.5

Plane = tuple[float, float]
"""North, east."""
Array = NDArray[np.float64]


class ExternalNavigation:
    """Errors (estimate minus truth) of position, velocity and tilt; they follow what it is told.

    Args:
        delay_s: A measurement belongs to the moment so long before it comes (VISO_DELAY_MS).
        seed: Of the errors of the inertial unit.
        reckons_s: How long it bridges without external navigation.
    """

    def __init__(self, delay_s: float = 0.05, seed: int = 0, reckons_s: float = RECKONS_S) -> None:
        self._delay_s = delay_s
        self._reckons_s = reckons_s
        random = Random(seed + 3)
        self._bias = np.array([random.gauss(0.0, BIAS_M_S2) for _ in range(2)])
        self._turn = np.array([random.gauss(0.0, TURN_RAD_S) for _ in range(2)])
        self._truth = np.zeros((2, 2))
        self._resets: int | None = None
        self.begin(0.0, (0.0, 0.0), aided_s=None)

    def begin(self, time_s: float, error_m: Plane, *, aided_s: float | None) -> None:
        """Begin to fly by it.

        Args:
            time_s: Now.
            error_m: Of the position until now.
            aided_s: When the position was last known by another source, None for never.
        """
        self._time_s = self._fused_s = time_s
        self.known_s: float | None = aided_s
        """When it last knew a position."""
        self._aided_s = aided_s
        self._velocity_s = self._unsure_s = 0.0
        self._speaks = False
        self._accepted_s: float | None = None
        self._errors = np.array([error_m, (0.0, 0.0), (0.0, 0.0)])
        self._covariance = np.diag([1.0, 0.25, 1e-4])
        self._ratios = [0.0, 0.0]
        self._past: deque[tuple[float, Array, Array]] = deque()

    @property
    def position_m(self) -> Plane:
        """Estimate minus truth."""
        return float(self._errors[0, 0]), float(self._errors[0, 1])

    @property
    def velocity_m_s(self) -> Plane:
        """Estimate minus truth."""
        return float(self._errors[1, 0]), float(self._errors[1, 1])

    def tilt_rad(self, yaw_rad: float) -> tuple[float, float]:
        """Return roll and pitch, estimate minus truth, of a vehicle with a heading."""
        north, east = self._errors[2]
        c, s = cos(yaw_rad), sin(yaw_rad)
        # Thrust that is estimated to point north is a nose that is estimated too low.
        return float(east * c - north * s), float(-north * c - east * s)

    def has_position(self, time_s: float) -> bool:
        """Tell whether it knows a position: it is aided, or bridges."""
        aided_s = self._aided_s if self._accepted_s is None else self._accepted_s
        if aided_s is None:
            return False
        by_velocity = self._velocity_flows(time_s)
        return time_s - aided_s <= (RECKONS_BY_VELOCITY_S if by_velocity else self._reckons_s)

    @property
    def is_unsure(self) -> bool:
        """Position and velocity have been contradicting it for too long: the failsafe is due."""
        return self._unsure_s >= UNSURE_S

    def step(self, time_s: float, truth_m: Plane, truth_m_s: Plane) -> None:
        """Let the errors grow up to a moment, at which position and velocity are truly these."""
        dt = time_s - self._time_s
        self._time_s, self._truth = time_s, np.array([truth_m, truth_m_s])
        if self.has_position(time_s):
            self.known_s = time_s
        position, velocity, tilt = self._errors
        change = dt * (GRAVITY_M_S2 * tilt + self._bias)
        self._errors = np.stack(
            (position + dt * (velocity + 0.5 * change), velocity + change, tilt + dt * self._turn)
        )
        self._past.append((time_s, self._truth, self._errors[:2]))
        while self._past[0][0] < time_s - REMEMBERED_S:
            self._past.popleft()
        over = [ratio >= UNSURE for ratio in self._ratios]
        doubted = all(over) or self._ratios[1] >= 2.0 * UNSURE
        self._unsure_s = max(0.0, self._unsure_s + (dt if doubted else -dt))

    def see_position(self, time_s: float, seen_m: Plane, resets: int) -> None:
        """Take a position; one with another number of resets is adopted at once."""
        if not all(map(isfinite, seen_m)) or not self._past:
            return
        off = self._off(time_s, 0, seen_m)
        jumped = self._resets is not None and resets != self._resets
        self._resets = resets
        if self._accepted_s is None or jumped or not self._fuse(time_s, 0, off, POSITION_ERROR_M):
            limit_s = ADOPTS_WITH_VELOCITY_S if self._velocity_flows(time_s) else ADOPTS_S
            waited = self._accepted_s is not None and time_s - self._accepted_s < limit_s
            if waited and not jumped:
                return
            self._shift(np.stack((off, np.zeros(2), np.zeros(2))))
            self._ratios[0] = 0.0
        self._accepted_s = time_s

    def see_velocity(self, time_s: float, seen_m_s: Plane) -> None:
        """Take a velocity."""
        if not all(map(isfinite, seen_m_s)) or not self._past:
            return
        if self._fuse(time_s, 1, self._off(time_s, 1, seen_m_s), VELOCITY_ERROR_M_S):
            self._velocity_s, self._speaks = time_s, True

    def _velocity_flows(self, time_s: float) -> bool:
        return self._speaks and time_s - self._velocity_s <= FRESH_S

    def _off(self, time_s: float, row: int, seen: Plane) -> Array:
        """Return by how much a measurement is off the estimate of its moment, (2,)."""
        at_s = time_s - self._delay_s
        _, truth, errors = min(self._past, key=lambda each: abs(each[0] - at_s))
        return np.asarray(np.array(seen) - truth[row] - errors[row])

    def _fuse(self, time_s: float, row: int, off: Array, error: float) -> bool:
        """Take a measurement unless it is beyond the gate (Kalman filter, alike for both axes)."""
        self._grow(time_s)
        variance = self._covariance[row, row] + error**2
        self._ratios[row] = float(np.hypot(*off)) / (GATE * sqrt(2.0 * variance))
        if self._ratios[row] > 1.0:
            return False
        gain = self._covariance[:, row] / variance
        self._covariance = self._covariance - np.outer(gain, self._covariance[row])
        self._shift(np.outer(gain, off))
        return True

    def _grow(self, time_s: float) -> None:
        dt, self._fused_s = time_s - self._fused_s, time_s
        move = np.array(
            [[1.0, dt, 0.5 * GRAVITY_M_S2 * dt**2], [0.0, 1.0, GRAVITY_M_S2 * dt], [0.0, 0.0, 1.0]]
        )
        noise = np.diag([0.0, ACCELERATION_NOISE**2 * dt, TURN_NOISE**2 * dt])
        self._covariance = move @ self._covariance @ move.T + noise

    def _shift(self, change: Array) -> None:
        """Correct the estimate (3 x 2), and what it was, by which later measurements are judged."""
        self._errors = self._errors + change
        self._past = deque((at, truth, errors + change[:2]) for at, truth, errors in self._past)
