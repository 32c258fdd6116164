# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training.instances`` trains and exports the bundled FastSAM."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from peace_ros.lab.training import options
from peace_ros.lab.training.instances.recipe import InstanceRecipe, run
from peace_ros.lab.training.screen import show


def main(
    out: Annotated[Path, typer.Option(help='Folder that gets fastsam-small.')],
    minutes: Annotated[float, typer.Option(help='Minutes of training of both networks.')] = 20.0,
    steps: options.Steps = None,
    seed: options.Seed = 0,
    real: options.Real = None,
    work: options.Work = Path('training_run'),
    start: Annotated[
        Path | None,
        typer.Option(help='segmenter.pt of lab.training: its backbone knows aerial images.'),
    ] = None,
    scenes: options.Scenes = 600,
    threads: options.Threads = 2,
) -> None:
    """Train the bundled FastSAM-like model and write its bundle."""
    recipe = InstanceRecipe(
        out=out, work=work, real=real, minutes=minutes, steps=steps, seed=seed,
        start=start, scenes=scenes,
    )  # fmt: skip
    show(partial(run, recipe), threads)


if __name__ == '__main__':
    typer.run(main)
