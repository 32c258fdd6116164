# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training.report``: print the figures of the model card."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from peace_ros.core.domain import Label
from peace_ros.lab.training.measure import (
    SafetyModel,
    class_iou,
    drawn_examples,
    dubai_examples,
    ranking_report,
    safety_report,
    speed_report,
)
from peace_ros.lab.training.sources import FRAME_PX, VALIDATION_SEED, load_drawn, load_dubai


def _safety_table(rows: dict[str, dict[str, float]]) -> None:
    figures = ['recall', 'precision', 'false_safe', 'iou_safe', 'iou_unsafe']
    classes = [label.name for label in Label if label.name in next(iter(rows.values()))]
    columns = [*figures, *classes]
    print('| threshold | ' + ' | '.join(name.lower() for name in columns) + ' |')
    print('|' + '---|' * (len(columns) + 1))
    for threshold, row in rows.items():
        print(f'| {threshold} | ' + ' | '.join(f'{row[name]:.2f}' for name in columns) + ' |')
    print()


def _line(name: str, values: dict[str, float]) -> None:
    print(f'{name}: ' + ', '.join(f'{key.lower()} {value:g}' for key, value in values.items()))
    print()


def main(
    models: Annotated[Path, typer.Option(help='Folder of the bundles.')] = Path('models'),
    real: Annotated[Path | None, typer.Option(help='Folder of real aerial images.')] = None,
    scenes: Annotated[int, typer.Option(help='Number of unseen drawn scenes.')] = 60,
) -> None:
    """Measure both bundles on scenes and images that training has not seen."""
    clipseg, clip = models / 'clipseg-small', models / 'clip-small'
    model = SafetyModel(clipseg)
    with TemporaryDirectory() as folder:
        sets = {'Drawn scenes': drawn_examples(Path(folder), scenes)}
        if real is not None:
            sets['Dubai tile 5'] = dubai_examples(real)
        for name, examples in sets.items():
            print(f'{name}, {len(examples)} frames\n')
            _safety_table(safety_report(model, examples))
            _line('Class IoU', class_iou(model, examples))
        seeds = range(VALIDATION_SEED, VALIDATION_SEED + scenes)
        drawn = load_drawn(Path(folder), seeds, size_px=FRAME_PX, workers=1)
        _line('First word right, drawn scenes', ranking_report(clip, drawn))
    if real is not None:
        _line('First word right, Dubai tile 5', ranking_report(clip, load_dubai(real, 'val')))
    _line('Speed', speed_report(clipseg, clip))


if __name__ == '__main__':
    typer.run(main)
