# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Things pasted onto views, because real images hold too few: cars, people, roofs, pools, courts.

All functions change image (uint8 RGB) and classes (uint8) in place.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.lab.training.arrays import Image, Points, Rng

_CAR_COLOURS = (
    (235, 235, 235), (200, 202, 205), (140, 142, 146), (60, 62, 66), (25, 26, 30), (150, 30, 30),
    (30, 60, 130), (40, 90, 60), (190, 160, 110), (220, 190, 60), (90, 60, 45), (200, 80, 30),
)  # fmt: skip
_ROOF_COLOURS = (
    (190, 95, 65), (150, 75, 55), (120, 60, 50), (95, 95, 100), (60, 60, 64), (210, 208, 204),
    (240, 240, 238), (175, 165, 150), (130, 125, 120), (205, 185, 150), (110, 125, 140),
    (160, 140, 120),
)  # fmt: skip
_WATER_COLOURS = (
    (50, 80, 60), (60, 85, 55), (40, 60, 70), (70, 75, 60), (30, 40, 45), (45, 75, 95),
    (85, 85, 65), (60, 120, 130), (20, 28, 30), (95, 110, 100), (90, 75, 50), (50, 90, 75),
    (45, 65, 50), (58, 78, 62), (72, 92, 76), (66, 86, 58), (40, 58, 40), (84, 100, 72),
)  # fmt: skip

_COURT_COLOURS = (
    (60, 110, 80), (75, 125, 85), (50, 90, 60), (50, 85, 130), (65, 105, 150), (40, 65, 110),
    (165, 85, 65), (150, 70, 55), (120, 120, 118), (95, 98, 100), (110, 75, 120), (180, 120, 90),
)  # fmt: skip
_LIKE_GROUND = 0.3
"""Of the waters: as green or as brown as the ground around, so that colour alone says nothing."""

_CROWN_COLOURS = (
    (70, 95, 50), (50, 75, 40), (110, 120, 60), (150, 110, 50), (170, 90, 50), (120, 70, 60),
    (170, 140, 135), (190, 165, 160), (140, 130, 110), (110, 100, 85), (90, 50, 45), (60, 85, 65),
)  # fmt: skip


def _rectangle(centre: tuple[float, float], length: float, width: float, angle: float) -> Points:
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    return np.array([centre + a * length * along + b * width * across for a, b in corners])


def _somewhere(image: Image, rng: Rng) -> tuple[tuple[float, float], float]:
    """Return a place in the image and a direction."""
    height, side = image.shape[:2]
    centre = (rng.uniform(0, side), rng.uniform(0, height))
    return centre, rng.uniform(0, np.pi)


def _grain(image: Image, mask: NDArray[np.bool_], rng: Rng, most: float) -> None:
    """Roughen what a mask covers, by up to ``most`` grey levels (one sigma)."""
    noise = rng.normal(0, rng.uniform(1, most), mask.sum())[:, None]
    image[mask] = np.clip(image[mask] + noise, 0, 255).astype(np.uint8)


def _fill(image: Image, polygon: Points, colour: tuple[float, ...]) -> None:
    points = np.round(polygon * 16).astype(np.int32)
    cv2.fillPoly(image, [points], colour, cv2.LINE_AA, 4)


def _mask(shape: tuple[int, ...], polygon: Points) -> NDArray[np.bool_]:
    mask = np.zeros(shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, [np.round(polygon * 16).astype(np.int32)], 1, cv2.LINE_8, 4)
    return mask.astype(bool)


def darken(image: Image, polygon: Points, factor: float) -> None:
    """Lay a shadow (bluish, as under a clear sky) over a polygon."""
    x0, y0 = np.maximum(np.floor(polygon.min(axis=0)).astype(int), 0)
    x1, y1 = np.ceil(polygon.max(axis=0)).astype(int) + 1
    part = image[y0:y1, x0:x1]
    if part.size == 0:
        return
    mask = np.zeros(part.shape[:2], dtype=np.float32)
    points = np.round((polygon - (x0, y0)) * 16).astype(np.int32)
    cv2.fillPoly(mask, [points], 1.0, cv2.LINE_AA, 4)
    tint = np.array([factor * 0.95, factor, min(1.0, factor * 1.1)], dtype=np.float32)
    part[:] = (part * (1.0 + mask[..., None] * (tint - 1.0))).astype(np.uint8)


def _jittered(
    rng: Rng, colours: tuple[tuple[int, int, int], ...], spread: float
) -> tuple[float, ...]:
    base = np.array(colours[int(rng.integers(len(colours)))], dtype=float)
    return tuple(float(v) for v in np.clip(base + rng.normal(0, spread, 3), 5, 250))


def paste_car(image: Image, classes: Image, rng: Rng, gsd_m: float, sun: Points) -> None:
    """Paste a car, van or lorry with windows and shadow; ``sun`` is the shadow of 1 m height."""
    kind = rng.random()
    length_m = rng.uniform(3.6, 5.0) if kind < 0.8 else rng.uniform(5.5, 12.0)
    width_m = rng.uniform(1.7, 2.0) if kind < 0.8 else rng.uniform(2.1, 2.6)
    length, width = length_m / gsd_m, width_m / gsd_m
    if length < 3.0:
        return
    centre, angle = _somewhere(image, rng)
    body = _rectangle(centre, length, width, angle)
    tall = 1.4 if kind < 0.8 else 2.8
    darken(image, body + sun * tall / gsd_m, rng.uniform(0.35, 0.6))
    colour = _jittered(rng, _CAR_COLOURS, 10)
    _fill(image, body, colour)
    if length > 7:
        glass = tuple(0.25 * v + 15 for v in colour)
        _fill(image, _rectangle(centre, length * 0.62, width * 0.82, angle), glass)
        roof = tuple(min(255.0, v * 1.08) for v in colour)
        _fill(image, _rectangle(centre, length * rng.uniform(0.3, 0.45), width * 0.76, angle), roof)
    classes[_mask(image.shape, body)] = Label.VEHICLE


def paste_person(image: Image, classes: Image, rng: Rng, gsd_m: float, sun: Points) -> None:
    """Paste a person seen from above with a cast shadow."""
    radius = rng.uniform(0.22, 0.34) / gsd_m
    if radius < 0.45:
        return
    height, side = image.shape[:2]
    centre = np.array([rng.uniform(0, side), rng.uniform(0, height)])
    shadow = np.array([centre, centre + sun * 1.7 / gsd_m])
    across = np.array([-sun[1], sun[0]])
    across = across / (np.linalg.norm(across) + 1e-6) * radius * 0.7
    corners = [shadow[0] + across, shadow[1] + across, shadow[1] - across, shadow[0] - across]
    darken(image, np.array(corners), rng.uniform(0.4, 0.65))
    clothes = tuple(float(v) for v in rng.uniform(10, 245, 3))
    angle = float(rng.uniform(0, 180))
    middle = (float(centre[0]), float(centre[1]))
    axes = (float(2 * radius), float(1.3 * radius))
    cv2.ellipse(image, (middle, axes, angle), clothes, -1, cv2.LINE_AA)
    if radius > 1.5:
        hair = (60.0, 45.0, 35.0) if rng.random() < 0.7 else (190.0, 160.0, 120.0)
        cv2.ellipse(image, (middle, (radius, radius), 0.0), hair, -1, cv2.LINE_AA)
    whole = np.zeros(classes.shape, dtype=np.uint8)
    cv2.ellipse(whole, (middle, (axes[0] + 1.0, axes[1] + 1.0), angle), 1, -1)
    classes[whole > 0] = Label.PERSON


def paste_standing_person(
    image: Image, classes: Image, rng: Rng, gsd_m: float, sun: Points
) -> None:
    """Paste a person seen from aside, as cameras that look ahead or lean do: legs, body, head."""
    height = rng.uniform(0.5, 1.7) / gsd_m
    width = rng.uniform(0.3, 0.5) / gsd_m
    if width < 1.0:
        return
    feet = np.array([rng.uniform(0, image.shape[1]), rng.uniform(0, image.shape[0])])
    angle = rng.uniform(0, 2 * np.pi)
    up = np.array([np.cos(angle), np.sin(angle)])
    aside = np.array([-up[1], up[0]]) * width / 2
    shadow = [feet + aside, feet - aside, feet + sun * 1.7 / gsd_m]
    darken(image, np.array(shadow), rng.uniform(0.4, 0.65))
    skin = (200.0, 165.0, 140.0) if rng.random() < 0.6 else (120.0, 85.0, 65.0)
    whole = np.zeros(classes.shape, dtype=np.uint8)
    parts = (
        (0.25, 0.55, 0.35, tuple(float(v) for v in rng.uniform(10, 160, 3))),
        (0.62, 0.5, 0.5, tuple(float(v) for v in rng.uniform(10, 245, 3))),
        (0.93, 0.18, 0.25, skin),
    )
    for along, long, wide, colour in parts:
        middle = feet + up * along * height
        box = (
            (float(middle[0]), float(middle[1])),
            (max(1.2, long * height), max(1.2, 2 * wide * width)),
            float(np.degrees(angle)),
        )
        cv2.ellipse(image, box, colour, -1, cv2.LINE_AA)
        cv2.ellipse(whole, box, 1, -1)
    classes[whole > 0] = Label.PERSON


def paste_roof(image: Image, classes: Image, rng: Rng, gsd_m: float, sun: Points) -> None:
    """Paste a house: flat or with two slopes, plain or ribbed, in any roof colour, with shadow."""
    length, width = rng.uniform(5, 22) / gsd_m, rng.uniform(4, 12) / gsd_m
    centre, angle = _somewhere(image, rng)
    body = _rectangle(centre, length, width, angle)
    tall = rng.uniform(2.5, 9) / gsd_m
    hull = cv2.convexHull(np.vstack([body, body + sun * tall]).astype(np.float32))[:, 0]
    darken(image, np.asarray(hull, dtype=np.float64), rng.uniform(0.3, 0.55))
    colour = np.array(_jittered(rng, _ROOF_COLOURS, 12))
    _fill(image, body, tuple(colour))
    if rng.random() < 0.6:
        shade = rng.uniform(0.6, 0.92)
        other = np.array([(body[0] + body[3]) / 2, (body[1] + body[2]) / 2, body[2], body[3]])
        _fill(image, other, tuple(colour * shade))
    mask = _mask(image.shape, body)
    if rng.random() < 0.5 and width > 12:
        steps = np.linspace(0, 1, int(width / rng.uniform(3, 7)) + 2)
        for step in steps:
            a, b = body[0] + step * (body[3] - body[0]), body[1] + step * (body[2] - body[1])
            ends = [tuple(np.round(p).astype(int).tolist()) for p in (a, b)]
            cv2.line(image, ends[0], ends[1], tuple(colour * 0.85), 1, cv2.LINE_AA)
    if rng.random() < 0.5:
        for _ in range(int(rng.integers(1, 4))):
            spot = (centre[0] + rng.normal(0, length / 6), centre[1] + rng.normal(0, width / 8))
            box = _rectangle(spot, 1.2 / gsd_m, 1.0 / gsd_m, angle)
            _fill(image, box, tuple(rng.uniform(60, 220) for _ in range(3)))
    _grain(image, mask, rng, 7.0)
    classes[mask] = Label.BUILDING


def paste_water(image: Image, classes: Image, rng: Rng) -> None:
    """Paste a pond, canal or pool: a smooth shape with faint waves and glints."""
    height, side = image.shape[:2]
    size = rng.uniform(0.15, 1.0) * side
    middle = np.array([rng.uniform(0, side), rng.uniform(0, height)])
    if rng.random() < 0.35:
        # A shore: the edge of something larger than the view.
        size = 2.0 * side
        away = rng.uniform(0, 2 * np.pi)
        reach = rng.uniform(0.8, 1.9) * side
        middle = np.array([side / 2, height / 2]) + reach * np.array([np.cos(away), np.sin(away)])
    count = int(rng.integers(6, 12))
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    radii = size * rng.uniform(0.5, 1.0, count)
    stretch = np.array([1.0, rng.uniform(0.2, 1.0)])
    turn = rng.uniform(0, np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1) * radii[:, None] * stretch
    polygon = ring @ rotation.T + middle
    mask = np.zeros((height, side), dtype=np.uint8)
    cv2.fillPoly(mask, [np.round(polygon).astype(np.int32)], 255)
    soft = int(rng.integers(1, 8)) * 2 + 1
    inside = np.asarray(cv2.medianBlur(mask, soft)) > 127
    if not inside.any():
        return
    base = _water_colour(image, classes, rng)
    image[inside] = water_texture(rng, height, side, base)[inside]
    classes[inside] = Label.WATER


def _crown(rng: Rng, centre: Points, radius: float) -> Points:
    """Return the outline of a crown: a few lobes, and raggedness that is finer."""
    angles = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    wobble = np.ones(72)
    for waves in range(2, 14):
        size = 0.22 * waves**-0.8 * rng.normal()
        wobble += size * np.cos(waves * angles + rng.uniform(0, 2 * np.pi))
    wobble = radius * np.clip(wobble, 0.5, 1.6)
    return centre + np.stack([np.cos(angles), np.sin(angles)], axis=1) * wobble[:, None]


def _mirrored(index: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    folded = index % (2 * size)
    return np.minimum(folded, 2 * size - 1 - folded)


def paste_tree(
    image: Image, classes: Image, rng: Rng, gsd_m: float, sun: Points, foliage: Image
) -> None:
    """Paste a crown cut from a photograph of trees, in any season's colour, with its shadow."""
    height, side = image.shape[:2]
    radius = float(np.clip(rng.uniform(1.2, 6.0) / gsd_m, 3.0, 0.25 * side))
    centre = np.array([rng.uniform(0, side), rng.uniform(0, height)])
    ring = _crown(rng, centre, radius)
    darken(image, ring + sun * rng.uniform(3, 9) / gsd_m, rng.uniform(0.3, 0.6))
    mask = _mask(image.shape, ring)
    # Leaves keep their size; a crown larger than the patch sees it mirrored.
    zoom = rng.uniform(0.7, 1.4)
    patch = cv2.resize(foliage, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_LINEAR)
    rows, columns = np.nonzero(mask)
    shift = rng.integers(0, 4096, 2)
    leaves = patch[
        _mirrored(rows + shift[0], patch.shape[0]), _mirrored(columns + shift[1], patch.shape[1])
    ].astype(np.float32)
    if rng.random() < 0.45:
        colour = np.array(_jittered(rng, _CROWN_COLOURS, 12), dtype=np.float32)
        grey = leaves.mean(axis=1, keepdims=True)
        leaves = grey / (grey.mean() + 1e-3) * colour
    # Lit on the side of the sun, darker opposite.
    lit = ((columns - centre[0]) * sun[0] + (rows - centre[1]) * sun[1]) / radius
    leaves = leaves * (1.0 - 0.22 * lit[:, None])
    image[mask] = np.clip(leaves, 0, 255).astype(np.uint8)
    classes[mask] = Label.TREE


def paste_court(image: Image, classes: Image, rng: Rng, gsd_m: float) -> None:
    """Paste a painted hard court with its lines: smooth and often green, and yet paved."""
    length, width = rng.uniform(14, 40) / gsd_m, rng.uniform(8, 20) / gsd_m
    if width < 12.0:
        return
    centre, angle = _somewhere(image, rng)
    body = _rectangle(centre, length, width, angle)
    apron = np.array(_jittered(rng, _COURT_COLOURS, 8))
    _fill(image, body, tuple(apron))
    field = _rectangle(centre, 0.82 * length, 0.78 * width, angle)
    # Every other court has a field of a second colour.
    if rng.random() < 0.5:
        _fill(image, field, _jittered(rng, _COURT_COLOURS, 8))
    mask = _mask(image.shape, body)
    _grain(image, mask, rng, 5.0)
    line = (float(rng.uniform(200, 250)),) * 3
    thick = max(1, round(0.07 / gsd_m))
    middle = np.array([(field[0] + field[1]) / 2, (field[2] + field[3]) / 2])
    for points, closed in ((field, True), (middle, False)):
        whole = [np.round(points * 16).astype(np.int32)]
        cv2.polylines(image, whole, closed, line, thick, cv2.LINE_AA, 4)
    ring = (float(centre[0]), float(centre[1])), (0.2 * width,) * 2, 0.0
    cv2.ellipse(image, ring, line, thick, cv2.LINE_AA)
    classes[mask] = Label.PAVED


def _water_colour(image: Image, classes: Image, rng: Rng) -> Points:
    """Return the colour of some water, or of the plants and the ground that are in the view."""
    around = np.isin(classes, (Label.GRASS, Label.BARE_GROUND, Label.TREE))
    if rng.random() < _LIKE_GROUND and around.any():
        label = rng.choice(np.unique(classes[around]))
        mean = image[classes == label].mean(axis=0)
        return np.asarray(mean * rng.uniform(0.6, 1.15) + rng.normal(0, 6, 3))
    return np.array(_jittered(rng, _WATER_COLOURS, 8)) * rng.uniform(0.7, 1.5)


def water_texture(rng: Rng, height: int, width: int, base: Points) -> Image:
    """Return a water surface (uint8 RGB): one hue, slow shading, ripples, sometimes glints."""
    slow = cv2.resize(
        rng.normal(0, 1, (5, 5)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC
    )
    grain = rng.normal(0, 1, (height, width)).astype(np.float32)
    sigma = rng.uniform(0.5, 2.5)
    waves = cv2.GaussianBlur(grain, (0, 0), sigmaX=sigma, sigmaY=sigma * rng.uniform(1, 3))
    fine = np.asarray(waves / (waves.std() + 1e-6))
    if rng.random() < 0.5 and height == width:
        fine = fine.T
    value = 1.0 + rng.uniform(0, 0.12) * slow + rng.uniform(0, 0.12) * fine
    out = base * value[..., None]
    if rng.random() < 0.25:
        out = out + 90.0 * (fine > 2.2)[..., None]
    return np.asarray(np.clip(out, 0, 255), dtype=np.uint8)


def recolour_water(image: Image, classes: Image, rng: Rng) -> None:
    """Give the water of a view another colour, keeping its brightness pattern."""
    inside = classes == Label.WATER
    if not inside.any():
        return
    grey = image[inside].astype(np.float32).mean(axis=1)
    colour = _water_colour(image, classes, rng)
    ratio = np.clip(grey / (grey.mean() + 1e-3), 0.3, 2.5)
    image[inside] = np.clip(ratio[:, None] * colour, 0, 255).astype(np.uint8)
