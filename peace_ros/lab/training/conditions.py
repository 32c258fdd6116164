# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Light, weather and camera looks for training, each with the words that describe it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from peace_ros.core.domain import Label
from peace_ros.lab.training.arrays import Image, Rng
from peace_ros.lab.training.degradations import WAYS, degrade
from peace_ros.lab.training.sources import TrainingSource
from peace_ros.simulation.drawing import apply_condition

Words = tuple[str, ...]

_PHOTO_FRAMES: Words = ('picture', 'image', 'view')
_RENDERED_FRAMES: Words = ('screen', 'game', 'animation', 'screenshot')
_PAINTED_FRAMES: Words = (
    'drawing', 'art', 'artwork', 'painting', 'illustration', 'cartoon', 'manga',
)  # fmt: skip
_CLEAR = ('plain', 'sunny', 'summer')
"""Looks in which nothing stands between the camera and the ground."""
_SEASONS = ('spring', 'summer', 'autumn', 'winter')


@dataclass(frozen=True)
class Condition:
    """A look and the true words of the three categories; an empty tuple says nothing."""

    name: str
    resolution: Words = ()
    frame: Words = ()
    environment: Words = ()
    plain: Words = ()
    """True words outside of the vocabularies, such as ``foggy``."""


_LOOKS: tuple[tuple[float, Condition], ...] = (
    (1.2, Condition('blurred', ('blurred',), (), (), ('blurry',))),
    (1.0, Condition('night', (), (), ('night', 'dark'))),
    (0.8, Condition('dark', (), (), ('dark', 'night'))),
    (0.6, Condition('evening', (), (), ('evening',), ('dusk',))),
    (0.4, Condition('morning', (), (), ('morning',), ('dawn',))),
    (0.3, Condition('afternoon', (), (), ('afternoon',))),
    (1.0, Condition('fog', (), (), ('fog',), ('foggy', 'mist', 'misty'))),
    (0.6, Condition('smog', (), (), ('smog',), ('haze', 'hazy'))),
    (1.0, Condition('snowy', (), (), ('snowy', 'winter'), ('snow',))),
    (0.8, Condition('rainy', (), (), ('rainy', 'damp'), ('rain', 'wet'))),
    (0.4, Condition('damp', (), (), ('damp',), ('wet',))),
    (0.6, Condition('sunny', (), (), ('sunny', 'bright'))),
    (0.6, Condition('bright', (), (), ('bright', 'sunny'))),
    (0.7, Condition('cloudy', (), (), ('cloudy',), ('overcast', 'gloomy'))),
    (1.0, Condition('rendered', ('rendered', '3D rendered'), _RENDERED_FRAMES, ())),
    (0.5, Condition('3D', ('3D', '3D rendered'), _RENDERED_FRAMES, ())),
    (0.5, Condition('painted', ('rendered',), _PAINTED_FRAMES, ())),
    (0.3, Condition('heat', (), (), ('heat',))),
    (0.4, Condition('heat-map', (), (), ('heat-map',))),
    (0.3, Condition('winter', (), (), ('winter',))),
    (0.4, Condition('autumn', (), (), ('autumn',))),
    (0.3, Condition('spring', (), (), ('spring',))),
    (0.3, Condition('summer', (), (), ('summer',))),
    (1.0, Condition('noise', (), (), (), ('noisy', 'noise', 'grainy', 'bad'))),
)
_CHANCES = np.array([chance for chance, _ in _LOOKS]) / sum(chance for chance, _ in _LOOKS)


def pick_condition(rng: Rng, source: TrainingSource, chance: float) -> Condition:
    """Draw a look (or none) for a view of a source, and complete its words."""
    if rng.random() < chance:
        look = _LOOKS[int(rng.choice(len(_LOOKS), p=_CHANCES))][1]
    else:
        look = Condition('plain')
    return _complete(look, source)


def _complete(look: Condition, source: TrainingSource) -> Condition:
    """Add to a look the words that are true of its source anyway."""
    drawn = source.kind == 'drawn'
    resolution = look.resolution or (('rendered', '3D rendered') if drawn else ())
    environment = look.environment
    if not environment and source.season in _SEASONS:
        environment = (source.season,)
    if not environment and not drawn:
        environment = ('summer', 'sunny', 'bright') if source.kind == 'drone' else ('map',)
    plain = look.plain
    if not drawn and look.name in _CLEAR:
        plain = (*plain, 'clear', 'sharp', 'good')
    frame = look.frame or _PHOTO_FRAMES
    return Condition(look.name, resolution, frame, environment, plain)


def apply(condition: Condition, image: Image, classes: Image, rng: Rng) -> Image:
    """Return the image under a look, same shape and type; ``classes`` say where snow lies."""
    if condition.name == 'plain':
        return image
    if condition.name in WAYS and rng.random() < 0.7:
        return degrade(image, condition.name, rng)
    if condition.name == 'painted':
        return _painted(image, rng)
    if condition.name == 'heat-map':
        return _heat_map(image, rng)
    labels = np.where(classes < len(Label), classes, np.uint8(Label.UNLABELED))
    changed = apply_condition(image, condition.name, rng, labels=labels)
    return np.asarray(changed, dtype=np.uint8)


def _painted(image: Image, rng: Rng) -> Image:
    flat = cv2.medianBlur(image, 2 * int(rng.integers(3, 6)) + 1)
    grey = cv2.cvtColor(flat, cv2.COLOR_RGB2GRAY)
    edges = cv2.adaptiveThreshold(
        grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, 9, rng.uniform(2, 5)
    )
    grey3 = grey[..., None].astype(np.float32)
    vivid = grey3 + (flat.astype(np.float32) - grey3) * 1.5
    inked = vivid * (0.35 + 0.65 * edges[..., None] / 255.0)
    return np.asarray(np.clip(inked, 0, 255), dtype=np.uint8)


def _heat_map(image: Image, rng: Rng) -> Image:
    maps = (cv2.COLORMAP_JET, cv2.COLORMAP_INFERNO, cv2.COLORMAP_HOT)
    painted = cv2.applyColorMap(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), maps[rng.integers(3)])
    return np.ascontiguousarray(painted[:, :, ::-1], dtype=np.uint8)
