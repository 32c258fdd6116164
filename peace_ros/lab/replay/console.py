# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay in the terminal: a progress bar, then what was found."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from peace_ros.lab.replay.outputs import QUIET_STATES
from peace_ros.lab.replay.report import ReplayReport
from peace_ros.lab.replay.run import ReplayOptions, replay


def replay_in_terminal(options: ReplayOptions, console: Console) -> ReplayReport:
    """Replay with a progress bar and print the summary.

    Raises:
        PeaceError: as :func:`peace_ros.lab.replay.replay` does.
    """
    columns = (
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task('loading', total=None)

        def show(done: int, total: int, state: str) -> None:
            bar.update(task, completed=done, total=max(done, total), description=state or 'frames')

        report, folder = replay(options, show)
    console.print(_table(report, folder))
    return report


def _visit(state: dict[str, float | str]) -> str:
    """Return name and time of a visit, and why the vehicle waited or was given back."""
    reason = f' ({state["reason"]})' if state['name'] in QUIET_STATES else ''
    return f'{state["name"]} {float(state["seconds"]):.1f} s{reason}'


def _table(report: ReplayReport, folder: Path) -> Table:
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow='fold')
    frames = f'{report.frames}'
    if report.unusable_frames:
        frames += f', {report.unusable_frames} unusable: {report.first_fault}'
    states = ', '.join(map(_visit, report.states))
    fates = ', '.join(f'{count} {fate}' for fate, count in report.heatmaps.items())
    altitudes = 'none'
    if report.altitudes_m is not None:
        altitudes = '{:.1f} to {:.1f} m above ground'.format(*report.altitudes_m)
    for name, value in (
        *(('note', each) for each in report.remarks),
        ('recording', report.source),
        ('frames', frames),
        ('altitude', altitudes),
        (
            'recorded',
            f'{report.recorded_s:.1f} s, replayed {report.faster_than_life:.1f} x as fast',
        ),
        ('prompts', '\n'.join(each.replace('{term}', '...') for each in report.prompts)),
        ('called safe', f'{100.0 * report.mean_safe_fraction:.1f} % of the ground seen'),
        ('states', states),
        ('verdicts', ', '.join(f'{k} {v}' for k, v in report.verdicts.items())),
        ('heatmaps', fates),
        ('outcome', report.outcome or 'none by the end of the recording'),
        ('results', str(folder)),
    ):
        table.add_row(name, Text(value))  # a path may look like markup
    return table
