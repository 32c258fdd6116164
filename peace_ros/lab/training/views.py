# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A training view: a turned and scaled cut of a source, with pasted things, light and weather."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from peace_ros.core.domain import Label
from peace_ros.lab.training import pasting
from peace_ros.lab.training.arrays import Image, Rng
from peace_ros.lab.training.conditions import Condition, apply, pick_condition
from peace_ros.lab.training.sources import FRAME_PX, TrainingSource
from peace_ros.lab.training.textures import NO_MATERIALS, Materials, cover, match_look, tint


@dataclass(frozen=True)
class TrainingView:
    """What the networks see, with its truth."""

    image_rgb: Image
    classes: Image
    """Labels and partial classes."""
    condition: Condition


def cut(source: TrainingSource, rng: Rng, size_px: int) -> tuple[Image, Image, float]:
    """Cut a random square and return image, classes and metres per pixel of the cut.

    A view smaller than a frame keeps the frame's scale; beyond the source, pixels are mirrored.
    """
    low, high = source.frame_side_px
    # Favour near-whole frames: the square root pulls the draw towards the larger side.
    frame = float(np.exp(np.log(low) + np.log(high / low) * rng.random() ** 0.6))
    side = frame * size_px / FRAME_PX
    level = 0
    while level + 1 < len(source.images_rgb) and side / 2 ** (level + 1) > 0.8 * size_px:
        level += 1
    image, classes = source.images_rgb[level], source.classes[level]
    height, width = image.shape[:2]
    side = side / 2**level
    margin_x, margin_y = min(side / 2, width / 2), min(side / 2, height / 2)
    centre = (rng.uniform(margin_x, width - margin_x), rng.uniform(margin_y, height - margin_y))
    angle = rng.uniform(0, 2 * np.pi)
    scale = side / size_px
    flip = -1.0 if rng.random() < 0.5 else 1.0
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    half = (size_px - 1) / 2
    matrix = np.array([[flip * c, -s, 0.0], [flip * s, c, 0.0]])
    matrix[:, 2] = np.array(centre) - matrix[:, :2] @ (half, half)
    options = cv2.WARP_INVERSE_MAP
    linear = cv2.INTER_LINEAR if scale > 0.8 or rng.random() < 0.5 else cv2.INTER_CUBIC
    size = (size_px, size_px)
    view = cv2.warpAffine(image, matrix, size, flags=options | linear,
                          borderMode=cv2.BORDER_REFLECT_101)  # fmt: skip
    truth = cv2.warpAffine(classes, matrix, size, flags=options | cv2.INTER_NEAREST,
                           borderMode=cv2.BORDER_REFLECT_101)  # fmt: skip
    return (
        np.ascontiguousarray(view, dtype=np.uint8),
        np.ascontiguousarray(truth, dtype=np.uint8),
        source.gsd_m * 2**level * scale,
    )


def _paste_surfaces(image: Image, classes: Image, rng: Rng, gsd_m: float, *, real: bool) -> None:
    if rng.random() < 0.7:
        pasting.recolour_water(image, classes, rng)
    if rng.random() < (0.4 if real else 0.25):
        pasting.paste_water(image, classes, rng)
    if rng.random() < (0.1 if real else 0.05):
        pasting.paste_court(image, classes, rng, gsd_m)


def _paste(
    source: TrainingSource,
    image: Image,
    classes: Image,
    rng: Rng,
    gsd_m: float,
    foliage: Sequence[Image],
) -> None:
    real = source.kind != 'drawn'
    azimuth, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 1.6)
    sun = np.array([np.cos(azimuth), np.sin(azimuth)]) * reach
    _paste_surfaces(image, classes, rng, gsd_m, real=real)
    if rng.random() < (0.3 if real else 0.1):
        most = int(np.clip(gsd_m * image.shape[0] / 9.0, 2, 7))
        for _ in range(int(rng.integers(1, most))):
            pasting.paste_roof(image, classes, rng, gsd_m, sun)
    if foliage and rng.random() < (0.35 if real else 0.3):
        for _ in range(int(rng.integers(1, 10))):
            leaves = foliage[int(rng.integers(len(foliage)))]
            pasting.paste_tree(image, classes, rng, gsd_m, sun, leaves)
    if rng.random() < (0.6 if real else 0.25):
        # A car park in a narrow view would hide the ground.
        most = int(np.clip(gsd_m * image.shape[0] / 5.0, 2, 9))
        for _ in range(int(rng.integers(1, most))):
            pasting.paste_car(image, classes, rng, gsd_m, sun)
    if rng.random() < 0.65:
        # From high up a view holds more people, and each of them is easier missed.
        for _ in range(int(rng.integers(1, 12 if gsd_m < 0.1 else 24))):
            seen_from = pasting.paste_person, pasting.paste_standing_person
            seen_from[int(rng.random() < 0.35)](image, classes, rng, gsd_m, sun)
    if rng.random() < 0.15:
        for _ in range(int(rng.integers(1, 4))):
            centre = rng.uniform(0, image.shape[0], 2)
            ring = centre + rng.normal(0, image.shape[0] / 6, (7, 2))
            hull = cv2.convexHull(ring.astype(np.float32))[:, 0].astype(np.float64)
            pasting.darken(image, hull, rng.uniform(0.35, 0.75))


def jitter(image: Image, rng: Rng) -> Image:
    """Change exposure, contrast, gamma, white balance, saturation; blur, noise, JPEG at times."""
    steps = np.arange(256, dtype=np.float64) / 255.0
    gamma = np.exp(rng.normal(0, 0.22))
    gain, lift = np.exp(rng.normal(0, 0.18)), rng.normal(0, 0.04)
    channels = []
    for _ in range(3):
        tone = np.exp(rng.normal(0, 0.06))
        channels.append(np.clip(steps**gamma * gain * tone + lift, 0, 1) * 255.0)
    table = np.stack(channels, axis=1).astype(np.uint8)[None]
    out = cv2.LUT(image, table)
    if rng.random() < 0.6:
        grey = cv2.cvtColor(out, cv2.COLOR_RGB2GRAY)
        colour = rng.uniform(0.3, 1.5)
        grey3 = cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)
        out = cv2.addWeighted(out, colour, grey3, 1.0 - colour, 0.0)
    if rng.random() < 0.2:
        out = cv2.GaussianBlur(out, (0, 0), rng.uniform(0.4, 1.4))
    if rng.random() < 0.25:
        noise = rng.normal(0, rng.uniform(2, 10), (*image.shape[:2], 1))
        out = np.clip(out + noise, 0, 255).astype(np.uint8)
    if rng.random() < 0.3:
        _, packed = cv2.imencode('.jpg', out, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 90))])
        out = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))
    return np.ascontiguousarray(out, dtype=np.uint8)


def sample_view(
    source: TrainingSource,
    rng: Rng,
    size_px: int,
    *,
    condition_chance: float = 0.3,
    materials: Materials = NO_MATERIALS,
) -> TrainingView:
    """Draw one augmented training view of a source, some of it in materials of real images."""
    image, classes, gsd_m = cut(source, rng, size_px)
    drawn = source.kind == 'drawn'
    if drawn:
        image = tint(image, classes, rng)
        if rng.random() < 0.4:
            image = cover(image, classes, rng, materials)
    _paste(source, image, classes, rng, gsd_m, materials.textures.get(Label.TREE, ()))
    if rng.random() < (0.35 if drawn else 0.1):
        image = match_look(image, rng, materials)
    image = jitter(image, rng)
    condition = pick_condition(rng, source, condition_chance)
    return TrainingView(apply(condition, image, classes, rng), classes, condition)
