# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training.held_out``: the photographs that are kept from training.

Writes the annotated ones with ``split: val`` and their labels for `peace evaluate`, which cuts
them: images/NAME.png, and labels/NAME.png with the ten common indices.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

from peace_ros.core.domain import Label, WorldError
from peace_ros.lab.training import annotations
from peace_ros.lab.training.sources import annotated_photographs, read_image

_SIDE_PX = 704
"""Longest of the shorter sides: pixels of all photographs are pooled, and a sharp one is not worth
more than a coarse one. Two of the network's inputs."""
_LABELS = np.arange(annotations.PIXEL_CLASS_COUNT, dtype=np.uint8)
# What may be either does not count; of NOT_SAFE it is only certain that nobody may land on it.
_LABELS[[annotations.VEGETATION, annotations.LOOSE_SURFACE]] = Label.UNLABELED
_LABELS[annotations.OPEN_GROUND] = Label.GRASS
_LABELS[annotations.NOT_SAFE] = Label.OBSTACLE


def write_held_out(real: Path, out: Path) -> int:
    """Write photographs and labels and return their number.

    Raises:
        WorldError: none of the photographs lies in ``ortho`` of the folder.
    """
    there = annotated_photographs(real, is_validation=True)
    if not there:
        names = ', '.join(
            each.name for each in annotations.load_annotations() if each.is_validation
        )
        raise WorldError(
            f'{real}/ortho: holds none of {names} (.jpg); their files in config/annotations say '
            'where to get them'
        )
    for folder in ('images', 'labels'):
        (out / folder).mkdir(parents=True, exist_ok=True)
    for annotation, path in there:
        image = read_image(path)
        scale = min(1.0, _SIDE_PX / min(image.shape[:2]))
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        labels = _LABELS[annotations.rasterise(annotation, image.shape[1], image.shape[0])]
        cv2.imwrite(str(out / 'images' / f'{annotation.name}.png'), image[..., ::-1])
        cv2.imwrite(str(out / 'labels' / f'{annotation.name}.png'), labels)
    return len(there)


def main(
    real: Annotated[Path, typer.Option(help='Folder of real images, as training takes it.')],
    out: Annotated[Path, typer.Option(help='Folder that gets images/ and labels/.')],
) -> None:
    """Write the photographs that training never sees."""
    try:
        count = write_held_out(real, out)
    except WorldError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from None
    typer.echo(f'{count} photographs in {out}')


if __name__ == '__main__':
    typer.run(main)
