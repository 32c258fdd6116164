# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training.instances.report``: figures and pictures of the bundle."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np
import typer

from peace_ros.core.domain import Frame, Label
from peace_ros.core.inference import Bundle
from peace_ros.core.segmentation import draw_overlay
from peace_ros.lab.training.instances.measure import (
    NAME,
    PROMPT,
    REPORT_SCENES,
    InstanceReport,
    drawn_frames,
    measure,
    open_segmenter,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from peace_ros.core.segmentation.fastsam import FastSamSegmenter
    from peace_ros.lab.training.measure import Example

_BORDER_RGB = (255, 255, 255)


def _table(report: InstanceReport) -> None:
    classes = [label.name for label in Label if label.name in report.rows[0].by_class]
    columns = ['threshold', 'miou', 'recall', 'false_safe', *(name.lower() for name in classes)]
    print('| ' + ' | '.join(columns) + ' |')
    print('|' + '---|' * len(columns))
    for row in report.rows:
        values = [row.miou, row.recall, row.false_safe, *(row.by_class[name] for name in classes)]
        print(f'| {row.threshold:.2f} | ' + ' | '.join(f'{value:.3f}' for value in values) + ' |')
    print(
        f'\nAll unsafe: miou {report.unsafe_miou:.3f}. Scored segments per frame: '
        f'{report.segments:.1f}; they cover {report.covered:.3f} of the frames.'
    )


def draw_segments(segmenter: FastSamSegmenter, frame: Frame) -> NDArray[np.uint8]:
    """Return the frame with its scored segments in colours, as uint8 RGB of the network's size."""
    segments = segmenter.segments(frame).scored
    heatmap = segmenter.segment(frame, PROMPT)
    height, width = heatmap.safety.shape
    image = cv2.resize(frame.image_rgb, (width, height), interpolation=cv2.INTER_AREA)
    rng = np.random.default_rng(0)
    for segment in segments:
        part = image[segment.rows, segment.columns]
        colour = rng.integers(40, 255, 3)
        part[segment.mask] = (0.5 * part[segment.mask] + 0.5 * colour).astype(np.uint8)
        mask = segment.mask.astype(np.uint8)
        outline = mask - cv2.erode(mask, np.ones((3, 3), np.uint8), borderValue=0)
        part[outline > 0] = _BORDER_RGB
    return np.asarray(image, np.uint8)


def _pictures(folder: Path, segmenter: FastSamSegmenter, examples: list[Example]) -> None:
    """Write image, segments and heatmap beside each other."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, example in enumerate(examples):
        frame = Frame(example.image_rgb, 0)
        painted = draw_segments(segmenter, frame)
        size = painted.shape[1::-1]
        overlay = draw_overlay(frame, segmenter.segment(frame, PROMPT))
        row = [cv2.resize(frame.image_rgb, size), painted, cv2.resize(overlay, size)]
        cv2.imwrite(str(folder / f'{number:03d}.png'), np.hstack(row)[:, :, ::-1])


def main(
    models: Annotated[Path, typer.Option(help='Folder of the bundles.')] = Path('models'),
    scenes: Annotated[int, typer.Option(help='Number of unseen drawn scenes.')] = 40,
    pictures: Annotated[
        Path | None, typer.Option(help='Folder that gets pictures of the segments.')
    ] = None,
) -> None:
    """Measure the bundle on drawn scenes that neither training nor the threshold has seen."""
    with TemporaryDirectory() as folder:
        seeds = range(REPORT_SCENES.start, REPORT_SCENES.start + scenes)
        examples = drawn_frames(Path(folder), seeds)
        _table(measure(models / NAME, examples))
        if pictures is not None:
            _pictures(pictures, open_segmenter(Bundle.load(models / NAME)), examples)


if __name__ == '__main__':
    typer.run(main)
