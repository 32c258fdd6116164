# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Web Mercator (EPSG:3857): places, tiles, and the size of a pixel on the ground."""

from __future__ import annotations

from dataclasses import dataclass
from math import asinh, atan, cos, degrees, floor, pi, radians, sinh, tan

from peace_ros.core.domain import ConfigurationError

EQUATOR_M = 2.0 * pi * 6378137.0
"""Circumference of the sphere of EPSG:3857."""
TILE_PX = 256
"""Side of a tile by the scheme; one of 512 pixels (@2x) shows the same ground."""
NORTHERNMOST_DEG = 85.05
"""The square of the projection ends here."""
FINEST_ZOOM = 23


@dataclass(frozen=True)
class GeoPlace:
    """A place on the earth, WGS 84 degrees."""

    latitude_deg: float
    longitude_deg: float

    def __post_init__(self) -> None:
        if not abs(self.latitude_deg) <= NORTHERNMOST_DEG or not abs(self.longitude_deg) <= 180.0:
            raise ConfigurationError(
                f'place {self.latitude_deg}, {self.longitude_deg}: give latitude within '
                f'{NORTHERNMOST_DEG} and longitude within 180 degrees'
            )

    def tile(self, zoom: int) -> tuple[float, float]:
        """Return (x, y) in tiles from the north-west corner of the map, with fractions."""
        count = 2**zoom
        x = (self.longitude_deg + 180.0) / 360.0 * count
        y = (1.0 - asinh(tan(radians(self.latitude_deg))) / pi) / 2.0 * count
        return x, y


def place_of_tile(x: float, y: float, zoom: int) -> GeoPlace:
    """Return the place at (x, y) in tiles; the inverse of :meth:`GeoPlace.tile`."""
    count = 2**zoom
    return GeoPlace(degrees(atan(sinh(pi * (1.0 - 2.0 * y / count)))), x / count * 360.0 - 180.0)


def gsd_m(latitude_deg: float, zoom: int, tile_px: int = TILE_PX) -> float:
    """Return metres on the ground per pixel; the map is stretched by 1 / cos(latitude)."""
    return float(EQUATOR_M * cos(radians(latitude_deg)) / (2**zoom * tile_px))


def quadkey(x: int, y: int, zoom: int) -> str:
    """Return the name of a tile in templates with {q}: a digit 0 to 3 for each level."""
    return ''.join(
        str((x >> level & 1) + 2 * (y >> level & 1)) for level in range(zoom - 1, -1, -1)
    )


def tiles_around(
    place: GeoPlace, size_m: float, zoom: int
) -> tuple[range, range, tuple[float, float]]:
    """Return the columns and rows of the tiles that hold a square, and its corner.

    Returns:
        columns, rows, and the north-west corner (x, y) in tiles with fractions.
    """
    x, y = place.tile(zoom)
    half = size_m / 2.0 / (gsd_m(place.latitude_deg, zoom) * TILE_PX)
    count = 2**zoom
    if x - half < 0.0 or y - half < 0.0 or x + half >= count or y + half >= count:
        raise ConfigurationError(
            f'a square of {size_m:g} m around {place.latitude_deg}, {place.longitude_deg} reaches '
            'beyond the map: give another place'
        )
    columns = range(floor(x - half), floor(x + half) + 1)
    rows = range(floor(y - half), floor(y + half) + 1)
    return columns, rows, (x - half, y - half)
