# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ground of the matrix: open where it shall be open, and nowhere when it is crowded."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import ConfigurationError, is_safe
from peace_ros.core.landing import LandingParameters
from peace_ros.lab.faults import worlds
from peace_ros.simulation.world import World


def widest_m(world: World) -> float:
    assert world.labels is not None
    safe = is_safe(world.labels).astype(np.uint8)
    return float(cv2.distanceTransform(safe, cv2.DIST_L2, 5).max()) * world.gsd_m


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp('worlds')
    worlds.prepare(place)
    return place


def test_the_meadow_is_open_and_the_crowd_leaves_no_site(folder: Path) -> None:
    needed_m = LandingParameters().required_clearance_m(50.0)
    assert widest_m(worlds.load(folder, 'meadow').world) > 3.0 * needed_m
    assert widest_m(worlds.load(folder, 'crowded').world) < needed_m


@pytest.mark.parametrize(('name', 'safe'), [('meadow', True), ('roofs', False)])
def test_the_start_lies_over_what_the_name_says(folder: Path, name: str, safe: bool) -> None:
    ground = worlds.load(folder, name)
    world = ground.world
    column, row = (round(each) for each in world.pixel(*ground.begin_m))
    assert world.labels is not None
    around = world.labels[row - 30 : row + 31, column - 30 : column + 31]
    assert bool(is_safe(around).mean() > 0.95) is safe
    assert min(column, row) * world.gsd_m > 37.0


def test_both_begin_at_the_same_place(folder: Path) -> None:
    meadow, crowded = (worlds.load(folder, name) for name in ('meadow', 'crowded'))
    assert (meadow.origin_east_m, meadow.origin_north_m) == (
        crowded.origin_east_m,
        crowded.origin_north_m,
    )


def test_flights_begin_away_from_the_origin_over_the_same_ground(folder: Path) -> None:
    away, at_origin = (worlds.load(folder, 'meadow', begin) for begin in (worlds.BEGIN_M, (0, 0)))
    assert min(abs(each) for each in away.begin_m) > 10.0
    there, here = away.world.pixel(*away.begin_m), at_origin.world.pixel(0.0, 0.0)
    assert there == pytest.approx(here)


def test_another_world_is_refused(folder: Path) -> None:
    with pytest.raises(ConfigurationError, match='moon'):
        worlds.load(folder, 'moon')
