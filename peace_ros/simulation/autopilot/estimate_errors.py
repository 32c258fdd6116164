# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the filter of the simulated autopilot is wrong about: velocity, position and height."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, exp, inf, sqrt
from random import Random

Plane = tuple[float, float]
"""North, east."""
BIAS_TIME_S = 15.0
"""How long the bias of the velocity stays alike."""
NOISE_TIME_S = 5.0
"""How long the error of the position stays alike."""
GLIDE_TIME_S = 2.0
"""How the height follows an error of the barometer: "over seconds" was seen of ArduCopter 4.7-dev
(a step of 8 m); this time constant was not measured."""
GNSS_TIME_S = 100.0
"""How long the error of the GNSS altitude stays alike."""


@dataclass(frozen=True)
class ErrorSizes:
    """Standard deviations along each horizontal axis."""

    velocity_bias_m_s: float = 0.0
    position_noise_m: float = 0.0

    def times(self, factor: float) -> ErrorSizes:
        """Return errors that are larger by a factor."""
        return ErrorSizes(factor * self.velocity_bias_m_s, factor * self.position_noise_m)


PX4_ERRORS = ErrorSizes(velocity_bias_m_s=0.23, position_noise_m=0.17)
"""Measured, PX4 v1.17-alpha (SIH): the velocity is off by 0.13 to 0.33 m/s, the middle of which
this is; changes of the position over 2 s are right within 0.42 m (99 %)."""


class EstimateErrors:
    """Estimate minus truth; wanders as an Ornstein-Uhlenbeck process.

    Args:
        sizes: Zero: no error.
        seed: Of the wandering.
    """

    def __init__(self, sizes: ErrorSizes | None = None, seed: int = 0) -> None:
        self._sizes = sizes or ErrorSizes()
        self._random = Random(seed + 1)
        self.velocity_m_s: Plane = self._drawn(self._sizes.velocity_bias_m_s)
        self.position_m: Plane = self._drawn(self._sizes.position_noise_m)

    def step(self, dt_s: float) -> None:
        """Wander on."""
        sizes = self._sizes
        self.velocity_m_s = self._wandered(
            self.velocity_m_s, dt_s / BIAS_TIME_S, sizes.velocity_bias_m_s
        )
        self.position_m = self._wandered(
            self.position_m, dt_s / NOISE_TIME_S, sizes.position_noise_m
        )

    def _drawn(self, size: float) -> Plane:
        return self._random.gauss(0.0, size), self._random.gauss(0.0, size)

    def _wandered(self, error: Plane, share: float, size: float) -> Plane:
        if size == 0.0:
            return 0.0, 0.0
        keep = exp(-share)
        north, east = self._drawn(size * sqrt(1.0 - keep * keep))
        return keep * error[0] + north, keep * error[1] + east


class BarometerError:
    """Error of the barometer: steps and drifts, which the estimated height follows smoothly.

    Args:
        glide_s: Time constant of the estimate.
    """

    def __init__(self, glide_s: float = GLIDE_TIME_S) -> None:
        self._glide_s = glide_s
        self._goal_m = self._error_m = 0.0
        self._rate_m_s = inf
        self.height_m = 0.0
        """Estimated height minus the true one."""
        self.climb_m_s = 0.0
        """How fast that changes."""

    def become(self, error_m: float, rate_m_s: float = inf) -> None:
        """Let the error of the barometer become so large, at once or at a rate above 0."""
        self._goal_m, self._rate_m_s = error_m, rate_m_s

    def step(self, dt_s: float) -> None:
        """Advance the error and the estimate."""
        left_m = self._goal_m - self._error_m
        self._error_m += copysign(min(abs(left_m), self._rate_m_s * dt_s), left_m)
        follow = (1.0 - exp(-dt_s / self._glide_s)) * (self._error_m - self.height_m)
        self.height_m += follow
        self.climb_m_s = follow / dt_s


class GnssAltitudeError:
    """Error of the altitude in GPS_RAW_INT; wanders as an Ornstein-Uhlenbeck process.

    Args:
        size_m: Standard deviation.
        seed: Of the wandering.
    """

    def __init__(self, size_m: float, seed: int = 0) -> None:
        self._random = Random(seed + 2)
        self.size_m = size_m
        self.error_m = self._random.gauss(0.0, size_m)

    def step(self, dt_s: float) -> None:
        """Wander on."""
        keep = exp(-dt_s / GNSS_TIME_S)
        spread_m = self.size_m * sqrt(1.0 - keep * keep)
        self.error_m = keep * self.error_m + self._random.gauss(0.0, spread_m)
