# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a worker does: the flights from one start, over one world, each with a row as result."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import lru_cache

from peace_ros.core.landing import LandingParameters
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.presets import Preset, load_preset
from peace_ros.lab.experiment.dovesei import DoveseiPolicy
from peace_ros.lab.experiment.eyes import Eyes, ModelEyes, TruthEyes
from peace_ros.lab.experiment.flight import Flown, LockStepFlight
from peace_ros.lab.experiment.judge import judge
from peace_ros.lab.experiment.places import DRAWN, Start, draw_start, open_camera
from peace_ros.lab.experiment.policies import OurPolicy, Policy
from peace_ros.lab.experiment.settings import ExperimentSettings, FlightKey
from peace_ros.lab.experiment.store import Row
from peace_ros.simulation.camera import NadirCamera

_PIPELINES = 1
"""That a worker keeps loaded: loading one takes 0.2 s, keeping two takes much memory."""


def fly_run(settings: ExperimentSettings, keys: Sequence[FlightKey]) -> list[Row]:
    """Fly from the start of one run.

    Args:
        settings: of the experiment.
        keys: the flights, all of one run; they share the world.

    Raises:
        PeaceError: the world or a configuration cannot be used.
    """
    run = keys[0].run
    place = settings.place_of(run)
    world = None if place.world == DRAWN else place.load()
    start = draw_start(place, settings.seed, run, world)
    options = {load_preset(each).name: each for each in settings.configurations}
    begun = time.process_time(), time.monotonic()
    camera = open_camera(place, start, CameraOptions().camera)
    rows = []
    for key in keys:
        preset = load_preset(options[key.configuration])
        row = _fly(settings, key, preset, camera, start)
        now = time.process_time(), time.monotonic()
        row['core_s'], row['wall_s'] = now[0] - begun[0], now[1] - begun[1]
        row['world'] = place.world
        begun = now
        rows.append(row)
    return rows


def _fly(
    settings: ExperimentSettings, key: FlightKey, preset: Preset, camera: NadirCamera, start: Start
) -> Row:
    condition = settings.place_of(key.run).condition
    eyes: Eyes = TruthEyes(settings.error_rate, start.seed)
    if settings.eyes == 'model':
        eyes = ModelEyes(_pipeline(str(preset.path)), condition, start.seed)
    policy: Policy = OurPolicy(preset, camera.camera)
    if key.policy == 'dovesei':
        policy = DoveseiPolicy(camera.camera)
    flight = LockStepFlight(
        camera, start, eyes, policy, settings.perception, limit_s=settings.limit_s
    )
    flown = flight.run()
    judgement = judge(flown, camera, preset.fill('landing', LandingParameters))
    return {
        **vars(key),
        'world_seed': start.seed,
        'start_east_m': start.east_m,
        'start_north_m': start.north_m,
        'start_heading_rad': start.heading_rad,
        **vars(judgement),
        'reason': flown.reason,
        'time_s': flown.time_s,
        'attempts': flown.attempts,
        'heatmaps': flown.heatmaps,
        'miou': flown.seen.miou,
        'state_s': list(flown.state_s.items()),
        **_track(flown),
    }


def _track(flown: Flown) -> Row:
    poses = [each.pose for each in flown.track]
    return {
        'track_time_s': [each.time_s for each in flown.track],
        'track_east_m': [pose.east_m for pose in poses],
        'track_north_m': [pose.north_m for pose in poses],
        'track_altitude_m': [pose.altitude_agl_m for pose in poses],
        'track_state': [each.state for each in flown.track],
        'end_quaternion_ned_frd': list(poses[-1].quaternion_ned_frd),
    }


@lru_cache(maxsize=_PIPELINES)
def _pipeline(preset: str) -> Pipeline:
    # One thread: the workers share the processor among them.
    return Pipeline.from_preset(preset, threads=1)
