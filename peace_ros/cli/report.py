# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from rich.console import Console
from typer import Argument, Option

from peace_ros.cli.extras import require


def report(
    folder: Annotated[Path, Argument(metavar='DIR', help='Of peace experiment --out.')] = Path(
        'experiment'
    ),
    *,
    out: Annotated[
        Path | None, Option(metavar='FILE', help='The page; default DIR/report.html.')
    ] = None,
    pictures: Annotated[
        int, Option(metavar='N', min=0, max=200, help='Failures shown with pictures.')
    ] = 12,
    strip: Annotated[
        list[int] | None, Option(metavar='RUN', help='Runs shown along their flight; several.')
    ] = None,
    charts: Annotated[
        Path | None, Option(metavar='DIR', help='Write the charts as PNG and PDF here.')
    ] = None,
) -> None:
    """Make one self-contained page of an experiment: tables, charts, failures with pictures."""
    require('pyarrow', 'scipy', 'jinja2', 'matplotlib')
    from peace_ros.lab.experiment.report.page import ReportOptions, write_report

    page, console = out or folder / 'report.html', Console(markup=False)
    with console.status('drawing the pictures'):
        flights = write_report(folder, page, ReportOptions(pictures, tuple(strip or ()), charts))
    console.print(f'{page}: {flights} flights', highlight=False, soft_wrap=True)
