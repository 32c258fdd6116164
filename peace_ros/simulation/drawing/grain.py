# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What grounds of one colour are told apart by: tufts, stones, joints, slabs, cracks, ripples.

Everything is a function of the place in metres, so that a window shows the same ground at any
resolution; what is finer than a pixel fades, as a camera would average it away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.noise import FloatImage, Noise
from peace_ros.simulation.drawing.window import DrawnWindow

Array = NDArray[np.floating[Any]]

_TUFTS, _STONES, _CRACKS = 2, 3, 4
"""Variants of the noise, so that no structure follows another or the colour."""
_BLADES_PER_TUFT = 0.6


@dataclass(frozen=True)
class Grain:
    """The fine structure of a ground; amplitudes are relative to its brightness."""

    tufts: float = 0.0
    """Of grass: dark gaps between clumps of 0.25 to 1 m, and blades of a few centimetres."""
    stones: float = 0.0
    """Single stones and clods of 0.1 to 0.3 m, lit and with a dark side."""
    cracks: float = 0.0
    """Of old sealed ground: thin dark lines some metres apart."""
    slab_m: tuple[float, float] = (0.0, 0.0)
    """Length and width of slabs, paving stones or repaired patches; 0 for none."""
    slab: float = 0.0
    """How much their tones differ."""
    joint: float = 0.0
    """How dark the joints between them are."""
    joint_m: float = 0.0
    """Width of the joints."""
    ripple_m: float = 0.0
    """Wavelength of ripples on water; 0 for none."""
    ripple: float = 0.0
    angle_rad: float = 0.0
    """Direction of slabs or ripples."""


_KINDS: dict[str, tuple[float, float]] = {
    # kind of paved ground: chance of slabs with joints (else repaired patches), of cracks
    'asphalt': (0.0, 0.4), 'new_asphalt': (0.0, 0.05), 'old_asphalt': (0.1, 0.8),
    'concrete': (0.85, 0.5), 'paving': (0.95, 0.1), 'red_paving': (0.95, 0.1),
    'court': (0.0, 0.1), 'green_court': (0.0, 0.1), 'blue_court': (0.0, 0.1),
}  # fmt: skip
_SMALL_STONES = ('paving', 'red_paving')


def draw_grain(rng: np.random.Generator, kind: str, label: Label) -> Grain:
    """Return the structure of a ground kind of the palette; every ground of it has its own."""
    angle = float(rng.uniform(0.0, pi))
    strength = float(rng.uniform(0.6, 1.4))
    if label == Label.GRASS:
        short = 0.4 if kind in {'turf', 'pitch', 'lawn'} else 1.0
        return Grain(tufts=0.10 * short * strength)
    if label == Label.BARE_GROUND:
        fine = 0.3 if kind in {'sand', 'pale_sand'} else 1.0
        return Grain(stones=0.11 * fine * strength)
    if label == Label.WATER:
        length = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
        return Grain(ripple_m=length, ripple=0.05 * strength * rng.random(), angle_rad=angle)
    slabs, cracked = _KINDS[kind]
    cracks = 0.16 * strength if rng.random() < cracked else 0.0
    if rng.random() >= slabs:
        size = float(rng.uniform(6.0, 25.0)), float(rng.uniform(2.5, 5.0))
        return Grain(cracks=cracks, slab_m=size, slab=0.08 * strength, joint=0.12,
                     joint_m=0.04, angle_rad=angle)  # fmt: skip
    small = kind in _SMALL_STONES
    length = float(rng.uniform(0.3, 1.2) if small else rng.uniform(2.0, 6.0))
    size = length, length * float(rng.uniform(0.5, 1.0))
    wide = float(rng.uniform(0.02, 0.04) if small else rng.uniform(0.03, 0.09))
    return Grain(cracks=cracks, slab_m=size, slab=0.09 * strength,
                 joint=0.42 * strength, joint_m=wide, angle_rad=angle)  # fmt: skip


def structure(
    window: DrawnWindow, noise: Noise, grains: Sequence[Grain], ids: NDArray[np.int16]
) -> FloatImage:
    """Return the relative brightness that the grains add, float32 height x width.

    Args:
        window: where.
        noise: of this window.
        grains: by ground number.
        ids: ground number of each pixel.
    """
    total = np.zeros(window.shape, np.float32)
    patterns: tuple[tuple[str, Callable[[], FloatImage]], ...] = (
        ('tufts', lambda: _tufts(noise)),
        ('stones', lambda: _stones(noise)),
        ('cracks', lambda: _cracks(window, noise)),
    )
    for name, pattern in patterns:
        amount = np.array([getattr(each, name) for each in grains], np.float32)
        if amount.any():
            total += amount[ids] * pattern()
    for number, each in enumerate(grains):
        if each.slab_m[0] > 0.0 or each.ripple_m > 0.0:
            _add_oriented(total, window, noise, each, ids == number)
    return total


def _tufts(noise: Noise) -> FloatImage:
    """Ridged noise: round clumps with thin dark gaps, and blades between."""
    clumps = 0.8 - np.abs(noise.band(0.25, 1.0, 0.2, _TUFTS) - 0.1)
    return np.asarray(
        -clumps * (clumps > 0.0) * 1.5 + _BLADES_PER_TUFT * noise.band(0.03125, 0.125, 0.1, _TUFTS),
        np.float32,
    )


def _stones(noise: Noise) -> FloatImage:
    """Return what stands out of the noise, so that most of the ground stays plain."""
    fine, coarse = noise.band(0.0625, 0.25, 0.4, _STONES), noise.octave(0, _STONES)
    height = fine + 0.3 * coarse
    return np.asarray(
        2.0 * np.maximum(height - 1.1, 0.0) - 2.0 * np.maximum(-height - 1.2, 0.0), np.float32
    )


def _cracks(window: DrawnWindow, noise: Noise) -> FloatImage:
    """Return thin lines where smooth noise changes its sign."""
    wide_m = max(0.05, window.gsd_m)
    field = noise.octave(2, _CRACKS) + 0.35 * noise.octave(0, _CRACKS)
    line = np.clip(1.0 - np.abs(field) / (0.45 * wide_m), 0.0, 1.0)
    return np.asarray(-line * min(1.0, 0.05 / window.gsd_m) * 2.0, np.float32)


def _add_oriented(
    total: FloatImage, window: DrawnWindow, noise: Noise, grain: Grain, own: NDArray[np.bool_]
) -> None:
    """Add slabs and ripples of one ground where it lies."""
    rows, columns = np.nonzero(own)
    if not rows.size:
        return
    gsd = window.gsd_m
    x = window.left_m + (columns + 0.5) * gsd
    y = window.top_m + (rows + 0.5) * gsd
    c, s = np.cos(grain.angle_rad), np.sin(grain.angle_rad)
    u, v = c * x + s * y, c * y - s * x
    if grain.ripple_m > 0.0:
        bent = u / grain.ripple_m + 0.5 * noise.octave(2, _TUFTS)[own]
        shown = np.clip(2.0 - 4.0 * gsd / grain.ripple_m, 0.0, 1.0)
        total[own] += (grain.ripple * shown * np.sin(2.0 * pi * bent)).astype(np.float32)
        return
    length, width = grain.slab_m
    row = np.floor(v / width)
    # Every other row is shifted by a half, as masons lay them.
    along = u / length + 0.5 * (row % 2.0)
    tone = _chance(np.floor(along), row) - 0.5
    shown = np.clip(2.0 - 2.5 * gsd / width, 0.0, 1.0)
    to_joint = np.minimum(to_edge(along) * length, to_edge(v / width) * width)
    filled = line_share(to_joint, grain.joint_m, gsd)
    worn = np.clip(0.75 + 0.35 * noise.octave(1, _CRACKS)[own], 0.0, 1.3)
    total[own] += (2.0 * grain.slab * shown * tone - grain.joint * filled * worn).astype(np.float32)


def to_edge(cells: Array) -> Array:
    """Return the distance to the nearest whole number."""
    return np.asarray(np.abs(cells - np.round(cells)))


def line_share(to_line_m: Array, wide_m: float, gsd_m: float) -> Array:
    """Return which part of each pixel a line covers, 0 to 1, by the distance to its middle."""
    filled = np.clip((0.5 * (wide_m + gsd_m) - to_line_m) / gsd_m, 0.0, 1.0)
    return np.asarray(filled * min(1.0, wide_m / gsd_m))


def _chance(i: NDArray[np.float64], j: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a number of 0 to 1 that belongs to a cell and looks like chance."""
    value = np.sin(i * 127.1 + j * 311.7) * 43758.5453
    return np.asarray(value - np.floor(value))
