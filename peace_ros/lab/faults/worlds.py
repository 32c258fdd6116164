# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ground of the matrix: drawn once, and where over it a flight begins."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from peace_ros.core.domain import ConfigurationError, is_safe
from peace_ros.recording import save_picture
from peace_ros.simulation.drawing.canvas import Canvas
from peace_ros.simulation.drawing.plan import Thing
from peace_ros.simulation.drawing.sprites import label_of, stamp_thing
from peace_ros.simulation.drawing.window import DrawnWindow
from peace_ros.simulation.world import World, draw_world, load_world

SEED = 2
SIZE_M = 240.0
GSD_M = 0.1
WORLDS = ('meadow', 'crowded', 'roofs')
BEGIN_M = (-24.0, -17.0)
"""North and east of the local origin, where a flight begins: at the origin errors of sign hide."""
_MARGIN_M = 40.0
"""The camera sees 37 m to each side from 50 m: the start keeps so far from the edge."""
_SPACING_M = 5.0
_CAR_M = (4.4, 1.8)
_COLOURS = ((188.0, 30.0, 34.0), (235.0, 235.0, 232.0), (30.0, 34.0, 40.0), (36.0, 62.0, 120.0))


@dataclass(frozen=True)
class FaultWorld:
    """One world with its files and the start, which is the local origin."""

    world: World
    """Its centre is placed so that flights begin over the ground that was looked for."""
    image_file: Path
    label_file: Path
    origin_east_m: float
    """Of the local frame, from the centre of the world."""
    origin_north_m: float
    begin_m: tuple[float, float]
    """North and east in the local frame."""


def prepare(folder: Path) -> None:
    """Draw the worlds into a folder, unless they are there.

    Raises:
        WorldError: the world cannot be drawn.
        RecordingError: the folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if all(file.is_file() for name in ('meadow', 'crowded') for file in _files(folder, name)):
        return
    meadow = draw_world(SEED, SIZE_M, GSD_M)
    for name, world in (('meadow', meadow), ('crowded', crowded(meadow))):
        if world.labels is not None:
            image_file, label_file = _files(folder, name)
            save_picture(world.image_rgb, image_file)
            save_picture(world.labels, label_file)


def load(folder: Path, name: str, begin_m: tuple[float, float] = BEGIN_M) -> FaultWorld:
    """Return a world of a prepared folder, for flights that begin there in the local frame.

    Raises:
        ConfigurationError: there is no world of that name.
        WorldError: its files cannot be used.
    """
    if name not in WORLDS:
        raise ConfigurationError(f'world {name!r}: choose one of {", ".join(WORLDS)}')
    image_file, label_file = _files(folder, 'meadow' if name == 'roofs' else name)
    world = load_world(image_file, GSD_M, label_file)
    # The crowded world begins where the meadow was.
    reference = load_world(_files(folder, 'meadow')[0], GSD_M, _files(folder, 'meadow')[1])
    north_m, east_m = _start(reference, over_safe_ground=name != 'roofs')
    origin_north_m, origin_east_m = north_m - begin_m[0], east_m - begin_m[1]
    placed = replace(world, centre_east_m=-origin_east_m, centre_north_m=-origin_north_m)
    return FaultWorld(placed, image_file, label_file, origin_east_m, origin_north_m, begin_m)


def crowded(world: World) -> World:
    """Return the world with a car every few metres, wherever the ground was safe."""
    labels = world.labels
    if labels is None:
        raise ConfigurationError(f'world {world.name} has no labels: there is nothing to occupy')
    height, width = labels.shape
    canvas = Canvas(DrawnWindow(0.0, 0.0, width, height, world.gsd_m), SEED)
    canvas.rgb[:] = world.image_rgb
    canvas.labels[:] = labels
    random = np.random.default_rng(SEED)
    for x_m in np.arange(0.5 * _SPACING_M, width * world.gsd_m, _SPACING_M):
        for y_m in np.arange(0.5 * _SPACING_M, height * world.gsd_m, _SPACING_M):
            x, y = (float(each + random.uniform(-0.4, 0.4)) for each in (x_m, y_m))
            pixel = labels[
                min(height - 1, int(y / world.gsd_m)), min(width - 1, int(x / world.gsd_m))
            ]
            if is_safe(np.array([pixel], np.uint8))[0]:
                rgb = _COLOURS[int(random.integers(len(_COLOURS)))]
                turn = float(random.uniform(0.0, 2.0 * np.pi))
                thing = Thing('saloon', x, y, turn, *_CAR_M, rgb, label_of('saloon'))
                stamp_thing(canvas, thing)
    image = np.clip(np.rint(canvas.rgb), 0.0, 255.0).astype(np.uint8)
    return replace(world, image_rgb=image, labels=canvas.labels, name=f'{world.name}-crowded')


def _files(folder: Path, name: str) -> tuple[Path, Path]:
    return folder / f'{name}.jpg', folder / f'{name}_label.png'


def _start(world: World, *, over_safe_ground: bool) -> tuple[float, float]:
    """Return north, east of the centre: deepest inside safe ground, or inside what is not."""
    if world.labels is None:
        raise ConfigurationError(f'world {world.name} has no labels: it cannot be judged')
    inside = is_safe(world.labels) == over_safe_ground
    depth = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    margin = round(_MARGIN_M / world.gsd_m)
    inner = depth[margin:-margin, margin:-margin]
    row, column = np.unravel_index(int(inner.argmax()), inner.shape)
    north_m, east_m = world.place(float(column + margin), float(row + margin))
    return round(north_m, 1), round(east_m, 1)
