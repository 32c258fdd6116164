# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seeded batches of views and prompts, made by a few threads while the networks train."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from peace_ros.core.domain import Label
from peace_ros.lab.training.annotations import PARTIAL_CLASSES, PIXEL_CLASS_COUNT
from peace_ros.lab.training.arrays import Image, Rng
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.sources import TrainingSource
from peace_ros.lab.training.text import TermPrompt, build_tokenizer, sample_prompt
from peace_ros.lab.training.textures import gather_materials
from peace_ros.lab.training.views import TrainingView, sample_view

BatchT = TypeVar('BatchT')

LABEL_COUNT = len(Label) - 1
_THREADS, _AHEAD = 2, 4


def pixel_class_table() -> Tensor:
    """Return which labels a pixel class may be: float32 [pixel classes, 9], label 1 first."""
    table = torch.zeros(PIXEL_CLASS_COUNT, LABEL_COUNT)
    table[1 : LABEL_COUNT + 1] = torch.eye(LABEL_COUNT)
    for index, labels in PARTIAL_CLASSES.items():
        table[index, [label - 1 for label in labels]] = 1.0
    return table


def encode(texts: Sequence[str]) -> tuple[Tensor, Tensor]:
    """Return token ids and attention mask of texts, both int64 [N, L]."""
    encoded = build_tokenizer().encode_batch(list(texts))
    ids = torch.tensor([each.ids for each in encoded], dtype=torch.int64)
    return ids, torch.tensor([each.attention_mask for each in encoded], dtype=torch.int64)


def wanted_labels(prompts: Sequence[TermPrompt]) -> Tensor:
    """Return 1 for each label that a prompt stands for: float32 [N, 9]."""
    wanted = torch.zeros(len(prompts), LABEL_COUNT)
    for row, prompt in enumerate(prompts):
        wanted[row, [label - 1 for label in prompt.labels]] = 1.0
    return wanted


def to_pixels(images: Sequence[Image]) -> Tensor:
    """Normalise uint8 RGB images [H, W, 3] to float32 [B, 3, H, W]."""
    scaled = torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).to(torch.float32) / 255.0
    mean, std = torch.tensor(MEAN), torch.tensor(STD)
    pixels = (scaled - mean[:, None, None]) / std[:, None, None]
    return pixels.contiguous(memory_format=torch.channels_last)


class Maker(ABC, Generic[BatchT]):
    """Makes batch n from the seed and n alone, so that a resumed run sees the same batches."""

    def __init__(
        self,
        sources: list[TrainingSource],
        shares: Mapping[str, float],
        seed: int,
        *,
        batch_size: int,
        view_px: int,
        condition_chance: float,
        salt: tuple[int, ...] = (),
    ) -> None:
        """Take the sources and how often each kind is drawn.

        Args:
            sources: of all kinds.
            shares: kind of source -> share of the views.
            seed: of everything that is drawn.
            batch_size: views per batch.
            view_px: side of a view.
            condition_chance: share of the views under a light, weather or camera condition.
            salt: sets the batches apart from those of other makers of this seed.
        """
        groups = [(share, [s for s in sources if s.kind == kind]) for kind, share in shares.items()]
        groups = [(share, group) for share, group in groups if group]
        total = sum(share for share, _ in groups)
        self._groups = [group for _, group in groups]
        self._shares = [share / total for share, _ in groups]
        self._seed, self._salt = seed, salt
        self._batch_size, self._view_px = batch_size, view_px
        self._condition_chance = condition_chance
        self._materials = gather_materials(sources, np.random.default_rng([seed, 4]))

    def make(self, number: int) -> BatchT:
        """Return batch ``number``."""
        return self._draw(np.random.default_rng([self._seed, *self._salt, number]))

    @abstractmethod
    def _draw(self, rng: Rng) -> BatchT:
        """Return a batch that follows from the generator alone."""

    def stream(self, first: int) -> Iterator[BatchT]:
        """Yield batches first, first + 1, ... made ahead of their use."""
        with ThreadPoolExecutor(_THREADS) as pool:
            waiting = deque(pool.submit(self.make, first + n) for n in range(_AHEAD))
            try:
                while True:
                    first += 1
                    batch = waiting.popleft().result()
                    waiting.append(pool.submit(self.make, first + _AHEAD - 1))
                    yield batch
            finally:
                for future in waiting:
                    future.cancel()

    def _source_of(self, rng: Rng, group: list[TrainingSource]) -> TrainingSource:
        return group[int(rng.integers(len(group)))]

    def _view(self, rng: Rng) -> TrainingView:
        group = self._groups[int(rng.choice(len(self._groups), p=self._shares))]
        return sample_view(
            self._source_of(rng, group),
            rng,
            self._view_px,
            condition_chance=self._condition_chance,
            materials=self._materials,
        )


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


class BatchMaker(Maker[Batch]):
    """Batches for the segmenter and for the ranker."""

    def __init__(
        self, sources: list[TrainingSource], shares: Mapping[str, float], seed: int, *,
        batch_size: int, view_px: int, prompts: int, condition_chance: float = 0.2,
    ) -> None:  # fmt: skip
        """Take what :class:`Maker` takes, and the number of prompts per view."""
        super().__init__(
            sources, shares, seed, batch_size=batch_size, view_px=view_px,
            condition_chance=condition_chance,
        )  # fmt: skip
        self._prompts = prompts

    def _source_of(self, rng: Rng, group: list[TrainingSource]) -> TrainingSource:
        """Draw a source; many pictures of one place count less each."""
        count = Counter(source.origin for source in group)
        weights = np.array([count[source.origin] ** -0.5 for source in group])
        return group[int(rng.choice(len(group), p=weights / weights.sum()))]

    def _draw(self, rng: Rng) -> Batch:
        views: list[TrainingView] = []
        prompts: list[TermPrompt] = []
        for _ in range(self._batch_size):
            views.append(self._view(rng))
            look = views[-1].condition
            words = (look.resolution, look.frame, look.environment)
            prompts += [sample_prompt(rng, words) for _ in range(self._prompts)]
        return Batch(
            to_pixels([view.image_rgb for view in views]),
            torch.from_numpy(np.stack([_with_margin(view.classes) for view in views])),
            *encode([prompt.text for prompt in prompts]),
            wanted_labels(prompts).reshape(self._batch_size, self._prompts, LABEL_COUNT),
            tuple(views),
        )


def _with_margin(classes: Image) -> NDArray[np.int64]:
    """Widen people by two pixels: nobody may land beside them, and one pixel is easily missed."""
    people = (classes == Label.PERSON).astype(np.uint8)
    near = cv2.dilate(people, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)))
    return np.where(near > 0, np.uint8(Label.PERSON), classes).astype(np.int64)
