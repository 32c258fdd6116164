# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training``: train and export both bundled models with one command."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from peace_ros.lab.training import options
from peace_ros.lab.training.recipe import Recipe, run
from peace_ros.lab.training.screen import show


def main(
    out: Annotated[Path, typer.Option(help='Folder that gets clip-small and clipseg-small.')],
    minutes: Annotated[float, typer.Option(help='Minutes of training of both together.')] = 85.0,
    steps: options.Steps = None,
    seed: options.Seed = 0,
    real: options.Real = None,
    work: options.Work = Path('training_run'),
    scenes: options.Scenes = 2000,
    start: Annotated[
        Path | None,
        typer.Option(help='clipseg-small of an earlier training to go on from, not from ImageNet.'),
    ] = None,
    ranker: Annotated[bool, typer.Option(help='Train clip-small too.')] = True,
    threads: options.Threads = 2,
) -> None:
    """Train the bundled models and write their bundles."""
    recipe = Recipe(
        out=out,
        work=work,
        real=real,
        minutes=minutes,
        steps=steps,
        seed=seed,
        scenes=scenes,
        start=start,
        with_ranker=ranker,
    )
    show(partial(run, recipe), threads)


if __name__ == '__main__':
    typer.run(main)
