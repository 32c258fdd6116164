# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.training.instances``: train and export the bundled FastSAM-like model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import torch
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from peace_ros.domain import PeaceError
from peace_ros.training.instances.recipe import Recipe, run


def main(
    out: Annotated[Path, typer.Option(help='Folder that gets fastsam-small.')],
    minutes: Annotated[float, typer.Option(help='Minutes of training of both networks.')] = 20.0,
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
    start: Annotated[
        Path | None,
        typer.Option(help='segmenter.pt of peace_ros.training: its backbone knows aerial images.'),
    ] = None,
    scenes: Annotated[int, typer.Option(help='Number of drawn scenes.')] = 600,
    threads: Annotated[int, typer.Option(help='CPU threads.')] = 2,
) -> None:
    """Train the bundled FastSAM-like model and write its bundle."""
    torch.set_num_threads(threads)
    cv2.setNumThreads(1)
    columns = (
        TextColumn('{task.description:>10}'), BarColumn(), TimeElapsedColumn(),
        TextColumn('{task.fields[line]}'),
    )  # fmt: skip
    recipe = Recipe(
        out=out, work=work, real=real, minutes=minutes, steps=steps, seed=seed,
        start=start, scenes=scenes,
    )  # fmt: skip
    console = Console()
    try:
        with Progress(*columns, console=console) as progress:
            tasks: dict[str, int] = {}

            def report(stage: str, share: float, line: str) -> None:
                if stage not in tasks:
                    tasks[stage] = progress.add_task(stage, total=1.0, line='')
                progress.update(tasks[stage], completed=share, line=line)  # type: ignore[arg-type]

            run(recipe, report)
    except PeaceError as error:
        console.print(f'[red]{error}')
        raise typer.Exit(1) from error


if __name__ == '__main__':
    typer.run(main)
