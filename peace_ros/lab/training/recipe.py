# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A whole training as one recipe: scenes, networks, threshold, bundles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import count, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from torch import Tensor

from peace_ros.core.inference import Bundle
from peace_ros.lab.training import ranker, segmenter
from peace_ros.lab.training.batches import BatchMaker, BatchT, Maker
from peace_ros.lab.training.export import export_ranker, export_segmenter
from peace_ros.lab.training.loop import NetworkT, TimeBudget, train
from peace_ros.lab.training.measure import drawn_examples, sweep
from peace_ros.lab.training.networks import Pair, SegmenterNetwork
from peace_ros.lab.training.sources import (
    SCENE_PX,
    TrainingSource,
    credits_of,
    load_drawn,
    load_real,
)
from peace_ros.lab.training.start import start_from

Report = Callable[[str, float, str], None]
"""Takes a stage, its progress (0 to 1) and a line of figures."""

_RANKER_SHARE = 0.12
"""Of the minutes; the segmenter gets the rest, or all when the ranker is not trained."""
_FIRST_BATCHES = 12
"""Batches on which the norms of a bundle's weights are measured."""
_GENTLER = 0.5
"""Of the learning rate, where the weights are trained already."""
_THRESHOLDS = (0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)


@dataclass(frozen=True, kw_only=True)
class BaseRecipe(ABC):
    """What to train on and for how long."""

    out: Path
    """Folder that gets the bundles."""
    work: Path
    """Folder of drawn scenes, checkpoints and curves; an interrupted run continues from it."""
    real: Path | None = None
    """Folder of real images with manifest.csv, or none."""
    minutes: float = 85.0
    steps: int | None = None
    """Steps of each network in place of minutes; the result then depends on the seed alone."""
    seed: int = 0
    start: Path | None = None
    """What an earlier training wrote, to continue from; none: ImageNet."""
    scenes: int = 2000
    scene_px: int = SCENE_PX
    validation_scenes: int = 60
    """Scenes that the threshold is chosen on."""
    batch_size: int = segmenter.BATCH_SIZE
    view_px: int = segmenter.VIEW_PX

    @abstractmethod
    def run(self, report: Report) -> None:
        """Train the networks and write the bundles."""

    def load_sources(self, report: Report) -> list[TrainingSource]:
        """Draw the scenes and load the real images."""

        def drawn(done: int) -> None:
            report('scenes', done / self.scenes, f'{done} of {self.scenes}')

        first = self.seed * 100_000
        sources = load_drawn(
            self.work / 'scenes', range(first, first + self.scenes), size_px=self.scene_px,
            workers=torch.get_num_threads(), report=drawn,
        )  # fmt: skip
        drawn(self.scenes)
        return sources + load_real(self.real)

    def fit(
        self, model: NetworkT, maker: Maker[BatchT],
        loss: Callable[[NetworkT, BatchT], dict[str, Tensor]], report: Report, *, stage: str,
        share: float, **options: Any,
    ) -> NetworkT:  # fmt: skip
        """Train a network for a share of the minutes; ``options`` are those of :func:`train`."""
        budget = TimeBudget(self.minutes * share, self.steps)
        shown = partial(report, stage)
        return train(model, maker, loss, budget, folder=self.work, report=shown, **options)

    def provenance(self, begin: str, sources: list[TrainingSource]) -> str:
        """Return how the weights were made, for the manifest."""
        length = f'{self.steps} steps' if self.steps else f'{self.minutes:g} minutes'
        return (
            f'{begin} (torch {torch.__version__}, seed {self.seed}, {length}) on {self.scenes} '
            f'scenes drawn by peace_ros{credits_of(sources)}.'
        )


@dataclass(frozen=True, kw_only=True)
class Recipe(BaseRecipe):
    """Trains ``clipseg-small`` and ``clip-small``; ``start`` is an earlier clipseg-small."""

    text_steps: int = 600
    with_ranker: bool = True
    """Whether ``clip-small`` is trained too."""

    def run(self, report: Report) -> None:
        """Train the networks and write the bundles."""
        sources = self.load_sources(report)
        if self.start is None:
            begin = (
                'Trained with peace_ros.lab.training, from EfficientNet-Lite0 weights (Apache-2.0; '
                'ImageNet) in the segmenter'
            )
        else:
            begin = f'{Bundle.load(self.start).manifest.provenance} From there, the segmenter'
        provenance = self.provenance(begin, sources)
        clipseg = self._train_segmenter(sources, report)
        report('threshold', 0.0, '')
        threshold = self._threshold(clipseg)
        report('threshold', 1.0, f'recommended {threshold}')
        export_segmenter(
            clipseg, self.out / 'clipseg-small', provenance=provenance,
            recommended={'threshold': threshold},
        )  # fmt: skip
        if self.with_ranker:
            clip = self._train_ranker(sources, report)
            export_ranker(clip, self.out / 'clip-small', provenance=provenance)

    def _train_ranker(self, sources: list[TrainingSource], report: Report) -> Pair:
        """Train on views of which three in four are under a condition, without prompts."""
        return self.fit(
            ranker.create_ranker(self.seed),
            BatchMaker(
                sources, ranker.SHARES, self.seed + 1, batch_size=self.batch_size,
                view_px=ranker.VIEW_PX, prompts=0, condition_chance=0.75,
            ),
            ranker.RankerLoss(self.seed),
            report,
            stage='ranker',
            name='ranker',
            share=_RANKER_SHARE,
            peak_rate=ranker.PEAK_RATE,
            slower=ranker.PRETRAINED,
        )  # fmt: skip

    def _train_segmenter(self, sources: list[TrainingSource], report: Report) -> SegmenterNetwork:
        model = segmenter.create_segmenter(self.seed)
        maker = BatchMaker(
            sources, segmenter.SHARES, self.seed, batch_size=self.batch_size,
            view_px=self.view_px, prompts=segmenter.PROMPTS,
        )  # fmt: skip
        begins = not (self.work / 'segmenter.pt').exists()
        if begins and self.start is not None:
            seen = (
                maker.make(number).pixels for number in islice(count(1_000_000), _FIRST_BATCHES)
            )
            start_from(model, self.start, seen)
        elif begins:
            report('text', 0.0, '')
            loss = segmenter.teach_text(model, self.seed, self.text_steps)
            report('text', 1.0, f'loss {loss:.4f}')
        return self.fit(
            model,
            maker,
            segmenter.SegmenterLoss(),
            report,
            stage='segmenter',
            name='segmenter',
            share=1.0 - _RANKER_SHARE * self.with_ranker,
            peak_rate=segmenter.PEAK_RATE * (_GENTLER if self.start else 1.0),
            slower=segmenter.PRETRAINED,
        )

    def _threshold(self, model: SegmenterNetwork) -> float:
        """Export aside, measure on drawn scenes that training has not seen, choose.

        The best threshold has the highest recall of safe ground minus twice the share of unsafe
        ground called safe: a hazard called safe counts double.
        """
        with TemporaryDirectory() as folder:
            aside = Path(folder) / 'clipseg-small'
            export_segmenter(model, aside, provenance='candidate')
            examples = drawn_examples(self.work / 'scenes', self.validation_scenes)
            rows = sweep(aside, 'peace_cs', examples, _THRESHOLDS)
            return max(rows, key=lambda row: row.recall - 2.0 * row.unsafe_called_safe).threshold
