# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace demo``: a simulated vehicle is brought down by the real nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def demo(
    *,
    world: Annotated[
        Path | None,
        typer.Option(help='Orthophoto (JPEG, PNG, GeoTIFF); without it a world is drawn.'),
    ] = None,
    gsd: Annotated[
        float | None,
        typer.Option(metavar='M', help='Metres of ground per pixel of --world.'),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            help='Label raster of --world; <name>_label.png beside it is found without this.'
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            metavar='X,Y', help='Start, metres east and north of the centre; default by --seed.'
        ),
    ] = None,
    config: Annotated[
        str, typer.Option(metavar='PRESET', help='Preset: dd_cs, d_cs, peace_cs, or a file.')
    ] = 'peace_cs',
    speed: Annotated[
        float | None,
        typer.Option(help='Simulated seconds per second; default: 2 if this machine keeps up.'),
    ] = None,
    seed: Annotated[int, typer.Option(help='Seed of the drawn world and of the start.')] = 1,
    autopilot: Annotated[
        str | None,
        typer.Option(metavar='KIND', help='What is simulated: ardupilot (default) or px4.'),
    ] = None,
    mavlink: Annotated[
        str | None,
        typer.Option(metavar='URL', help='An autopilot that already runs.'),
    ] = None,
    pose_mavlink: Annotated[
        str | None,
        typer.Option(metavar='URL', help='A second connection to it, which the camera follows.'),
    ] = None,
    camera_px: Annotated[
        int,
        typer.Option(
            metavar='N',
            help='Side of the image; from 704 on it is also seen closer, in parts; takes time.',
        ),
    ] = 352,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Empty or new folder; default runs/<time>-seed<seed>.'),
    ] = None,
    timeout: Annotated[
        float, typer.Option(metavar='S', help='Seconds that the landing may take.')
    ] = 330.0,
) -> None:
    """Fly a simulated vehicle from 100 m to 20 m over a place that the nodes choose by camera.

    Exit status 0 only when it ended over a place that the ground truth does not call unsafe.
    """
    from rich.console import Console

    from peace_ros.simulation.demo.options import DemoOptions, parse_start
    from peace_ros.simulation.demo.run import run_demo

    options = DemoOptions(
        world=world,
        gsd_m=gsd,
        labels=labels,
        start=None if start is None else parse_start(start),
        config=config,
        speed=speed,
        seed=seed,
        autopilot=autopilot,
        mavlink=mavlink,
        pose_mavlink=pose_mavlink,
        camera_px=camera_px,
        run_dir=run_dir,
        timeout_s=timeout,
    )
    raise typer.Exit(run_demo(options, Console()))
