# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places: a net of streets, blocks between them, and what fills the blocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing import blocks, open_ground
from peace_ros.simulation.drawing.furnish import Block, Furnisher
from peace_ros.simulation.drawing.palette import Material, Palette
from peace_ros.simulation.drawing.plan import Plan, Warp
from peace_ros.simulation.drawing.river import add_river

_FILLERS: dict[str, Callable[[Furnisher, Block], None]] = {
    each.__name__: each
    for each in (
        *(blocks.houses, blocks.city, blocks.square, blocks.parking, blocks.industry),
        *(blocks.farmyard, open_ground.field, open_ground.meadow, open_ground.park),
        *(open_ground.sports, open_ground.wood, open_ground.allotments, open_ground.works),
        *(open_ground.desert, open_ground.lake),
    )
}


@dataclass(frozen=True)
class _Layout:
    """Sizes of streets and blocks, and how often each filler stands."""

    fillers: dict[str, float]
    block_m: tuple[float, float]
    street_m: tuple[float, float]
    surfaces: tuple[str, ...]
    sidewalk_m: float
    traffic_per_100m: float
    walkers_per_100m: float


_LAYOUTS: dict[str, _Layout] = {
    'suburb': _Layout(
        {'houses': 6, 'park': 1.6, 'sports': 0.6, 'parking': 0.5, 'square': 0.3, 'meadow': 0.8,
         'allotments': 0.7},
        (46, 95), (5.5, 8.0), ('asphalt', 'old_asphalt', 'new_asphalt'), 1.8, 2.5, 3.0,
    ),
    'city': _Layout(
        {'city': 5, 'square': 1.6, 'park': 1.6, 'parking': 0.8, 'works': 0.7, 'sports': 0.5},
        (45, 85), (8.0, 15.0), ('asphalt', 'new_asphalt'), 3.2, 7.0, 12.0,
    ),
    'farmland': _Layout(
        {'field': 6, 'meadow': 2.5, 'wood': 0.9, 'farmyard': 1.1, 'lake': 0.4},
        (70, 160), (2.6, 5.0), ('track', 'track', 'gravel', 'old_asphalt'), 0.0, 0.8, 0.8,
    ),
    'park': _Layout(
        {'park': 5, 'sports': 1.4, 'wood': 0.9, 'lake': 0.9, 'square': 0.5, 'meadow': 1.0,
         'parking': 0.4},
        (60, 120), (3.0, 6.0), ('gravel', 'asphalt', 'paving', 'old_asphalt'), 0.6, 1.0, 6.0,
    ),
    'industrial': _Layout(
        {'industry': 5, 'parking': 1.6, 'works': 1.0, 'meadow': 1.2, 'sports': 0.3},
        (55, 110), (8.0, 13.0), ('asphalt', 'old_asphalt', 'concrete'), 1.2, 4.0, 2.0,
    ),
    'riverside': _Layout(
        {'park': 2.5, 'city': 1.4, 'houses': 1.3, 'meadow': 1.5, 'square': 0.8, 'parking': 0.5},
        (50, 95), (6.0, 10.0), ('asphalt', 'old_asphalt'), 2.0, 4.0, 6.0,
    ),
    'desert': _Layout(
        {'desert': 5, 'works': 3.0, 'industry': 0.4, 'square': 0.2},
        (70, 140), (4.0, 9.0), ('track', 'gravel', 'new_asphalt'), 0.0, 1.5, 1.5,
    ),
    'village': _Layout(
        {'houses': 3.2, 'farmyard': 1.2, 'meadow': 2.0, 'allotments': 1.1, 'field': 1.2,
         'wood': 0.4, 'square': 0.4, 'sports': 0.3},
        (50, 100), (4.0, 6.0), ('asphalt', 'old_asphalt', 'gravel'), 0.8, 1.4, 2.2,
    ),
    'forest': _Layout(
        {'wood': 7, 'meadow': 1.6, 'field': 0.8, 'farmyard': 0.3, 'lake': 0.4},
        (60, 130), (2.6, 5.0), ('track', 'gravel'), 0.0, 0.5, 1.0,
    ),
}  # fmt: skip

_Along = Callable[[float, float], tuple[float, float]]

LAYOUTS = tuple(name for name in _LAYOUTS if name != 'forest')
"""Of scenes; forest is for towns only, so that the scenes of a seed stay as they are."""


def plan_layout(rng: np.random.Generator, layout: str, season: str, extent_m: float) -> Plan:
    """Plan a place of a layout that fills a square of an extent around the origin."""
    half = 0.75 * extent_m + 14.0
    # Small scenes look at any part of a block, not always at its middle.
    shift = rng.uniform(-40.0, 40.0, 2)
    warp = Warp(
        angle_rad=float(rng.uniform(0.0, 2.0 * pi)),
        bend_m=(float(rng.uniform(0, 5)), float(rng.uniform(0, 5))),
        wavelength_m=(float(rng.uniform(90, 220)), float(rng.uniform(90, 220))),
        phase_rad=(float(rng.uniform(0, 6.3)), float(rng.uniform(0, 6.3))),
    )
    area = Block(shift[0] - half, shift[1] - half, shift[0] + half, shift[1] + half)
    middle = warp.points(np.array([area.middle]))[0]
    warp = replace(warp, shift_m=(-float(middle[0]), -float(middle[1])))
    palette = Palette(rng, season)
    style = _LAYOUTS[layout]
    plan = Plan(warp, palette.material(style.surfaces[0]))
    furnisher = Furnisher(plan, rng, palette)
    fill_district(furnisher, area, layout, 0.72 * extent_m + 16.0)
    if layout == 'riverside':
        add_river(furnisher, area, (0.15, 0.4))
    return plan


def fill_district(
    f: Furnisher, area: Block, layout: str, reach_m: float, *, ragged: bool = True
) -> None:
    """Fill an area with the streets and blocks of a layout, as far as it can be seen.

    Args:
        f: what places things.
        area: to fill, in plan coordinates.
        layout: one of LAYOUTS.
        reach_m: blocks farther from the middle of the area stay empty.
        ragged: start the net of streets at random places outside the area.
    """
    rng, style = f.rng, _LAYOUTS[layout]
    surface = f.material(style.surfaces[int(rng.integers(len(style.surfaces)))], 2)
    f.plan.rectangle(area.x0, area.y0, area.x1, area.y1, surface)
    net = area
    if ragged:
        net = Block(
            area.x0 - rng.uniform(0, style.block_m[1]),
            area.y0 - rng.uniform(0, style.block_m[1]),
            area.x1 + 10.0,
            area.y1 + 10.0,
        )
    found: list[Block] = []
    _split(f, net, style, found, surface)
    names = list(style.fillers)
    weights = np.array([style.fillers[n] for n in names], float)
    for block in found:
        if _distance_m(block, area.middle) > reach_m:
            continue
        name = names[int(rng.choice(len(names), p=weights / weights.sum()))]
        inner = block
        if style.sidewalk_m > 0.0:
            f.plan.rectangle(block.x0, block.y0, block.x1, block.y1, f.material('paving', 2))
            inner = block.inset(style.sidewalk_m)
            _walkers(f, block, style)
        else:
            f.plan.rectangle(block.x0, block.y0, block.x1, block.y1, f.material('rough'))
            inner = block.inset(float(rng.uniform(0.4, 1.6)))
        _FILLERS[name](f, inner)


def _distance_m(block: Block, point: tuple[float, float]) -> float:
    x, y = point
    return float(
        np.hypot(max(block.x0 - x, 0.0, x - block.x1), max(block.y0 - y, 0.0, y - block.y1))
    )


def _split(
    f: Furnisher, area: Block, style: _Layout, found: list[Block], surface: Material
) -> None:
    rng = f.rng
    low, high = style.block_m
    size = max(area.width_m, area.depth_m)
    limit = rng.uniform(low, high) * 1.25
    if size <= max(limit, 1.2 * low):
        found.append(area)
        return
    at = float(rng.uniform(0.38, 0.62))
    wide = float(rng.uniform(*style.street_m))
    if area.width_m >= area.depth_m:
        x = area.x0 + at * area.width_m
        run_street(f, True, x, (area.y0, area.y1), wide, style, surface)
        _split(f, Block(area.x0, area.y0, x - wide / 2, area.y1), style, found, surface)
        _split(f, Block(x + wide / 2, area.y0, area.x1, area.y1), style, found, surface)
    else:
        y = area.y0 + at * area.depth_m
        run_street(f, False, y, (area.x0, area.x1), wide, style, surface)
        _split(f, Block(area.x0, area.y0, area.x1, y - wide / 2), style, found, surface)
        _split(f, Block(area.x0, y + wide / 2, area.x1, area.y1), style, found, surface)


def run_avenue(
    f: Furnisher, vertical: bool, centre: float, span: tuple[float, float], wide: float
) -> None:
    """Paint and fill a main street between districts."""
    run_street(f, vertical, centre, span, wide, _LAYOUTS['city'], f.plan.background)


def run_street(
    f: Furnisher,
    vertical: bool,
    centre: float,
    span: tuple[float, float],
    wide: float,
    style: _Layout,
    surface: Material,
) -> None:
    """Paint the markings of a street and put its traffic."""
    rng = f.rng
    start, end = span

    def at(along: float, across: float) -> tuple[float, float]:
        return (centre + across, along) if vertical else (along, centre + across)

    heading = pi / 2 if vertical else 0.0
    paved = surface.label == Label.PAVED
    if paved and wide > 5.0:
        _street_markings(f, at, span, wide)
    length = (end - start) / 100.0
    for _ in range(int(rng.poisson(style.traffic_per_100m * length))):
        lane = (0.25 if rng.random() < 0.5 else -0.25) * wide
        sprite = None if rng.random() < 0.9 else ('bus', 'truck')[int(rng.integers(2))]
        f.vehicle(*at(float(rng.uniform(start, end)), lane), heading, sprite)
    if paved and wide > 6.5 and style.sidewalk_m > 1.0:
        for t in np.arange(start, end, 5.6):
            for c in (1.1 - wide / 2, wide / 2 - 1.1):
                if rng.random() < 0.33:
                    f.vehicle(*at(float(t), c), heading)
    if style.sidewalk_m > 0.5:
        _street_side(f, at, span, wide)
    for _ in range(int(rng.poisson(0.25 * style.walkers_per_100m * length))):
        f.person(*at(float(rng.uniform(start, end)), float(rng.uniform(-0.5, 0.5)) * wide))


def _street_markings(f: Furnisher, at: _Along, span: tuple[float, float], wide: float) -> None:
    """Paint centre line, edge lines and pedestrian crossings."""
    rng = f.rng
    start, end = span

    def mark(a0: float, a1: float, c0: float, c1: float) -> None:
        (xa, ya), (xb, yb) = at(a0, c0), at(a1, c1)
        f.plan.marking(min(xa, xb), min(ya, yb), max(xa, xb), max(ya, yb))

    if rng.random() < 0.75:
        for t in np.arange(start, end, 6.0 if rng.random() < 0.5 else 4.0):
            mark(float(t), float(t) + 2.2, -0.07, 0.07)
    if wide > 9.0:
        for c in (2.4 - wide / 2, wide / 2 - 2.4):
            mark(start, end, c - 0.06, c + 0.06)
    for _ in range(int(rng.poisson((end - start) / 120.0))):
        t = float(rng.uniform(start, end))
        for c in np.arange(0.5 - wide / 2, wide / 2 - 0.4, 1.0):
            mark(t, t + 3.0, float(c), float(c) + 0.5)


def _street_side(f: Furnisher, at: _Along, span: tuple[float, float], wide: float) -> None:
    """Set lamp posts and a row of trees."""
    rng = f.rng
    start, end = span
    for t in np.arange(start, end, 26.0):
        f.obstacle('pole', *at(float(t), wide / 2 + 0.4), 1.6, 0.35, (176, 178, 178))
    if rng.random() < 0.45:
        for t in np.arange(start, end, 9.0):
            if rng.random() < 0.8:
                f.tree(*at(float(t), -wide / 2 - 1.0), 3.0, 7.0)


def _walkers(f: Furnisher, block: Block, style: _Layout) -> None:
    rim = 2 * (block.width_m + block.depth_m)
    rng, walk = f.rng, style.sidewalk_m
    for _ in range(int(rng.poisson(style.walkers_per_100m * rim / 100.0))):
        inward = float(rng.uniform(0.2, max(walk - 0.2, 0.3)))
        x, y = f.point(block)
        side = int(rng.integers(4))
        if side < 2:
            y = block.y0 + inward if side == 0 else block.y1 - inward
        else:
            x = block.x0 + inward if side == 2 else block.x1 - inward
        f.person(x, y)
