# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training``: train and export the bundled models with one command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import torch
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.lab.training.instances.recipe import InstanceRecipe
from peace_ros.lab.training.recipe import BaseRecipe, Recipe


def main(
    out: Annotated[Path, typer.Option(help='Folder that gets the bundles.')],
    family: Annotated[
        str, typer.Option(help='clipseg (clipseg-small and clip-small) or fastsam (fastsam-small).')
    ] = 'clipseg',
    minutes: Annotated[
        float | None, typer.Option(help='Minutes of training in all; none: 85, fastsam 20.')
    ] = None,
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
    scenes: Annotated[
        int | None, typer.Option(help='Number of drawn scenes; none: 2000, fastsam 600.')
    ] = None,
    start: Annotated[
        Path | None,
        typer.Option(
            help='Continue from this, not from ImageNet: clipseg-small of an earlier training; '
            'for fastsam a segmenter.pt, whose backbone knows aerial images.'
        ),
    ] = None,
    ranker: Annotated[bool, typer.Option(help='Train clip-small too.')] = True,
    threads: Annotated[int, typer.Option(help='CPU threads.')] = 2,
) -> None:
    """Train bundled models and write their bundles."""
    lengths = {'minutes': minutes, 'scenes': scenes}
    options = {
        'out': out, 'work': work, 'real': real, 'steps': steps, 'seed': seed, 'start': start,
        **{name: value for name, value in lengths.items() if value is not None},
    }  # fmt: skip
    torch.set_num_threads(threads)
    cv2.setNumThreads(1)
    console = Console()
    try:
        recipe: BaseRecipe
        if family == 'clipseg':
            recipe = Recipe(**options, with_ranker=ranker)
        elif family == 'fastsam':
            recipe = InstanceRecipe(**options)
        else:
            raise ConfigurationError(f'--family {family}: choose clipseg or fastsam')
        _run(recipe, console)
    except PeaceError as error:
        console.print(f'[red]{error}')
        raise typer.Exit(1) from error


def _run(recipe: BaseRecipe, console: Console) -> None:
    """Run a recipe with a progress bar per stage."""
    columns = (
        TextColumn('{task.description:>10}'), BarColumn(), TimeElapsedColumn(),
        TextColumn('{task.fields[line]}'),
    )  # fmt: skip
    tasks: dict[str, TaskID] = {}
    with Progress(*columns, console=console) as progress:

        def report(stage: str, share: float, line: str) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(stage, total=1.0, line='')
            progress.update(tasks[stage], completed=share, line=line)

        recipe.run(report)


if __name__ == '__main__':
    typer.run(main)
