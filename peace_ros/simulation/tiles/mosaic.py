# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A square world from tiles around a place, with its scale on the ground and its attribution."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, WorldError
from peace_ros.simulation.picture_files import check_size
from peace_ros.simulation.tiles.mercator import (
    EQUATOR_M,
    TILE_PX,
    GeoPlace,
    gsd_m,
    tiles_around,
)
from peace_ros.simulation.tiles.source import TileSource
from peace_ros.simulation.world import World

PARIS = (GeoPlace(48.837, 2.295), GeoPlace(48.881, 2.390))
"""South-west and north-east corner of the rectangle of starts in the PEACE paper."""
PRESETS = {'paris': PARIS}
ZOOM = 20

Watch = Callable[[int, int], None]
"""Gets how many tiles are here, and how many there will be."""


def place_in(corners: tuple[GeoPlace, GeoPlace], seed: int) -> GeoPlace:
    """Return a place, uniform in a rectangle of latitude and longitude as in the paper."""
    draw = np.random.default_rng([seed, 0x9A7])
    south_west, north_east = corners
    return GeoPlace(
        float(draw.uniform(south_west.latitude_deg, north_east.latitude_deg)),
        float(draw.uniform(south_west.longitude_deg, north_east.longitude_deg)),
    )


def world_from_tiles(
    source: TileSource,
    place: GeoPlace,
    size_m: float,
    zoom: int = ZOOM,
    watch: Watch = lambda _here, _all: None,
) -> World:
    """Put the tiles around a place together.

    Args:
        source: of the tiles.
        place: the middle of the world.
        size_m: side of the square on the ground, 60 to 2000.
        zoom: of the tiles.
        watch: is called after each tile.

    Raises:
        WorldError: tiles are missing, of different sizes, or no pictures.
    """
    if not 60.0 <= size_m <= 2000.0:
        raise ConfigurationError(f'size {size_m} m of a world from tiles: give 60 to 2000 m')
    columns, rows, corner = tiles_around(place, size_m, zoom)
    first = source.tile(zoom, columns[0], rows[0])
    side = first.shape[0]
    name = f'tiles-{place.latitude_deg:.5f},{place.longitude_deg:.5f}'
    check_size(len(columns) * side, len(rows) * side, f'world {name!r}')
    image = np.empty((len(rows) * side, len(columns) * side, 3), np.uint8)
    total = len(rows) * len(columns)
    for number, (row, column) in enumerate(np.ndindex(len(rows), len(columns)), start=1):
        tile = source.tile(zoom, columns[column], rows[row])
        if tile.shape[0] != side:
            raise WorldError(
                f'tile {zoom}/{columns[column]}/{rows[row]} has {tile.shape[0]} px and others '
                f'{side}: give another --cache for tiles of one size'
            )
        image[row * side : (row + 1) * side, column * side : (column + 1) * side] = tile
        watch(number, total)
    left, top = (
        round((at - begin) * side) for at, begin in zip(corner, (columns[0], rows[0]), strict=True)
    )
    scale_m = gsd_m(place.latitude_deg, zoom, side)
    size_px = round(size_m / scale_m)
    return World(image[top : top + size_px, left : left + size_px], None, scale_m, name)


def save_geotiff(world: World, place: GeoPlace, zoom: int, attribution: str, path: Path) -> None:
    """Write a world of tiles as GeoTIFF in EPSG:3857, with the attribution as TIFF copyright.

    Raises:
        WorldError: the place cannot be written to.
    """
    import rasterio  # noqa: PLC0415 - of the extra geo, for this only
    from rasterio.errors import RasterioError  # noqa: PLC0415
    from rasterio.transform import from_origin  # noqa: PLC0415

    height, width = world.image_rgb.shape[:2]
    # In the units of the projection a pixel does not depend on the latitude.
    side_px = round(gsd_m(place.latitude_deg, zoom, 1) / world.gsd_m)
    unit = EQUATOR_M / (2**zoom * side_px)
    x, y = place.tile(zoom)
    count = 2**zoom
    middle = ((x / count - 0.5) * EQUATOR_M, (0.5 - y / count) * EQUATOR_M)
    transform = from_origin(
        middle[0] - width / 2.0 * unit, middle[1] + height / 2.0 * unit, unit, unit
    )
    try:
        with rasterio.open(
            path,
            'w',
            driver='GTiff',
            height=height,
            width=width,
            count=3,
            dtype='uint8',
            crs='EPSG:3857',
            transform=transform,
            photometric='RGB',
            compress='deflate',
            tiled=True,
        ) as target:
            target.write(with_attribution(world.image_rgb, attribution).transpose(2, 0, 1))
            target.update_tags(TIFFTAG_COPYRIGHT=attribution)
    except (OSError, RasterioError) as error:
        path.unlink(missing_ok=True)
        raise WorldError(f'world {path} cannot be written ({error}): give another --out') from error


def with_attribution(image_rgb: NDArray[np.uint8], attribution: str) -> NDArray[np.uint8]:
    """Return the picture with the attribution written at its lower edge."""
    written = image_rgb.copy()
    scale = max(0.4, min(1.0, image_rgb.shape[1] / 2.0 / (TILE_PX * 4)))
    text = attribution.replace('©', '(c)').encode('ascii', 'replace').decode()
    (width, height), base = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    at = (max(4, image_rgb.shape[1] - width - 6), image_rgb.shape[0] - base - 4)
    corner = (at[0] - 4, at[1] - height - 4)
    cv2.rectangle(written, corner, (at[0] + width + 4, at[1] + base + 2), (255, 255, 255), -1)
    cv2.putText(written, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, (20, 20, 20), 1, cv2.LINE_AA)
    return np.asarray(written, np.uint8)
