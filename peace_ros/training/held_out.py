# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.training.held_out``: photographs that are kept from training, as views.

Writes squares of the annotated photographs with ``split: val`` and their labels, for `peace
evaluate`: images/NAME.png, and labels/NAME.png with the ten common indices.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np
import typer

from peace_ros.domain import Label, WorldError
from peace_ros.training.annotations import (
    LOOSE_SURFACE,
    NOT_SAFE,
    OPEN_GROUND,
    PIXEL_CLASS_COUNT,
    VEGETATION,
    load_annotations,
    rasterise,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

_LEAST_SIDE_PX = 300
"""Smaller cuts than the network's input would only be blown up."""
_MOST_SIDE_PX = 512
"""Pixels of all views are pooled, and a sharp photograph is not worth more than a coarse one."""
_LABELS = np.arange(PIXEL_CLASS_COUNT, dtype=np.uint8)
# What may be either does not count; all that is certain of NOT_SAFE is that nobody may land on it.
_LABELS[[VEGETATION, LOOSE_SURFACE]] = Label.UNLABELED
_LABELS[OPEN_GROUND] = Label.GRASS
_LABELS[NOT_SAFE] = Label.OBSTACLE


def squares(width_px: int, height_px: int) -> Iterator[tuple[int, int, int]]:
    """Yield left, top and side of squares side by side: as large as fits, and half as large."""
    short = min(width_px, height_px)
    for side in (short, short // 2):
        if side >= _LEAST_SIDE_PX:
            for top in range(0, height_px - side + 1, side):
                for left in range(0, width_px - side + 1, side):
                    yield left, top, side


def write_views(real: Path, out: Path) -> int:
    """Write views and labels and return their number.

    Raises:
        WorldError: none of the photographs lies in ``ortho`` of the folder.
    """
    count = 0
    for annotation in load_annotations():
        path = real / 'ortho' / f'{annotation.name}.jpg'
        if not annotation.is_validation or not path.is_file():
            continue
        image = cv2.imread(str(path))
        if image is None:
            raise WorldError(f'{path}: cannot be read as an image; get it again')
        labels = _LABELS[rasterise(annotation, image.shape[1], image.shape[0])]
        for left, top, side in squares(image.shape[1], image.shape[0]):
            cut = np.s_[top : top + side, left : left + side]
            name = f'{annotation.name}_{side}_{left}_{top}.png'
            _write(out / 'images' / name, image[cut], cv2.INTER_AREA)
            _write(out / 'labels' / name, labels[cut], cv2.INTER_NEAREST)
            count += 1
    if not count:
        names = ', '.join(each.name for each in load_annotations() if each.is_validation)
        raise WorldError(f'{real}/ortho: holds none of {names} (.jpg); their files in '
                         'config/annotations say where to get them')  # fmt: skip
    return count


def _write(path: Path, picture: NDArray[np.uint8], shrink: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    side = min(_MOST_SIDE_PX, picture.shape[0])
    cv2.imwrite(str(path), cv2.resize(picture, (side, side), interpolation=shrink))


def main(
    real: Annotated[Path, typer.Option(help='Folder of real images, as training takes it.')],
    out: Annotated[Path, typer.Option(help='Folder that gets images/ and labels/.')],
) -> None:
    """Write the views that training never sees."""
    try:
        count = write_views(real, out)
    except WorldError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from None
    typer.echo(f'{count} views in {out}')


if __name__ == '__main__':
    typer.run(main)
