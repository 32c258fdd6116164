# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace demo``: a simulated vehicle is brought down by the real nodes."""

from __future__ import annotations

import typer
from rich.console import Console

from peace_ros.cli.extras import require
from peace_ros.cli.options import with_options
from peace_ros.simulation.demo.options import DemoOptions


@with_options(DemoOptions)
def demo(*, options: DemoOptions) -> None:
    """Fly a simulated vehicle from 100 m to 20 m over a place that the nodes choose by camera.

    Exit status 0 only when it ended over a place that the ground truth does not call unsafe.
    """
    if options.watch:
        require('starlette', 'uvicorn', 'websockets')
    from peace_ros.simulation.demo.run import run_demo

    raise typer.Exit(run_demo(options, Console(markup=False)))
