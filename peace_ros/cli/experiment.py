# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace experiment``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from typer import Exit, Option

from peace_ros.cli.extras import require
from peace_ros.recording.run_folder import write_whole

_PAPER_HZ = 0.82
_INTERRUPTED = 130


def experiment(
    *,
    runs: Annotated[int, Option(metavar='N', help='Starts; each configuration gets all.')] = 100,
    configs: Annotated[
        str,
        Option(metavar='NAMES', help='Presets or files, with commas between; all: the six.'),
    ] = 'peace_cs',
    policy: Annotated[
        str, Option(metavar='NAMES', help='ours, dovesei (as published), or both with a comma.')
    ] = 'ours',
    eyes: Annotated[
        str, Option(metavar='KIND', help='model, or truth: heatmaps from the labels.')
    ] = 'model',
    error_rate: Annotated[
        float, Option(metavar='SHARE', help='Of the ground that --eyes truth shows wrongly.')
    ] = 0.0,
    world: Annotated[
        list[str] | None,
        Option(metavar='FILE', help='Orthophoto with labels beside it; several. Without: drawn.'),
    ] = None,
    gsd: Annotated[
        float | None, Option(metavar='M', help='Metres of ground per pixel of --world.')
    ] = None,
    district: Annotated[
        str, Option(metavar='NAME', help='Of drawn worlds: mixed, suburb, coast ...')
    ] = 'mixed',
    season: Annotated[
        str, Option(metavar='NAME', help='Of drawn worlds; without: the seed of each run.')
    ] = '',
    condition: Annotated[
        str, Option(metavar='NAME', help='Weather, light or image quality of every view.')
    ] = 'clear',
    seed: Annotated[int, Option(help='Of worlds, starts and errors.')] = 1,
    rate: Annotated[float, Option(metavar='HZ', help='Heatmaps per second.')] = _PAPER_HZ,
    latency: Annotated[
        float, Option(metavar='S', help='From the exposure of a frame to its heatmap.')
    ] = 0.3,
    limit: Annotated[float, Option(metavar='S', help='Simulated time of a run.')] = 1200.0,
    workers: Annotated[int, Option(metavar='N', min=1, max=64, help='Processes.')] = 1,
    scheduler: Annotated[
        str, Option(metavar='ADDRESS', help='Dask scheduler whose workers fly instead.')
    ] = '',
    out: Annotated[
        Path, Option(metavar='DIR', help='Flights are kept here; those in it are not repeated.')
    ] = Path('experiment'),
    json_file: Annotated[
        Path | None, Option('--json', metavar='FILE', help='Write the figures here.')
    ] = None,
) -> None:
    """Fly many landings in simulated time from 100 m to 20 m and judge each by ground truth.

    Every configuration and policy gets the same starts. Interrupted, it goes on where it was.
    """
    require('pyarrow', 'scipy', *(('distributed',) if scheduler else ()))
    from peace_ros.lab.experiment.figures import figures
    from peace_ros.lab.experiment.flight import Perception
    from peace_ros.lab.experiment.places import DRAWN, Place
    from peace_ros.lab.experiment.run import run_experiment
    from peace_ros.lab.experiment.settings import CONFIGURATIONS, ExperimentSettings
    from peace_ros.lab.experiment.store import FlightStore, Row
    from peace_ros.simulation.demo.signals import interruptible

    settings = ExperimentSettings(
        runs=runs,
        configurations=CONFIGURATIONS if configs == 'all' else _names(configs),
        policies=_names(policy),
        eyes=eyes,
        error_rate=error_rate,
        places=tuple(Place(each, gsd, district, season, condition) for each in world or (DRAWN,)),
        seed=seed,
        perception=Perception(rate, latency),
        limit_s=limit,
    )
    store, console = FlightStore(out, settings), Console(markup=False)
    columns = (
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    progress = Progress(*columns, console=console, disable=not console.is_terminal)
    with interruptible(), progress:
        total = sum(1 for run in range(runs) for _ in settings.flights_of(run))
        wanted = {key for run in range(runs) for key in settings.flights_of(run)}
        task = progress.add_task('flights', total=total, completed=len(store.finished & wanted))

        def tell(rows: list[Row]) -> None:
            progress.advance(task, len(rows))
            for row in rows:
                console.print(_line(row), markup=False, highlight=False, soft_wrap=True)

        try:
            run_experiment(settings, store, workers=workers, scheduler=scheduler, watch=tell)
        except KeyboardInterrupt:
            console.print(
                f'interrupted: {len(store.finished)} flights are kept in {store.path}; the same '
                'command goes on',
                highlight=False,
                soft_wrap=True,
            )
            raise Exit(_INTERRUPTED) from None
    told = figures(store.rows())
    if json_file is not None:
        write_whole(json_file, json.dumps(told, indent=2) + '\n', 'figures')
    console.print(_table(told['groups']))
    console.print(f'flights: {store.path}', highlight=False)


def _names(text: str) -> tuple[str, ...]:
    return tuple(each.strip() for each in text.split(',') if each.strip())


def _line(row: dict[str, object]) -> str:
    hazard = f' ({row["hazard"]})' if row['hazard'] else ''
    return (
        f'run {row["run"]} {row["configuration"]} {row["policy"]}: {row["result"]}{hazard}, '
        f'{row["time_s"]:.0f} s: {row["reason"]}'
    )


def _table(groups: list[dict[str, object]]) -> Table:
    table, counts = Table(), ('runs', 'safe', 'unsafe', 'no_zone', 'no_zone_right', 'timeout')
    for name in ('', 'runs', 'safe', 'unsafe', 'no zone', 'of them right', 'time-out', 'time, s'):
        table.add_column(name, justify='right')
    for each in groups:
        table.add_row(
            f'{each["configuration"]} {each["policy"]}',
            *(str(each[name]) for name in counts),
            f'{each["time_s_mean"]:.0f}',
        )
    return table
