# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What drawn views borrow from real ones: the look of ground, water, leaves, and of light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.lab.training.arrays import Image, Rng
from peace_ros.lab.training.sources import TrainingSource

_GROUND = (Label.GRASS, Label.BARE_GROUND, Label.PAVED, Label.WATER)
_SIDE_PX = (48, 128)
_TRIES = 120
_SHADE_PX = 4.0


@dataclass(frozen=True)
class Materials:
    """Textures by label, and looks as mean and spread in CIELAB, cut out of real images."""

    textures: dict[Label, tuple[Image, ...]] = field(default_factory=dict)
    looks: tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...] = ()


NO_MATERIALS = Materials()


def gather_materials(sources: Sequence[TrainingSource], rng: Rng) -> Materials:
    """Cut squares that hold nothing but one label, and note the colours of any squares."""
    textures: dict[Label, list[Image]] = {}
    looks = []
    for source in sources:
        if source.kind == 'drawn':
            continue
        tries = _TRIES if source.kind == 'drone' else _TRIES // 10
        for image, classes in zip(source.images_rgb, source.classes, strict=True):
            height, width = classes.shape
            for _ in range(tries):
                side = int(rng.integers(*_SIDE_PX))
                top, left = rng.integers(0, height - side), rng.integers(0, width - side)
                window = (slice(top, top + side), slice(left, left + side))
                found = int(classes[window][0, 0])
                if found in (*_GROUND, Label.TREE) and (classes[window] == found).all():
                    textures.setdefault(Label(found), []).append(image[window])
            looks.append(_look(image))
    return Materials({key: tuple(value) for key, value in textures.items()}, tuple(looks))


def _look(image_rgb: Image) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    small = cv2.resize(image_rgb, (64, 64), interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(small, cv2.COLOR_RGB2LAB).reshape(-1, 3).astype(np.float32)
    return lab.mean(axis=0), lab.std(axis=0) + 1.0


def cover(image: Image, classes: Image, rng: Rng, materials: Materials) -> Image:
    """Lay real textures over the ground of a drawn view; its light and shadows stay."""
    out = image.astype(np.float32)
    shade = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), (0, 0), _SHADE_PX)
    for label in _GROUND:
        choice = materials.textures.get(label, ())
        ground = classes == label
        if not choice or rng.random() < 0.4 or not ground.any():
            continue
        texture = _tiled(choice[int(rng.integers(len(choice)))], rng, image.shape[0])
        light = shade.astype(np.float32) / max(float(shade[ground].mean()), 1.0)
        # Half of the views keep some of the drawn colour, so that more colours are seen.
        part = rng.uniform(0.5, 1.0)
        covered = texture * np.clip(light, 0.3, 1.7)[..., None]
        out[ground] = part * covered[ground] + (1.0 - part) * out[ground]
    return np.clip(out, 0.0, 255.0).astype(np.uint8)


def _tiled(texture: Image, rng: Rng, size_px: int) -> NDArray[np.float32]:
    """Repeat a texture in mirrored tiles until it fills a view, turned and scaled at random."""
    side = texture.shape[0]
    scale, angle = rng.uniform(0.6, 1.6), rng.uniform(0.0, 360.0)
    middle = (side / 2.0, side / 2.0)
    matrix = cv2.getRotationMatrix2D(middle, angle, scale)
    matrix[:, 2] += (size_px - side) / 2.0
    turned = cv2.warpAffine(
        texture, matrix, (size_px, size_px), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    return np.asarray(turned, dtype=np.float32)


def match_look(image: Image, rng: Rng, materials: Materials) -> Image:
    """Move the light of a view towards that of a real image, and its colours a little."""
    if not materials.looks:
        return image
    mean, spread = materials.looks[int(rng.integers(len(materials.looks)))]
    own_mean, own_spread = _look(image)
    part = np.array([1.0, 0.5, 0.5], dtype=np.float32) * rng.uniform(0.1, 0.8)
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB).astype(np.float32)
    gain = np.clip(spread / own_spread, 0.6, 1.6)
    moved = (lab - own_mean) * gain + mean
    mixed = np.clip(part * moved + (1.0 - part) * lab, 0.0, 255.0).astype(np.uint8)
    return np.ascontiguousarray(cv2.cvtColor(mixed, cv2.COLOR_LAB2RGB), dtype=np.uint8)


_TINTS: dict[Label, tuple[float, float, float]] = {
    Label.GRASS: (12.0, 4.0, 7.0), Label.BARE_GROUND: (14.0, 4.0, 7.0),
    Label.PAVED: (16.0, 4.0, 6.0), Label.BUILDING: (24.0, 9.0, 10.0), Label.TREE: (12.0, 5.0, 7.0),
}  # fmt: skip
"""Spread in CIELAB by which the material of a label may differ from what was drawn."""


def tint(image: Image, classes: Image, rng: Rng) -> Image:
    """Vary the tones of the labels of a drawn view: its palette is small."""
    chosen = [label for label in _TINTS if rng.random() < 0.4]
    if not chosen:
        return image
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB).astype(np.float32)
    for label in chosen:
        lab[classes == label] += rng.normal(0.0, _TINTS[label]).astype(np.float32)
    moved = np.clip(lab, 0.0, 255.0).astype(np.uint8)
    return np.ascontiguousarray(cv2.cvtColor(moved, cv2.COLOR_LAB2RGB), dtype=np.uint8)
