# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A large place of several districts, drawn tile by tile so that memory stays small."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import ceil, cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import WorldError
from peace_ros.simulation.drawing.furnish import Block, Furnisher
from peace_ros.simulation.drawing.layouts import fill_district, run_avenue
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.palette import SEASONS, Palette
from peace_ros.simulation.drawing.plan import Plan, Warp
from peace_ros.simulation.drawing.plan_index import PlanIndex
from peace_ros.simulation.drawing.river import add_river
from peace_ros.simulation.drawing.scene import Look, develop, render, sensor_noise
from peace_ros.simulation.drawing.window import DrawnWindow

_TILE_PX = 1000
_MARGIN_M = 24.0
"""Longest shadow that reaches into a tile from outside."""
_RIM_M, _RIM_PX = 0.8, 8
"""How far around a tile the light on crowns and the blur of the camera reach."""


@dataclass(frozen=True)
class District:
    """What a town is made of: two kinds of parts, side by side like the fields of a chessboard."""

    open_layouts: tuple[str, ...]
    built_layouts: tuple[str, ...]
    river: float = 0.7
    """How often there is a water."""
    river_width: tuple[float, float] = (0.06, 0.10)
    """Of it, as a part of the extent."""


DISTRICTS: dict[str, District] = {
    'mixed': District(
        ('park', 'farmland', 'village', 'desert'),
        ('suburb', 'city', 'industrial', 'suburb', 'village'),
    ),
    'suburb': District(('park', 'village'), ('suburb',), river=0.3),
    'city_centre': District(('park', 'city'), ('city',)),
    'campus': District(('park',), ('city', 'park', 'suburb'), river=0.3),
    'farmland': District(('farmland',), ('farmland', 'village'), river=0.4),
    'industrial': District(('industrial',), ('industrial', 'suburb'), river=0.5),
    'coast': District(
        ('park', 'desert'), ('suburb', 'city', 'village'), river=1.0, river_width=(0.3, 0.4)
    ),
    'forest_edge': District(('forest',), ('forest', 'forest', 'farmland'), river=0.4),
}
"""Name -> its parts."""
MIXED = 'mixed'


class Town:
    """The plan of a mixed place, and its drawing in parts.

    Args:
        seed: 0 or more; the same seed and extent give the same place at any resolution.
        extent_m: width and height in metres.
        district: one of DISTRICTS.
        season: one of SEASONS; empty lets the seed choose.

    Raises:
        WorldError: district or season is unknown.
    """

    def __init__(self, seed: int, extent_m: float, district: str = MIXED, season: str = '') -> None:
        check_town(district, season)
        rng = np.random.Generator(np.random.PCG64([seed, 2]))
        drawn_season = SEASONS[int(rng.choice(4, p=(0.3, 0.4, 0.2, 0.1)))]
        self._seed, self._half_m = seed, 0.5 * extent_m
        self._sun = Sun(float(rng.uniform(0.0, 2.0 * pi)), float(rng.uniform(0.75, 1.0)), 0.9)
        self._look = Look.draw(rng)
        plan = plan_town(rng, season or drawn_season, extent_m, DISTRICTS[district])
        self._index = PlanIndex(plan)

    def draw(
        self, rows: slice, columns: slice, gsd_m: float
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the image (height x width x 3, RGB) and the labels of a part.

        Args:
            rows: pixels, counted from the north edge.
            columns: pixels, counted from the west edge.
            gsd_m: metres per pixel.
        """
        part = DrawnWindow(
            columns.start * gsd_m - self._half_m,
            rows.start * gsd_m - self._half_m,
            columns.stop - columns.start,
            rows.stop - rows.start,
            gsd_m,
        )
        rim, margin = _aligned(_RIM_M / gsd_m + _RIM_PX), round(_MARGIN_M / gsd_m)
        # Only what stands towards the sun casts a shadow into the part.
        east, south = cos(self._sun.azimuth_rad), sin(self._sun.azimuth_rad)
        up, down = (_aligned(rim + margin * max(0.0, each)) for each in (-south, south))
        left, right = (_aligned(rim + margin * max(0.0, each)) for each in (-east, east))
        window = part.grown(left, up, right, down)
        shown = (
            slice(up - rim, up + part.height_px + rim),
            slice(left - rim, left + part.width_px + rim),
        )
        plan = self._index.within(window)
        canvas = render(plan, window, self._seed, self._sun, self._look, shown)
        noise = sensor_noise(part.grown(margin, margin, margin, margin), self._seed)
        crop = slice(margin - rim, rim - margin)
        image = develop(canvas.rgb[shown], self._look, noise[crop, crop])
        return image[rim:-rim, rim:-rim], canvas.labels[shown][rim:-rim, rim:-rim]


def _aligned(px: float) -> int:
    """Return at least this many pixels: smooth noise is drawn in blocks of four."""
    return 4 * ceil(px / 4.0)


def check_town(district: str, season: str) -> None:
    """Refuse what no town can be; see :class:`Town`."""
    if district not in DISTRICTS:
        raise WorldError(f'district {district!r}: choose one of {", ".join(DISTRICTS)}')
    if season and season not in SEASONS:
        raise WorldError(f'season {season!r}: choose one of {", ".join(SEASONS)}')


def tiles_of(size_px: int, tile_px: int) -> list[slice]:
    """Return the pixels of each tile along one side."""
    return [slice(at, min(at + tile_px, size_px)) for at in range(0, size_px, tile_px)]


def draw_town(
    seed: int, size_px: int, gsd_m: float, district: str = MIXED, season: str = ''
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return image (size x size x 3, RGB) and labels (size x size) of a place; see Town."""
    town = Town(seed, size_px * gsd_m, district, season)
    image = np.empty((size_px, size_px, 3), np.uint8)
    labels = np.empty((size_px, size_px), np.uint8)
    for rows, columns in product(tiles_of(size_px, _TILE_PX), repeat=2):
        image[rows, columns], labels[rows, columns] = town.draw(rows, columns, gsd_m)
    return image, labels


def plan_town(
    rng: np.random.Generator, season: str, extent_m: float, district: District = DISTRICTS[MIXED]
) -> Plan:
    """Plan districts of different layouts, open ones next to built ones, often with a river."""
    warp = Warp(
        angle_rad=float(rng.uniform(0.0, 2.0 * pi)),
        bend_m=(float(rng.uniform(2, 6)), float(rng.uniform(2, 6))),
        wavelength_m=(float(rng.uniform(120, 240)), float(rng.uniform(120, 240))),
        phase_rad=(float(rng.uniform(0, 6.3)), float(rng.uniform(0, 6.3))),
    )
    palette = Palette(rng, season)
    plan = Plan(warp, palette.material('asphalt'))
    furnisher = Furnisher(plan, rng, palette)
    half = 0.72 * extent_m + 12.0
    area = Block(-half, -half, half, half)
    count = max(2, round(2 * half / 118.0))
    edges = np.linspace(-half, half, count + 1)
    inner = rng.uniform(-16.0, 16.0, (2, count - 1))
    x, y = edges.copy(), edges.copy()
    x[1:-1] += inner[0]
    y[1:-1] += inner[1]
    start = int(rng.integers(2))
    for i in range(count):
        for j in range(count):
            is_open = (i + j + start) % 2 == 0
            kinds = district.open_layouts if is_open else district.built_layouts
            layout = kinds[int(rng.integers(len(kinds)))]
            block = Block(
                float(x[i]) + 5.0, float(y[j]) + 5.0, float(x[i + 1]) - 5.0, float(y[j + 1]) - 5.0
            )
            fill_district(furnisher, block, layout, 1e9, ragged=False)
    for k in range(1, count):
        for vertical, line in ((True, float(x[k])), (False, float(y[k]))):
            run_avenue(furnisher, vertical, line, (-half, half), 10.0)
    if rng.random() < district.river:
        add_river(furnisher, area, district.river_width)
    return plan
