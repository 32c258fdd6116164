# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.training``: train and export both bundled models with one command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import torch
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from peace_ros.domain import PeaceError
from peace_ros.training.recipe import Recipe, run


class _Screen:
    """One progress bar per stage."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._tasks: dict[str, TaskID] = {}

    def __call__(self, stage: str, share: float, line: str) -> None:
        if stage not in self._tasks:
            self._tasks[stage] = self._progress.add_task(stage, total=1.0, line='')
        self._progress.update(self._tasks[stage], completed=share, line=line)


def main(
    out: Annotated[Path, typer.Option(help='Folder that gets clip-small and clipseg-small.')],
    minutes: Annotated[float, typer.Option(help='Minutes of training of both together.')] = 85.0,
    steps: Annotated[
        int | None, typer.Option(help='Steps of each network in place of minutes; repeatable.')
    ] = None,
    seed: Annotated[int, typer.Option(help='Seed of scenes, views and weights.')] = 0,
    real: Annotated[
        Path | None, typer.Option(help='Folder of real aerial images with manifest.csv.')
    ] = None,
    work: Annotated[
        Path, typer.Option(help='Folder of scenes, checkpoints and curves; continues from it.')
    ] = Path('training_run'),
    scenes: Annotated[int, typer.Option(help='Number of drawn scenes.')] = 2000,
    threads: Annotated[int, typer.Option(help='CPU threads.')] = 2,
) -> None:
    """Train the bundled models and write their bundles."""
    torch.set_num_threads(threads)
    cv2.setNumThreads(1)
    columns = (
        TextColumn('{task.description:>10}'), BarColumn(), TimeElapsedColumn(),
        TextColumn('{task.fields[line]}'),
    )  # fmt: skip
    recipe = Recipe(
        out=out, work=work, real=real, minutes=minutes, steps=steps, seed=seed, scenes=scenes
    )
    console = Console()
    try:
        with Progress(*columns, console=console) as progress:
            run(recipe, _Screen(progress))
    except PeaceError as error:
        console.print(f'[red]{error}')
        raise typer.Exit(1) from error


if __name__ == '__main__':
    typer.run(main)
