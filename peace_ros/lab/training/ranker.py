# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Training of the CLIP-like image/text pair that ranks condition words."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from peace_ros.lab.training.backbone import load_pretrained
from peace_ros.lab.training.batches import Batch, encode
from peace_ros.lab.training.conditions import Condition
from peace_ros.lab.training.networks import Pair, RankerImage
from peace_ros.lab.training.text import CONDITION_WORDS, EXTRA_WORDS, vocabulary

VIEW_PX = 224
PEAK_RATE = 3e-3
PRETRAINED = ('image.backbone.', 0.1)
SHARES = {'drawn': 0.35, 'satellite': 0.2, 'drone': 0.45}

_PLAIN_WORDS = (
    'blurry', 'foggy', 'mist', 'misty', 'haze', 'hazy', 'snow', 'rain', 'wet', 'dusk', 'dawn',
    'overcast', 'gloomy', 'noisy', 'noise', 'grainy', 'bad', 'clear', 'sharp', 'good',
)  # fmt: skip
_LOOKS: dict[str, tuple[str, ...]] = {
    'blurred': ('blurred',), 'noise': ('noisy',), 'night': ('night', 'dark'),
    'dark': ('dark', 'night'), 'fog': ('fog',), 'smog': ('smog',), 'rainy': ('rainy',),
    'snowy': ('snowy',), 'rendered': ('rendered',), '3D': ('rendered',), 'painted': ('rendered',),
    'evening': ('evening',), 'cloudy': ('cloudy',), 'sunny': ('sunny',), 'bright': ('bright',),
    'heat-map': ('heat-map',),
}  # fmt: skip
"""Look -> what it is called among the words of all categories together."""
_LOOK_WORDS = ('clear', *dict.fromkeys(word for words in _LOOKS.values() for word in words))
_PHRASES = (
    '{}', '{}', '{}', 'A {} image', 'a {} photo', 'A {} image.', 'an image in {}', 'A {} view',
    'a photo of {}', 'a {} aerial image', 'it is {}', 'A photo in {}.', 'A {} picture of grass',
)  # fmt: skip


def create_ranker(seed: int) -> Pair:
    """Return a pair that starts from ImageNet; its other weights follow from the seed."""
    torch.manual_seed(seed + 1)
    image = RankerImage()
    model = Pair(image, len(vocabulary()), most_scale=30.0)
    load_pretrained(image.backbone)
    return model


class RankerLoss:
    """Contrastive loss over the words of each category, and of all looks together."""

    def __init__(self, seed: int) -> None:
        if not set(_PLAIN_WORDS) <= set(EXTRA_WORDS.split()):
            raise ValueError('plain words must be part of the vocabulary')
        self._rng = np.random.default_rng([seed, 5])

    def __call__(self, ranker: Pair, batch: Batch) -> dict[str, Tensor]:
        """Return the loss of each category."""
        image = ranker.image(batch.pixels)
        scale = ranker.scale()
        conditions = [view.condition for view in batch.views]
        losses = {}
        for name, words in {
            **CONDITION_WORDS,
            'environment': CONDITION_WORDS['environment'] + _PLAIN_WORDS,
            'look': _LOOK_WORDS,
        }.items():
            phrase = _PHRASES[int(self._rng.integers(len(_PHRASES)))]
            text = ranker.text(*encode([phrase.format(word) for word in words]))
            similar = scale * image @ text.T
            losses[name] = _several_true(similar, _truth(conditions, name, words))
        return losses


def _truth(conditions: list[Condition], name: str, words: tuple[str, ...]) -> Tensor:
    rows = []
    for condition in conditions:
        if name == 'look':
            true = set(_LOOKS.get(condition.name, ()))
            # A drawn view without a look is neither clear nor anything else for certain.
            true |= {'clear'} if condition.name == 'plain' and 'clear' in condition.plain else set()
        else:
            true = set(getattr(condition, name))
        if name == 'environment':
            true |= set(condition.plain)
        rows.append([float(word in true) for word in words])
    return torch.tensor(rows)


def _several_true(similar: Tensor, truth: Tensor) -> Tensor:
    """Cross-entropy with the true words sharing the target evenly; images without one do not."""
    count = truth.sum(dim=1, keepdim=True)
    target = truth / count.clamp(min=1.0)
    each = -(target * functional.log_softmax(similar, dim=1)).sum(dim=1)
    has = (count[:, 0] > 0).to(torch.float32)
    return (each * has).sum() / has.sum().clamp(min=1.0)
