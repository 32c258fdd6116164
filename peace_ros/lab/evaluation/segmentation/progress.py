# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bar that runs while images are scored."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)


@contextmanager
def over_images(console: Console, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar; yield what to call with the number of images that are done."""
    described = TextColumn('{task.description}')
    columns = (described, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task('images', total=total)

        def report(done: int) -> None:
            progress.update(task, completed=done)

        yield report
