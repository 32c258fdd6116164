# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small things that every kind of block uses: houses, trees, cars, people, furniture."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.palette import Material, Palette, Rgb, jitter
from peace_ros.simulation.drawing.plan import Building, Plan, Thing
from peace_ros.simulation.drawing.sprites import label_of

_CAR_SPRITES = ('car', 'saloon', 'estate', 'car', 'van')


@dataclass(frozen=True)
class Block:
    """A rectangle of ground between streets, in plan coordinates (metres)."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width_m(self) -> float:
        """Extent along x."""
        return self.x1 - self.x0

    @property
    def depth_m(self) -> float:
        """Extent along y."""
        return self.y1 - self.y0

    @property
    def middle(self) -> tuple[float, float]:
        """Centre."""
        return 0.5 * (self.x0 + self.x1), 0.5 * (self.y0 + self.y1)

    def inset(self, margin_m: float) -> Block:
        """Return the block without a margin (never turned inside out)."""
        m = min(margin_m, 0.49 * self.width_m, 0.49 * self.depth_m)
        return Block(self.x0 + m, self.y0 + m, self.x1 - m, self.y1 - m)


class Furnisher:
    """Puts things into a plan with one random stream and one palette."""

    def __init__(self, plan: Plan, rng: np.random.Generator, palette: Palette) -> None:
        self.plan = plan
        self.rng = rng
        self.palette = palette
        self._materials: dict[tuple[str, int], Material] = {}

    def material(self, kind: str, variants: int = 6) -> Material:
        """Return one of a few variants of a ground kind of this place."""
        key = (kind, int(self.rng.integers(variants)))
        if key not in self._materials:
            self._materials[key] = self.palette.material(kind)
        return self._materials[key]

    def point(self, block: Block) -> tuple[float, float]:
        """Return a random point of a block."""
        return (
            float(self.rng.uniform(block.x0, block.x1)),
            float(self.rng.uniform(block.y0, block.y1)),
        )

    def fill(self, block: Block, kind: str) -> None:
        """Lay a ground over a whole block."""
        self.plan.rectangle(block.x0, block.y0, block.x1, block.y1, self.material(kind))

    def blob(
        self,
        x: float,
        y: float,
        radius_m: float,
        material: Material,
        rough: float = 0.2,
        within: Block | None = None,
    ) -> None:
        """Lay a rounded irregular patch that stays within a block."""
        count = 96 if rough > 0.0 else 40
        angle = np.linspace(0.0, 2 * pi, count, endpoint=False)
        radius = np.ones(count)
        for k in range(1, 24 if rough > 0.0 else 1):
            size = rough * float(self.rng.normal(0.0, 0.75)) / k**1.25
            radius += size * np.cos(k * angle + self.rng.uniform(0, 2 * pi))
        radius = radius_m * np.clip(radius, 0.3, 1.6)
        outline = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
        if within is not None:
            outline = np.clip(outline, (within.x0, within.y0), (within.x1, within.y1))
        self.plan.ground(outline, material)

    def tree(self, x: float, y: float, low_m: float = 3.0, high_m: float = 9.0) -> None:
        """Plant a tree of a crown diameter."""
        rgb, kind = self.palette.crown()
        diameter = float(self.rng.uniform(low_m, high_m))
        height = diameter * float(self.rng.uniform(0.8, 1.3))
        if kind == 'conifer':
            diameter, height = 0.65 * diameter, 1.5 * height
        self.plan.tree(x, y, diameter, height, rgb, kind)

    def bush(self, x: float, y: float, low_m: float = 0.8, high_m: float = 2.6) -> None:
        """Plant a bush."""
        diameter = float(self.rng.uniform(low_m, high_m))
        rgb = self.palette.hedge()
        self.plan.tree(x, y, diameter, diameter * 0.7, rgb, 'leafy')

    def trees(self, block: Block, per_hectare: float, low_m: float, high_m: float) -> None:
        """Scatter trees."""
        count = self.rng.poisson(per_hectare * block.width_m * block.depth_m / 1e4)
        for _ in range(int(count)):
            self.tree(*self.point(block), low_m, high_m)

    def clump(self, x: float, y: float, radius_m: float, count: int) -> None:
        """Plant a group of trees and bushes."""
        for _ in range(count):
            r, a = radius_m * self.rng.random() ** 0.5, self.rng.uniform(0, 2 * pi)
            if self.rng.random() < 0.3:
                self.bush(x + r * cos(a), y + r * sin(a))
            else:
                self.tree(x + r * cos(a), y + r * sin(a))

    def vehicle(self, x: float, y: float, heading_rad: float, sprite: str | None = None) -> None:
        """Park a vehicle."""
        rng = self.rng
        name = sprite or _CAR_SPRITES[int(rng.integers(len(_CAR_SPRITES)))]
        length, width = {
            'truck': (rng.uniform(8.0, 15.0), 2.5),
            'bus': (rng.uniform(11.0, 13.0), 2.55),
            'van': (rng.uniform(5.0, 6.0), 2.0),
            'boat': (rng.uniform(6.0, 22.0), rng.uniform(2.4, 4.5)),
            'digger': (7.5, 2.9),
        }.get(name, (rng.uniform(4.1, 4.8), rng.uniform(1.75, 1.9)))
        rgb = self.palette.paint()
        if name == 'digger':
            rgb = jitter(rng, (214, 164, 48), 0.1, 0.05)
        elif name == 'van' and rng.random() < 0.6:
            rgb = (224.0, 226.0, 228.0)
        flip = pi if rng.random() < 0.5 else 0.0
        heading = heading_rad + flip + float(rng.normal(0.0, 0.02))
        self.plan.put(Thing(name, x, y, heading, float(length), float(width), rgb, Label.VEHICLE))

    def person(self, x: float, y: float) -> None:
        """Put a person who stands or walks."""
        rng = self.rng
        sprite = 'person' if rng.random() < 0.5 else 'walker'
        size = float(rng.uniform(0.48, 0.6))
        heading = float(rng.uniform(0, 2 * pi))
        self.plan.put(Thing(sprite, x, y, heading, size, size, self.palette.cloth(), Label.PERSON))

    def people(self, block: Block, per_hectare: float) -> None:
        """Scatter people, alone and in groups."""
        left = int(self.rng.poisson(per_hectare * block.width_m * block.depth_m / 1e4))
        while left > 0:
            x, y = self.point(block)
            group = int(min(left, 1 + self.rng.geometric(0.55)))
            for _ in range(group):
                self.person(x + self.rng.normal(0, 0.9), y + self.rng.normal(0, 0.9))
            left -= group

    def obstacle(
        self,
        sprite: str,
        x: float,
        y: float,
        length_m: float,
        width_m: float,
        rgb: tuple[float, float, float],
        heading_rad: float | None = None,
    ) -> None:
        """Put an obstacle."""
        heading = float(self.rng.uniform(0, 2 * pi)) if heading_rad is None else heading_rad
        self.plan.put(Thing(sprite, x, y, heading, length_m, width_m, rgb, label_of(sprite)))

    def garden_furniture(self, x: float, y: float) -> None:
        """Put a table, a parasol, a trampoline or a crate."""
        rng = self.rng
        pick = rng.random()
        if pick < 0.45:
            self.obstacle('table', x, y, 1.9, 1.6, jitter(rng, (150, 118, 84), 0.25, 0.05))
        elif pick < 0.7:
            self.obstacle('parasol', x, y, 2.8, 2.8, jitter(rng, (196, 176, 150), 0.2, 0.15))
        elif pick < 0.85:
            self.obstacle('trampoline', x, y, 3.4, 3.4, (52, 84, 140))
        else:
            self.obstacle('crate', x, y, 1.6, 1.0, jitter(rng, (110, 100, 90), 0.3, 0.08))

    def fence(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Set up a fence, wall or hedge."""
        rng = self.rng
        pick = rng.random()
        if pick < 0.45:
            self.hedge(x0, y0, x1, y1)
        elif pick < 0.75:
            self.plan.barrier(x0, y0, x1, y1, 0.16, 1.5, jitter(rng, (132, 112, 92), 0.25, 0.05))
        else:
            self.plan.barrier(x0, y0, x1, y1, 0.32, 1.8, jitter(rng, (186, 176, 162), 0.15, 0.05))

    def hedge(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Plant a hedge as a row of bushes that touch."""
        length = float(np.hypot(x1 - x0, y1 - y0))
        size = float(self.rng.uniform(1.1, 1.9))
        rgb = self.palette.hedge()
        steps = max(2, int(length / (0.62 * size)))
        for t in np.linspace(0.0, 1.0, steps):
            x = x0 + (x1 - x0) * t + self.rng.normal(0, 0.1)
            y = y0 + (y1 - y0) * t + self.rng.normal(0, 0.1)
            wide = size * float(self.rng.uniform(0.85, 1.2))
            self.plan.tree(x, y, wide, 1.2 * size, jitter(self.rng, rgb, 0.08, 0.02), 'leafy')

    def house(
        self, x: float, y: float, length_m: float, width_m: float, heading_rad: float
    ) -> None:
        """Build a dwelling, sometimes with a wing."""
        rng, plan = self.rng, self.plan
        pitched = rng.random() < 0.8
        roof = ('gable' if rng.random() < 0.65 else 'hip') if pitched else 'flat'
        style = 'tiles' if pitched else ('flat_pale' if rng.random() < 0.5 else 'flat_dark')
        rgb = self.palette.roof(style)
        eaves = float(rng.uniform(2.8, 6.0))
        seed = int(rng.integers(2**31))
        if rng.random() < 0.4:
            side = 1.0 if rng.random() < 0.5 else -1.0
            wing = float(rng.uniform(3.5, 6.0))
            du, dv = side * 0.25 * length_m, 0.5 * width_m
            wx = x + du * cos(heading_rad) - dv * sin(heading_rad)
            wy = y + du * sin(heading_rad) + dv * cos(heading_rad)
            turned, low = heading_rad + pi / 2, eaves * 0.9
            plan.put(Building(wx, wy, wing * 1.4, wing, turned, low, roof, rgb, seed))
        plan.put(Building(x, y, length_m, width_m, heading_rad, eaves, roof, rgb, seed))

    def hall(
        self,
        at: tuple[float, float],
        length_m: tuple[float, float],
        width_m: tuple[float, float],
        eaves_m: tuple[float, float],
        roof: str = 'flat',
        style: str = 'flat_pale',
        heading_rad: float = 0.0,
        rgb: Rgb | None = None,
    ) -> None:
        """Build a body whose sizes lie within bounds, in a colour or one of a style."""
        length, width, eaves = (
            float(self.rng.uniform(*each)) for each in (length_m, width_m, eaves_m)
        )
        rgb = self.palette.roof(style) if rgb is None else rgb
        seed = int(self.rng.integers(2**31))
        self.plan.put(Building(*at, length, width, heading_rad, eaves, roof, rgb, seed))

    def shed(self, x: float, y: float, heading_rad: float) -> None:
        """Build a garden shed or garage."""
        rng = self.rng
        style = ('tiles', 'flat_dark', 'metal', 'flat_pale')[int(rng.integers(4))]
        roof = 'gable' if style == 'tiles' else 'plain'
        length, width = float(rng.uniform(2.2, 6.0)), float(rng.uniform(1.8, 3.2))
        rgb, seed = self.palette.roof(style), int(rng.integers(2**31))
        self.plan.put(Building(x, y, length, width, heading_rad, 2.2, roof, rgb, seed))
