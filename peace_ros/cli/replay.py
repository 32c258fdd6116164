# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace replay``: the cores over a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from peace_ros.cli.options import with_options
from peace_ros.lab.replay import ReplayOptions, SourceOptions
from peace_ros.lab.replay.console import replay_in_terminal


@with_options(SourceOptions)
def replay(
    *,
    options: SourceOptions,
    source: Annotated[Path, typer.Argument(help='Bag (folder, .mcap, .db3) or video file.')],
    config: Annotated[str, typer.Option(metavar='PRESET', help='Preset or file.')] = 'peace_cs',
    out: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Empty or new folder; default runs/<source>_replay.'),
    ] = None,
) -> None:
    """Run prompts, segmentation and landing over a recording; the vehicle cannot be moved."""
    replay_in_terminal(ReplayOptions(source, config, out, options), Console(markup=False))
