# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay in the terminal: a progress bar, then what was found."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from peace_ros.lab.replay import run
from peace_ros.lab.replay.outputs import QUIET_STATES
from peace_ros.lab.replay.regression import GoldenOptions, Regression, replay_regression
from peace_ros.lab.replay.report import ReplayReport
from peace_ros.lab.replay.trace import described


def replay_in_terminal(options: run.ReplayOptions, console: Console) -> ReplayReport:
    """Replay with a progress bar and print the summary.

    Raises:
        PeaceError: as :func:`peace_ros.lab.replay.replay` does.
    """
    with _shown(console) as show:
        report, folder = run.replay(options, show)
    console.print(_table(report, folder))
    return report


def compare_in_terminal(
    options: run.ReplayOptions, golden: GoldenOptions, console: Console
) -> bool:
    """Replay, compare with the golden file or make it, and print both; return whether it passed.

    Raises:
        PeaceError: as :func:`peace_ros.lab.replay.regression.replay_regression` does.
    """
    with _shown(console) as show:
        result = replay_regression(options, golden, show)
    console.print(_table(result.report, result.folder))
    if result.golden is None:
        console.print(
            f'{golden.file} was made: {len(result.found.masks)} frames, states '
            f'{", ".join(result.found.distinct_states)}. Look at the results before you keep it.',
            highlight=False,
        )
        return True
    console.print(_checks(result))
    told = described(result.golden.made_with)
    console.print(f'golden: {told}', f'now: {described(result.found.made_with)}', sep='\n')
    if result.first_ns is not None:
        console.print(
            f'first difference at {result.first_ns * 1e-9:.1f} s: '
            f'{result.folder / "difference.png"}',
            highlight=False,
        )
    return result.passed


def compare_presets_in_terminal(
    options: run.ReplayOptions, presets: tuple[str, str], console: Console
) -> None:
    """Replay with two presets, and print both and where their page is.

    Raises:
        PeaceError: as :func:`peace_ros.lab.replay.side_by_side.replay_side_by_side` does.
    """
    # Here, because the page needs an extra that other replays do without.
    from peace_ros.lab.replay.side_by_side import figures, replay_side_by_side  # noqa: PLC0415

    with _shown(console) as show:
        sides, page = replay_side_by_side(options, presets, show)
    table = Table('', *(each.name for each in sides))
    for heading, cells in figures(sides):
        table.add_row(heading, *cells)
    console.print(table)
    console.print(f'page: {page}', highlight=False)


@contextmanager
def _shown(console: Console) -> Iterator[run.Progress]:
    """Show a progress bar; yield what it is told with."""
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

        yield show


def _checks(result: Regression) -> Table:
    table = Table('check', '', 'found', 'tolerance')
    for each in result.checks:
        verdict = Text('same', 'green') if each.passed else Text('OTHER', 'bold red')
        table.add_row(each.name, verdict, each.found, each.tolerance)
    return table


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
