# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace replay``: the cores over a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from peace_ros.cli.options import with_options
from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.replay import ReplayOptions, SourceOptions
from peace_ros.lab.replay.console import (
    compare_in_terminal,
    compare_presets_in_terminal,
    replay_in_terminal,
)
from peace_ros.lab.replay.excerpt import Excerpt
from peace_ros.lab.replay.regression import GoldenOptions

EXIT_FAILED = 1


@with_options(SourceOptions)
def replay(
    *,
    options: SourceOptions,
    source: Annotated[Path, typer.Argument(help='Bag (folder, .mcap, .db3) or video file.')],
    config: Annotated[
        str | None,
        typer.Option(
            metavar='PRESET',
            help='Preset or file; default: what a file of the flight recorder says, else peace_cs.',
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Empty or new folder; default runs/<source>_replay.'),
    ] = None,
    assign: Annotated[
        list[str] | None,
        typer.Option(
            '--set',
            metavar='NODE.PARAMETER=VALUE',
            help='Another value than that of the preset, as landing.safety_threshold=0.7; repeat '
            'it for several.',
        ),
    ] = None,
    segment: Annotated[
        str | None,
        typer.Option(metavar='START:END', help='Seconds since the first frame; default: all.'),
    ] = None,
    engage_at: Annotated[
        float | None,
        typer.Option(
            metavar='S',
            help='Begin the landing so long after the first frame; default: when the recorded '
            'landing began, else at once.',
        ),
    ] = None,
    compare: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar='A B',
            help='Replay with two presets or parameter files and write a page that compares '
            'them; --set counts for B alone.',
        ),
    ] = None,
    golden: Annotated[
        Path | None,
        typer.Option(
            metavar='FILE',
            help='Compare prompts, heatmaps, states, sites and set-points with this file; exit 1 '
            'on a difference. It is made when it does not exist.',
        ),
    ] = None,
    remake_golden: Annotated[
        bool, typer.Option('--remake-golden', help='Write the file of --golden anew.')
    ] = False,
    junit: Annotated[
        Path | None,
        typer.Option(metavar='FILE', help='Write the comparison as JUnit XML; with --golden.'),
    ] = None,
) -> None:
    """Run prompts, segmentation and landing over a recording; the vehicle cannot be moved."""
    console = Console(markup=False)
    replayed = ReplayOptions(
        source,
        config,
        out,
        options,
        tuple(assign or ()),
        Excerpt() if segment is None else Excerpt.parse(segment),
        engage_at,
    )
    if golden is None and (remake_golden or junit is not None):
        raise ConfigurationError('--remake-golden and --junit compare nothing: give --golden')
    if compare is not None:
        if golden is not None or config is not None:
            raise ConfigurationError('--compare names both presets: leave out --config, --golden')
        compare_presets_in_terminal(replayed, compare, console)
    elif golden is None:
        replay_in_terminal(replayed, console)
    elif not compare_in_terminal(replayed, GoldenOptions(golden, remake_golden, junit), console):
        raise typer.Exit(EXIT_FAILED)
