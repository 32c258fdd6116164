# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The training of fastsam-small: scenes, segmenter, naming of segments, threshold, bundle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pickle import UnpicklingError
from tempfile import TemporaryDirectory
from typing import Any, cast

import torch

from peace_ros.core.domain import ConfigurationError, Prompt
from peace_ros.lab.training.backbone import Backbone, load_pretrained
from peace_ros.lab.training.instances.batches import CropMaker, InstanceMaker
from peace_ros.lab.training.instances.export import export_instances
from peace_ros.lab.training.instances.losses import InstanceLoss, MatchLoss
from peace_ros.lab.training.instances.networks import INPUT_PX, CropEncoder, InstanceNetwork
from peace_ros.lab.training.measure import ThresholdRow, drawn_examples, sweep
from peace_ros.lab.training.networks import Pair
from peace_ros.lab.training.recipe import BaseRecipe, Report
from peace_ros.lab.training.text import vocabulary

NAME = 'fastsam-small'
MOST_PERSONS = 0.1
"""Share of the persons' pixels that may be called safe: from high up few get a segment."""
MOST_FALSE_SAFE = 0.05
"""Share of what is called safe that may be unsafe."""
_PROMPT = Prompt('A rendered view of {term} in summer.', 0)
_THRESHOLDS = (0.2, 0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
_MATCHER_SHARE = 0.4
"""Of the minutes; the segmenter gets the rest."""
_PRETRAINED_RATE = 0.25
"""Part of the learning rate for weights that are trained already."""


@dataclass(frozen=True, kw_only=True)
class InstanceRecipe(BaseRecipe):
    """Trains ``fastsam-small``.

    ``start`` is a ``segmenter.pt`` of the clipseg training, whose backbone knows aerial images.
    """

    minutes: float = 20.0
    scenes: int = 600
    validation_scenes: int = 40
    batch_size: int = 6
    view_px: int = INPUT_PX
    crop_batch_size: int = 6
    """Views per batch of segments."""
    shifts: tuple[float, ...] = (0.8, 1.6, 2.4, 3.2, 4.0)
    """Of the confidence, in log-odds; the best is chosen with the threshold."""

    def run(self, report: Report) -> None:
        """Train both networks and write the bundle."""
        sources = self.load_sources(report)
        network = self.fit(
            create_network(self.seed, self.start),
            InstanceMaker(sources, self.seed, batch_size=self.batch_size, view_px=self.view_px),
            InstanceLoss(),
            report,
            stage='segmenter',
            share=1.0 - _MATCHER_SHARE,
            peak_rate=2e-3,
            slower=('trunk.backbone.', _PRETRAINED_RATE),
            name='instances',
        )
        matcher = self.fit(
            create_matcher(self.seed, self.start),
            CropMaker(
                sources, self.seed, batch_size=self.crop_batch_size, prompts=40,
                view_px=self.view_px,
            ),
            MatchLoss(self.seed),
            report,
            stage='matcher',
            name='matcher',
            share=_MATCHER_SHARE,
            peak_rate=3e-3,
            slower=('image.backbone.', _PRETRAINED_RATE),
        )  # fmt: skip
        tuned = ', fine-tuned in clipseg-small,' if self.start else ''
        provenance = self.provenance(
            'Trained with peace_ros.lab.training.instances, from EfficientNet-Lite0 weights '
            f'(Apache-2.0; ImageNet){tuned} in the segmenter',
            sources,
        )
        report('threshold', 0.0, '')
        chosen = self._choose(network, matcher)
        report('threshold', 1.0, f'recommended {chosen["recommended"]["threshold"]}')
        export_instances(network, matcher, self.out / NAME, provenance=provenance, **chosen)

    def _choose(self, network: InstanceNetwork, matcher: Pair) -> dict[str, Any]:
        """Export aside, measure on drawn scenes that training has not seen, choose."""
        examples = drawn_examples(self.work / 'scenes', self.validation_scenes)
        found: list[tuple[ThresholdRow, float]] = []
        with TemporaryDirectory() as folder:
            aside = Path(folder) / NAME
            for shift in self.shifts:
                export_instances(network, matcher, aside, provenance='candidate', shift=shift)
                rows = sweep(aside, 'peace_fs', examples, _THRESHOLDS, _PROMPT)
                found.append((max(rows, key=merit), shift))
        row, shift = max(found, key=lambda each: merit(each[0]))
        return {'shift': shift, 'recommended': {'threshold': row.threshold}}


def merit(row: ThresholdRow) -> tuple[float, float]:
    """Return what better rows have more of: both budgets kept, or nearly; then mIoU."""
    excess = max(row.persons / MOST_PERSONS, row.false_safe / MOST_FALSE_SAFE)
    return -max(1.0, excess), row.miou


def create_network(seed: int, start: Path | None = None) -> InstanceNetwork:
    """Return a segmenter that knows ImageNet, or what the backbone in ``start`` has learned since.

    Its other weights follow from the seed. Raises ConfigurationError when ``start`` holds no such
    backbone.
    """
    torch.manual_seed(seed + 2)
    network = InstanceNetwork()
    _fill_backbone(network.trunk.backbone, start)
    if start is not None:
        # It was trained on more aerial images than this training has.
        network.trunk.freeze(len(network.trunk.backbone.stages))
    return cast('InstanceNetwork', network.to(memory_format=torch.channels_last))  # type: ignore[call-overload]


def _fill_backbone(backbone: Backbone, start: Path | None) -> None:
    if start is None:
        load_pretrained(backbone)
        return
    try:
        given = torch.load(start, weights_only=True)['average']
        # The segmenter's backbone is deeper.
        found = {name: given[f'encoder.backbone.{name}'] for name in backbone.state_dict()}
    except (OSError, KeyError, UnpicklingError) as error:
        raise ConfigurationError(
            f'{start}: no checkpoint of the clipseg segmenter ({error}); give the segmenter.pt in '
            'the work folder of peace_ros.lab.training, or nothing to start from ImageNet'
        ) from error
    backbone.load_state_dict(found)


def create_matcher(seed: int, start: Path | None = None) -> Pair:
    """Return a pair whose image encoder starts like the backbone of :func:`create_network`."""
    torch.manual_seed(seed + 3)
    image = CropEncoder()
    matcher = Pair(image, len(vocabulary()), most_scale=40.0)
    _fill_backbone(image.backbone, start)
    return cast('Pair', matcher.to(memory_format=torch.channels_last))  # type: ignore[call-overload]
