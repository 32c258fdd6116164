# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a training command shows: a progress bar per stage, and one sentence when it is refused."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import torch
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from peace_ros.core.domain import PeaceError

Report = Callable[[str, float, str], None]
"""Gets a stage, its progress (0 to 1) and a line of figures."""


class _Screen:
    """One progress bar per stage."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._tasks: dict[str, TaskID] = {}

    def __call__(self, stage: str, share: float, line: str) -> None:
        if stage not in self._tasks:
            self._tasks[stage] = self._progress.add_task(stage, total=1.0, line='')
        self._progress.update(self._tasks[stage], completed=share, line=line)


def show(work: Callable[[Report], None], threads: int) -> None:
    """Run ``work`` on a number of threads with its progress on the screen."""
    torch.set_num_threads(threads)
    cv2.setNumThreads(1)
    columns = (
        TextColumn('{task.description:>10}'), BarColumn(), TimeElapsedColumn(),
        TextColumn('{task.fields[line]}'),
    )  # fmt: skip
    console = Console()
    try:
        with Progress(*columns, console=console) as progress:
            work(_Screen(progress))
    except PeaceError as error:
        console.print(f'[red]{error}')
        raise typer.Exit(1) from error
