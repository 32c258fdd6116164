# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The options that say which labelled images, and the source that they mean."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typer import Option

from peace_ros.lab.evaluation.segmentation.classes import MIXED, dataset_names
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

_DATASET = f'One of {", ".join(dataset_names())}; needs --root.'
_WIDEST = 4.0
_MIXED = f'Classes of safe and unsafe ground alike: {", ".join(MIXED)}.'


@dataclass(frozen=True)
class EvaluationInputs:
    """Options of ``peace evaluate`` and ``peace ablate`` that name images."""

    dataset: Annotated[str, Option(metavar='NAME', help=_DATASET)] = ''
    root: Annotated[Path | None, Option(metavar='DIR', help='Where the dataset was unpacked.')] = (
        None
    )
    images: Annotated[
        Path | None, Option(metavar='DIR', help='Folder of images; needs --labels.')
    ] = None
    labels: Annotated[
        Path | None, Option(metavar='DIR', help='Folder of label PNGs, same stems.')
    ] = None
    manifest: Annotated[
        Path | None, Option(metavar='FILE', help='CSV with columns image, label, split.')
    ] = None
    drawn: Annotated[int, Option(metavar='N', min=0, help='Draw N scenes.')] = 0
    drawn_seed: Annotated[
        int | None, Option(metavar='SEED', min=0, help='First seed of the drawn scenes.')
    ] = None
    drawn_px: Annotated[
        int, Option(metavar='N', min=64, max=4096, help='Side of the camera that sees the scenes.')
    ] = CAMERA_PX
    drawn_shape: Annotated[
        str, Option(metavar='W:H', help='Shape of its frames, at least 1:1: their middle is kept.')
    ] = '1:1'
    classes: Annotated[
        str, Option(metavar='NAME|FILE', help='Class table of --labels and --manifest.')
    ] = 'common'
    split: Annotated[str, Option(help='Only this split of the dataset or manifest.')] = ''
    mixed: Annotated[str, Option(help=_MIXED)] = 'ignore'
    limit: Annotated[
        int | None, Option(metavar='N', min=1, help='At most N images, evenly spread.')
    ] = None


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
            f'images from {" and ".join(given) or "no source"}: give exactly one of --dataset with '
            '--root, --images with --labels, --manifest, --drawn N'
        )
    return sampled(_open(inputs), inputs.limit)


def parse_shape(text: str) -> float:
    """Return width over height of ``W:H``.

    Raises DatasetError for anything else, and for frames that are higher than wide.
    """
    width, colon, height = text.partition(':')
    try:
        shape = float(width) / float(height)
    except (ValueError, ZeroDivisionError):
        shape = 0.0
    if not colon or not 1.0 <= shape <= _WIDEST:
        raise DatasetError(f'--drawn-shape {text}: give W:H from 1:1 to {_WIDEST:g}:1, e.g. 16:9')
    return shape


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
    return drawn_source(inputs.drawn, first_seed, inputs.drawn_px, parse_shape(inputs.drawn_shape))
