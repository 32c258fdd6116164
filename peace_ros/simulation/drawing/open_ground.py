# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Blocks without houses: fields, meadows, parks, sports grounds, woods, works, desert, water."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np

from peace_ros.simulation.drawing.furnish import Block, Furnisher
from peace_ros.simulation.drawing.palette import Material, jitter

_FIELDS: dict[str, tuple[str, ...]] = {
    'spring': ('crop_green', 'crop_green', 'ploughed', 'meadow', 'crop_gold'),
    'summer': ('crop_gold', 'crop_gold', 'stubble', 'crop_green', 'meadow', 'dry_grass'),
    'autumn': ('ploughed', 'stubble', 'crop_green', 'meadow', 'soil'),
    'winter': ('ploughed', 'crop_green', 'meadow', 'soil', 'ploughed'),
}


def field(f: Furnisher, block: Block) -> None:
    """Strips of crops with tramlines, headlands and the odd person or tractor."""
    rng = f.rng
    kinds = _FIELDS[f.palette.season]
    angle = 0.0 if rng.random() < 0.6 else pi / 2
    at = block.x0
    while at < block.x1 - 1.0:
        wide = float(rng.uniform(18.0, 70.0))
        end = block.x1 if block.x1 - at - wide < 12.0 else at + wide
        kind = kinds[int(rng.integers(len(kinds)))]
        period = float(rng.choice([0.75, 1.5, 3.0, 6.0]))
        material = f.palette.material(
            kind, period, f.plan.warp.angle_rad + angle, float(rng.uniform(0.03, 0.11))
        )
        f.plan.rectangle(at, block.y0, end, block.y1, material)
        track = f.material('track')
        for x in np.arange(at + 9.0, end - 4.0, 18.0):
            if rng.random() < 0.5:
                for side in (-0.9, 0.9):
                    f.plan.rectangle(
                        float(x) + side - 0.18, block.y0, float(x) + side + 0.18, block.y1, track
                    )
        if rng.random() < 0.4:
            f.plan.rectangle(end - 2.5, block.y0, end, block.y1, f.material('rough'))
        at = end
    if rng.random() < 0.35:
        f.vehicle(*f.point(block), pi / 2, 'truck')
    if rng.random() < 0.5:
        f.hedge(block.x0, block.y1, block.x1, block.y1)
    f.people(block, 6.0)
    f.trees(block, 2.5, 6.0, 11.0)


def meadow(f: Furnisher, block: Block) -> None:
    """Pasture: rough and lush patches, a few trees, a fence."""
    rng = f.rng
    f.fill(block, ('meadow', 'rough', 'lawn', 'dry_grass')[int(rng.integers(4))])
    for _ in range(int(rng.poisson(2.5))):
        kind = ('rough', 'meadow', 'soil', 'dry_grass')[int(rng.integers(4))]
        f.blob(*f.point(block), float(rng.uniform(2.5, 10.0)), f.material(kind), 0.35, block)
    if rng.random() < 0.5:
        y = rng.uniform(block.y0, block.y1)
        ends = np.linspace(block.x0, block.x1, 14)
        bend = rng.uniform(2, 6) * np.sin(ends / rng.uniform(9, 22) + rng.uniform(0, 6))
        path = np.stack([ends, y + bend], axis=1)
        f.plan.path(path, float(rng.uniform(0.8, 2.6)), f.material('track'))
    f.trees(block, 12.0, 4.0, 10.0)
    for _ in range(int(rng.poisson(5))):
        f.bush(*f.point(block))
    f.people(block, 10.0)
    f.plan.barrier(block.x0, block.y0 + 0.5, block.x1, block.y0 + 0.5, 0.12, 1.2, (128, 112, 94))


def park(f: Furnisher, block: Block) -> None:
    """Lawns, winding paths, groups of trees, a pond, benches, people."""
    rng = f.rng
    f.fill(block, 'lawn')
    if rng.random() < 0.5:
        material = f.palette.material(
            'lawn', float(rng.uniform(1.5, 4.0)), float(rng.uniform(0, pi)), 0.06
        )
        inner = block.inset(float(rng.uniform(3, 10)))
        f.plan.rectangle(inner.x0, inner.y0, inner.x1, inner.y1, material)
    for _ in range(int(rng.poisson(1.5))):
        f.blob(*f.point(block), float(rng.uniform(4, 12)), f.material('meadow'), 0.3, block)
    surface = f.material(('gravel', 'paving', 'old_asphalt', 'sand')[int(rng.integers(4))], 2)
    for _ in range(int(rng.integers(1, 4))):
        _winding(f, block, surface, float(rng.uniform(1.8, 3.6)))
    if rng.random() < 0.35:
        x, y = f.point(block.inset(12.0))
        radius = float(rng.uniform(5.0, 13.0))
        kind = ('pond', 'algae', 'dark_water', 'blue_water')[int(rng.integers(4))]
        f.blob(x, y, radius + 1.2, f.material('rough'), 0.2, block)
        f.blob(x, y, radius, f.material(kind), 0.2, block)
    if rng.random() < 0.35:
        x, y = f.point(block.inset(10.0))
        f.blob(x, y, float(rng.uniform(4, 8)), f.material('sand'), 0.1, block)
        for _ in range(3):
            f.garden_furniture(x + rng.normal(0, 2.5), y + rng.normal(0, 2.5))
    for _ in range(int(rng.integers(2, 6))):
        x, y = f.point(block)
        f.clump(x, y, float(rng.uniform(4, 13)), int(rng.integers(4, 15)))
    f.trees(block, 22.0, 4.0, 11.0)
    for _ in range(int(rng.poisson(4))):
        f.obstacle('table', *f.point(block), 1.9, 1.6, jitter(rng, (150, 122, 92), 0.2, 0.05))
    f.people(block, 55.0)


def _winding(f: Furnisher, block: Block, material: Material, width_m: float) -> None:
    rng = f.rng
    t = np.linspace(0.0, 1.0, 26)
    if rng.random() < 0.5:
        start, end = (
            (block.x0, rng.uniform(block.y0, block.y1)),
            (block.x1, rng.uniform(block.y0, block.y1)),
        )
    else:
        start, end = (
            (rng.uniform(block.x0, block.x1), block.y0),
            (rng.uniform(block.x0, block.x1), block.y1),
        )
    line = np.outer(1 - t, start) + np.outer(t, end)
    sway = rng.uniform(2.0, 9.0) * np.sin(t * rng.uniform(3.0, 9.0) + rng.uniform(0, 6))
    across = np.array([-(end[1] - start[1]), end[0] - start[0]])
    across = across / max(float(np.hypot(*across)), 1e-6)
    line += np.outer(sway * np.sin(pi * t), across)
    f.plan.path(line, width_m, material)


def sports(f: Furnisher, block: Block) -> None:
    """A pitch with mown stripes and lines, or courts; goals, players, lights."""
    rng = f.rng
    f.fill(block, 'lawn')
    inner = block.inset(5.0)
    x, y = inner.middle
    long_x = inner.width_m > inner.depth_m
    length = min(max(inner.width_m, inner.depth_m), 100.0)
    width = min(inner.width_m, inner.depth_m, 62.0, 0.68 * length)
    court = rng.random() < 0.3
    if court:
        length, width = min(length, 36.0), min(width, 18.0)
    half_x, half_y = (length / 2, width / 2) if long_x else (width / 2, length / 2)
    angle = f.plan.warp.angle_rad + (0.0 if long_x else pi / 2)
    if court:
        colours = ('court', 'green_court', 'blue_court', 'old_asphalt', 'asphalt')
        rim = f.material(colours[int(rng.integers(len(colours)))])
        margin = float(rng.uniform(1.5, 4.0))
        f.plan.rectangle(
            x - half_x - margin, y - half_y - margin, x + half_x + margin, y + half_y + margin, rim
        )
        material = f.material(colours[int(rng.integers(len(colours)))])
    else:
        kind = 'turf' if rng.random() < 0.2 else 'pitch'
        material = f.palette.material(kind, float(rng.uniform(8, 14)), angle, 0.07)
    f.plan.rectangle(x - half_x, y - half_y, x + half_x, y + half_y, material)
    for s in (-1.0, 1.0):
        ex, ey = half_x - 0.6, half_y - 0.6
        f.plan.marking(x + s * ex - 0.06, y - ey, x + s * ex + 0.06, y + ey)
        f.plan.marking(x - ex, y + s * ey - 0.06, x + ex, y + s * ey + 0.06)
        gx, gy = (x + s * ex, y) if long_x else (x, y + s * ey)
        if not court:
            bx, by = (0.0, 3.6) if long_x else (3.6, 0.0)
            f.plan.barrier(gx - bx, gy - by, gx + bx, gy + by, 0.14, 2.2, (235, 235, 235))
    # The middle line; on a court the service lines and the line between them as well.
    for part in (-0.27, 0.0, 0.27) if court else (0.0,):
        if long_x:
            at = x + part * length
            f.plan.marking(at - 0.06, y - half_y + 0.6, at + 0.06, y + half_y - 0.6)
        else:
            at = y + part * length
            f.plan.marking(x - half_x + 0.6, at - 0.06, x + half_x - 0.6, at + 0.06)
    if court and long_x:
        f.plan.marking(x - 0.27 * length, y - 0.06, x + 0.27 * length, y + 0.06)
    elif court:
        f.plan.marking(x - 0.06, y - 0.27 * length, x + 0.06, y + 0.27 * length)
    f.people(Block(x - half_x, y - half_y, x + half_x, y + half_y), 50.0)
    spacing = float(rng.uniform(7.0, 14.0))
    for t in np.arange(block.x0 + 5, block.x1, spacing):
        for edge in (block.y0 + 2.5, block.y1 - 2.5):
            f.tree(float(t), edge, 4.0, 8.0)
    f.obstacle('pole', x - half_x - 1.5, y - half_y - 1.5, 2.0, 0.4, (200, 200, 200))
    f.obstacle('pole', x + half_x + 1.5, y + half_y + 1.5, 2.0, 0.4, (200, 200, 200))


def wood(f: Furnisher, block: Block) -> None:
    """Dense trees with a clearing or a track."""
    rng = f.rng
    f.fill(block, 'forest_floor')
    clear_x, clear_y = f.point(block)
    clear = float(rng.uniform(6, 18)) if rng.random() < 0.5 else 0.0
    if clear:
        f.blob(clear_x, clear_y, clear, f.material('meadow'), 0.25, block)
    spacing = float(rng.uniform(4.4, 6.0))
    for x in np.arange(block.x0, block.x1, spacing):
        for y in np.arange(block.y0, block.y1, spacing):
            px, py = x + rng.normal(0, 1.0), y + rng.normal(0, 1.0)
            if np.hypot(px - clear_x, py - clear_y) > clear:
                f.tree(float(px), float(py), 4.5, 9.5)
    f.people(block, 6.0)


def allotments(f: Furnisher, block: Block) -> None:
    """Rows of small vegetable gardens with sheds."""
    rng = f.rng
    f.fill(block, 'rough')
    size_x, size_y = float(rng.uniform(8, 13)), float(rng.uniform(12, 20))
    for x in np.arange(block.x0 + 1, block.x1 - size_x + 0.1, size_x + 1.2):
        for y in np.arange(block.y0 + 1, block.y1 - size_y + 0.1, size_y + 1.8):
            for _ in range(int(rng.integers(1, 5))):
                bx, by = x + rng.uniform(0, size_x - 4), y + rng.uniform(0, size_y - 5)
                kind = ('bed', 'soil', 'bed', 'lawn')[int(rng.integers(4))]
                f.plan.rectangle(
                    bx, by, bx + rng.uniform(2, 5), by + rng.uniform(2, 6), f.material(kind)
                )
            if rng.random() < 0.7:
                f.shed(x + rng.uniform(2, size_x - 2), y + size_y - 2.0, pi / 2)
            for _ in range(int(rng.poisson(2.5))):
                f.bush(x + rng.uniform(0, size_x), y + rng.uniform(0, size_y), 0.6, 2.4)
            if rng.random() < 0.35:
                f.tree(x + rng.uniform(0, size_x), y + rng.uniform(0, size_y), 2.5, 5.0)
            if rng.random() < 0.3:
                f.person(x + rng.uniform(0, size_x), y + rng.uniform(0, size_y))
            if rng.random() < 0.5:
                f.fence(x - 0.6, y, x - 0.6, y + size_y)


def works(f: Furnisher, block: Block) -> None:
    """Construction site: earth, haul roads, pipes, containers, diggers, a shell."""
    rng = f.rng
    f.fill(block, ('earthworks', 'soil', 'track', 'sand')[int(rng.integers(4))])
    for _ in range(int(rng.integers(2, 6))):
        kind = ('soil', 'earthworks', 'track', 'gravel', 'rough', 'sand')[int(rng.integers(6))]
        f.blob(*f.point(block), float(rng.uniform(3, 16)), f.material(kind), 0.4, block)
    for _ in range(int(rng.integers(1, 3))):
        _winding(f, block, f.material('track'), float(rng.uniform(3, 8)))
    if rng.random() < 0.25:
        f.blob(*f.point(block), float(rng.uniform(1.5, 4)), f.material('pond'), 0.35, block)
    if rng.random() < 0.5 and min(block.width_m, block.depth_m) > 30:
        shell = (176.0, 172.0, 164.0)
        f.hall(f.point(block.inset(12.0)), (10, 22), (8, 14), (2, 9), rgb=shell)
    for _ in range(int(rng.poisson(2.5))):
        f.vehicle(*f.point(block), rng.uniform(0, pi), 'digger' if rng.random() < 0.6 else 'truck')
    for _ in range(int(rng.poisson(2.0))):
        x, y = f.point(block)
        kind, size = ('pipe', (1.6, 1.6)) if rng.random() < 0.5 else ('crate', (2.2, 1.4))
        rgb = jitter(rng, (176, 172, 164), 0.12, 0.03)
        for k in range(int(rng.integers(2, 9))):
            f.obstacle(kind, x + 2.2 * (k % 4), y + 2.2 * (k // 4), *size, rgb, 0.0)
    if rng.random() < 0.5:
        x, y = f.point(block)
        f.obstacle('container', x, y, 6.1, 2.44, jitter(rng, (196, 196, 190), 0.2, 0.08))
    f.people(block, 28.0)
    f.plan.barrier(block.x0, block.y0, block.x1, block.y0, 0.12, 2.0, (170, 170, 164))


def desert(f: Furnisher, block: Block) -> None:
    """Sand and gravel with tyre tracks, scrub, and a few pale flat roofs."""
    rng = f.rng
    f.fill(block, ('sand', 'pale_sand', 'gravel', 'track')[int(rng.integers(4))])
    for _ in range(int(rng.integers(2, 6))):
        kind = ('pale_sand', 'gravel', 'soil', 'sand', 'dry_grass')[int(rng.integers(5))]
        f.blob(*f.point(block), float(rng.uniform(4, 22)), f.material(kind), 0.4, block)
    for _ in range(int(rng.integers(0, 3))):
        _winding(f, block, f.material('track'), float(rng.uniform(2.0, 4.0)))
    for _ in range(int(rng.poisson(0.0035 * block.width_m * block.depth_m))):
        x, y = f.point(block)
        diameter = float(rng.uniform(0.6, 3.0))
        rgb = jitter(rng, (106, 100, 68), 0.2, 0.06)
        f.plan.tree(x, y, diameter, 0.6 * diameter, rgb, 'leafy')
    for _ in range(int(rng.poisson(1.3))):
        f.hall(f.point(block.inset(8.0)), (8, 18), (7, 13), (3, 8))
    for _ in range(int(rng.poisson(1.5))):
        f.vehicle(*f.point(block), rng.uniform(0, pi))
    f.people(block, 22.0)


def lake(f: Furnisher, block: Block) -> None:
    """Open water with a shore."""
    rng = f.rng
    f.fill(block, 'meadow')
    x, y = block.middle
    radius = 0.42 * min(block.width_m, block.depth_m)
    kind = ('blue_water', 'pond', 'dark_water', 'algae', 'river')[int(rng.integers(5))]
    f.blob(x, y, radius + float(rng.uniform(0.6, 3)), f.material('sand'), 0.15, block)
    f.blob(x, y, radius, f.material(kind), 0.15, block)
    for _ in range(int(rng.integers(8, 22))):
        a, r = rng.uniform(0, 2 * pi), radius * rng.uniform(1.15, 1.4)
        f.tree(x + r * cos(a), y + r * sin(a), 3.5, 8.0)
    f.people(block, 25.0)
