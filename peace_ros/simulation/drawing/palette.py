# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Colours and textures of the ground, roofs, crowns, vehicles and clothes, by season."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, sin

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.simulation.drawing.grain import Grain, draw_grain

Rgb = tuple[float, float, float]
"""Red, green, blue reflectance as the camera would store it in full sun, 0 to 255."""

_PLAIN = Grain()

SEASONS = ('spring', 'summer', 'autumn', 'winter')


@dataclass(frozen=True)
class Material:
    """Ground: two colours that coarse noise mixes, contrast of three bands, optional stripes."""

    label: Label
    rgb: Rgb
    other_rgb: Rgb
    contrast: tuple[float, float, float]
    """Relative amplitude of noise coarser than 4 m, 0.5 to 4 m, finer."""
    stripe_per_m: tuple[float, float] = (0.0, 0.0)
    """Wave vector in cycles per metre."""
    stripe: float = 0.0
    """Relative amplitude of the stripes."""
    grain: Grain = _PLAIN
    """Structure that is told apart from noise: joints, stones, tufts, ripples."""


_G, _B, _P, _W = Label.GRASS, Label.BARE_GROUND, Label.PAVED, Label.WATER

# label, colour, other colour, contrast coarse / middle / fine
_KINDS: dict[str, tuple[Label, Rgb, Rgb, tuple[float, float, float]]] = {
    'lawn': (_G, (74, 102, 52), (96, 112, 62), (0.049, 0.063, 0.085)),
    'meadow': (_G, (84, 104, 56), (116, 116, 74), (0.07, 0.084, 0.128)),
    'rough': (_G, (72, 92, 48), (102, 104, 66), (0.091, 0.126, 0.17)),
    'dry_grass': (_G, (150, 138, 92), (122, 120, 74), (0.056, 0.07, 0.102)),
    'crop_green': (_G, (84, 116, 54), (108, 128, 66), (0.042, 0.042, 0.085)),
    'crop_gold': (_G, (178, 154, 98), (158, 140, 84), (0.035, 0.042, 0.0765)),
    'stubble': (_G, (172, 152, 108), (144, 134, 90), (0.049, 0.056, 0.085)),
    'pitch': (_G, (82, 122, 58), (98, 130, 66), (0.035, 0.035, 0.0595)),
    'turf': (_G, (64, 104, 62), (70, 108, 66), (0.014, 0.021, 0.034)),
    'forest_floor': (_G, (72, 72, 42), (88, 78, 50), (0.105, 0.14, 0.17)),
    'soil': (_B, (128, 100, 74), (108, 86, 64), (0.056, 0.07, 0.111)),
    'ploughed': (_B, (120, 96, 74), (140, 114, 88), (0.049, 0.056, 0.0935)),
    'sand': (_B, (196, 172, 134), (178, 156, 122), (0.035, 0.042, 0.0425)),
    'pale_sand': (_B, (206, 194, 170), (188, 176, 154), (0.035, 0.049, 0.051)),
    'gravel': (_B, (170, 160, 142), (152, 144, 128), (0.035, 0.042, 0.0935)),
    'track': (_B, (164, 146, 114), (140, 124, 94), (0.063, 0.084, 0.102)),
    'earthworks': (_B, (150, 122, 90), (124, 100, 76), (0.084, 0.105, 0.111)),
    'bed': (_B, (104, 82, 60), (90, 84, 54), (0.07, 0.14, 0.187)),
    'asphalt': (_P, (104, 105, 108), (118, 117, 116), (0.035, 0.028, 0.0425)),
    'new_asphalt': (_P, (70, 72, 76), (80, 81, 84), (0.021, 0.021, 0.034)),
    'old_asphalt': (_P, (138, 135, 130), (124, 122, 120), (0.042, 0.042, 0.051)),
    'concrete': (_P, (182, 178, 168), (160, 157, 150), (0.042, 0.042, 0.051)),
    'paving': (_P, (164, 156, 148), (148, 142, 136), (0.028, 0.035, 0.0595)),
    'red_paving': (_P, (158, 118, 102), (142, 110, 98), (0.028, 0.035, 0.0595)),
    'court': (_P, (160, 92, 72), (150, 88, 70), (0.021, 0.021, 0.0255)),
    'green_court': (_P, (74, 110, 84), (78, 116, 88), (0.021, 0.021, 0.0255)),
    'blue_court': (_P, (70, 104, 146), (76, 110, 150), (0.021, 0.021, 0.0255)),
    'river': (_W, (66, 76, 56), (56, 70, 54), (0.042, 0.035, 0.034)),
    'pond': (_W, (54, 62, 44), (40, 48, 40), (0.084, 0.056, 0.034)),
    'blue_water': (_W, (48, 80, 100), (42, 70, 90), (0.042, 0.042, 0.0425)),
    'dark_water': (_W, (24, 30, 32), (32, 38, 36), (0.07, 0.056, 0.051)),
    'algae': (_W, (72, 92, 48), (56, 74, 42), (0.06, 0.03, 0.02)),
    'pool': (_W, (96, 184, 204), (110, 196, 212), (0.014, 0.035, 0.0425)),
}

_LIVING = ('lawn', 'meadow', 'rough', 'crop_green', 'pitch')

_SEASON_TINT: dict[str, Rgb] = {
    'spring': (0.92, 1.04, 0.88),
    'summer': (1.0, 1.0, 0.96),
    'autumn': (1.07, 0.98, 0.94),
    'winter': (1.02, 0.92, 0.98),
}


def jitter(rng: np.random.Generator, rgb: Rgb, light: float, hue: float) -> Rgb:
    """Vary a colour: ``light`` relative in brightness, ``hue`` relative per channel."""
    level, *tints = rng.standard_normal(4).tolist()
    red, green, blue = (
        min(max(value * exp(light * level + hue * tint), 4.0), 250.0)
        for value, tint in zip(rgb, tints, strict=True)
    )
    return red, green, blue


class Palette:
    """Draws colours of one season; the same generator state gives the same colours."""

    def __init__(self, rng: np.random.Generator, season: str) -> None:
        self.season = season
        self._rng = rng
        # A generator of its own: what grounds are made of does not move what stands on them.
        self._grain_rng = rng.spawn(1)[0]
        self._dryness = float(rng.beta(1.0, 2.8)) if season in {'summer', 'autumn'} else 0.1

    def material(
        self, kind: str, stripe_m: float = 0.0, angle_rad: float = 0.0, stripe: float = 0.0
    ) -> Material:
        """Return a variant of a ground kind, with stripes of a period when it is given."""
        label, rgb, other, contrast = _KINDS[kind]
        first, second = np.asarray(rgb, float), np.asarray(other, float)
        if kind in _LIVING:
            tint = np.asarray(_SEASON_TINT[self.season])
            straw = np.array([158.0, 142.0, 98.0])
            dry = self._dryness * self._rng.uniform(0.3, 1.0)
            first = (first * tint) * (1 - 0.6 * dry) + straw * 0.6 * dry
            second = (second * tint) * (1 - dry) + straw * dry
        if kind == 'forest_floor' and self.season in {'autumn', 'winter'}:
            first, second = first * (1.3, 1.1, 1.0), second * (1.35, 1.1, 1.0)
        gain = np.exp(self._rng.normal(0.0, 0.13)) * np.exp(self._rng.normal(0.0, 0.035, 3))
        wave = (0.0, 0.0)
        if stripe_m > 0.0:
            wave = (cos(angle_rad) / stripe_m, sin(angle_rad) / stripe_m)
        grain = draw_grain(self._grain_rng, kind, label)
        return Material(
            label, _rgb(first * gain), _rgb(second * gain), contrast, wave, stripe, grain
        )

    def crown(self) -> tuple[Rgb, str]:
        """Return the colour and kind of a tree."""
        choices = _CROWNS[self.season]
        bounds = np.cumsum([share for share, _, _ in choices])
        at = int(np.searchsorted(bounds[:-1], self._rng.random(), side='right'))
        _, kind, colours = choices[at]
        base = colours[int(self._rng.integers(len(colours)))]
        return jitter(self._rng, base, 0.2, 0.06), kind

    def hedge(self) -> Rgb:
        """Return the colour of a hedge."""
        base: Rgb = (62, 86, 44) if self.season != 'winter' else (84, 82, 58)
        return jitter(self._rng, base, 0.2, 0.06)

    def roof(self, style: str) -> Rgb:
        """Return the colour of a roof of a style (tiles, flat_pale, flat_dark, metal)."""
        colours = _ROOFS[style]
        return jitter(self._rng, colours[self._rng.integers(len(colours))], 0.12, 0.04)

    def paint(self) -> Rgb:
        """Return the colour of a vehicle."""
        return jitter(self._rng, _PAINTS[self._rng.integers(len(_PAINTS))], 0.12, 0.03)

    def cloth(self) -> Rgb:
        """Return the colour of clothes."""
        return jitter(self._rng, _CLOTHS[self._rng.integers(len(_CLOTHS))], 0.2, 0.1)


def _rgb(values: NDArray[np.float64]) -> Rgb:
    red, green, blue = np.clip(values, 3.0, 250.0)
    return float(red), float(green), float(blue)


_ROOFS: dict[str, tuple[Rgb, ...]] = {
    'tiles': (
        (174, 100, 74), (186, 118, 88), (150, 84, 66), (140, 106, 88), (112, 92, 82), (98, 94, 94),
        (78, 80, 86), (168, 132, 108), (122, 78, 66), (132, 120, 112),
    ),
    'flat_pale': ((206, 204, 198), (188, 184, 176), (222, 220, 216), (198, 188, 170)),
    'flat_dark': ((92, 92, 96), (112, 108, 106), (72, 74, 80), (130, 124, 118)),
    'metal': ((172, 180, 188), (196, 202, 206), (138, 152, 168), (150, 98, 84), (112, 132, 118)),
}  # fmt: skip

_NEEDLES: tuple[Rgb, ...] = ((48, 68, 44), (54, 76, 56))
_BARE: tuple[Rgb, ...] = ((112, 98, 84), (124, 110, 92))
_GREENS: tuple[Rgb, ...] = ((70, 98, 48), (58, 84, 46), (84, 108, 58), (96, 110, 70), (62, 78, 44))

# Share, kind and colours of the trees of a season; the last one takes what is left.
_CROWNS: dict[str, tuple[tuple[float, str, tuple[Rgb, ...]], ...]] = {
    'spring': (
        (0.14, 'conifer', _NEEDLES),
        (0.12, 'blossom', ((206, 184, 182), (214, 206, 196), (196, 160, 160))),
        (0.14, 'bare', ((132, 114, 96), (140, 112, 104))),
        (0.60, 'leafy', ((90, 120, 52), (78, 110, 48), (106, 130, 62), (124, 128, 72))),
    ),
    'summer': (
        (0.14, 'conifer', _NEEDLES),
        (0.04, 'leafy', ((104, 62, 58),)),
        (0.82, 'leafy', _GREENS),
    ),
    'autumn': (
        (0.14, 'conifer', _NEEDLES),
        (0.14, 'bare', _BARE),
        (0.30, 'leafy', _GREENS),
        (0.42, 'leafy', ((166, 104, 48), (146, 76, 50), (176, 144, 66), (128, 92, 56))),
    ),
    'winter': (
        (0.16, 'conifer', _NEEDLES),
        (0.70, 'bare', _BARE),
        (0.14, 'leafy', ((66, 80, 50), (58, 70, 46))),
    ),
}

_PAINTS: tuple[Rgb, ...] = (
    (226, 228, 230), (222, 224, 226), (190, 194, 198), (150, 154, 160), (104, 108, 114),
    (44, 46, 50), (36, 38, 44), (30, 32, 36), (150, 38, 40), (182, 50, 46), (44, 66, 122),
    (62, 92, 142), (70, 84, 72), (186, 170, 130), (206, 172, 58), (92, 60, 48), (206, 104, 48),
)  # fmt: skip

_CLOTHS: tuple[Rgb, ...] = (
    (44, 46, 56), (34, 34, 38), (60, 72, 110), (200, 198, 194), (168, 46, 48), (128, 124, 118),
    (72, 60, 52), (52, 92, 70), (214, 180, 70), (196, 120, 140), (86, 120, 168), (222, 120, 50),
)  # fmt: skip
