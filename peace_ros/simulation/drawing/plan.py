# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands where, in metres: the plan of a place before anything is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.palette import Material, Rgb

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Ground:
    """A polygon (N, 2) of one material; later ones lie over earlier ones."""

    points_m: Points
    material: Material
    low_m: Points
    high_m: Points


@dataclass(frozen=True)
class Building:
    """A rectangular body with a roof; several together make other shapes."""

    x_m: float
    y_m: float
    length_m: float
    width_m: float
    heading_rad: float
    eaves_m: float
    roof: str
    rgb: Rgb
    seed: int

    @property
    def reach_m(self) -> float:
        """Radius of its outer circle."""
        return 0.5 * float(np.hypot(self.length_m, self.width_m))


@dataclass(frozen=True)
class Tree:
    """A crown of leaves, needles, blossom or bare branches; bushes are small ones."""

    x_m: float
    y_m: float
    diameter_m: float
    height_m: float
    rgb: Rgb
    kind: str
    heading_rad: float


@dataclass(frozen=True)
class Thing:
    """A vehicle, a person or an obstacle drawn from a sprite."""

    sprite: str
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    width_m: float
    rgb: Rgb
    label: Label


@dataclass(frozen=True)
class Barrier:
    """A fence, wall or hedge between two points."""

    start_m: tuple[float, float]
    end_m: tuple[float, float]
    width_m: float
    height_m: float
    rgb: Rgb


@dataclass(frozen=True)
class Warp:
    """Bends and turns straight plans, so that streets curve and nothing lies along the axes."""

    angle_rad: float
    bend_m: tuple[float, float] = (0.0, 0.0)
    wavelength_m: tuple[float, float] = (150.0, 150.0)
    phase_rad: tuple[float, float] = (0.0, 0.0)
    shift_m: tuple[float, float] = (0.0, 0.0)

    def points(self, points_m: Points) -> Points:
        """Map (N, 2) points."""
        x, y = points_m[:, 0], points_m[:, 1]
        a, b = self.bend_m
        bent_x = x + a * np.sin(2 * pi * y / self.wavelength_m[0] + self.phase_rad[0])
        bent_y = y + b * np.sin(2 * pi * x / self.wavelength_m[1] + self.phase_rad[1])
        c, s = cos(self.angle_rad), sin(self.angle_rad)
        east, south = self.shift_m
        return np.stack([c * bent_x - s * bent_y + east, s * bent_x + c * bent_y + south], axis=1)

    def place(self, x_m: float, y_m: float, heading_rad: float) -> tuple[float, float, float]:
        """Map a position with a heading."""
        x0, y0 = self._point(x_m, y_m)
        x1, y1 = self._point(x_m + 0.5 * cos(heading_rad), y_m + 0.5 * sin(heading_rad))
        return x0, y0, atan2(y1 - y0, x1 - x0)

    def _point(self, x_m: float, y_m: float) -> tuple[float, float]:
        # As points(), for a single point without the cost of arrays.
        bent_x = x_m + self.bend_m[0] * sin(2 * pi * y_m / self.wavelength_m[0] + self.phase_rad[0])
        bent_y = y_m + self.bend_m[1] * sin(2 * pi * x_m / self.wavelength_m[1] + self.phase_rad[1])
        c, s = cos(self.angle_rad), sin(self.angle_rad)
        east, south = self.shift_m
        return c * bent_x - s * bent_y + east, s * bent_x + c * bent_y + south


def _subdivided(points_m: Points, step_m: float) -> Points:
    """Cut long edges of a closed polygon, so that a warp can bend them."""
    if len(points_m) > 12:
        return points_m
    corners: list[tuple[float, float]] = [(float(x), float(y)) for x, y in points_m]
    parts: list[tuple[float, float]] = []
    for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
        count = max(1, int(hypot(x1 - x0, y1 - y0) / step_m))
        for k in range(count):
            t = k / count
            parts.append((x0 + (x1 - x0) * t, y0 + (y1 - y0) * t))
    return np.array(parts)


@dataclass
class Plan:
    """Everything of a place; filled by layouts, read by the renderer."""

    warp: Warp
    background: Material
    grounds: list[Ground] = field(default_factory=list)
    painted: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Markings before the warp: left, upper, right, lower edge."""
    buildings: list[Building] = field(default_factory=list)
    trees: list[Tree] = field(default_factory=list)
    things: list[Thing] = field(default_factory=list)
    barriers: list[Barrier] = field(default_factory=list)
    wet: list[tuple[Points, float]] = field(default_factory=list)
    """Middle line (N, 2) and half width of rivers: no markings there."""

    def ground(self, points_m: Points | Sequence[tuple[float, float]], material: Material) -> None:
        """Lay a polygon."""
        shape = self.warp.points(_subdivided(np.asarray(points_m, float), 6.0))
        self.grounds.append(Ground(shape, material, shape.min(0), shape.max(0)))

    def rectangle(self, x0: float, y0: float, x1: float, y1: float, material: Material) -> None:
        """Lay a rectangle."""
        self.ground([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], material)

    def path(self, points_m: Points, width_m: float, material: Material) -> None:
        """Lay a strip along a polyline (N, 2)."""
        self.ground(strip(points_m, width_m), material)

    def marking(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Paint a rectangle along the axes; long ones are cut, so that they bend."""
        count = max(1, int(max(x1 - x0, y1 - y0) / 6.0))
        dx, dy = (x1 - x0, 0.0) if x1 - x0 > y1 - y0 else (0.0, y1 - y0)
        for k in range(count):
            a, b = k / count, (k + 1) / count
            right, lower = x0 + dx * b if dx else x1, y0 + dy * b if dy else y1
            self.painted.append((x0 + dx * a, y0 + dy * a, right, lower))

    def markings(self) -> Points:
        """Return all painted quadrilaterals, (N, 4, 2): no label of their own."""
        quads = self.quads()
        for line_m, reach_m in self.wet:
            away = quads.mean(axis=1)[:, None, :] - line_m[None, :, :]
            quads = quads[np.hypot(away[..., 0], away[..., 1]).min(axis=1) > reach_m]
        return quads

    def quads(self) -> Points:
        """Return the quadrilaterals of `painted` after the warp, (N, 4, 2)."""
        boxes = np.array(self.painted, float).reshape(-1, 4)
        corners = boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 2)
        return self.warp.points(corners).reshape(-1, 4, 2)

    def put(self, item: Building | Thing) -> None:
        """Set up a building, vehicle, person or obstacle that is given in plan coordinates."""
        x, y, heading = self.warp.place(item.x_m, item.y_m, item.heading_rad)
        placed = replace(item, x_m=x, y_m=y, heading_rad=heading)
        if isinstance(placed, Building):
            self.buildings.append(placed)
        else:
            self.things.append(placed)

    def tree(
        self, x_m: float, y_m: float, diameter_m: float, height_m: float, rgb: Rgb, kind: str
    ) -> None:
        """Plant a tree or bush."""
        x, y, heading = self.warp.place(x_m, y_m, (x_m * 12.9 + y_m * 78.2) % (2 * pi))
        self.trees.append(Tree(x, y, diameter_m, height_m, rgb, kind, heading))

    def barrier(
        self, x0: float, y0: float, x1: float, y1: float, width_m: float, height_m: float, rgb: Rgb
    ) -> None:
        """Set up a fence, wall or hedge."""
        count = max(1, int(np.hypot(x1 - x0, y1 - y0) / 10.0))
        steps = np.linspace(0.0, 1.0, count + 1)[:, None]
        ends = self.warp.points(np.array([x0, y0]) + steps * np.array([x1 - x0, y1 - y0]))
        for (ax, ay), (bx, by) in pairwise(ends.tolist()):
            self.barriers.append(Barrier((ax, ay), (bx, by), width_m, height_m, rgb))


def strip(points_m: Points, width_m: float) -> Points:
    """Return the polygon of a strip along a polyline (N, 2)."""
    along = np.gradient(points_m, axis=0)
    along /= np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) * (0.5 * width_m)
    return np.concatenate([points_m + normal, (points_m - normal)[::-1]])
