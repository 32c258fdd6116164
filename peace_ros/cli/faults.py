# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace faults``."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from peace_ros.lab.faults import report, worlds
from peace_ros.lab.faults.catalogue import FAULTS, choose
from peace_ros.lab.faults.fault import Fault
from peace_ros.lab.faults.judge import describe
from peace_ros.lab.faults.run import Row, run_faults
from peace_ros.lab.faults.soak import SoakOptions, soak_in_terminal
from peace_ros.simulation.demo.signals import interruptible

EXIT_OK, EXIT_FAILED = 0, 1


def faults(
    *,
    only: Annotated[
        list[str] | None,
        typer.Option('--only', metavar='NAME', help='A fault or a group; may be repeated.'),
    ] = None,
    show: Annotated[
        bool, typer.Option('--list', help='List the faults, what must happen, and exit.')
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option('--json', metavar='FILE', help='Write the report here.')
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, max=1000, help='Fly each fault so often.')] = 1,
    jobs: Annotated[
        int, typer.Option(min=1, max=16, help='Flights at a time; each needs about two cores.')
    ] = 1,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Keep logs and worlds here; default: a temporary folder.'),
    ] = None,
    soak: Annotated[
        float | None,
        typer.Option(
            metavar='MINUTES',
            min=0.5,
            help='Instead of the matrix: fly, land and fly again, and watch memory and timing.',
        ),
    ] = None,
) -> None:
    """Put every fault into a flight of the real processes and judge what happens.

    Exit status 0 only when each did what is documented, without an unsafe hand-over or a crash.
    """
    console = Console(markup=False)
    chosen = tuple(fault for fault in choose(only or ()) for _ in range(repeat))
    if show:
        for fault in FAULTS:
            console.print(f'{fault.group}/{fault.name}: {fault.goes_wrong}', style='bold')
            console.print(f'    {fault.at}: {describe(fault)}', highlight=False)
        raise typer.Exit(EXIT_OK)
    folder = run_dir or Path(tempfile.mkdtemp(prefix='peace_faults_'))
    passed = False
    with interruptible():
        with console.status('drawing the worlds'):
            worlds.prepare(folder / 'worlds')
        if soak is not None:
            passed = soak_in_terminal(SoakOptions(soak * 60.0, folder), console, json_file)
        else:
            passed = _matrix(console, chosen, jobs, folder, json_file)
    if passed and run_dir is None:
        shutil.rmtree(folder, ignore_errors=True)
    elif not passed:
        console.print(f'logs: {folder}', highlight=False)
    raise typer.Exit(EXIT_OK if passed else EXIT_FAILED)


def _matrix(
    console: Console,
    chosen: tuple[Fault, ...],
    jobs: int,
    folder: Path,
    json_file: Path | None,
) -> bool:
    """Run the faults; return whether all of them passed."""
    began = time.monotonic()
    under_way: list[str] = []
    lock = threading.Lock()
    columns = (
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task('faults', total=len(chosen))

        def tell(name: str, row: Row | None) -> None:
            with lock:
                if row is None:
                    under_way.append(name)
                else:
                    under_way.remove(name)
                    progress.advance(task)
                    style = None if row['passed'] else 'red'
                    console.print(
                        report.line(row),
                        style=style,
                        markup=False,
                        highlight=False,
                        soft_wrap=True,
                    )
                progress.update(task, description=', '.join(under_way) or 'faults')

        results = run_faults(chosen, jobs, folder, folder / 'worlds', tell)
    if results.trouble:
        console.print(results.trouble, style='red', markup=False, highlight=False)
    told = report.figures(results, time.monotonic() - began)
    if json_file is not None:
        report.write(told, json_file)
    console.print(report.table(told))
    return bool(told['passed'] == told['faults'] == len(chosen))
