# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace words``."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.lab.evaluation.words import load_frames, measure
from peace_ros.recording.run_folder import write_whole


def words(
    images: Annotated[Path, typer.Argument(metavar='DIR', help='Folder of clear aerial images.')],
    clip: Annotated[str, typer.Option(metavar='BUNDLE', help='CLIP bundle.')] = 'clip-small',
    strength: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, help='Of the conditions; default: 0.35 to 1 at random.'),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help='Of their variation.')] = 0,
    limit: Annotated[int, typer.Option(min=1, help='At most so many images.')] = 200,
    json_file: Annotated[
        Path | None, typer.Option('--json', metavar='FILE', help='Write the figures here.')
    ] = None,
) -> None:
    """Measure how often CLIP names the condition that a frame was put under, of ten."""
    frames = load_frames(images)[:limit]
    encoder = ClipEncoder(Bundle.load(clip))
    console = Console(markup=False)
    watch = partial(track, description='images', console=console, transient=True)
    figures = measure(frames, encoder, seed=seed, strength=strength, watch=watch)
    table = Table('condition', 'named first', 'most often taken for')
    for row, (word, share) in enumerate(figures.right_by_word.items()):
        others = figures.counts[row].copy()
        others[row] = 0
        wrong = figures.words[int(others.argmax())] if others.any() else ''
        table.add_row(word, f'{100 * share:.0f} %', wrong)
    console.print(table)
    console.print(f'right word first: {100 * figures.right:.1f} % of {figures.counts.sum()} frames')
    if json_file is not None:
        write_whole(json_file, json.dumps(figures.as_json(), indent=2) + '\n', 'figures')
