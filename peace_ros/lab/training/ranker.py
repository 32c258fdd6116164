# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Training of the CLIP-like image/text pair that ranks condition words."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
import torch
from torch.nn import functional

from peace_ros.lab.training.backbone import load_pretrained
from peace_ros.lab.training.batches import Batch, BatchMaker
from peace_ros.lab.training.networks import Ranker
from peace_ros.lab.training.text import (
    ENVIRONMENT_WORDS,
    EXTRA_WORDS,
    FRAME_WORDS,
    RESOLUTION_WORDS,
    build_tokenizer,
    vocabulary,
)

if TYPE_CHECKING:
    from torch import Tensor, nn

    from peace_ros.lab.training.conditions import Condition
    from peace_ros.lab.training.sources import TrainingSource

BATCH_SIZE = 24
VIEW_PX = 224
PEAK_RATE = 3e-3
PRETRAINED = ('image.backbone.', 0.1)
_SHARES = {'drawn': 0.35, 'satellite': 0.2, 'drone': 0.45}

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


def create_ranker(seed: int) -> Ranker:
    """Return a ranker that knows ImageNet; its other weights follow from the seed."""
    torch.manual_seed(seed + 1)
    model = Ranker(len(vocabulary()))
    load_pretrained(model.image.backbone)
    return model


def create_maker(
    sources: list[TrainingSource],
    seed: int,
    *,
    batch_size: int = BATCH_SIZE,
    view_px: int = VIEW_PX,
) -> BatchMaker:
    """Return the batches of the ranker: three of four views under a look, no prompts."""
    groups = [
        (share, [source for source in sources if source.kind == kind])
        for kind, share in _SHARES.items()
    ]
    return BatchMaker(
        groups, seed=seed + 1, batch_size=batch_size, view_px=view_px, prompts=0,
        condition_chance=0.75,
    )  # fmt: skip


class RankerLoss:
    """Contrastive loss over the words of each category, and of all looks together."""

    def __init__(self, seed: int) -> None:
        if not set(_PLAIN_WORDS) <= set(EXTRA_WORDS):
            raise ValueError('plain words must be part of the vocabulary')
        self._rng = np.random.default_rng([seed, 5])
        self._tokenizer = build_tokenizer()

    def __call__(self, model: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Sum the categories."""
        ranker = cast('Ranker', model)
        image = ranker.image(batch.pixels)
        scale = ranker.log_scale.exp().clamp(max=30.0)
        conditions = [view.condition for view in batch.views]
        losses = {}
        for name, words in (
            ('resolution', RESOLUTION_WORDS),
            ('frame', FRAME_WORDS),
            ('environment', ENVIRONMENT_WORDS + _PLAIN_WORDS),
            ('look', _LOOK_WORDS),
        ):
            phrase = _PHRASES[int(self._rng.integers(len(_PHRASES)))]
            encoded = self._tokenizer.encode_batch([phrase.format(word) for word in words])
            text = ranker.text(
                torch.tensor([each.ids for each in encoded]),
                torch.tensor([each.attention_mask for each in encoded]),
            )
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
