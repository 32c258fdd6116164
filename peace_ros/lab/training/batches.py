# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seeded batches of views and prompts, made by a few threads while the networks train."""

from __future__ import annotations

from collections import Counter, deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import cv2
import numpy as np
import torch

from peace_ros.core.domain import Label
from peace_ros.lab.training.annotations import PARTIAL_CLASSES, PIXEL_CLASS_COUNT
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.text import build_tokenizer, sample_prompt
from peace_ros.lab.training.textures import gather_materials
from peace_ros.lab.training.views import sample_view

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray
    from torch import Tensor

    from peace_ros.lab.training.sources import TrainingSource
    from peace_ros.lab.training.views import TrainingView

LABEL_COUNT = len(Label) - 1


BatchT = TypeVar('BatchT')


def pixel_class_table() -> Tensor:
    """Return which labels a pixel class may be: float32 [pixel classes, 9], label 1 first."""
    table = torch.zeros(PIXEL_CLASS_COUNT, LABEL_COUNT)
    for label in Label:
        if label != Label.UNLABELED:
            table[label, label - 1] = 1.0
    for index, labels in PARTIAL_CLASSES.items():
        for label in labels:
            table[index, label - 1] = 1.0
    return table


def to_pixels(images: np.ndarray) -> Tensor:
    """Normalise uint8 RGB [B, H, W, 3] to float32 [B, 3, H, W]."""
    scaled = torch.from_numpy(images).permute(0, 3, 1, 2).to(torch.float32) / 255.0
    mean, std = torch.tensor(MEAN), torch.tensor(STD)
    pixels = (scaled - mean[:, None, None]) / std[:, None, None]
    return pixels.contiguous(memory_format=torch.channels_last)


def _with_margin(classes: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Widen people by two pixels: to touch one is to hurt one, and one pixel is easily missed."""
    people = (classes == Label.PERSON).astype(np.uint8)
    near = cv2.dilate(people, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)))
    return np.where(near > 0, np.uint8(Label.PERSON), classes).astype(np.int64)


@dataclass(frozen=True)
class Batch:
    """Views with prompts."""

    pixels: Tensor
    """Float32 [B, 3, S, S], normalised."""
    classes: Tensor
    """Int64 [B, S, S]: labels and partial classes."""
    input_ids: Tensor
    """Int64 [B * T, L]."""
    attention_mask: Tensor
    wanted: Tensor
    """Float32 [B, T, 9]: labels that each prompt stands for."""
    views: tuple[TrainingView, ...]


def _chances(sources: list[TrainingSource]) -> NDArray[np.float64]:
    """Return how often each source is taken; many pictures of one place count less each."""
    count = Counter(source.origin for source in sources)
    chances = np.array([count[source.origin] ** -0.5 for source in sources])
    return chances / chances.sum()


class BatchMaker:
    """Makes batch n from the seed and n alone, so that a resumed run sees what it would have."""

    def __init__(
        self, groups: list[tuple[float, list[TrainingSource]]], *, seed: int, batch_size: int,
        view_px: int, prompts: int, condition_chance: float = 0.2,
    ) -> None:  # fmt: skip
        """``groups`` holds source lists with their share of the views."""
        kept = [(share, sources) for share, sources in groups if sources]
        total = sum(share for share, _ in kept)
        self._shares = [share / total for share, _ in kept]
        self._sources = [sources for _, sources in kept]
        self._chances = [_chances(sources) for sources in self._sources]
        self._seed, self._batch_size = seed, batch_size
        self._view_px, self._prompts = view_px, prompts
        self._condition_chance = condition_chance
        self._tokenizer = build_tokenizer()
        every = [source for sources in self._sources for source in sources]
        self._materials = gather_materials(every, np.random.default_rng([seed, 4]))

    def make(self, number: int) -> Batch:
        """Return batch ``number``."""
        rng = np.random.default_rng([self._seed, number])
        views: list[TrainingView] = []
        texts: list[str] = []
        wanted = np.zeros((self._batch_size, self._prompts, LABEL_COUNT), dtype=np.float32)
        for index in range(self._batch_size):
            group = int(rng.choice(len(self._sources), p=self._shares))
            source = self._sources[group][
                int(rng.choice(self._chances[group].size, p=self._chances[group]))
            ]
            view = sample_view(
                source,
                rng,
                self._view_px,
                condition_chance=self._condition_chance,
                materials=self._materials,
            )
            views.append(view)
            look = view.condition
            words = (look.resolution, look.frame, look.environment)
            for term in range(self._prompts):
                prompt = sample_prompt(rng, words)
                texts.append(prompt.text)
                for label in prompt.labels:
                    wanted[index, term, label - 1] = 1.0
        encoded = self._tokenizer.encode_batch(texts) if texts else []
        return Batch(
            to_pixels(np.stack([view.image_rgb for view in views])),
            torch.from_numpy(np.stack([_with_margin(view.classes) for view in views])),
            torch.tensor([each.ids for each in encoded], dtype=torch.int64),
            torch.tensor([each.attention_mask for each in encoded], dtype=torch.int64),
            torch.from_numpy(wanted),
            tuple(views),
        )

    def stream(self, first: int) -> Iterator[Batch]:
        """Yield batches first, first + 1, ... made ahead of their use."""
        return made_ahead(self.make, first, threads=2, ahead=4)


def made_ahead(
    make: Callable[[int], BatchT], first: int, *, threads: int, ahead: int
) -> Iterator[BatchT]:
    """Yield make(first), make(first + 1), ...; so many are in the making while one is used."""
    with ThreadPoolExecutor(threads) as pool:
        waiting = deque(pool.submit(make, first + n) for n in range(ahead))
        number = first + ahead
        try:
            while True:
                batch = waiting.popleft().result()
                waiting.append(pool.submit(make, number))
                number += 1
                yield batch
        finally:
            for future in waiting:
                future.cancel()
