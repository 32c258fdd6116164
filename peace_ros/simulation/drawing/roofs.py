# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Buildings: a rectangular body with a gabled, hipped, flat, shed-row or saw-tooth roof."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.canvas import Canvas
from peace_ros.simulation.drawing.grain import Array, line_share, to_edge
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.noise import FloatImage
from peace_ros.simulation.drawing.plan import Building

PITCHED = ('gable', 'hip')


def draw_building(canvas: Canvas, building: Building, sun: Sun) -> None:
    """Draw one building true to size: roof, label and height."""
    window = canvas.window
    reach = building.reach_m
    if not window.sees_disc(building.x_m, building.y_m, reach):
        return
    # The box of a turned rectangle is smaller than that of its outer circle.
    c, s = cos(building.heading_rad), sin(building.heading_rad)
    half_x = 0.5 * (abs(c) * building.length_m + abs(s) * building.width_m)
    half_y = 0.5 * (abs(s) * building.length_m + abs(c) * building.width_m)
    centre, half = np.array([building.x_m, building.y_m]), np.array([half_x, half_y])
    region = canvas.region(centre - half, centre + half)
    if region is None:
        return
    sub = canvas.sub_window(*region)
    g = sub.gsd_m
    x = sub.left_m - building.x_m + (np.arange(sub.width_px, dtype=np.float32) + 0.5) * g
    y = sub.top_m - building.y_m + (np.arange(sub.height_px, dtype=np.float32) + 0.5) * g
    u = np.asarray(c * x[None, :] + s * y[:, None], np.float32)
    v = np.asarray(-s * x[None, :] + c * y[:, None], np.float32)
    inside_u = 0.5 * building.length_m - np.abs(u)
    inside_v = 0.5 * building.width_m - np.abs(v)
    inside = np.minimum(inside_u, inside_v)
    alpha = np.clip(inside / g + 0.5, 0.0, 1.0)
    rng = np.random.Generator(np.random.PCG64(building.seed))
    if building.roof in PITCHED:
        colour, height = _pitched(canvas, region, building, sun, (u, v, inside_u, inside_v), rng)
    else:
        colour, height = _flat(canvas, region, building, (u, v, inside), rng)
    # The higher of two overlapping bodies is seen.
    here = canvas.height_m[region]
    wins = (alpha > 0.0) & (height >= here - 0.05)
    alpha = np.where(wins, alpha, 0.0).astype(np.float32)
    part = canvas.rgb[region]
    part += (colour - part) * alpha[..., None]
    own = alpha >= 0.5
    canvas.labels[region][own] = Label.BUILDING
    here[own] = height[own]


def _pitched(
    canvas: Canvas,
    region: tuple[slice, slice],
    building: Building,
    sun: Sun,
    frame: tuple[Array, Array, Array, Array],
    rng: np.random.Generator,
) -> tuple[FloatImage, FloatImage]:
    u, v, inside_u, inside_v = frame
    slope = float(rng.uniform(0.45, 0.85))
    along = inside_v
    end_face = np.zeros(u.shape, bool)
    if building.roof == 'hip':
        end_face = inside_u < inside_v
        along = np.minimum(inside_u, inside_v)
    height = building.eaves_m + slope * np.clip(along, 0.0, None)
    # Normals of the two long faces and, of a hipped roof, the two ends.
    c, s = cos(building.heading_rad), sin(building.heading_rad)
    face_v = np.where(v > 0, 1.0, -1.0)
    face_u = np.where(u > 0, 1.0, -1.0)
    nx = np.where(end_face, face_u * c, -face_v * s) * slope
    ny = np.where(end_face, face_u * s, face_v * c) * slope
    light = sun.facing(nx, ny)
    g = canvas.window.gsd_m
    rows_m = 0.34
    visible = np.clip(rows_m / g - 1.5, 0.0, 1.0)
    rows = 0.07 * visible * np.sin((2 * np.pi / rows_m) * along)
    noise = canvas.noise
    stain = 0.05 * noise.octave(1)[region] + 0.05 * noise.octave(-1)[region]
    grain = 0.05 * noise.octave(-2)[region]
    shade = light * (1.0 + rows + stain + grain)
    ridge = (
        np.abs(v)
        if building.roof == 'gable'
        else np.abs(inside_u - inside_v) + 10.0 * (inside_u > inside_v + 0.5)
    )
    shade = shade * (1.0 + 0.12 * (ridge < 0.2))
    colour = np.asarray(building.rgb, np.float32) * shade[..., None]
    # Solar panels, roof windows and chimneys lie in faces.
    if rng.random() < 0.22:
        side = 1.0 if rng.random() < 0.5 else -1.0
        panel = (side * v > 0.6) & (inside_v > 0.5) & (np.abs(u) < 0.3 * building.length_m)
        gap = (np.abs(np.mod(u, 1.05) - 0.5) > 0.46) * np.clip(0.3 / g - 0.5, 0.0, 1.0)
        blue = np.array([38, 44, 66], np.float32) * (light[..., None] * 0.8 + 0.3)
        blue = blue * (1.0 + 0.7 * gap[..., None])
        colour[panel & ~end_face] = blue[panel & ~end_face]
    for _ in range(int(rng.integers(0, 4))):
        pu = rng.uniform(-0.4, 0.4) * building.length_m
        pv = rng.uniform(0.15, 0.35) * building.width_m * (1 if rng.random() < 0.5 else -1)
        spot = (np.abs(u - pu) < 0.4) & (np.abs(v - pv) < 0.55)
        colour[spot] = (52, 58, 66) if rng.random() < 0.6 else (186, 196, 206)
    if rng.random() < 0.6:
        pu = rng.uniform(-0.35, 0.35) * building.length_m
        pv = rng.uniform(-0.2, 0.2) * building.width_m
        spot = (np.abs(u - pu) < 0.45) & (np.abs(v - pv) < 0.35)
        colour[spot] = (146, 112, 98) if rng.random() < 0.6 else (170, 164, 156)
        height = height + 1.0 * spot
    return np.asarray(colour, np.float32), np.asarray(height, np.float32)


def _flat(
    canvas: Canvas,
    region: tuple[slice, slice],
    building: Building,
    frame: tuple[Array, Array, Array],
    rng: np.random.Generator,
) -> tuple[FloatImage, FloatImage]:
    u, v, inside = frame
    noise, g = canvas.noise, canvas.window.gsd_m
    height = np.full(u.shape, building.eaves_m, np.float32)
    dirt = 0.05 * noise.octave(2)[region] + 0.035 * noise.octave(0)[region]
    dirt = dirt + 0.03 * noise.octave(-2)[region]
    shade = 1.0 + dirt
    if building.roof in {'metal', 'saw'}:
        period = 1.0 if building.roof == 'metal' else float(rng.uniform(4.0, 8.0))
        if building.roof == 'metal':
            fade = np.clip(period / g - 2.0, 0.0, 1.0)
            shade = shade + 0.06 * fade * np.sign(np.sin((2 * np.pi / period) * u))
            shade = shade + np.where(v > 0, 0.07, -0.05)
        else:
            shade = shade + 0.22 * (np.mod(u, period) / period - 0.5)
    else:
        shade = shade + _covering(canvas, region, u if rng.random() < 0.5 else v, rng)
    colour = np.asarray(building.rgb, np.float32) * shade[..., None]
    if building.roof == 'flat':
        rim = (inside < 0.45) & (inside > -g)
        colour[rim] *= 1.16
        height = height + 0.6 * rim
        inner_line = (inside < 0.7) & (inside >= 0.45)
        colour[inner_line] *= 0.86
    _roof_things(colour, height, building, (u, v), rng)
    return np.asarray(colour, np.float32), np.asarray(height, np.float32)


def _covering(
    canvas: Canvas, region: tuple[slice, slice], across: Array, rng: np.random.Generator
) -> FloatImage:
    """Return the relative brightness of what covers a flat roof: strips of membrane, or ballast.

    Membrane comes in strips of a metre or two with seams between them; gravel ballast has
    walkways of slabs. Without them a roof that fills the picture would be no different from soil.
    """
    g = canvas.window.gsd_m
    if rng.random() < 0.8:
        period, wide, tone = float(rng.uniform(1.0, 2.2)), 0.08, float(rng.uniform(-0.35, -0.12))
        strips = np.floor(across / period)
        differ = np.sin(strips * 127.1) * np.clip(2.0 - 2.5 * g / period, 0.0, 1.0)
        out = 0.025 * differ
    else:
        period, wide, tone = float(rng.uniform(6.0, 11.0)), 0.6, float(rng.uniform(0.1, 0.25))
        out = 0.06 * canvas.noise.octave(-3, 1)[region]
    line = line_share(to_edge(across / period) * period, wide, g)
    return np.asarray(out + tone * line, np.float32)


def _roof_things(
    colour: FloatImage,
    height: FloatImage,
    building: Building,
    frame: tuple[FloatImage, FloatImage],
    rng: np.random.Generator,
) -> None:
    """Set skylights, air conditioners, stair heads and panels on a flat roof."""
    u, v = frame
    half_u, half_v = 0.5 * building.length_m - 1.5, 0.5 * building.width_m - 1.5
    if half_u < 1.0 or half_v < 1.0:
        return
    area = building.length_m * building.width_m
    if rng.random() < 0.25 and area > 80:
        rows = (np.abs(u) < 0.8 * half_u) & (np.abs(v) < 0.8 * half_v)
        panel = rows & (np.mod(v, 2.2) < 1.3) & (np.mod(u, 6.0) < 5.4)
        colour[panel] = (40, 48, 72)
        height[panel] += 0.4
        return
    count = int(min(12, rng.poisson(1.0 + area / 90.0)))
    row_v = rng.uniform(-half_v, half_v)
    for _ in range(count):
        pu = rng.uniform(-half_u, half_u)
        pv = row_v if rng.random() < 0.6 else rng.uniform(-half_v, half_v)
        size = rng.uniform(0.4, 1.1)
        spot = (np.abs(u - pu) < size) & (np.abs(v - pv) < size * 0.8)
        kind = rng.random()
        if kind < 0.5:
            colour[spot] = np.float32(rng.uniform(150, 220))
            height[spot] += 1.2
        elif kind < 0.8:
            colour[spot] = (206, 216, 224)
        else:
            colour[spot] = (58, 60, 64)
            height[spot] += 0.8
