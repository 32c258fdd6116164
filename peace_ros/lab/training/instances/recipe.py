# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The whole training as one recipe: scenes, segmenter, naming of segments, threshold, bundle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from pickle import UnpicklingError
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, cast

import torch

from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.training.backbone import load_pretrained
from peace_ros.lab.training.export import with_weights
from peace_ros.lab.training.instances.batches import CropMaker, InstanceMaker
from peace_ros.lab.training.instances.export import Description, export_bundle
from peace_ros.lab.training.instances.losses import InstanceLoss, MatchLoss
from peace_ros.lab.training.instances.measure import (
    CHOICE_SCENES,
    NAME,
    best_row,
    drawn_frames,
    measure,
    merit,
)
from peace_ros.lab.training.instances.networks import INPUT_PX, InstanceNetwork, Matcher
from peace_ros.lab.training.loop import TimeBudget, train
from peace_ros.lab.training.sources import SCENE_PX, credits_of, load_drawn, load_real
from peace_ros.lab.training.text import vocabulary

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

    from peace_ros.lab.training.backbone import Backbone
    from peace_ros.lab.training.sources import TrainingSource

_MATCHER_SHARE = 0.4
"""Of the minutes; the segmenter gets the rest."""
_SEGMENTER_RATE = 2e-3
_MATCHER_RATE = 3e-3
_PRETRAINED = ('trunk.backbone.', 0.25)
_PRETRAINED_CROPS = ('image.backbone.', 0.25)
"""What is known already is changed with care: at this part of the rate."""


@dataclass(frozen=True)
class InstanceRecipe:
    """What to train on and for how long."""

    out: Path
    """Folder that gets ``fastsam-small``."""
    work: Path
    """Folder of drawn scenes, checkpoints and curves; a run that was cut short goes on from it."""
    real: Path | None = None
    """Folder of real images with manifest.csv, or none."""
    minutes: float = 20.0
    steps: int | None = None
    """Steps of each network in place of minutes; the result then depends on the seed alone."""
    seed: int = 0
    start: Path | None = None
    """A ``segmenter.pt`` of lab.training whose backbone has seen aerial images, or none."""
    scenes: int = 600
    scene_px: int = SCENE_PX
    choice_scenes: int = len(CHOICE_SCENES)
    batch_size: int = 6
    views_of_crops: int = 6
    side_px: int = INPUT_PX
    shifts: tuple[float, ...] = (0.8, 1.6, 2.4, 3.2, 4.0)
    """Of the confidence, in log-odds; the best is chosen with the threshold."""


def run(recipe: InstanceRecipe, report: Callable[[str, float, str], None]) -> None:
    """Train both networks and write the bundle.

    ``report`` gets the stage, its progress (0 to 1) and a line of figures.
    """
    sources = _load_sources(recipe, report)
    network = _train_segmenter(recipe, sources, report)
    matcher = _train_matcher(recipe, sources, report)
    description = Description(_provenance(recipe, sources), {})
    report('threshold', 0.0, '')
    chosen = _choose(recipe, network, matcher, description)
    report('threshold', 1.0, f'recommended {chosen.recommended["threshold"]}')
    export_bundle(network, matcher, recipe.out / NAME, chosen)


def _load_sources(
    recipe: InstanceRecipe, report: Callable[[str, float, str], None]
) -> list[TrainingSource]:
    def drawn(done: int) -> None:
        report('scenes', done / recipe.scenes, f'{done} of {recipe.scenes}')

    first = recipe.seed * 100_000
    seeds = range(first, first + recipe.scenes)
    sources = load_drawn(
        recipe.work / 'scenes', seeds, size_px=recipe.scene_px,
        workers=torch.get_num_threads(), report=drawn,
    )  # fmt: skip
    report('scenes', 1.0, f'{recipe.scenes} of {recipe.scenes}')
    return sources + load_real(recipe.real)


def create_network(seed: int, start: Path | None = None) -> InstanceNetwork:
    """Return a segmenter that knows ImageNet, or what the backbone in ``start`` has learned since.

    Its other weights follow from the seed. Raises ConfigurationError when ``start`` holds no such
    backbone.
    """
    torch.manual_seed(seed + 2)
    network = InstanceNetwork()
    _fill_backbone(network.trunk.backbone, start)
    if start is not None:
        # It has seen more aerial images than this training will show it.
        network.trunk.freeze(len(network.trunk.backbone.stages))
    return cast('InstanceNetwork', network.to(memory_format=torch.channels_last))  # type: ignore[call-overload]


def _fill_backbone(backbone: Backbone, start: Path | None) -> None:
    if start is None:
        load_pretrained(backbone)
    else:
        backbone.load_state_dict(_backbone_of(start, backbone))


def _backbone_of(path: Path, backbone: Backbone) -> dict[str, Tensor]:
    """Return from a checkpoint of the clipseg segmenter what this shallower backbone shares."""
    try:
        given: dict[str, Tensor] = torch.load(path, weights_only=True)['average']
        found = {name: given[f'encoder.backbone.{name}'] for name in backbone.state_dict()}
    except (OSError, KeyError, UnpicklingError) as error:
        raise ConfigurationError(
            f'{path}: no checkpoint of the clipseg segmenter ({error}); give the segmenter.pt in '
            'the work folder of peace_ros.lab.training, or nothing to start from ImageNet'
        ) from error
    return found


def create_matcher(seed: int, start: Path | None = None) -> Matcher:
    """Return a pair whose image encoder begins as :func:`create_network`'s backbone does."""
    torch.manual_seed(seed + 3)
    matcher = Matcher(len(vocabulary()))
    _fill_backbone(matcher.image.backbone, start)
    return cast('Matcher', matcher.to(memory_format=torch.channels_last))  # type: ignore[call-overload]


def _train_segmenter(
    recipe: InstanceRecipe, sources: list[TrainingSource], report: Callable[[str, float, str], None]
) -> InstanceNetwork:
    network = create_network(recipe.seed, recipe.start)
    maker = InstanceMaker(
        sources, recipe.seed, batch_size=recipe.batch_size, side_px=recipe.side_px
    )
    state = train(
        network,
        cast('Any', maker),
        cast('Any', InstanceLoss()),
        TimeBudget(recipe.minutes * (1.0 - _MATCHER_SHARE), recipe.steps),
        peak_rate=_SEGMENTER_RATE,
        folder=recipe.work,
        name='instances',
        report=lambda progress, line: report('segmenter', progress, line),
        slower=_PRETRAINED,
    )
    return cast('InstanceNetwork', with_weights(network, state))


def _train_matcher(
    recipe: InstanceRecipe, sources: list[TrainingSource], report: Callable[[str, float, str], None]
) -> Matcher:
    matcher = create_matcher(recipe.seed, recipe.start)
    maker = CropMaker(
        sources, recipe.seed, views=recipe.views_of_crops, prompts=40, side_px=recipe.side_px
    )
    state = train(
        matcher,
        cast('Any', maker),
        cast('Any', MatchLoss(recipe.seed)),
        TimeBudget(recipe.minutes * _MATCHER_SHARE, recipe.steps),
        peak_rate=_MATCHER_RATE,
        folder=recipe.work,
        name='matcher',
        report=lambda progress, line: report('matcher', progress, line),
        slower=_PRETRAINED_CROPS,
    )
    return cast('Matcher', with_weights(matcher, state))


def _choose(
    recipe: InstanceRecipe, network: InstanceNetwork, matcher: Matcher, description: Description
) -> Description:
    """Export aside, measure on drawn scenes that training has not seen, choose."""
    seeds = CHOICE_SCENES[: recipe.choice_scenes]
    examples = drawn_frames(recipe.work / 'scenes', seeds)
    rows = {}
    with TemporaryDirectory() as folder:
        for shift in recipe.shifts:
            candidate = replace(description, shift=shift)
            export_bundle(network, matcher, Path(folder) / NAME, candidate)
            rows[shift] = best_row(measure(Path(folder) / NAME, examples))
    best = max(rows, key=lambda shift: merit(rows[shift]))
    return replace(description, shift=best, recommended={'threshold': rows[best].threshold})


def _provenance(recipe: InstanceRecipe, sources: list[TrainingSource]) -> str:
    length = f'{recipe.steps} steps' if recipe.steps else f'{recipe.minutes:g} minutes'
    start = ', fine-tuned in clipseg-small,' if recipe.start else ''
    text = (
        'Trained with peace_ros.lab.training.instances, from EfficientNet-Lite0 weights '
        f'(Apache-2.0; ImageNet){start} in the segmenter (torch {torch.__version__}, '
        f'seed {recipe.seed}, {length}) on {recipe.scenes} scenes drawn by peace_ros'
    )
    return text + credits_of(sources) + '.'
