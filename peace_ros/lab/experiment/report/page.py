# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of an experiment; it needs no other file. Its text is `templates/experiment.html.j2`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from peace_ros import __version__
from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.core.landing import LandingParameters
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.presets import load_preset
from peace_ros.lab.experiment.figures import figures
from peace_ros.lab.experiment.places import Place
from peace_ros.lab.experiment.report.charts import COLOURS, as_svg, draw_charts, save_charts
from peace_ros.lab.experiment.report.moments import RunPictures, run_pictures
from peace_ros.lab.experiment.report.paper import PAPER
from peace_ros.lab.experiment.store import NAME, Row, read_flights, read_identity
from peace_ros.recording.run_folder import write_whole

_TEMPLATE = 'experiment.html.j2'
_GRAVEST = ('unsafe', 'failed', 'unknown', 'timeout', 'no_zone')
"""Order in which failures are shown."""


@dataclass(frozen=True)
class ReportOptions:
    """What a page shows."""

    pictures: int = 12
    """Failures that are shown with pictures."""
    strips: tuple[int, ...] = ()
    """Runs with a filmstrip; without any: the first landing."""
    charts: Path | None = None
    """Folder for the charts as PNG and PDF."""


def write_report(folder: Path, out: Path, options: ReportOptions) -> int:
    """Write the page of an experiment.

    Args:
        folder: of the experiment.
        out: file of the page.
        options: what it shows.

    Returns:
        The number of flights in it.

    Raises:
        RecordingError: the flights cannot be read, or the page not written.
        ConfigurationError: there are no flights yet, or a run that was asked for is not there.
    """
    path = folder / NAME
    rows: list[Row] = read_flights(path).to_pylist()
    if not rows:
        raise ConfigurationError(f'{path} holds no flight yet: run peace experiment first')
    identity = read_identity(path)
    places = [Place(**each) for each in identity['places']]
    groups: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda row: row['run']):
        groups.setdefault(_name(row), []).append(row)
    charts = draw_charts(groups)
    if options.charts is not None:
        save_charts(charts, options.charts)
    failures = sorted(
        (row for row in rows if row['result'] in _GRAVEST and not row['no_zone_right']),
        key=lambda row: (_GRAVEST.index(row['result']), row['run']),
    )
    shown = partial(_pictured, places=places, uses_model=identity['eyes'] == 'model')
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
    )
    environment.filters['interval'] = _interval
    told = figures(rows)
    template = (files(__package__) / 'templates' / _TEMPLATE).read_text('utf-8')
    page = environment.from_string(template).render(
        version=__version__,
        identity=identity,
        places=places,
        command=_command(identity, rows),
        groups=told['groups'],
        paired=told['paired'],
        paper=PAPER,
        colours=COLOURS,
        charts={name: as_svg(figure) for name, figure in charts.items()},
        failures=[shown(row) for row in failures[: options.pictures]],
        further=max(0, len(failures) - options.pictures),
        strips=[shown(row) for row in _chosen(rows, options.strips)],
        rows=rows,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(out, page, 'report')
    return len(rows)


def _name(row: Row) -> str:
    paper = PAPER.get(row['configuration'])
    name = row['configuration'] if paper is None else paper.name
    return name if row['policy'] == 'ours' else f'{name}, {row["policy"]}'


def _chosen(rows: Sequence[Row], runs: tuple[int, ...]) -> list[Row]:
    if not runs:
        return [row for row in rows if row['result'] == 'safe'][:1]
    missing = set(runs) - {row['run'] for row in rows}
    if missing:
        raise ConfigurationError(
            f'run {min(missing)} was not flown: give --strip one of the runs of the experiment'
        )
    return [row for row in rows if row['run'] in runs]


def _pictured(row: Row, places: Sequence[Place], *, uses_model: bool) -> dict[str, Any]:
    """Return a flight with its pictures, or with the sentence that says why there are none."""
    pictures: RunPictures | None = None
    problem, footprint_m = '', LandingParameters().safety_radius_m
    try:
        pipeline = None
        if uses_model:
            pipeline = Pipeline.from_preset(load_preset(row['configuration']), threads=1)
        place = places[row['run'] % len(places)]
        pictures = run_pictures(row, place, footprint_m, pipeline)
    except PeaceError as error:
        problem = str(error)
    return {'row': row, 'name': _name(row), 'pictures': pictures, 'problem': problem}


def _interval(interval: tuple[float, float] | None, scale: float = 1.0, digits: int = 0) -> str:
    if interval is None:
        return ''
    return ' to '.join(f'{scale * each:.{digits}f}' for each in interval)


def _command(identity: dict[str, Any], rows: Sequence[Row]) -> str:
    """Return the command that flies this again."""
    configurations = ','.join(dict.fromkeys(row['configuration'] for row in rows))
    policies = ','.join(dict.fromkeys(row['policy'] for row in rows))
    runs = 1 + max(row['run'] for row in rows)
    return (
        f'peace experiment --runs {runs} --configs {configurations} --policy {policies} '
        f'--eyes {identity["eyes"]} --seed {identity["seed"]} --rate {identity["rate_hz"]:g} '
        f'--latency {identity["latency_s"]:g}'
    )
