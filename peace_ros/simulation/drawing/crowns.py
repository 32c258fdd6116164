# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trees and bushes from above: domes of leaf clusters, cones of needles, bare branches."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import cos, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.canvas import Canvas
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.noise import FloatImage
from peace_ros.simulation.drawing.plan import Tree

Point = NDArray[np.float64]

_STAMP_PX = 96
_VARIANTS = 12


@lru_cache(maxsize=1)
def _stamps() -> dict[str, list[list[FloatImage]]]:
    """Return pyramids of crowns, 0 outside to 1 at the top; 'bare' holds an opacity instead."""
    rng = np.random.Generator(np.random.PCG64(7))
    makers = {'leafy': _dome, 'conifer': _cone, 'bare': _branches}
    stamps = {}
    for kind, make in makers.items():
        stamps[kind] = [_pyramid(make(rng)) for _ in range(_VARIANTS)]
    stamps['blossom'] = stamps['leafy']
    return stamps


def _pyramid(image: FloatImage) -> list[FloatImage]:
    levels = [image]
    while levels[-1].shape[0] > 3:
        size = levels[-1].shape[0] // 2
        levels.append(cv2.resize(levels[-1], (size, size), interpolation=cv2.INTER_AREA))
    return levels


def _polar() -> tuple[FloatImage, FloatImage]:
    axis = ((np.arange(_STAMP_PX) + 0.5) / _STAMP_PX * 2.0 - 1.0).astype(np.float32)
    return np.hypot(axis[None, :], axis[:, None]), np.arctan2(axis[:, None], axis[None, :])


def _dome(rng: np.random.Generator) -> FloatImage:
    radius, angle = _polar()
    edge = np.full_like(radius, 0.86)
    for k in range(2, 9):
        edge += rng.normal(0.0, 0.075 / k**0.5) * np.cos(k * angle + rng.uniform(0, 6.3))
    dome = np.sqrt(np.clip(1.0 - (radius / edge) ** 2, 0.0, None))
    # Lumps: a crown is a heap of smaller rounded clusters.
    lumps = np.zeros_like(dome)
    axis = (np.arange(_STAMP_PX) + 0.5) / _STAMP_PX * 2.0 - 1.0
    for _ in range(26):
        r, a, size = 0.8 * rng.random() ** 0.5, rng.uniform(0, 6.3), rng.uniform(0.14, 0.3)
        d2 = (axis[None, :] - r * cos(a)) ** 2 + (axis[:, None] - r * sin(a)) ** 2
        lump = (1.0 - 0.6 * r * r) * np.sqrt(np.clip(1.0 - d2 / size**2, 0.0, None)) * size * 1.5
        lumps = np.maximum(lumps, lump)
    return np.asarray(np.clip(0.72 * dome + lumps * (dome > 0), 0.0, 1.1), np.float32)


def _cone(rng: np.random.Generator) -> FloatImage:
    radius, angle = _polar()
    arms = int(rng.integers(7, 13))
    edge = 0.85 + 0.10 * np.cos(arms * angle + rng.uniform(0, 6.3)) * radius
    cone = np.clip(1.0 - radius / edge, 0.0, None)
    ripple = 0.06 * np.sin(radius * 22.0 + rng.uniform(0, 6.3)) * (cone > 0)
    return np.asarray(np.clip(cone**0.9 + ripple * cone, 0.0, 1.0), np.float32)


def _branches(rng: np.random.Generator) -> FloatImage:
    scale = 4
    size = _STAMP_PX * scale
    image = np.zeros((size, size), np.uint8)
    middle = np.array([size / 2, size / 2])

    def grow(start: Point, angle: float, length: float, width: float, depth: int) -> None:
        end = start + length * np.array([cos(angle), sin(angle)])
        cv2.line(
            image,
            tuple(int(v) for v in start),
            tuple(int(v) for v in end),
            255,
            max(1, int(width)),
            cv2.LINE_AA,
        )
        if depth > 0:
            for _ in range(3):
                at = start + (end - start) * rng.uniform(0.4, 1.0)
                turn = angle + rng.uniform(-0.9, 0.9)
                grow(at, turn, length * rng.uniform(0.45, 0.75), width * 0.6, depth - 1)

    for k in range(9):
        angle = k * 2 * np.pi / 9 + rng.uniform(-0.3, 0.3)
        grow(middle, angle, size * rng.uniform(0.14, 0.22), 9.0, 4)
    small = cv2.resize(image, (_STAMP_PX, _STAMP_PX), interpolation=cv2.INTER_AREA)
    radius, _ = _polar()
    haze = 0.25 * np.clip(1.0 - (radius / 0.9) ** 4, 0.0, 1.0)
    return np.asarray(np.clip(small / 255.0 * 0.95 + haze, 0.0, 0.9) * (radius < 0.95), np.float32)


class _Grove:
    """Collects crowns of one canvas: which tree each pixel belongs to."""

    def __init__(self, canvas: Canvas, trees: Sequence[Tree]) -> None:
        self.canvas = canvas
        self.owner = np.full(canvas.window.shape, -1, np.int32)
        self.colours = np.array([t.rgb for t in trees] or [(0, 0, 0)], np.float32)

    def place(self, number: int, tree: Tree) -> None:
        canvas, window = self.canvas, self.canvas.window
        radius = 0.5 * tree.diameter_m
        centre = np.array([tree.x_m, tree.y_m])
        region = canvas.region(centre - radius, centre + radius)
        if region is None:
            return
        variant = int(abs(tree.x_m * 7.13 + tree.y_m * 3.71) * 10) % _VARIANTS
        levels = _stamps()[tree.kind][variant]
        finest = tree.diameter_m / _STAMP_PX
        level = int(np.clip(np.log2(max(window.gsd_m / finest, 1.0)), 0, len(levels) - 1))
        stamp = levels[level]
        sub = canvas.sub_window(*region)
        n = stamp.shape[0]
        a, g = n / tree.diameter_m, sub.gsd_m
        c, s = cos(tree.heading_rad), sin(tree.heading_rad)
        x0, y0 = sub.left_m + 0.5 * g - tree.x_m, sub.top_m + 0.5 * g - tree.y_m
        matrix = a * np.array([[c * g, s * g, c * x0 + s * y0], [-s * g, c * g, c * y0 - s * x0]])
        matrix[:, 2] += 0.5 * n - 0.5
        crown = cv2.warpAffine(
            stamp,
            matrix,
            (sub.width_px, sub.height_px),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
        )
        if tree.kind == 'bare':
            self._bare(region, crown, tree)
        else:
            self._solid(region, crown, number, tree)

    def _solid(
        self, region: tuple[slice, slice], crown: FloatImage, number: int, tree: Tree
    ) -> None:
        body = (0.35 if tree.kind != 'conifer' else 0.05) * tree.height_m
        top = body + crown * (tree.height_m - body)
        here = self.canvas.height_m[region]
        own = (crown > 0.12) & (top > here)
        here[own] = top[own]
        self.owner[region][own] = number
        self.canvas.labels[region][own] = Label.TREE

    def _bare(self, region: tuple[slice, slice], crown: FloatImage, tree: Tree) -> None:
        canvas = self.canvas
        here = canvas.height_m[region]
        own = (crown > 0.1) & (here < tree.height_m)
        alpha = np.where(own, crown, 0.0).astype(np.float32)
        canvas.blend(region, alpha, tree.rgb)
        self.owner[region][own] = -1
        canvas.labels[region][own] = Label.TREE
        branch = own & (crown > 0.42)
        veil = canvas.veil_m[region]
        veil[branch] = np.maximum(veil[branch], 0.85 * tree.height_m)


def draw_trees(canvas: Canvas, trees: Sequence[Tree], sun: Sun) -> None:
    """Draw all trees of a window: colour lit by their own relief, label and height."""
    window = canvas.window
    seen = [t for t in trees if window.sees_disc(t.x_m, t.y_m, 0.5 * t.diameter_m)]
    if not seen:
        return
    grove = _Grove(canvas, seen)
    for number, tree in enumerate(seen):
        grove.place(number, tree)
    leaves = grove.owner >= 0
    if not leaves.any():
        return
    noise, g = canvas.noise, window.gsd_m
    relief = 0.30 * noise.octave(0) + 0.22 * noise.octave(-1)
    if g < 0.2:
        relief = relief + 0.12 * noise.octave(-2)
    height = canvas.height_m
    height += np.where(leaves, relief, 0.0).astype(np.float32)
    # Cluster relief is what lights leaves; the smoothed step at the rim of a crown is not.
    soft = cv2.GaussianBlur(height, (0, 0), max(0.6, 0.12 / g))
    nx = -cv2.Sobel(soft, cv2.CV_32F, 1, 0, ksize=3) / np.float32(8.0 * g)
    ny = -cv2.Sobel(soft, cv2.CV_32F, 0, 1, ksize=3) / np.float32(8.0 * g)
    light = sun.facing(np.clip(nx, -1.6, 1.6), np.clip(ny, -1.6, 1.6))
    hollow = np.clip((cv2.blur(height, (k := max(3, round(1.6 / g)) | 1, k)) - height), 0.0, 4.0)
    light = light * (1.0 - 0.16 * hollow) * (1.0 + 0.10 * noise.octave(-1))
    colour = grove.colours[np.clip(grove.owner, 0, None)] * light[..., None]
    canvas.rgb[leaves] = colour[leaves]
