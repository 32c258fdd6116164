# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The charts of an experiment, drawn by matplotlib: SVG for the page, PNG and PDF for papers."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from peace_ros.core.domain import RecordingError
from peace_ros.lab.chart_style import CHART_STYLE
from peace_ros.lab.experiment.report.paper import PAPER
from peace_ros.lab.experiment.store import Row

COLOURS = {
    'safe': '#15803d',
    'unsafe': '#b91c1c',
    'no_zone': '#a16207',
    'timeout': '#57606a',
    'unknown': '#7e22ce',
    'failed': '#0e7490',
}
"""Of results."""
Groups = dict[str, list[Row]]
"""Name of configuration and policy -> its flights."""


def draw_charts(groups: Groups) -> dict[str, Figure]:
    """Return name -> chart: results, time, distance, time of each run, paths."""
    with rc_context(CHART_STYLE):
        return {
            'results': _results(groups),
            'time': _boxes(groups, 'time_s', 'Time of a run', 's'),
            'distance': _boxes(
                groups, 'horizontal_distance_m', 'Way over the ground, landings', 'm'
            ),
            'runs': _runs(groups),
            'paths': _paths(groups),
            'states': _states(groups),
        }


def as_svg(figure: Figure) -> str:
    """Return the `svg` element of a chart."""
    out = StringIO()
    with rc_context(CHART_STYLE):
        figure.savefig(out, format='svg', metadata={'Date': None, 'Creator': None})
    return out.getvalue()[out.getvalue().index('<svg') :]


def save_charts(charts: dict[str, Figure], folder: Path) -> None:
    """Write each chart as PNG and as PDF.

    Raises:
        RecordingError: the folder cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in charts.items():
            figure.savefig(folder / f'{name}.png', dpi=200)
            figure.savefig(folder / f'{name}.pdf', metadata={'CreationDate': None})
    except OSError as error:
        raise RecordingError(f'charts cannot be written to {folder} ({error})') from error


def _axes(title: str, width: float = 5.2, height: float = 3.6) -> tuple[Figure, Axes]:
    figure = Figure((width, height), layout='constrained')
    axes = figure.subplots()
    axes.set_title(title)
    return figure, axes


def _results(groups: Groups) -> Figure:
    figure, axes = _axes('Results, % of the runs', height=1.2 + 0.5 * len(groups))
    for place, rows in enumerate(groups.values()):
        left = 0.0
        for result, colour in COLOURS.items():
            share = 100.0 * sum(row['result'] == result for row in rows) / len(rows)
            if share:
                axes.barh(place, share, left=left, color=colour, height=0.6)
                if share >= 5.0:
                    axes.text(
                        left + share / 2.0,
                        place,
                        f'{share:.0f}',
                        color='white',
                        ha='center',
                        va='center',
                    )
            left += share
    axes.set_yticks(range(len(groups)), list(groups))
    axes.invert_yaxis()
    axes.set_xlim(0.0, 100.0)
    axes.grid(visible=False)
    return figure


def _boxes(groups: Groups, name: str, title: str, unit: str) -> Figure:
    """Draw box plots, and a mark where the paper's mean lies."""
    figure, axes = _axes(title, height=1.2 + 0.5 * len(groups))
    landings_only = name != 'time_s'
    values = [
        [row[name] for row in rows if not landings_only or row['result'] in {'safe', 'unsafe'}]
        for rows in groups.values()
    ]
    axes.boxplot(values, orientation='horizontal', widths=0.55, medianprops={'color': '#0b62a8'})
    for place, rows in enumerate(groups.values(), start=1):
        paper = PAPER.get(rows[0]['configuration'])
        if paper is not None:
            axes.plot(getattr(paper, name), place, 'D', color='#c2410c', markersize=6)
    axes.set_yticks(range(1, len(groups) + 1), list(groups))
    axes.invert_yaxis()
    axes.set_xlabel(f'{unit}; diamond: mean of the paper')
    axes.set_xlim(left=0.0)
    return figure


def _runs(groups: Groups) -> Figure:
    figure, axes = _axes('Time of each run', width=8.0)
    marks = 'osv^DPX*hp'
    for number, (name, rows) in enumerate(groups.items()):
        for result, colour in COLOURS.items():
            points = [(row['run'], row['time_s']) for row in rows if row['result'] == result]
            if points:
                axes.plot(
                    *zip(*points, strict=True),
                    marks[number % len(marks)],
                    color=colour,
                    markersize=4,
                    linestyle='none',
                    label=f'{name}: {result}',
                )
    axes.set(xlabel='run', ylabel='s')
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=7, ncols=2)
    return figure


def _paths(groups: Groups) -> Figure:
    figure, axes = _axes('Paths over the ground, all from the middle', height=5.2)
    for rows in groups.values():
        for row in rows:
            colour = COLOURS[row['result']]
            axes.plot(row['track_east_m'], row['track_north_m'], color=colour, linewidth=0.8)
            axes.plot(row['track_east_m'][-1], row['track_north_m'][-1], '.', color=colour)
    axes.plot(0.0, 0.0, 'o', color='black', markersize=5)
    axes.set(xlabel='east of the start, m', ylabel='north of the start, m')
    axes.set_aspect('equal', adjustable='datalim')
    return figure


def _states(groups: Groups) -> Figure:
    figure, axes = _axes('Mean time in each state', height=1.8 + 0.5 * len(groups))
    names = list(dict.fromkeys(name for rows in groups.values() for name in _mean_s(rows)))
    shades = ('#0b62a8', '#0e7490', '#15803d', '#a16207', '#c2410c', '#7e22ce', '#57606a', '#111')
    left = [0.0] * len(groups)
    for number, state in enumerate(names):
        seconds = [_mean_s(rows).get(state, 0.0) for rows in groups.values()]
        colour = shades[number % len(shades)]
        axes.barh(range(len(groups)), seconds, left=left, color=colour, height=0.6, label=state)
        left = [a + b for a, b in zip(left, seconds, strict=True)]
    axes.set_yticks(range(len(groups)), list(groups))
    axes.invert_yaxis()
    axes.set_xlabel('s')
    figure.legend(fontsize=7, ncols=4, loc='outside lower center')
    return figure


def _mean_s(rows: Sequence[Row]) -> dict[str, float]:
    total: dict[str, float] = {}
    for row in rows:
        for name, seconds in row['state_s']:
            total[name] = total.get(name, 0.0) + seconds / len(rows)
    return total
