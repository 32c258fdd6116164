# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the flights of an experiment begin: a world and a start for each run.

A start depends on the seed and on the number of the run only, so that each configuration and each
policy gets the same ones, however many workers there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, tan
from pathlib import Path

import numpy as np

from peace_ros.core.domain import Camera, ConfigurationError, WorldError
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.drawing import CONDITIONS
from peace_ros.simulation.drawing.town import MIXED, check_town
from peace_ros.simulation.town_camera import TownCamera
from peace_ros.simulation.world import World, load_world

START_ALTITUDE_M = 100.0
SIZE_M, GSD_M = 600.0, 0.1
"""Of drawn worlds: large enough that a search does not see the edge."""
DRAWN = 'drawn'
_DRAWN_WITHIN_M = 20.0
_SEEDS_OF_AN_EXPERIMENT = 100_000


@dataclass(frozen=True)
class Place:
    """The ground that runs fly over."""

    world: str = DRAWN
    """`drawn`, or the file of an orthophoto; its labels lie beside it as `<name>_label.png`."""
    gsd_m: float | None = None
    """Metres per pixel of the file; None: its georeference says it."""
    district: str = MIXED
    """Of a drawn world, one of DISTRICTS."""
    season: str = ''
    """Of a drawn world; empty: the seed of each run chooses."""
    condition: str = 'clear'
    """Weather, light or image quality of every view, one of CONDITIONS."""

    def __post_init__(self) -> None:
        check_town(self.district, self.season)
        if self.condition not in CONDITIONS:
            raise WorldError(f'condition {self.condition!r}: choose one of {", ".join(CONDITIONS)}')
        if self.world == DRAWN:
            return
        if self.season or self.district != MIXED:
            raise ConfigurationError(
                f'district and season belong to drawn worlds, not to {self.world}: leave them out'
            )
        if not self.path.is_file():
            raise ConfigurationError(
                f'world {self.world}: no such file; give an orthophoto, or {DRAWN}'
            )
        if not self.label_file.is_file():
            raise ConfigurationError(
                f'world {self.world} has no labels, which judge the landings: put '
                f'{self.label_file.name} beside it'
            )

    @property
    def path(self) -> Path:
        """The file of the orthophoto."""
        return Path(self.world)

    @property
    def label_file(self) -> Path:
        """The label raster beside it."""
        return self.path.with_name(f'{self.path.stem}_label.png')

    def load(self) -> World:
        """Read the orthophoto and its labels.

        Raises:
            WorldError: a file cannot be used, or the labels do not fit.
        """
        return load_world(self.path, self.gsd_m, self.label_file)


@dataclass(frozen=True)
class Start:
    """Where one run begins; the local origin of the vehicle lies below."""

    run: int
    seed: int
    """Of the drawn world, the gusts and the errors of heatmaps made from labels."""
    east_m: float
    """From the middle of the world."""
    north_m: float
    heading_rad: float


def draw_start(place: Place, seed: int, run: int, world: World | None = None) -> Start:
    """Return the start of a run.

    Args:
        place: the world; the start keeps the first view of an orthophoto inside it, where it can.
        seed: of the experiment, 0 or more.
        run: number of the run, 0 or more.
        world: of an orthophoto.
    """
    draw = np.random.default_rng([seed, run, 0x57A27])
    east_m, north_m = draw.uniform(-1.0, 1.0, 2)
    heading_rad = float(draw.uniform(-pi, pi))
    reach_m = np.array([_DRAWN_WITHIN_M, _DRAWN_WITHIN_M])
    if place.world != DRAWN and world is not None:
        seen_m = START_ALTITUDE_M * tan(radians(CameraOptions().camera_fov) / 2.0)
        reach_m = np.maximum(np.array(world.size_m) / 2.0 - seen_m, 0.15 * np.array(world.size_m))
    return Start(
        run=run,
        seed=seed * _SEEDS_OF_AN_EXPERIMENT + run,
        east_m=round(float(east_m * reach_m[0]), 1),
        north_m=round(float(north_m * reach_m[1]), 1),
        heading_rad=heading_rad,
    )


def open_camera(place: Place, start: Start, camera: Camera) -> NadirCamera:
    """Return the camera over the world of a start, in the local frame of the vehicle.

    Raises:
        WorldError: the world cannot be used.
    """
    centre_m = (-start.north_m, -start.east_m)
    if place.world == DRAWN:
        return TownCamera(start.seed, camera, SIZE_M, GSD_M, centre_m, place.district, place.season)
    world = place.load()
    return NadirCamera(
        World(world.image_rgb, world.labels, world.gsd_m, world.name, *centre_m), camera
    )
