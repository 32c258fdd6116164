# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The whole training as one recipe: scenes, ranker, segmenter, threshold, bundles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, cast

import torch

from peace_ros.core.inference import Bundle
from peace_ros.lab.training import ranker, segmenter
from peace_ros.lab.training.export import export_ranker, export_segmenter, with_weights
from peace_ros.lab.training.loop import TimeBudget, train
from peace_ros.lab.training.measure import SafetyModel, choose_threshold, drawn_examples
from peace_ros.lab.training.sources import SCENE_PX, credits_of, load_drawn, load_real
from peace_ros.lab.training.start import start_from

if TYPE_CHECKING:
    from collections.abc import Callable

    from peace_ros.lab.training.networks import Ranker, SegmenterNetwork
    from peace_ros.lab.training.sources import TrainingSource

_RANKER_SHARE = 0.12
"""Of the minutes; the segmenter gets the rest, or all when the ranker is left as it is."""
_FIRST_LOOKS = 12
"""Batches that tell the norms of a bundle's weights what to expect."""
_GENTLER = 0.5
"""Of the learning rate, where the weights are good already."""


@dataclass(frozen=True)
class Recipe:
    """What to train on and for how long."""

    out: Path
    """Folder that gets ``clip-small`` and ``clipseg-small``."""
    work: Path
    """Folder of drawn scenes, checkpoints and curves; a run that was cut short goes on from it."""
    real: Path | None = None
    """Folder of real images with manifest.csv, or none."""
    minutes: float = 40.0
    steps: int | None = None
    """Steps of each network in place of minutes; the result then depends on the seed alone."""
    seed: int = 0
    scenes: int = 2000
    validation_scenes: int = 60
    batch_size: int = segmenter.BATCH_SIZE
    view_px: int = segmenter.VIEW_PX
    scene_px: int = SCENE_PX
    text_steps: int = 600
    start: Path | None = None
    """Bundle ``clipseg-small`` of an earlier training to go on from, or none: from ImageNet."""
    with_ranker: bool = True
    """Whether ``clip-small`` is trained too."""


def run(recipe: Recipe, report: Callable[[str, float, str], None]) -> None:
    """Train both networks and write both bundles.

    ``report`` gets the stage, its progress (0 to 1) and a line of figures.
    """
    sources = _load_sources(recipe, report)
    provenance = _provenance(recipe, sources)
    clipseg = _train_segmenter(recipe, sources, report)
    report('threshold', 0.0, '')
    threshold = _threshold(recipe, clipseg)
    report('threshold', 1.0, f'recommended {threshold}')
    export_segmenter(
        clipseg,
        recipe.out / 'clipseg-small',
        provenance=provenance,
        recommended={'threshold': threshold},
    )
    if recipe.with_ranker:
        clip = _train_ranker(recipe, sources, report)
        export_ranker(clip, recipe.out / 'clip-small', provenance=provenance, recommended={})


def _load_sources(
    recipe: Recipe, report: Callable[[str, float, str], None]
) -> list[TrainingSource]:
    def drawn(done: int) -> None:
        report('scenes', done / recipe.scenes, f'{done} of {recipe.scenes}')

    first = recipe.seed * 100_000
    seeds = range(first, first + recipe.scenes)
    sources = load_drawn(recipe.work / 'scenes', seeds, size_px=recipe.scene_px, report=drawn)
    report('scenes', 1.0, f'{recipe.scenes} of {recipe.scenes}')
    return sources + load_real(recipe.real)


def _train_ranker(
    recipe: Recipe, sources: list[TrainingSource], report: Callable[[str, float, str], None]
) -> Ranker:
    model = ranker.create_ranker(recipe.seed)
    state = train(
        model,
        ranker.create_maker(sources, recipe.seed, batch_size=recipe.batch_size),
        ranker.RankerLoss(recipe.seed),
        TimeBudget(recipe.minutes * _RANKER_SHARE, recipe.steps),
        peak_rate=ranker.PEAK_RATE,
        folder=recipe.work,
        name='ranker',
        report=lambda progress, line: report('ranker', progress, line),
        slower=ranker.PRETRAINED,
    )
    return cast('Ranker', with_weights(model, state))


def _train_segmenter(
    recipe: Recipe, sources: list[TrainingSource], report: Callable[[str, float, str], None]
) -> SegmenterNetwork:
    model = segmenter.create_segmenter(recipe.seed)
    maker = segmenter.create_maker(
        sources, recipe.seed, batch_size=recipe.batch_size, view_px=recipe.view_px
    )
    begins = not (recipe.work / 'segmenter.pt').exists()
    if begins and recipe.start is not None:
        looks = (maker.make(number).pixels for number in islice(count(1_000_000), _FIRST_LOOKS))
        start_from(model, recipe.start, looks)
    elif begins:
        report('text', 0.0, '')
        loss = segmenter.teach_text(model, recipe.seed, recipe.text_steps)
        report('text', 1.0, f'loss {loss:.4f}')
    state = train(
        model,
        maker,
        segmenter.SegmenterLoss(),
        TimeBudget(recipe.minutes * (1.0 - _RANKER_SHARE * recipe.with_ranker), recipe.steps),
        peak_rate=segmenter.PEAK_RATE * (_GENTLER if recipe.start else 1.0),
        folder=recipe.work,
        name='segmenter',
        report=lambda progress, line: report('segmenter', progress, line),
        slower=segmenter.PRETRAINED,
    )
    return cast('SegmenterNetwork', with_weights(model, state))


def _threshold(recipe: Recipe, model: SegmenterNetwork) -> float:
    """Export aside, measure on drawn scenes that training has not seen, choose."""
    with TemporaryDirectory() as folder:
        aside = Path(folder) / 'clipseg-small'
        export_segmenter(model, aside, provenance='candidate', recommended={})
        examples = drawn_examples(recipe.work / 'scenes', recipe.validation_scenes)
        return choose_threshold(SafetyModel(aside), examples)


def _provenance(recipe: Recipe, sources: list[TrainingSource]) -> str:
    length = f'{recipe.steps} steps' if recipe.steps else f'{recipe.minutes:g} minutes on two cores'
    if recipe.start is None:
        begin = (
            'Trained with peace_ros.lab.training, from EfficientNet-Lite0 weights (Apache-2.0; '
            'ImageNet) in the segmenter'
        )
    else:
        begin = f'{Bundle.load(recipe.start).manifest.provenance} From there, the segmenter'
    text = (
        f'{begin} (torch {torch.__version__}, seed '
        f'{recipe.seed}, {length}) on {recipe.scenes} scenes drawn by peace_ros'
    )
    return text + credits_of(sources) + '.'
