# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Weather, light, season and image quality, applied to a finished image; labels never change."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label, WorldError

Image = NDArray[np.float32]
Labels = NDArray[np.uint8]
Rng = np.random.Generator
_Effect = Callable[[Image, Rng, float, 'Labels | None'], Image]

_GREY = np.array([0.3, 0.59, 0.11], np.float32)


def apply_condition(
    image_rgb: NDArray[np.uint8],
    name: str,
    rng: np.random.Generator,
    *,
    strength: float | None = None,
    labels: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]:
    """Return the image under a condition of CONDITIONS.

    Args:
        image_rgb: height x width x 3.
        name: a key of CONDITIONS: a word of the paper's vocabularies, 'clear' or 'noise'.
        rng: varies the effect.
        strength: 0 (hardly seen) to 1 (heavy); None lets ``rng`` choose between 0.35 and 1.
        labels: height x width, tells snow where ground and water are; without it colour decides.

    Raises:
        WorldError: an unknown condition.
    """
    if name not in _EFFECTS:
        raise WorldError(f'condition {name!r}: choose one of {", ".join(CONDITIONS)}')
    force = float(rng.uniform(0.35, 1.0)) if strength is None else float(np.clip(strength, 0, 1))
    changed = _EFFECTS[name](image_rgb.astype(np.float32), rng, force, labels)
    return np.clip(changed, 0.0, 255.0).astype(np.uint8)


def _smooth(rng: np.random.Generator, shape: tuple[int, ...], cells: int) -> Image:
    small = rng.standard_normal((cells + 2, cells + 2), dtype=np.float32)
    size = (shape[1], shape[0])
    return np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_CUBIC), np.float32)


def _saturate(image: Image, gain: float) -> Image:
    grey = (image @ _GREY)[..., None]
    return np.asarray(grey + (image - grey) * np.float32(gain), np.float32)


def _tint(image: Image, red: float, green: float, blue: float) -> Image:
    return np.asarray(image * np.array([red, green, blue], np.float32))


def _clear(image: Image, _rng: np.random.Generator, _force: float, _labels: Labels | None) -> Image:
    return image


def _snowy(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    """Cover with snow what lies open; steep, warm, moving and wet things show through."""
    patch = 0.55 * _smooth(rng, image.shape, 6) + 0.35 * _smooth(rng, image.shape, 40)
    cover = np.clip(2.6 * force - 0.35 + 0.45 * patch, 0.0, 0.94)
    if labels is not None:
        share = np.ones(len(Label), np.float32)
        share[Label.PAVED], share[Label.VEHICLE], share[Label.TREE] = 0.6, 0.55, 0.5
        share[Label.WATER], share[Label.PERSON], share[Label.OBSTACLE] = 0.04, 0.05, 0.5
        cover = cover * cv2.blur(share[labels], (3, 3))
    grey = image @ _GREY
    mean = cv2.blur(grey, (31, 31))
    relief = np.clip(grey / np.maximum(mean, 20.0), 0.25, 1.25)
    snow = np.clip(np.clip(150.0 + 0.45 * mean, 150, 236) * relief**0.75, 40.0, 250.0)
    white = snow[..., None] * np.array([0.965, 0.985, 1.03], np.float32)
    mixed = image + (white - image) * cover[..., None]
    return np.asarray(_saturate(mixed, 0.8), np.float32)


def _winter(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    if rng.random() < 0.5:
        return _snowy(image, rng, 0.35 + 0.5 * force, labels)
    pale = _tint(_saturate(image, 1.0 - 0.5 * force), 0.97, 0.98, 1.06)
    return np.asarray(pale * 0.9 + 14.0, np.float32)


def _greenness(image: Image) -> Image:
    excess = 2.0 * image[..., 1] - image[..., 0] - image[..., 2]
    return np.asarray(np.clip(excess / 40.0, 0.0, 1.0), np.float32)


def _autumn(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    green = _greenness(image)
    if labels is not None:
        green = np.maximum(green, 0.7 * (labels == Label.TREE).astype(np.float32))
        keeps = np.ones(len(Label), np.float32)
        keeps[Label.GRASS], keeps[Label.WATER], keeps[Label.VEHICLE] = 0.5, 0.0, 0.0
        green = green * keeps[labels]
    hue = np.clip(0.5 + 0.5 * _smooth(rng, image.shape, 22), 0.0, 1.0)[..., None]
    grey = (image @ _GREY)[..., None]
    ends = np.array([[1.55, 0.92, 0.42], [1.45, 1.15, 0.5]], np.float32)
    leaves = grey * (ends[0] * hue + ends[1] * (1 - hue)) * np.float32(1.1)
    return np.asarray(image + (leaves - image) * (green * force)[..., None], np.float32)


def _spring(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    fresh = _tint(image, 0.95, 1.0 + 0.16 * force, 0.86) * np.float32(1.05)
    green = _greenness(image)[..., None]
    return np.asarray(image + (fresh - image) * (0.4 + 0.6 * green), np.float32)


def _summer(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    warm = _tint(image, 1.0 + 0.10 * force, 1.0 + 0.03 * force, 1.0 - 0.08 * force)
    return np.asarray((warm - 110.0) * (1.0 + 0.15 * force) + 116.0, np.float32)


def _fog(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    veil = np.clip(0.35 + 0.42 * force + 0.10 * _smooth(rng, image.shape, 3), 0.0, 0.9)[..., None]
    air = rng.uniform(176.0, 226.0) * np.array([0.99, 1.0, 1.02], np.float32)
    soft = cv2.GaussianBlur(image, (0, 0), 0.4 + 1.2 * force)
    return np.asarray(soft + (air - soft) * veil, np.float32)


def _smog(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    veil = np.clip(0.28 + 0.36 * force + 0.07 * _smooth(rng, image.shape, 3), 0.0, 0.8)[..., None]
    air = rng.uniform(138.0, 182.0) * np.array([1.06, 0.99, 0.82], np.float32)
    return np.asarray(image + (air - image) * veil, np.float32)


def _night(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    dim = 0.36 - 0.22 * force
    dark = _tint(_saturate(image, 0.45), 0.82, 0.92, 1.2) * np.float32(dim)
    lamps = np.zeros(image.shape[:2], np.float32)
    for _ in range(int(rng.poisson(3.0))):
        r, c = rng.integers(0, image.shape[0]), rng.integers(0, image.shape[1])
        if labels is None or labels[r, c] in {Label.PAVED, Label.OBSTACLE}:
            lamps[r, c] = 1.0
    if lamps.any():
        glow = cv2.GaussianBlur(lamps, (0, 0), 0.05 * image.shape[0])
        glow /= glow.max()
        dark = dark + image * glow[..., None] * np.array([0.55, 0.42, 0.22], np.float32)
    grain = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(2.0 + 5.0 * force)
    return np.asarray(dark + grain, np.float32)


def _dark(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    dim = np.float32(0.62 - 0.4 * force)
    grain = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(2.0)
    return np.asarray(_saturate(image, 0.8) * dim + grain, np.float32)


def _bright(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    lifted = 255.0 * (np.clip(image, 0, 255) / 255.0) ** (1 - 0.45 * force)
    return np.asarray(lifted + 12 * force, np.float32)


def _sunny(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    warm = _tint(_saturate(image, 1.0 + 0.25 * force), 1.0 + 0.08 * force, 1.03, 1 - 0.05 * force)
    return np.asarray((warm - 118.0) * (1.08 + 0.28 * force) + 128.0 + 6.0 * force, np.float32)


def _cloudy(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    flat = (image - 110.0) * np.float32(1.0 - 0.35 * force) + 108.0
    cloud = 1.0 - 0.14 * force * np.clip(0.5 + _smooth(rng, image.shape, 2), 0.0, 1.5)
    cool = _tint(_saturate(flat, 1.0 - 0.35 * force), 0.96, 0.99, 1.05)
    return np.asarray(cool * cloud[..., None], np.float32)


def _rainy(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    wet = _damp(image, rng, force, labels)
    streaks = (rng.random(image.shape[:2], dtype=np.float32) > 0.988).astype(np.float32)
    length = max(5, image.shape[0] // 28)
    kernel = np.zeros((length, length), np.float32)
    lean = int(rng.integers(-length // 3, length // 3 + 1))
    middle = length // 2
    cv2.line(kernel, (middle - lean // 2, 0), (middle + lean // 2, length - 1), 1.0, 1)
    rain = cv2.filter2D(streaks, -1, kernel / kernel.sum()) * np.float32(length)
    veil = wet + (np.float32(168.0) - wet) * np.float32(0.16 * force)
    return np.asarray(veil + rain[..., None] * np.float32(26.0 * force), np.float32)


def _damp(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    dull = _tint(_saturate(image, 1.0 - 0.15 * force), 0.94, 0.97, 1.02)
    wet = dull * np.float32(1.0 - 0.3 * force)
    sheen = np.clip(_smooth(rng, image.shape, 14) - 0.7, 0.0, 1.0)
    if labels is not None:
        sheen = sheen * np.isin(labels, (Label.PAVED, Label.BARE_GROUND))
    return np.asarray(wet + sheen[..., None] * np.float32(42.0 * force), np.float32)


def _evening(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    low = _tint(image, 1.0 + 0.20 * force, 0.98 - 0.06 * force, 0.92 - 0.28 * force)
    return np.asarray(low * np.float32(0.92 - 0.22 * force), np.float32)


def _morning(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    mist = image + (np.float32(196.0) - image) * np.float32(0.14 * force)
    return np.asarray(_tint(mist, 1.0 + 0.07 * force, 1.0, 1.0 - 0.02 * force) * 0.95, np.float32)


def _afternoon(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    return np.asarray(_tint(image, 1.0 + 0.09 * force, 1.02, 1.0 - 0.10 * force), np.float32)


def _heat(image: Image, _rng: Rng, force: float, _labels: Labels | None) -> Image:
    pale = _tint(image, 1.0 + 0.14 * force, 1.02, 1.0 - 0.16 * force)
    return np.asarray(pale + (np.float32(214.0) - pale) * np.float32(0.14 * force), np.float32)


def _blurred(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    sigma = (0.9 + 2.6 * force) * image.shape[0] / 352.0
    if rng.random() < 0.6:
        return np.asarray(cv2.GaussianBlur(image, (0, 0), max(sigma, 0.6)), np.float32)
    length = max(3, round(3.2 * sigma)) | 1
    kernel = np.zeros((length, length), np.float32)
    angle = rng.uniform(0, np.pi)
    half = length / 2
    ends = [
        (round(half + s * half * np.cos(angle)), round(half + s * half * np.sin(angle)))
        for s in (-1, 1)
    ]
    cv2.line(kernel, ends[0], ends[1], 1.0, 1)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.float32)


def _rendered(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    """Flat shaded: detail smoothed within regions, few tones, clean edges."""
    smooth = np.clip(image, 0, 255).astype(np.uint8)
    for _ in range(1 + round(2 * force)):
        smooth = cv2.bilateralFilter(smooth, 5, 48.0, 2.5)
    step = np.float32(10.0 + 18.0 * force)
    flat = np.round(smooth.astype(np.float32) / step) * step
    return np.asarray(_saturate(flat, 1.1 + 0.25 * float(rng.random())), np.float32)


def _three_d(image: Image, rng: Rng, force: float, labels: Labels | None) -> Image:
    """Embossed: edges lit from one side, as in a computer-made relief."""
    flat = _rendered(image, rng, 0.35 * force, labels)
    grey = cv2.GaussianBlur(flat @ _GREY, (0, 0), 1.0)
    relief = sum(cv2.Sobel(grey, cv2.CV_32F, dx, dy, ksize=3) for dx, dy in ((1, 0), (0, 1)))
    lit = np.clip(relief * (0.25 + 0.35 * force), -70.0, 70.0)
    return np.asarray(flat + lit[..., None], np.float32)


def _noise(image: Image, rng: Rng, force: float, _labels: Labels | None) -> Image:
    sigma = np.float32(7.0 + 22.0 * force)
    return np.asarray(image + rng.standard_normal(image.shape, dtype=np.float32) * sigma)


_EFFECTS: dict[str, _Effect] = {
    'clear': _clear,
    'summer': _summer,
    'winter': _winter,
    'autumn': _autumn,
    'spring': _spring,
    'heat': _heat,
    'morning': _morning,
    'afternoon': _afternoon,
    'evening': _evening,
    'night': _night,
    'bright': _bright,
    'dark': _dark,
    'sunny': _sunny,
    'rainy': _rainy,
    'cloudy': _cloudy,
    'snowy': _snowy,
    'smog': _smog,
    'fog': _fog,
    'damp': _damp,
    '3D': _three_d,
    '3D rendered': _rendered,
    'rendered': _rendered,
    'blurred': _blurred,
    'noise': _noise,
}

CONDITIONS = tuple(_EFFECTS)
"""Words that :func:`apply_condition` can draw."""
