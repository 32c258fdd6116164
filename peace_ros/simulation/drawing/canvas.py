# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The layers that a scene is painted on, and the ground under everything."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.drawing.grain import structure
from peace_ros.simulation.drawing.noise import FloatImage, Noise
from peace_ros.simulation.drawing.palette import Material, Rgb
from peace_ros.simulation.drawing.plan import Ground, Plan
from peace_ros.simulation.drawing.window import DrawnWindow

_FINER = 2

Region = tuple[slice, slice]
"""Rows and columns of a canvas."""


class Canvas:
    """Colour in full sun, label and height of each pixel of a window."""

    def __init__(self, window: DrawnWindow, seed: int) -> None:
        self.window = window
        self.seed = seed
        self.noise = Noise(window, seed)
        self.rgb: FloatImage = np.zeros((*window.shape, 3), np.float32)
        """Height x width x 3, 0 to 255."""
        self.labels: NDArray[np.uint8] = np.zeros(window.shape, np.uint8)
        self.height_m: FloatImage = np.zeros(window.shape, np.float32)
        """Height of what is on top above the ground."""
        self.veil_m: FloatImage = np.zeros(window.shape, np.float32)
        """Height of bare branches, which let most of the light through."""

    def region(self, low_m: NDArray[np.float64], high_m: NDArray[np.float64]) -> Region | None:
        """Return rows and columns of the pixels in a box with a pixel of margin, if any."""
        w = self.window
        c0, r0 = (int(v) for v in np.floor(w.pixels(low_m)) - 1)
        c1, r1 = (int(v) for v in np.ceil(w.pixels(high_m)) + 2)
        c0, r0, c1, r1 = max(c0, 0), max(r0, 0), min(c1, w.width_px), min(r1, w.height_px)
        if c0 >= c1 or r0 >= r1:
            return None
        return slice(r0, r1), slice(c0, c1)

    @property
    def whole(self) -> Region:
        """The region of all pixels."""
        return slice(0, self.window.height_px), slice(0, self.window.width_px)

    def sub_window(self, rows: slice, columns: slice) -> DrawnWindow:
        """Return the window of a region."""
        w = self.window
        return DrawnWindow(
            w.left_m + columns.start * w.gsd_m,
            w.top_m + rows.start * w.gsd_m,
            columns.stop - columns.start,
            rows.stop - rows.start,
            w.gsd_m,
        )

    def coverage(self, polygons_m: Sequence[NDArray[np.float64]], region: Region) -> FloatImage:
        """Return which part of each pixel of a region polygons cover, 0 to 1."""
        sub = self.sub_window(*region)
        factor = 4 if sub.width_px * sub.height_px < 200_000 else 2
        fine = sub.finer(factor)
        mask = np.zeros(fine.shape, np.uint8)
        for polygon in polygons_m:
            points = fine.fixed_point(polygon)
            cv2.fillPoly(mask, [points], 255, cv2.LINE_8, fine.shift_bits)
        small = cv2.resize(mask, (sub.width_px, sub.height_px), interpolation=cv2.INTER_AREA)
        return np.asarray(small.astype(np.float32) * np.float32(1.0 / 255.0))

    def blend(self, region: Region, alpha: FloatImage, rgb: Rgb) -> None:
        """Lay a colour over a region with an opacity per pixel."""
        part = self.rgb[region]
        part += (np.asarray(rgb, np.float32) - part) * alpha[..., None]


def paint_ground(canvas: Canvas, plan: Plan, region: Region) -> None:
    """Fill the colour and the labels of a region with the ground of a plan."""
    window = canvas.sub_window(*region)
    noise = Noise(window, canvas.seed)
    seen = [g for g in plan.grounds if window.sees(g.low_m, g.high_m)]
    materials, index = _indexed(plan.background, seen)
    fine = window.finer(_FINER)
    fine_ids = np.zeros(fine.shape, np.int16)
    ids = np.zeros(window.shape, np.int16)
    for ground in seen:
        number = index[ground.material]
        for view, image in ((fine, fine_ids), (window, ids)):
            points = view.fixed_point(ground.points_m)
            cv2.fillPoly(image, [points], number, cv2.LINE_8, view.shift_bits)
    # A colour of 8 bits is enough here: the noise that follows spreads it.
    colours = np.array([m.rgb for m in materials]).round().astype(np.uint8)
    size = (window.width_px, window.height_px)
    base = np.empty((*window.shape, 3), np.float32)
    for channel in range(3):
        large = colours[:, channel].take(fine_ids)
        base[..., channel] = cv2.resize(large, size, interpolation=cv2.INTER_AREA)
    canvas.labels[region] = np.array([m.label for m in materials], np.uint8)[ids]
    shift = np.array([np.subtract(m.other_rgb, m.rgb) for m in materials], np.float32)
    mix = np.clip(0.42 + 0.42 * noise.band(1.0, 32.0, 0.6, 1), 0.0, 1.0)
    base += shift[ids] * mix[..., None]
    base *= _texture(window, noise, materials, ids)[..., None]
    canvas.rgb[region] = base
    _paint_markings(canvas, region, plan.markings(), noise)


def _indexed(
    background: Material, grounds: Sequence[Ground]
) -> tuple[list[Material], dict[Material, int]]:
    index = {background: 0}
    for ground in grounds:
        index.setdefault(ground.material, len(index))
    return list(index), index


def _texture(
    window: DrawnWindow, noise: Noise, materials: Sequence[Material], ids: NDArray[np.int16]
) -> FloatImage:
    contrast = np.array([m.contrast for m in materials], np.float32)
    gain = contrast[:, 0][ids] * noise.band(4.0, 32.0, 0.5)
    gain += contrast[:, 1][ids] * noise.band(0.5, 2.0, 0.4)
    gain += contrast[:, 2][ids] * noise.band(0.0625, 0.25, 0.2)
    gain += structure(window, noise, [m.grain for m in materials], ids)
    stripe = np.array([m.stripe for m in materials], np.float32)
    if stripe.any():
        # Stripes narrower than two pixels average away instead of aliasing.
        wave = np.array([m.stripe_per_m for m in materials], np.float32)
        cycles_px = np.hypot(wave[:, 0], wave[:, 1]) * window.gsd_m
        stripe = stripe * np.clip(2.0 - 4.0 * cycles_px, 0.0, 1.0)
        x = window.left_m + (np.arange(window.width_px, dtype=np.float32) + 0.5) * window.gsd_m
        y = window.top_m + (np.arange(window.height_px, dtype=np.float32) + 0.5) * window.gsd_m
        phase = wave[:, 0][ids] * x[None, :] + wave[:, 1][ids] * y[:, None]
        phase += 0.12 * noise.octave(3)
        gain += stripe[ids] * np.sin((2.0 * np.pi) * phase) * (1.0 + 0.4 * noise.octave(2))
    return np.asarray(np.clip(1.0 + gain, 0.25, 1.9), np.float32)


def _paint_markings(
    canvas: Canvas, region: Region, quads_m: NDArray[np.float64], noise: Noise
) -> None:
    window = canvas.sub_window(*region)
    low, high = quads_m.min(axis=1, initial=1e9), quads_m.max(axis=1, initial=-1e9)
    seen = (low < (window.right_m, window.bottom_m)).all(1)
    seen &= (high > (window.left_m, window.top_m)).all(1)
    if not seen.any():
        return
    alpha = canvas.coverage(list(quads_m[seen]), region)
    worn = np.clip(0.68 + 0.2 * noise.band(0.25, 4.0, 0.3), 0.1, 0.95)
    canvas.blend(region, np.asarray(alpha * worn, np.float32), (214.0, 214.0, 208.0))
