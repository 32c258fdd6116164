# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace replay``: the cores over a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def replay(
    *,
    source: Annotated[Path, typer.Argument(help='Bag (folder, .mcap, .db3) or video file.')],
    image_topic: Annotated[
        str | None,
        typer.Option(help='Image or CompressedImage; default: the only one, or /image.'),
    ] = None,
    pose_topic: Annotated[
        str | None,
        typer.Option(help='PoseStamped, PoseWithCovarianceStamped or Odometry, in ENU.'),
    ] = None,
    config: Annotated[str, typer.Option(metavar='PRESET', help='Preset or file.')] = 'peace_cs',
    out: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Empty or new folder; default runs/<source>_replay.'),
    ] = None,
    fov: Annotated[
        float | None,
        typer.Option(
            metavar='DEG', help='Full horizontal field of view; default camera_info, else 73.'
        ),
    ] = None,
    altitude: Annotated[
        str, typer.Option(metavar='START:END', help='Metres, linear over the file; for videos.')
    ] = '100:20',
    every: Annotated[int, typer.Option(metavar='N', help='Take every N-th frame.')] = 1,
    hz: Annotated[
        float | None,
        typer.Option(metavar='HZ', help='Take at most HZ frames per recorded second.'),
    ] = None,
    limit: Annotated[
        int | None,
        typer.Option(metavar='N', help='Stop after N frames.'),
    ] = None,
) -> None:
    """Run prompts, segmentation and landing over a recording; the vehicle cannot be moved."""
    from rich.console import Console

    from peace_ros.lab.replay import ReplayOptions, SourceOptions
    from peace_ros.lab.replay.console import replay_in_terminal

    part = SourceOptions(
        image_topic=image_topic,
        pose_topic=pose_topic,
        fov_x_deg=fov,
        altitude=altitude,
        every=every,
        hz=hz,
        limit=limit,
    )
    replay_in_terminal(ReplayOptions(source, config, out, part), Console())
