# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A river with banks, boats, walkers and sometimes a bridge."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.drawing.furnish import Block, Furnisher
from peace_ros.simulation.drawing.plan import Plan


def add_river(f: Furnisher, area: Block, share: tuple[float, float]) -> None:
    """Run a river through an area, a share of its width wide; what stood in its way is gone."""
    rng = f.rng
    x_mid = area.middle[0] + float(rng.uniform(-0.22, 0.22)) * area.width_m
    width = float(np.clip(rng.uniform(*share) * area.width_m, 9.0, 70.0))
    ys = np.arange(area.y0 - 10, area.y1 + 14, 5.0)
    bend = rng.uniform(3.0, 10.0) * np.sin(ys / rng.uniform(22.0, 50.0) + rng.uniform(0, 6))
    line = np.stack([x_mid + bend, ys], axis=1)
    bank = ('rough', 'concrete', 'paving', 'sand', 'gravel')[int(rng.integers(5))]
    margin = float(rng.uniform(1.5, 5.0))
    clear_river(f.plan, line, 0.5 * width + margin)
    f.plan.path(line, width + 2 * margin, f.material(bank))
    kind = ('river', 'river', 'blue_water', 'dark_water', 'algae')[int(rng.integers(5))]
    f.plan.path(line, width, f.material(kind))
    for _ in range(int(rng.poisson(1.6))):
        k = int(rng.integers(len(line)))
        f.vehicle(
            float(line[k, 0] + rng.uniform(-0.3, 0.3) * width), float(line[k, 1]), pi / 2, 'boat'
        )
    for k in range(0, len(line), 2):
        for side in (-1.0, 1.0):
            if rng.random() < 0.35:
                away = side * (0.5 * width + margin * rng.uniform(0.3, 1.2))
                f.tree(float(line[k, 0] + away), float(line[k, 1]), 3.0, 7.0)
            if rng.random() < 0.5:
                away = side * (0.5 * width + margin * rng.uniform(0.2, 1.0))
                f.person(float(line[k, 0] + away), float(line[k, 1] + rng.uniform(-3, 3)))
    if len(line) > 16 and rng.random() < 0.5:
        k = int(rng.integers(8, len(line) - 8))
        y = float(line[k, 1])
        half = 0.5 * width + margin + 12.0
        f.plan.rectangle(x_mid - half, y - 5.0, x_mid + half, y + 5.0, f.material('asphalt'))
        for t in np.arange(x_mid - half, x_mid + half, 7.0):
            if rng.random() < 0.4:
                f.vehicle(float(t), y + (2.2 if rng.random() < 0.5 else -2.2), 0.0)
        for side in (-5.0, 5.0):
            f.plan.barrier(
                x_mid - half, y + side, x_mid + half, y + side, 0.3, 1.1, (168, 166, 160)
            )


def clear_river(plan: Plan, line_m: NDArray[np.float64], reach_m: float) -> None:
    """Take away what stands within a distance of a polyline (N, 2), in plan coordinates."""
    course = plan.warp.points(line_m)

    def dry(x: float, y: float, radius: float) -> bool:
        return bool(np.hypot(course[:, 0] - x, course[:, 1] - y).min() > reach_m + radius)

    plan.buildings[:] = [b for b in plan.buildings if dry(b.x_m, b.y_m, 0.45 * b.reach_m)]
    plan.trees[:] = [t for t in plan.trees if dry(t.x_m, t.y_m, 0.2 * t.diameter_m)]
    plan.things[:] = [t for t in plan.things if dry(t.x_m, t.y_m, 1.0)]
    plan.barriers[:] = [
        b
        for b in plan.barriers
        if dry(0.5 * (b.start_m[0] + b.end_m[0]), 0.5 * (b.start_m[1] + b.end_m[1]), 4.0)
    ]
    plan.wet.append((course, reach_m))
