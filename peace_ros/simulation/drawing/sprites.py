# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Vehicles, people and obstacles as seen from above, drawn once at 4 cm and stamped at any size."""

from __future__ import annotations

from functools import lru_cache
from math import cos, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.canvas import Canvas
from peace_ros.simulation.drawing.noise import FloatImage
from peace_ros.simulation.drawing.plan import Barrier, Thing

# Channels of a sprite: fixed grey, paint (how much of the own colour), opacity, height in metres.
_GREY, _PAINT, _ALPHA, _HEIGHT = range(4)
_SEEN = 0.1
"""A thing that covers less than this of every pixel has no pixel of its own."""


class _Sketch:
    """A drawing board in fractions of length (x, nose right) and width (y)."""

    def __init__(self, columns: int, rows: int) -> None:
        self.image = np.zeros((rows, columns, 4), np.float32)

    def box(
        self,
        x0: float,
        x1: float,
        y0: float,
        y1: float,
        grey: float,
        paint: float,
        height: float,
        corner: float = 0.0,
    ) -> None:
        """Draw a rectangle with corners cut by a fraction."""
        rows, columns = self.image.shape[:2]
        c = corner
        shape = np.array([
            (x0 + c, y0), (x1 - c, y0), (x1, y0 + c), (x1, y1 - c),
            (x1 - c, y1), (x0 + c, y1), (x0, y1 - c), (x0, y0 + c),
        ])  # fmt: skip
        self.fill(shape * (columns, rows), grey, paint, height)

    def disc(
        self,
        x: float,
        y: float,
        radius_x: float,
        radius_y: float,
        grey: float,
        paint: float,
        height: float,
    ) -> None:
        """Draw an ellipse."""
        rows, columns = self.image.shape[:2]
        turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        shape = np.stack([x + radius_x * np.cos(turn), y + radius_y * np.sin(turn)], axis=1)
        self.fill(shape * (columns, rows), grey, paint, height)

    def fill(self, shape_px: NDArray[np.float64], grey: float, paint: float, height: float) -> None:
        """Draw a polygon (N, 2) in pixels."""
        points = np.rint((shape_px - 0.5) * 32).astype(np.int32)
        cv2.fillPoly(self.image, [points], (grey, paint, 1.0, height), cv2.LINE_8, 5)


def _boxes(columns: int, rows: int, *boxes: tuple[float, ...]) -> FloatImage:
    """Draw rectangles one over the other; each holds the arguments of :meth:`_Sketch.box`."""
    s = _Sketch(columns, rows)
    for box in boxes:
        s.box(*box)
    return s.image


def _car(front: float, rear: float, height: float) -> FloatImage:
    return _boxes(
        112, 44,
        (0.0, 1.0, 0.02, 0.98, 0, 0.92, height * 0.55, 0.06),
        (0.03, 0.97, 0.10, 0.90, 0, 1.0, height * 0.6, 0.05),
        (rear - 0.07, front + 0.14, 0.09, 0.91, 46, 0.08, height * 0.75, 0.05),
        (rear, front, 0.14, 0.86, 0, 1.08, height, 0.02),
        (0.975, 0.998, 0.10, 0.24, 220, 0.1, 0.6),
        (0.975, 0.998, 0.76, 0.90, 220, 0.1, 0.6),
    )  # fmt: skip


def _truck() -> FloatImage:
    return _boxes(
        220, 62,
        (0.78, 1.0, 0.05, 0.95, 0, 0.9, 2.8, 0.02), (0.93, 0.98, 0.10, 0.90, 44, 0.05, 2.2),
        (0.0, 0.76, 0.0, 1.0, 205, 0.12, 3.4), (0.01, 0.75, 0.04, 0.96, 214, 0.14, 3.5),
    )  # fmt: skip


def _bus() -> FloatImage:
    return _boxes(
        300, 64,
        (0.0, 1.0, 0.0, 1.0, 0, 0.95, 3.1, 0.015), (0.02, 0.95, 0.08, 0.92, 150, 0.4, 3.2),
        *((x, x + 0.09, 0.3, 0.7, 120, 0.1, 3.4) for x in (0.2, 0.5, 0.78)),
        (0.965, 0.995, 0.08, 0.92, 40, 0.05, 2.0),
    )  # fmt: skip


def _boat() -> FloatImage:
    s = _Sketch(220, 60)
    hull = np.array([(0, 0.08), (0.7, 0), (1, 0.5), (0.7, 1), (0, 0.92)]) * (220, 60)
    s.fill(hull, 0, 1.0, 1.2)
    s.box(0.06, 0.66, 0.14, 0.86, 150, 0.2, 1.2)
    s.box(0.2, 0.55, 0.22, 0.78, 214, 0.1, 2.4)
    return s.image


def _digger() -> FloatImage:
    return _boxes(
        200, 80,
        (0.0, 0.5, 0.02, 0.2, 60, 0.0, 0.9), (0.0, 0.5, 0.8, 0.98, 60, 0.0, 0.9),
        (0.02, 0.46, 0.15, 0.85, 0, 1.0, 2.4), (0.24, 0.46, 0.18, 0.45, 50, 0.1, 2.9),
        (0.44, 0.88, 0.55, 0.68, 0, 0.9, 3.0), (0.86, 1.0, 0.42, 0.82, 70, 0.2, 1.2),
    )  # fmt: skip


def _person(stride: float) -> FloatImage:
    s = _Sketch(32, 32)
    s.disc(0.5 + stride, 0.42, 0.2, 0.1, 40, 0.1, 0.5)
    s.disc(0.5 - stride, 0.58, 0.2, 0.1, 40, 0.1, 0.5)
    s.disc(0.5, 0.5, 0.26, 0.5, 0, 1.0, 1.4)
    s.disc(0.54, 0.5, 0.22, 0.2, 66, 0.12, 1.72)
    s.disc(0.62, 0.5, 0.1, 0.12, 150, 0.1, 1.65)
    return s.image


def _ribbed(height: float, ribs: int) -> FloatImage:
    starts = np.linspace(0.0, 1.0, ribs + 1)[:-1]
    strips = ((x, x + 0.35 / ribs, 0.03, 0.97, 0, 1.06, height) for x in starts)
    return _boxes(150, 62, (0.0, 1.0, 0.0, 1.0, 0, 0.95, height), *strips)


def _table() -> FloatImage:
    benches = ((0.0, 1.0, y, y + 0.18, 0, 0.8, 0.45) for y in (0.0, 0.82))
    return _boxes(52, 44, *benches, (0.05, 0.95, 0.3, 0.7, 0, 1.0, 0.75))


def _parasol() -> FloatImage:
    s = _Sketch(64, 64)
    s.disc(0.5, 0.5, 0.5, 0.5, 0, 1.0, 2.3)
    for turn in np.arange(0.0, 2 * np.pi, np.pi / 2):
        wedge = [(0.5, 0.5)] + [
            (0.5 + 0.49 * cos(turn + a), 0.5 + 0.49 * sin(turn + a)) for a in (0.0, 0.4, 0.78)
        ]
        s.fill(np.array(wedge) * 64, 0, 0.86, 2.4)
    return s.image


def _ring(inner: float, height: float) -> FloatImage:
    s = _Sketch(64, 64)
    s.disc(0.5, 0.5, 0.5, 0.5, 0, 1.0, height)
    s.disc(0.5, 0.5, inner, inner, 34, 0.1, height * 0.8)
    return s.image


def _pole() -> FloatImage:
    s = _Sketch(64, 12)
    s.box(0.0, 1.0, 0.3, 0.7, 0, 0.9, 0.3)
    s.disc(0.1, 0.5, 0.09, 0.45, 0, 1.0, 6.0)
    return s.image


@lru_cache(maxsize=1)
def _sprites() -> dict[str, list[FloatImage]]:
    """Return each sprite as a pyramid, finest first."""
    base = {
        'car': _car(0.58, 0.22, 1.45),
        'saloon': _car(0.56, 0.28, 1.4),
        'estate': _car(0.58, 0.10, 1.5),
        'van': _car(0.74, 0.06, 2.0),
        'truck': _truck(),
        'bus': _bus(),
        'boat': _boat(),
        'digger': _digger(),
        'person': _person(0.0),
        'walker': _person(0.16),
        'container': _ribbed(2.5, 14),
        'crate': _ribbed(1.2, 3),
        'table': _table(),
        'parasol': _parasol(),
        'trampoline': _ring(0.42, 0.8),
        'pipe': _ring(0.34, 1.0),
        'pole': _pole(),
    }
    pyramids = {}
    for name, image in base.items():
        # Colour is kept premultiplied, so that shrinking does not darken the edges.
        levels = [image * np.where(np.arange(4) == _ALPHA, 1.0, image[..., 2:3]).astype(np.float32)]
        while min(levels[-1].shape[:2]) >= 4:
            rows, columns = levels[-1].shape[:2]
            size = ((columns + 1) // 2, (rows + 1) // 2)
            levels.append(cv2.resize(levels[-1], size, interpolation=cv2.INTER_AREA))
        pyramids[name] = levels
    return pyramids


def stamp_thing(canvas: Canvas, thing: Thing) -> None:
    """Draw one vehicle, person or obstacle, true to size, with label and height."""
    window = canvas.window
    reach = 0.5 * float(np.hypot(thing.length_m, thing.width_m)) + window.gsd_m
    if not window.sees_disc(thing.x_m, thing.y_m, reach):
        return
    centre = np.array([thing.x_m, thing.y_m])
    region = canvas.region(centre - reach, centre + reach)
    if region is None:
        return
    levels = _sprites()[thing.sprite]
    finest_m = min(thing.length_m / levels[0].shape[1], thing.width_m / levels[0].shape[0])
    level = int(np.clip(np.floor(np.log2(max(window.gsd_m / finest_m, 1.0))), 0, len(levels) - 1))
    sprite = levels[level]
    sub = canvas.sub_window(*region)
    rows, columns = sprite.shape[:2]
    # Pixels of the region -> metres along and across the thing -> pixels of the sprite.
    g, c, s = sub.gsd_m, cos(thing.heading_rad), sin(thing.heading_rad)
    x0, y0 = sub.left_m + 0.5 * g - thing.x_m, sub.top_m + 0.5 * g - thing.y_m
    a, b = columns / thing.length_m, rows / thing.width_m
    matrix = np.array(
        [
            [a * c * g, a * s * g, a * (c * x0 + s * y0) + 0.5 * columns - 0.5],
            [-b * s * g, b * c * g, b * (c * y0 - s * x0) + 0.5 * rows - 0.5],
        ]
    )
    drawn = cv2.warpAffine(
        sprite,
        matrix,
        (sub.width_px, sub.height_px),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(0, 0, 0, 0),
    )
    _composite(canvas, region, drawn, thing)


def _composite(
    canvas: Canvas, region: tuple[slice, slice], drawn: FloatImage, thing: Thing
) -> None:
    alpha = drawn[..., _ALPHA]
    paint = np.asarray(thing.rgb, np.float32)
    part = canvas.rgb[region]
    part *= (1.0 - alpha)[..., None]
    part += drawn[..., _PAINT, None] * paint + drawn[..., _GREY, None]
    # A person is about one pixel wide from high up: the pixel it fills most is its pixel.
    # What only its transparent corner reaches has none.
    own = alpha >= max(_SEEN, min(0.5, 0.75 * float(alpha.max())))
    canvas.labels[region][own] = thing.label
    tall = np.where(alpha > 0.3, drawn[..., _HEIGHT], 0.0)
    np.maximum(canvas.height_m[region], tall, out=canvas.height_m[region])


def stamp_barrier(canvas: Canvas, barrier: Barrier) -> None:
    """Draw one fence or wall with label and height."""
    window = canvas.window
    start, end = np.array(barrier.start_m), np.array(barrier.end_m)
    low, high = np.minimum(start, end), np.maximum(start, end)
    margin = barrier.width_m
    if not window.sees(low - margin, high + margin):
        return
    region = canvas.region(low - margin, high + margin)
    if region is None:
        return
    along = (end - start) / max(float(np.hypot(*(end - start))), 1e-6)
    side = np.array([-along[1], along[0]]) * (0.5 * barrier.width_m)
    shape = np.array([start + side, end + side, end - side, start - side])
    alpha = canvas.coverage([shape], region)
    canvas.blend(region, alpha, barrier.rgb)
    own = alpha >= min(0.5, 0.6 * barrier.width_m / window.gsd_m)
    canvas.labels[region][own] = Label.OBSTACLE
    height = canvas.height_m[region]
    height[own] = np.maximum(height[own], barrier.height_m)


def label_of(sprite: str) -> Label:
    """Return the class of a sprite."""
    if sprite in {'car', 'saloon', 'estate', 'van', 'truck', 'bus', 'boat', 'digger'}:
        return Label.VEHICLE
    return Label.PERSON if sprite in {'person', 'walker'} else Label.OBSTACLE
