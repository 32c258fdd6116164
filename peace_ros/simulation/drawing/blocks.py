# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Blocks where people live and work: gardens, city blocks, squares, car parks, yards."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np

from peace_ros.simulation.drawing.furnish import Block, Furnisher
from peace_ros.simulation.drawing.palette import jitter
from peace_ros.simulation.drawing.plan import Building


def houses(f: Furnisher, block: Block) -> None:
    """Two rows of lots, back to back, each with a house and a garden."""
    rng = f.rng
    f.fill(block, 'lawn')
    lot = float(rng.uniform(13.0, 24.0))
    long_x = block.width_m >= block.depth_m
    length = block.width_m if long_x else block.depth_m
    depth = (block.depth_m if long_x else block.width_m) / 2
    count = max(1, int(length / lot))
    step = length / count
    setback = float(rng.uniform(3.0, 8.0))
    for row in (0, 1):
        for k in range(count):
            _lot(f, block, long_x, row, (k * step, (k + 1) * step), (depth, setback))
    if rng.random() < 0.8:
        a, b = _at(block, long_x, 0.0, depth), _at(block, long_x, length, depth)
        f.fence(*a, *b)


def _at(block: Block, long_x: bool, along: float, across: float) -> tuple[float, float]:
    if long_x:
        return block.x0 + along, block.y0 + across
    return block.x0 + across, block.y0 + along


def _lot(
    f: Furnisher,
    block: Block,
    long_x: bool,
    row: int,
    span: tuple[float, float],
    sizes: tuple[float, float],
) -> None:
    rng = f.rng
    depth, setback = sizes
    a0, a1 = span
    total = 2 * depth

    def at(along: float, inward: float) -> tuple[float, float]:
        return _at(block, long_x, along, inward if row == 0 else total - inward)

    def patch(s0: float, i0: float, s1: float, i1: float, kind: str) -> None:
        (xa, ya), (xb, yb) = at(s0, i0), at(s1, i1)
        f.plan.rectangle(min(xa, xb), min(ya, yb), max(xa, xb), max(ya, yb), f.material(kind))

    patch(a0, 0.0, a1, depth, ('lawn', 'lawn', 'meadow', 'rough')[int(rng.integers(4))])
    wide = a1 - a0
    heading = 0.0 if long_x else pi / 2
    front = setback + float(rng.uniform(0.0, 1.5))
    house_depth = float(min(rng.uniform(7.5, 11.0), depth * 0.5))
    house_width = float(min(wide - 3.0, rng.uniform(8.0, 14.0)))
    middle = 0.5 * (a0 + a1) + float(rng.uniform(-0.5, 0.5)) * (wide - house_width - 1.0)
    drive = a0 + 2.2 if rng.random() < 0.5 else a1 - 2.2
    surface = ('paving', 'gravel', 'concrete', 'old_asphalt')[int(rng.integers(4))]
    patch(drive - 1.5, 0.0, drive + 1.5, front + float(rng.uniform(0, 6)), surface)
    patch(middle - 0.6, 0.0, middle + 0.6, front, 'paving')
    terrace = front + house_depth + float(rng.uniform(2.0, 4.5))
    if terrace < depth:
        patch(middle - 4.0, front + house_depth - 1, middle + 3.0, terrace, 'paving')
        f.garden_furniture(*at(middle + rng.uniform(-3, 2), terrace - 1.5))
    f.house(*at(middle, front + 0.5 * house_depth), house_width, house_depth, heading)
    if rng.random() < 0.55:
        f.vehicle(*at(drive, 2.6 + rng.uniform(0, 1)), heading + pi / 2)
    _garden(f, (a0, a1), (front + house_depth, depth), at, patch, heading)
    if rng.random() < 0.75:
        f.fence(*at(a0, front), *at(a0, depth - 0.3))
    if rng.random() < 0.4:
        f.fence(*at(a0 + 0.5, 0.5), *at(min(drive - 2.0, a1) if drive > middle else a1, 0.5))


def _garden(
    f: Furnisher,
    span: tuple[float, float],
    reach: tuple[float, float],
    at: Callable[[float, float], tuple[float, float]],
    patch: Callable[[float, float, float, float, str], None],
    heading: float,
) -> None:
    rng = f.rng
    a0, a1 = span
    near, far = reach
    if far - near < 4.0:
        return
    if rng.random() < 0.6:
        f.shed(*at(rng.uniform(a0 + 3, a1 - 3), far - 2.2), heading)
    if rng.random() < 0.16 and far - near > 8:
        s, i = rng.uniform(a0 + 3, a1 - 9), rng.uniform(near + 3, far - 4)
        patch(s - 0.8, i - 0.8, s + 7.3, i + 4.3, 'paving')
        patch(s, i, s + 6.5, i + 3.5, 'pool')
    if rng.random() < 0.35:
        s, i = rng.uniform(a0 + 1, a1 - 5), rng.uniform(near, far - 3)
        patch(s, i, s + rng.uniform(2, 5), i + rng.uniform(1.5, 4), 'bed')
    for _ in range(int(rng.poisson(2.2))):
        f.tree(*at(rng.uniform(a0, a1), rng.uniform(near, far)), 2.5, 6.5)
    for _ in range(int(rng.poisson(4.0))):
        f.bush(*at(rng.uniform(a0, a1), rng.uniform(0.5, far)))
    if rng.random() < 0.4:
        f.garden_furniture(*at(rng.uniform(a0 + 1, a1 - 1), rng.uniform(near, far)))
    if rng.random() < 0.5:
        for _ in range(int(rng.integers(1, 4))):
            f.person(*at(rng.uniform(a0, a1), rng.uniform(near + 0.5, far)))


def city(f: Furnisher, block: Block) -> None:
    """Tall houses along the streets round a courtyard."""
    rng = f.rng
    yard = ('paving', 'lawn', 'asphalt', 'gravel', 'concrete')[int(rng.integers(5))]
    f.fill(block, yard)
    deep = float(rng.uniform(10.0, 15.0))
    style = int(rng.integers(3))
    for side in range(4):
        horizontal = side % 2 == 0
        length = block.width_m if horizontal else block.depth_m - 2 * deep
        at = 0.0 if horizontal else deep
        end = at + length
        while at < end - 6.0:
            wide = float(min(rng.uniform(10.0, 26.0), end - at))
            if end - at - wide < 8.0:
                wide = end - at
            if rng.random() < 0.9:
                mid = at + 0.5 * wide
                if horizontal:
                    y = block.y0 + deep / 2 if side == 0 else block.y1 - deep / 2
                    _city_house(f, block.x0 + mid, y, wide, deep, 0.0, style)
                else:
                    x = block.x0 + deep / 2 if side == 1 else block.x1 - deep / 2
                    _city_house(f, x, block.y0 + mid, wide, deep, pi / 2, style)
            at += wide
    yard_block = block.inset(deep + 1.5)
    if min(yard_block.width_m, yard_block.depth_m) > 6.0:
        f.trees(yard_block, 50.0, 4.0, 8.0)
        f.people(yard_block, 40.0)
        if yard in {'asphalt', 'concrete', 'paving'}:
            for _ in range(int(rng.poisson(4))):
                f.vehicle(*f.point(yard_block), pi / 2 * int(rng.integers(2)))


def _city_house(
    f: Furnisher, x: float, y: float, length: float, width: float, heading: float, style: int
) -> None:
    rng = f.rng
    pick = rng.random() + 0.3 * (style - 1)
    eaves = float(rng.uniform(8.0, 20.0))
    if pick < 0.4:
        roof, rgb = 'gable', f.palette.roof('tiles')
    elif pick < 0.55:
        roof, rgb = 'hip', f.palette.roof('tiles')
    elif pick < 0.75:
        roof, rgb = 'plain', f.palette.roof('metal')
    else:
        roof = 'flat'
        rgb = f.palette.roof('flat_pale' if rng.random() < 0.55 else 'flat_dark')
    seed = int(rng.integers(2**31))
    f.plan.put(Building(x, y, length, width, heading, eaves, roof, rgb, seed))


def square(f: Furnisher, block: Block) -> None:
    """Paved or gravelled square with people, trees, kiosks."""
    rng = f.rng
    surface = ('paving', 'red_paving', 'concrete', 'gravel', 'sand')[int(rng.integers(5))]
    f.fill(block, surface)
    if surface not in {'gravel', 'sand'}:
        _bands(f, block)
    inner = block.inset(4.0)
    x, y = inner.middle
    if rng.random() < 0.5:
        f.blob(x, y, 0.2 * min(inner.width_m, inner.depth_m), f.material('lawn'))
    elif rng.random() < 0.4:
        f.blob(x, y, 4.0, f.material('concrete'), 0.0)
        f.blob(x, y, 3.4, f.material('blue_water'), 0.0)
    for t in np.arange(inner.x0, inner.x1, 8.0):
        for edge in (inner.y0, inner.y1):
            if rng.random() < 0.75:
                f.tree(float(t), edge, 4.0, 7.0)
    f.people(inner, 220.0)
    for _ in range(int(rng.poisson(3))):
        f.garden_furniture(*f.point(inner))
    for _ in range(int(rng.poisson(1.2))):
        f.shed(*f.point(inner), 0.0)


def _bands(f: Furnisher, block: Block) -> None:
    """Lay bands of other stones over a paved square: what tells it from soil from high up."""
    rng = f.rng
    stones = f.material(('paving', 'red_paving', 'concrete', 'new_asphalt')[int(rng.integers(4))])
    wide, apart = float(rng.uniform(0.3, 0.9)), float(rng.uniform(3.5, 9.0))
    f.plan.rectangle(block.x0, block.y0, block.x1, block.y0 + wide, stones)
    f.plan.rectangle(block.x0, block.y1 - wide, block.x1, block.y1, stones)
    for x in np.arange(block.x0, block.x1, apart):
        f.plan.rectangle(float(x), block.y0, float(x) + wide, block.y1, stones)
    if rng.random() < 0.6:
        for y in np.arange(block.y0 + apart, block.y1 - wide, apart):
            f.plan.rectangle(block.x0, float(y), block.x1, float(y) + wide, stones)


def parking(f: Furnisher, block: Block) -> None:
    """Car park: rows of bays, islands with trees, lamp posts."""
    rng = f.rng
    f.fill(block, ('asphalt', 'new_asphalt', 'old_asphalt', 'concrete')[int(rng.integers(4))])
    inner = block.inset(1.5)
    full = float(rng.uniform(0.3, 0.95))
    y = inner.y0
    while y + 16.0 <= inner.y1 + 0.1:
        for row in (y + 2.5, y + 13.5):
            for x in np.arange(inner.x0 + 1.25, inner.x1 - 1.0, 2.5):
                f.plan.marking(float(x) - 1.31, row - 2.5, float(x) - 1.19, row + 2.5)
                if rng.random() < full:
                    f.vehicle(float(x), row + float(rng.normal(0, 0.15)), pi / 2)
        if rng.random() < 0.6:
            f.plan.rectangle(
                inner.x0, y + 16.0, inner.x1, min(y + 17.5, inner.y1), f.material('lawn')
            )
            for x in np.arange(inner.x0 + 4.0, inner.x1, 11.0):
                f.tree(float(x), y + 16.7, 3.0, 5.5)
        for x in np.arange(inner.x0 + 8.0, inner.x1, 24.0):
            f.obstacle('pole', float(x), y + 8.0, 1.6, 0.35, (190, 190, 190))
        y += 17.5
    f.people(inner, 25.0)


def industry(f: Furnisher, block: Block) -> None:
    """Halls with flat or metal roofs, yards with containers and lorries."""
    rng = f.rng
    f.fill(block, ('concrete', 'asphalt', 'old_asphalt', 'gravel')[int(rng.integers(4))])
    inner = block.inset(3.0)
    along_x = inner.width_m >= inner.depth_m
    if rng.random() < 0.6:
        f.plan.rectangle(
            block.x0, block.y0, block.x1, block.y0 + rng.uniform(3, 10), f.material('lawn')
        )
    share = float(rng.uniform(0.35, 0.6))
    size_x = inner.width_m * (share if along_x else 0.9)
    size_y = inner.depth_m * (0.75 if along_x else share)
    style = ('flat_pale', 'flat_dark', 'metal', 'metal')[int(rng.integers(4))]
    roof = 'flat' if style.startswith('flat') else ('saw' if rng.random() < 0.3 else 'metal')
    x, y = inner.x0 + size_x / 2, inner.y1 - size_y / 2
    eaves, rgb = float(rng.uniform(6.0, 11.0)), f.palette.roof(style)
    seed = int(rng.integers(2**31))
    sizes = max(size_x, 6.0), max(size_y, 6.0)
    f.plan.put(Building(x, y, *sizes, 0.0, eaves, roof, rgb, seed))
    yard = (
        Block(inner.x0 + size_x + 3, inner.y0, inner.x1, inner.y1)
        if along_x
        else Block(inner.x0, inner.y0, inner.x1, inner.y1 - size_y - 3)
    )
    if min(yard.width_m, yard.depth_m) > 8.0:
        for _ in range(int(rng.poisson(0.004 * yard.width_m * yard.depth_m))):
            x, y = f.point(yard)
            for k in range(int(rng.integers(1, 4))):
                rgb = jitter(rng, _CONTAINERS[int(rng.integers(len(_CONTAINERS)))], 0.15, 0.05)
                f.obstacle('container', x, y + 2.6 * k, 6.1, 2.44, rgb, 0.0)
        for _ in range(int(rng.poisson(4))):
            f.vehicle(*f.point(yard), pi / 2 * int(rng.integers(2)), 'truck')
        for _ in range(int(rng.poisson(6))):
            f.vehicle(*f.point(yard), pi / 2 * int(rng.integers(2)))
        for _ in range(int(rng.poisson(5))):
            f.obstacle('crate', *f.point(yard), 1.6, 1.2, jitter(rng, (150, 120, 84), 0.2, 0.05))
        f.people(yard, 25.0)
    f.plan.barrier(block.x0, block.y0 + 0.3, block.x1, block.y0 + 0.3, 0.12, 2.0, (150, 156, 154))


_CONTAINERS = (
    (168, 66, 48), (52, 84, 132), (70, 108, 84), (196, 196, 192), (206, 140, 52), (92, 92, 98),
)  # fmt: skip


def farmyard(f: Furnisher, block: Block) -> None:
    """Barns round a yard of gravel and concrete."""
    rng = f.rng
    f.fill(block, 'rough')
    yard = block.inset(min(8.0, 0.2 * block.width_m))
    f.fill(yard, ('gravel', 'track', 'concrete', 'soil')[int(rng.integers(4))])
    for k in range(int(rng.integers(2, 5))):
        at = f.point(yard)
        style = ('tiles', 'metal', 'tiles', 'flat_dark')[int(rng.integers(4))]
        roof = 'gable' if style == 'tiles' else 'metal'
        f.hall(at, (14, 34), (8, 14), (3.5, 6), roof, style, pi / 2 * (k % 2))
    for _ in range(int(rng.poisson(3))):
        f.vehicle(*f.point(yard), rng.uniform(0, pi), 'truck' if rng.random() < 0.4 else None)
    for _ in range(int(rng.poisson(6))):
        f.obstacle('crate', *f.point(yard), 1.4, 1.2, jitter(rng, (196, 176, 120), 0.2, 0.05))
    f.trees(block, 40.0, 5.0, 10.0)
    f.people(block, 12.0)
