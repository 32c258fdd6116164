# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a plan to an image with labels, and the drawn scenes that train the bundled model."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import WorldError
from peace_ros.simulation.drawing.canvas import Canvas, Region, paint_ground
from peace_ros.simulation.drawing.crowns import draw_trees
from peace_ros.simulation.drawing.layouts import LAYOUTS, plan_layout
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.noise import FloatImage
from peace_ros.simulation.drawing.palette import SEASONS
from peace_ros.simulation.drawing.plan import Plan
from peace_ros.simulation.drawing.roofs import draw_building
from peace_ros.simulation.drawing.sprites import stamp_barrier, stamp_thing
from peace_ros.simulation.drawing.window import DrawnWindow


@dataclass(frozen=True)
class Scene:
    """A drawn nadir image and its ground truth."""

    image_rgb: NDArray[np.uint8]
    """size x size x 3."""
    labels: NDArray[np.uint8]
    """size x size of :class:`peace_ros.core.domain.Label`, no pixel UNLABELED."""
    gsd_m: float
    season: str
    layout: str


@dataclass(frozen=True)
class Look:
    """How the camera of a scene renders colours."""

    gain: tuple[float, float, float]
    contrast: float
    saturation: float
    haze: float
    blur_px: float
    grain: float
    ambient: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Look:
        """Return the look of a scene."""
        exposure = np.exp(rng.normal(-0.06, 0.13))
        warm = rng.normal(-0.02, 0.035)
        tint = rng.normal(0.0, 0.02)
        return cls(
            gain=(
                float(exposure * (1 + warm)),
                float(exposure * (1 + tint)),
                float(exposure * (1 - warm)),
            ),
            contrast=float(np.exp(rng.normal(-0.04, 0.12))),
            saturation=float(np.exp(rng.normal(-0.20, 0.20))),
            haze=float(max(0.0, rng.normal(2.0, 7.0))),
            blur_px=float(rng.uniform(0.25, 0.9)),
            grain=float(rng.uniform(0.5, 3.0)),
            ambient=float(rng.uniform(0.30, 0.52)),
        )


def render(
    plan: Plan,
    window: DrawnWindow,
    seed: int,
    sun: Sun,
    look: Look,
    shown: Region | None = None,
) -> Canvas:
    """Draw a plan in a window; the canvas then holds the final colours, labels and heights.

    Args:
        plan: of the place.
        window: where heights count.
        seed: of the noise.
        sun: of the place.
        look: of the camera.
        shown: pixels of the window that will be looked at; the rest only casts shadows and has
            neither ground nor light. None: all.
    """
    canvas = Canvas(window, seed)
    shown = canvas.whole if shown is None else shown
    paint_ground(canvas, plan, shown)
    for barrier in plan.barriers:
        stamp_barrier(canvas, barrier)
    for thing in plan.things:
        stamp_thing(canvas, thing)
    for building in plan.buildings:
        draw_building(canvas, building, sun)
    draw_trees(canvas, plan.trees, sun)
    shadow = sun.shadow(canvas.height_m, window.gsd_m)
    if canvas.veil_m.any():
        np.maximum(shadow, 0.4 * sun.shadow(canvas.veil_m, window.gsd_m), out=shadow)
    sky = np.array([0.90, 0.97, 1.12], np.float32) * look.ambient
    depth = sun.clearness * (1.0 - sky)
    canvas.rgb[shown] *= 1.0 - shadow[shown][..., None] * depth
    return canvas


def develop(rgb: FloatImage, look: Look, grain: FloatImage) -> NDArray[np.uint8]:
    """Turn colours into the 8-bit image that a camera would give.

    Args:
        rgb: height x width x 3, 0 to 255.
        look: of the camera.
        grain: see :func:`sensor_noise`.
    """
    image = rgb
    if look.blur_px > 0.3:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), look.blur_px), np.float32)
    grey = image @ np.array([0.3, 0.59, 0.11], np.float32)
    image = grey[..., None] + (image - grey[..., None]) * np.float32(look.saturation)
    image = image * np.asarray(look.gain, np.float32)
    image = (image - 112.0) * np.float32(look.contrast) + np.float32(112.0 + look.haze)
    return np.asarray(np.clip(image + grain * np.float32(look.grain), 0.0, 255.0), np.uint8)


def sensor_noise(w: DrawnWindow, seed: int) -> FloatImage:
    """Return the noise of the pixels of a window, height x width x 1, unit variance.

    It belongs to pixels and not to the ground: it is drawn from the place of the window.
    """
    key = [seed, 9, abs(round(w.left_m / w.gsd_m)), abs(round(w.top_m / w.gsd_m))]
    rng = np.random.Generator(np.random.PCG64(key))
    return rng.standard_normal((*w.shape, 1), dtype=np.float32)


def draw_scene(
    seed: int,
    size_px: int,
    gsd_m: float,
    *,
    season: str | None = None,
    layout: str | None = None,
) -> Scene:
    """Draw a square aerial scene with exact labels.

    Args:
        seed: 0 or more; the same seed and extent (size_px * gsd_m) give the same place, whatever
            the resolution.
        size_px: width and height, 16 to 8192.
        gsd_m: ground sampling distance in metres per pixel, 0.02 to 2.
        season: one of SEASONS, or None to let the seed choose.
        layout: one of LAYOUTS, or None to let the seed choose.

    Raises:
        WorldError: an argument is out of its range.
    """
    _check(seed, size_px, gsd_m, season, layout)
    rng = np.random.Generator(np.random.PCG64([seed, 1]))
    chosen_season = SEASONS[int(rng.integers(len(SEASONS)))]
    chosen_layout = LAYOUTS[int(rng.integers(len(LAYOUTS)))]
    season, layout = season or chosen_season, layout or chosen_layout
    sun = Sun.draw(rng, season)
    look = Look.draw(rng)
    extent = round(size_px * gsd_m, 6)
    plan = plan_layout(rng, layout, season, extent)
    window = DrawnWindow(-0.5 * extent, -0.5 * extent, size_px, size_px, gsd_m)
    canvas = render(plan, window, seed, sun, look)
    image = develop(canvas.rgb, look, sensor_noise(window, seed))
    return Scene(image, canvas.labels, gsd_m, season, layout)


def _check(seed: int, size_px: int, gsd_m: float, season: str | None, layout: str | None) -> None:
    if seed < 0:
        raise WorldError(f'seed {seed}: give a whole number of 0 or more')
    if not 16 <= size_px <= 8192:
        raise WorldError(f'scene of {size_px} px: give 16 to 8192 px')
    if not 0.02 <= gsd_m <= 2.0:
        raise WorldError(f'ground sampling distance {gsd_m} m: give 0.02 to 2 m per pixel')
    if season is not None and season not in SEASONS:
        raise WorldError(f'season {season!r}: choose one of {", ".join(SEASONS)}')
    if layout is not None and layout not in LAYOUTS:
        raise WorldError(f'layout {layout!r}: choose one of {", ".join(LAYOUTS)}')
