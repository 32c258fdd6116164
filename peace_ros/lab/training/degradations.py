# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many ways to blur, darken, cover or redraw an image, so that the condition is learned.

``peace_ros.simulation.drawing.apply_condition`` draws each condition in one way. A ranker that has
seen only that way learns the filter, not the weather.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.lab.training.arrays import Image, Rng

Real = NDArray[np.float32]
Way = Callable[[Real, Rng], Real]

_GREY = np.array([0.3, 0.59, 0.11], np.float32)


def degrade(image_rgb: Image, name: str, rng: Rng) -> Image:
    """Return the image in one of the ways of a condition of WAYS, drawn by ``rng``."""
    ways = WAYS[name]
    changed = ways[int(rng.integers(len(ways)))](image_rgb.astype(np.float32), rng)
    return np.clip(changed, 0.0, 255.0).astype(np.uint8)


def _grey(image: Real) -> Real:
    return np.asarray((image @ _GREY)[..., None], np.float32)


def _saturated(image: Real, gain: float) -> Real:
    grey = _grey(image)
    return np.asarray(grey + (image - grey) * np.float32(gain), np.float32)


def _clouds(rng: Rng, shape: tuple[int, ...], cells: int) -> Real:
    """Return smooth noise of unit spread."""
    coarse = rng.standard_normal((cells + 2, cells + 2)).astype(np.float32)
    return np.asarray(cv2.resize(coarse, shape[1::-1], interpolation=cv2.INTER_CUBIC), np.float32)


def _gaussian_blur(image: Real, rng: Rng) -> Real:
    sigma = rng.uniform(1.1, 5.0) * image.shape[0] / 352
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.float32)


def _motion_blur(image: Real, rng: Rng) -> Real:
    length = max(5, int(rng.uniform(6, 26) * image.shape[0] / 352))
    kernel = np.zeros((length, length), np.float32)
    middle, angle = (length - 1) / 2, rng.uniform(0, np.pi)
    reach = np.array([np.cos(angle), np.sin(angle)]) * middle
    start, end = np.round(middle - reach).astype(int), np.round(middle + reach).astype(int)
    cv2.line(kernel, start.tolist(), end.tolist(), 1.0)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.float32)


def _defocus(image: Real, rng: Rng) -> Real:
    side = 2 * max(1, int(rng.uniform(1.6, 8) * image.shape[0] / 352)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)).astype(np.float32)
    return np.asarray(cv2.filter2D(image, -1, disc / disc.sum()), np.float32)


def _box_blur(image: Real, rng: Rng) -> Real:
    side = 2 * max(1, int(rng.uniform(1.2, 7) * image.shape[0] / 352)) + 1
    return np.asarray(cv2.blur(image, (side, side)), np.float32)


def _upscaled(image: Real, rng: Rng) -> Real:
    part = rng.uniform(0.12, 0.4)
    small = cv2.resize(image, None, fx=part, fy=part, interpolation=cv2.INTER_AREA)
    ways = (cv2.INTER_LINEAR, cv2.INTER_CUBIC)
    size = image.shape[1::-1]
    return np.asarray(cv2.resize(small, size, interpolation=ways[rng.integers(2)]), np.float32)


def _gaussian_noise(image: Real, rng: Rng) -> Real:
    channels = 3 if rng.random() < 0.7 else 1
    noise = rng.standard_normal((*image.shape[:2], channels)).astype(np.float32)
    return image + noise * np.float32(rng.uniform(10, 60))


def _salt_and_pepper(image: Real, rng: Rng) -> Real:
    chance, amount = rng.random(image.shape[:2]), rng.uniform(0.01, 0.12)
    out = image.copy()
    out[chance < amount / 2], out[chance > 1 - amount / 2] = 0.0, 255.0
    return out


def _speckle(image: Real, rng: Rng) -> Real:
    noise = rng.standard_normal(image.shape).astype(np.float32)
    return image * (1.0 + noise * np.float32(rng.uniform(0.12, 0.5)))


def _night(image: Real, rng: Rng) -> Real:
    cold = np.array([0.75, 0.88, 1.2], np.float32) ** np.float32(rng.uniform(0.3, 1.2))
    grain = rng.standard_normal(image.shape).astype(np.float32) * np.float32(rng.uniform(0, 7))
    dim = np.float32(rng.uniform(0.1, 0.36))
    return _saturated(image, rng.uniform(0.2, 0.8)) * cold * dim + grain


def _dim(image: Real, rng: Rng) -> Real:
    return image * np.float32(rng.uniform(0.08, 0.42))


def _dim_by_gamma(image: Real, rng: Rng) -> Real:
    return np.asarray(255.0 * (image / 255.0) ** rng.uniform(2.2, 4.5), np.float32)


def _even_fog(image: Real, rng: Rng) -> Real:
    veil, air = np.float32(rng.uniform(0.3, 0.85)), np.float32(rng.uniform(165, 250))
    return image * (1 - veil) + air * veil


def _drifting_fog(image: Real, rng: Rng) -> Real:
    drift = _clouds(rng, image.shape, int(rng.integers(1, 7)))
    veil = np.clip(rng.uniform(0.35, 0.75) + rng.uniform(0.05, 0.3) * drift, 0.05, 0.95)[..., None]
    return image * (1 - veil) + np.float32(rng.uniform(170, 245)) * veil


def _thick_fog(image: Real, rng: Rng) -> Real:
    return _even_fog(_gaussian_blur(image, rng), rng)


def _streaks(image: Real, rng: Rng) -> Real:
    """Draw falling drops as lines of one direction."""
    height, width = image.shape[:2]
    layer = np.zeros((height, width), np.float32)
    lean, length = rng.uniform(-0.6, 0.6), rng.uniform(8, 40) * height / 352
    for _ in range(int(rng.uniform(60, 900))):
        x, y, long = rng.uniform(0, width), rng.uniform(-20, height), length * rng.uniform(0.5, 1.3)
        ends = (round(x), round(y)), (round(x + lean * long), round(y + long))
        cv2.line(layer, *ends, float(rng.uniform(0.4, 1.0)), int(rng.random() < 0.15) + 1)
    if rng.random() < 0.6:
        layer = np.asarray(cv2.GaussianBlur(layer, (0, 0), 0.7), np.float32)
    drops = layer[..., None] * np.float32(rng.uniform(0.3, 0.85))
    return image * (1 - drops) + np.float32(rng.uniform(170, 250)) * drops


def _rain(image: Real, rng: Rng) -> Real:
    dull = _saturated(image, rng.uniform(0.5, 1.0)) * np.float32(rng.uniform(0.55, 1.0))
    return _streaks(dull, rng)


def _rain_in_mist(image: Real, rng: Rng) -> Real:
    veil = np.float32(rng.uniform(0.1, 0.35))
    return _rain(image * (1 - veil) + np.float32(150) * veil, rng)


def _flakes(image: Real, rng: Rng) -> Real:
    """Draw falling snow: white dots of several sizes."""
    height, width = image.shape[:2]
    layer = np.zeros((height, width), np.float32)
    largest = max(0.5, rng.uniform(1.0, 4.0) * height / 352)
    for _ in range(int(rng.uniform(150, 1600))):
        centre = (round(rng.uniform(0, width)), round(rng.uniform(0, height)))
        cv2.circle(layer, centre, round(rng.uniform(0.4, largest)), float(rng.uniform(0.6, 1)), -1)
    if rng.random() < 0.6:
        layer = np.asarray(cv2.GaussianBlur(layer, (0, 0), rng.uniform(0.5, 1.2)), np.float32)
    return image * (1 - layer[..., None]) + 250.0 * layer[..., None]


def _snow_cover(image: Real, rng: Rng) -> Real:
    """Whiten: all of it, or the bright and the green."""
    grey = _grey(image)
    if rng.random() < 0.5:
        cover = np.clip((grey - rng.uniform(20, 110)) / rng.uniform(20, 70), 0, 1)
    else:
        cover = np.full_like(grey, rng.uniform(0.5, 0.9))
    cover = cover * np.clip(0.8 + 0.3 * _clouds(rng, image.shape, 8), 0, 1)[..., None]
    white = np.clip(rng.uniform(150, 205) + 0.45 * grey, 0, 252)
    white = white * np.array([0.97, 0.99, 1.02], np.float32)
    return np.asarray(image + (white - image) * cover * np.float32(0.95), np.float32)


def _snow_fall(image: Real, rng: Rng) -> Real:
    return _flakes(_snow_cover(image, rng), rng)


def _posterised(image: Real, rng: Rng) -> Real:
    step = np.float32(rng.uniform(22, 70))
    return _saturated(np.floor(image / step) * step + step / 2, rng.uniform(1.0, 1.6))


def _flat_shaded(image: Real, rng: Rng) -> Real:
    flat = np.clip(image, 0, 255).astype(np.uint8)
    for _ in range(int(rng.integers(1, 4))):
        flat = cv2.bilateralFilter(flat, 7, rng.uniform(40, 110), rng.uniform(2, 6))
    return _saturated(flat.astype(np.float32), rng.uniform(1.0, 1.6))


def _painted_flat(image: Real, rng: Rng) -> Real:
    side = 2 * int(rng.integers(2, 6)) + 1
    flat = cv2.medianBlur(np.clip(image, 0, 255).astype(np.uint8), side)
    return _posterised(flat.astype(np.float32), rng)


def _few_colours(image: Real, rng: Rng) -> Real:
    """Keep a handful of colours of the image itself."""
    small = cv2.resize(image, (48, 48), interpolation=cv2.INTER_AREA).reshape(-1, 3)
    palette = small[rng.choice(len(small), int(rng.integers(5, 14)), replace=False)]
    smooth = cv2.GaussianBlur(image, (0, 0), 1.2).reshape(-1, 3)
    distance = (palette**2).sum(axis=1) - 2.0 * smooth @ palette.T
    return np.asarray(palette[distance.argmin(axis=1)].reshape(image.shape), np.float32)


def _outlined(image: Real, rng: Rng) -> Real:
    flat = _flat_shaded(image, rng)
    grey = cv2.medianBlur(np.clip(_grey(image)[..., 0], 0, 255).astype(np.uint8), 3)
    edges = cv2.adaptiveThreshold(
        grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, 9, rng.uniform(3, 7)
    )
    return flat * (edges[..., None] / np.float32(255))


def _overexposed(image: Real, rng: Rng) -> Real:
    return image * np.float32(rng.uniform(1.25, 1.9)) + np.float32(rng.uniform(0, 30))


def _warm_light(image: Real, rng: Rng) -> Real:
    warm = np.array([1.1, 1.04, 0.9], np.float32) ** np.float32(rng.uniform(0.4, 1.4))
    return (image * warm - 110.0) * np.float32(rng.uniform(1.05, 1.5)) + np.float32(130.0)


def _overcast(image: Real, rng: Rng) -> Real:
    dull = _saturated(image, rng.uniform(0.35, 0.8))
    flat = (dull - 110.0) * np.float32(rng.uniform(0.45, 0.8)) + np.float32(rng.uniform(85, 120))
    return flat * np.array([0.96, 0.99, 1.05], np.float32)


def _low_sun(image: Real, rng: Rng) -> Real:
    part = np.float32(rng.uniform(0.5, 1.5))
    orange = np.array([1.2, 0.92, 0.66], np.float32) ** part
    return image * orange * np.float32(rng.uniform(0.6, 1.0))


def _false_colours(image: Real, rng: Rng) -> Real:
    maps = (cv2.COLORMAP_JET, cv2.COLORMAP_INFERNO, cv2.COLORMAP_HOT, cv2.COLORMAP_TURBO)
    grey = np.clip(_grey(image)[..., 0], 0, 255).astype(np.uint8)
    return cv2.applyColorMap(grey, maps[rng.integers(4)])[..., ::-1].astype(np.float32)


def _brown_haze(image: Real, rng: Rng) -> Real:
    veil = np.float32(rng.uniform(0.25, 0.65))
    air = np.float32(rng.uniform(120, 190)) * np.array([1.08, 0.98, 0.78], np.float32)
    return image * (1 - veil) + air * veil


WAYS: dict[str, tuple[Way, ...]] = {
    'blurred': (_gaussian_blur, _motion_blur, _defocus, _box_blur, _upscaled),
    'noise': (_gaussian_noise, _gaussian_noise, _salt_and_pepper, _speckle),
    'night': (_night,),
    'dark': (_dim, _dim_by_gamma),
    'fog': (_even_fog, _drifting_fog, _thick_fog),
    'rainy': (_rain, _streaks, _rain_in_mist),
    'snowy': (_snow_cover, _flakes, _snow_fall),
    'rendered': (_posterised, _flat_shaded, _painted_flat, _few_colours, _outlined),
    'sunny': (_warm_light,),
    'bright': (_overexposed,),
    'cloudy': (_overcast,),
    'evening': (_low_sun,),
    'heat-map': (_false_colours,),
    'smog': (_brown_haze,),
}
"""Condition -> ways to draw it."""
