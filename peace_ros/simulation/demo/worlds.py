# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The world of a demo: drawn from a seed or loaded, and where in it the vehicle starts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from peace_ros.core.domain import RecordingError
from peace_ros.recording import save_picture
from peace_ros.simulation.demo.options import DemoOptions
from peace_ros.simulation.world import World, draw_world, load_world

SIZE_M = 400.0
GSD_M = 0.1
_START_WITHIN = 0.15
"""The start lies within this part of the size of the world around its centre: from 100 m the
camera sees 74 m to each side, and the search goes farther."""


@dataclass(frozen=True)
class DemoWorld:
    """A world with its files and the start, which is the local origin."""

    world: World
    image_file: Path
    label_file: Path | None
    start_east_m: float
    start_north_m: float
    note: str
    """What the user should know of it."""


def prepare_world(options: DemoOptions, run_dir: Path) -> DemoWorld:
    """Draw or load the world; a drawn one is written into the run folder.

    Raises:
        WorldError: an image or label raster cannot be used.
        RecordingError: the run folder cannot be written to.
    """
    label_file: Path | None
    if options.world is None:
        world = draw_world(options.seed, SIZE_M, GSD_M)
        image_file = run_dir / 'world.jpg'
        label_file = run_dir / 'world_label.png'
        _save(world, image_file, label_file)
        note = f'drawn from seed {options.seed}, {SIZE_M:.0f} m at {GSD_M} m per pixel'
    else:
        image_file = options.world.resolve()
        found = options.label_file()
        label_file = found.resolve() if found is not None else None
        world = load_world(image_file, options.gsd_m, label_file)
        note = f'{image_file.name}, {_size(world)} at {world.gsd_m:g} m per pixel, '
        note += 'without ground truth' if label_file is None else f'labels {label_file.name}'
        if label_file is not None and options.labels is None:
            note += ' (found beside it)'
    east_m, north_m = options.start_m or _drawn_start(world, options.seed)
    placed = replace(world, centre_east_m=-east_m, centre_north_m=-north_m)
    return DemoWorld(placed, image_file, label_file, east_m, north_m, note)


def _save(world: World, image_file: Path, label_file: Path) -> None:
    if world.labels is None:
        raise RecordingError(f'world {world.name} was drawn without labels: it cannot be judged')
    save_picture(world.image_rgb, image_file)
    save_picture(world.labels, label_file)


def _size(world: World) -> str:
    east_m, north_m = world.size_m
    return f'{east_m:.0f} x {north_m:.0f} m'


def _drawn_start(world: World, seed: int) -> tuple[float, float]:
    draw = np.random.default_rng([seed, 0x57A27])
    east_m, north_m = draw.uniform(-_START_WITHIN, _START_WITHIN, 2) * world.size_m
    return round(float(east_m), 1), round(float(north_m), 1)
