# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A large place of several districts, drawn tile by tile so that memory stays small."""

from __future__ import annotations

from itertools import product
from math import pi

import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.drawing.furnish import Block, Furnisher
from peace_ros.simulation.drawing.layouts import fill_district, run_avenue
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.palette import SEASONS, Palette
from peace_ros.simulation.drawing.plan import Plan, Warp
from peace_ros.simulation.drawing.river import add_river
from peace_ros.simulation.drawing.scene import Look, develop, render
from peace_ros.simulation.drawing.window import DrawnWindow

_TILE_PX = 1000
_MARGIN_M = 24.0
"""Longest shadow that reaches into a tile from outside."""
_OPEN = ('park', 'farmland', 'village', 'desert')
_BUILT = ('suburb', 'city', 'industrial', 'suburb', 'village')


class Town:
    """The plan of a mixed place, and its drawing in parts.

    Args:
        seed: 0 or more; the same seed and extent give the same place at any resolution.
        extent_m: width and height in metres.
    """

    def __init__(self, seed: int, extent_m: float) -> None:
        rng = np.random.Generator(np.random.PCG64([seed, 2]))
        season = SEASONS[int(rng.choice(4, p=(0.3, 0.4, 0.2, 0.1)))]
        self._seed, self._half_m = seed, 0.5 * extent_m
        self._sun = Sun(float(rng.uniform(0.0, 2.0 * pi)), float(rng.uniform(0.75, 1.0)), 0.9)
        self._look = Look.draw(rng)
        self._plan = plan_town(rng, season, extent_m)

    def draw(
        self, rows: slice, columns: slice, gsd_m: float
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the image (height x width x 3, RGB) and the labels of a part.

        Args:
            rows: pixels, counted from the north edge.
            columns: pixels, counted from the west edge.
            gsd_m: metres per pixel.
        """
        margin = round(_MARGIN_M / gsd_m)
        window = DrawnWindow(
            (columns.start - margin) * gsd_m - self._half_m,
            (rows.start - margin) * gsd_m - self._half_m,
            columns.stop - columns.start + 2 * margin,
            rows.stop - rows.start + 2 * margin,
            gsd_m,
        )
        canvas = render(self._plan, window, self._seed, self._sun, self._look)
        inner = (slice(margin, window.height_px - margin), slice(margin, window.width_px - margin))
        return develop(canvas, self._look, self._seed)[inner], canvas.labels[inner]


def tiles_of(size_px: int, tile_px: int) -> list[slice]:
    """Return the pixels of each tile along one side."""
    return [slice(at, min(at + tile_px, size_px)) for at in range(0, size_px, tile_px)]


def draw_town(seed: int, size_px: int, gsd_m: float) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return image (size x size x 3, RGB) and labels (size x size) of a mixed place."""
    town = Town(seed, size_px * gsd_m)
    image = np.empty((size_px, size_px, 3), np.uint8)
    labels = np.empty((size_px, size_px), np.uint8)
    for rows, columns in product(tiles_of(size_px, _TILE_PX), repeat=2):
        image[rows, columns], labels[rows, columns] = town.draw(rows, columns, gsd_m)
    return image, labels


def plan_town(rng: np.random.Generator, season: str, extent_m: float) -> Plan:
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
            kinds = _OPEN if (i + j + start) % 2 == 0 else _BUILT
            layout = kinds[int(rng.integers(len(kinds)))]
            district = Block(
                float(x[i]) + 5.0, float(y[j]) + 5.0, float(x[i + 1]) - 5.0, float(y[j + 1]) - 5.0
            )
            fill_district(furnisher, district, layout, 1e9, ragged=False)
    for k in range(1, count):
        for vertical, line in ((True, float(x[k])), (False, float(y[k]))):
            run_avenue(furnisher, vertical, line, (-half, half), 10.0)
    if rng.random() < 0.7:
        add_river(furnisher, area, (0.06, 0.10))
    return plan
