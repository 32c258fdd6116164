# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options that the training commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Steps = Annotated[
    int | None, typer.Option(help='Steps of each network in place of minutes; repeatable.')
]
Seed = Annotated[int, typer.Option(help='Seed of scenes, views and weights.')]
Real = Annotated[Path | None, typer.Option(help='Folder of real aerial images with manifest.csv.')]
Work = Annotated[
    Path, typer.Option(help='Folder of scenes, checkpoints and curves; continues from it.')
]
Scenes = Annotated[int, typer.Option(help='Number of drawn scenes.')]
Threads = Annotated[int, typer.Option(help='CPU threads.')]
