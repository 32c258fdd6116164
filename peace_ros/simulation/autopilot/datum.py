# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where home lies on the globe, and how places of MAVLink messages become local ones."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, isfinite, radians

from pymavlink.dialects.v20 import ardupilotmega as mavlink

METRES_PER_DEGREE = 111_319.49
_E7 = 1e7
_ABOVE_SEA = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
_ABOVE_GROUND = frozenset(
    {
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
"""Altitudes above home and above terrain are one: the ground is flat."""

Vector = tuple[float, float, float]
"""North, east, down from home, metres."""


@dataclass(frozen=True)
class Datum:
    """Home on the globe; the ground around it is a plane."""

    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    altitude_msl_m: float = 0.0
    """Of the ground."""
    origin_above_home_m: float = 0.0
    """Height of the origin of LOCAL_POSITION_NED above home."""

    def geodetic_e7(self, north_m: float, east_m: float) -> tuple[int, int]:
        """Return latitude and longitude in 1e-7 degrees."""
        latitude = self.latitude_deg + north_m / METRES_PER_DEGREE
        longitude = self.longitude_deg + east_m / self._metres_per_degree_east
        return round(latitude * _E7), round(longitude * _E7)

    def local_m(
        self, frame: int, latitude_deg: float, longitude_deg: float, altitude_m: float
    ) -> Vector | None:
        """Return a global place from home; None for another frame or an impossible place."""
        if frame not in _ABOVE_SEA | _ABOVE_GROUND or not isfinite(altitude_m):
            return None
        if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0):
            return None
        above_home_m = altitude_m - (self.altitude_msl_m if frame in _ABOVE_SEA else 0.0)
        return (
            (latitude_deg - self.latitude_deg) * METRES_PER_DEGREE,
            (longitude_deg - self.longitude_deg) * self._metres_per_degree_east,
            -above_home_m,
        )

    @property
    def _metres_per_degree_east(self) -> float:
        return METRES_PER_DEGREE * cos(radians(self.latitude_deg))
