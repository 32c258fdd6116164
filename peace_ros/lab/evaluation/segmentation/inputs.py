# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The options that say which labelled images, and the source that they mean."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from peace_ros.lab.evaluation.segmentation.classes import MIXED
from peace_ros.lab.evaluation.segmentation.datasets import dataset_source
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.samples import (
    CAMERA_PX,
    DRAWN_SEED,
    SampleSource,
    drawn_source,
    folder_source,
    manifest_source,
    sampled,
)


@dataclass(frozen=True)
class EvaluationInputs:
    """Options of ``peace evaluate`` and ``peace ablate`` that name images."""

    dataset: str = ''
    root: Path | None = None
    images: Path | None = None
    labels: Path | None = None
    manifest: Path | None = None
    drawn: int = 0
    drawn_seed: int | None = None
    drawn_px: int = CAMERA_PX
    classes: str = 'common'
    split: str = ''
    mixed: str = 'ignore'
    limit: int | None = None


def open_source(inputs: EvaluationInputs) -> SampleSource:
    """Return the images that the options name.

    Raises DatasetError when they name none, or several sources, or one that cannot be used.
    """
    if inputs.mixed not in MIXED:
        raise DatasetError(f'--mixed {inputs.mixed}: give one of {", ".join(MIXED)}')
    ways = {
        '--dataset': bool(inputs.dataset),
        '--images': inputs.images is not None,
        '--manifest': inputs.manifest is not None,
        '--drawn': inputs.drawn > 0,
    }
    given = [name for name, there in ways.items() if there]
    if len(given) != 1:
        raise DatasetError(
            f'images from {" and ".join(given) or "nowhere"}: give one of --dataset with --root, '
            '--images with --labels, --manifest, --drawn N'
        )
    return sampled(_open(inputs), inputs.limit)


def _open(inputs: EvaluationInputs) -> SampleSource:
    if inputs.dataset:
        if inputs.root is None:
            raise DatasetError(f'--dataset {inputs.dataset} without --root: give its folder')
        return dataset_source(inputs.dataset, inputs.root, inputs.split, inputs.mixed)
    if inputs.manifest is not None:
        return manifest_source(inputs.manifest, inputs.split, inputs.classes, inputs.mixed)
    if inputs.images is not None:
        if inputs.labels is None:
            raise DatasetError(f'--images {inputs.images} without --labels: give their folder')
        return folder_source(inputs.images, inputs.labels, inputs.classes, inputs.mixed)
    first_seed = DRAWN_SEED if inputs.drawn_seed is None else inputs.drawn_seed
    return drawn_source(inputs.drawn, first_seed, inputs.drawn_px)
