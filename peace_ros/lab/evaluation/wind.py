# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Landings in wind with gusts: distance to the site, lowest altitude, and swing.

``python -m peace_ros.lab.evaluation.wind --seeds 12`` flies the landing core against the physics
and the GUIDED mode of the simulated autopilot, in simulated time: wind leans the vehicle and its
camera, gusts push it. Poses are late by what a line takes, heatmaps by what a network takes; the
heatmaps are those of a modest model (smooth errors) over one safe island.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import cos, hypot, inf, pi, sin
from pathlib import Path
from time import monotonic

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import (
    NADIR,
    Camera,
    Heatmap,
    HeightReport,
    Label,
    Mount,
    Pose,
    Site,
    Telemetry,
)
from peace_ros.core.landing import Decision, LandingCore, LandingParameters, State
from peace_ros.core.mapping import MapParameters
from peace_ros.recording.run_folder import write_whole
from peace_ros.simulation.autopilot.estimate_errors import (
    PX4_ERRORS,
    EstimateErrors,
    GnssAltitudeError,
)
from peace_ros.simulation.autopilot.hovering import hovering, velocity_target
from peace_ros.simulation.autopilot.personality import Kind, Personality
from peace_ros.simulation.autopilot.physics import Physics
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.world import World

ERROR_LIMIT_M = 1.5
OVERSHOOT_LIMIT_M = 1.0
SWING_LIMIT_M = 1.0
"""Distance to and fro of a vehicle that circles its site instead of hovering over it."""
START_M = 60.0
ISLAND_M = 12.0
"""Radius of the safe ground."""
_TICK_S = 0.01
_POSE_S = 0.03
_STEP_S = 0.05
_LINE_DELAY_S = 0.04
_LATENCY_S = 0.3
_LIMIT_S = 150.0
_AFTER_S = 10.0
"""Time observed after the hand-over, in which gusts go on."""
_LAST_S = 10.0
"""End of the descent, in which the vehicle must hover over the site."""
_PIXELS = 96
_DRAWN_PX = 320
"""Longer edge of the pictures from which heatmaps are made."""
_CELL_M = 0.25
_HALF_M = 100.0
_SAFE, _UNSAFE = 0.9, 0.1
_SAFE_SCORE = 0.5
"""Of the map; above, a cell is more likely safe than not."""
_NOISE, _NOISE_PX = 0.15, 5.0
"""Standard deviation and width of the errors of the heatmaps."""


@dataclass(frozen=True)
class Landed:
    """One flight."""

    seed: int
    handed_over: bool
    seconds: float
    error_m: float
    """True distance to the middle of the site at the hand-over."""
    worst_after_m: float
    """True distance to the same place, the largest of the seconds after it."""
    lowest_m: float
    """True altitude, until those seconds are over."""
    swing_m: float
    """To and fro over the ground, the larger of both axes, in the last seconds of the descent."""
    attempts: int
    off_m: float
    """Distance from the reported to the true position at the hand-over."""
    off_swing_m: float
    """As ``swing_m``, of that error alone: a vehicle that follows it swings so far."""
    clearance_m: float
    """True distance from the vehicle to unsafe ground at the hand-over."""

    @property
    def is_good(self) -> bool:
        """Whether it kept the limits.

        A landing steers by the reported position, and cannot know what that is off by: this is
        granted beside the limits of error and swing. The true place counts where it matters: over
        safe ground, with the radius of the vehicle, and not too low.
        """
        p = LandingParameters()
        return (
            self.handed_over
            and self.error_m <= ERROR_LIMIT_M + self.off_m
            and self.swing_m <= SWING_LIMIT_M + self.off_swing_m
            and self.clearance_m >= p.safety_radius_m
            and self.lowest_m >= p.handover_altitude_m - OVERSHOOT_LIMIT_M
        )


class WindFlight:
    """One vehicle with its landing, in simulated time.

    Args:
        wind_m_s: Mean speed of the wind; its direction comes from the seed.
        gust_m_s: Standard deviation of the gusts.
        seed: Of gusts, direction, place of the island and errors of the heatmaps.
        heatmap_hz: Heatmaps per second.
        px4_errors: Above 0: fly as PX4, with so many times its measured errors.
        camera: What looks down, with its lens; None: a small square pinhole.
        mount: How it is mounted.
        start_m: Height at which the flight begins.
        gnss_noise_m: Standard deviation of the GNSS altitude.
    """

    def __init__(
        self,
        wind_m_s: float,
        gust_m_s: float,
        seed: int,
        heatmap_hz: float = 5.0,
        px4_errors: float = 0.0,
        camera: Camera | None = None,
        mount: Mount = NADIR,
        start_m: float = START_M,
        gnss_noise_m: float = 0.0,
    ) -> None:
        self._random = np.random.default_rng(seed)
        self._seed, self._heatmap_s = seed, 1.0 / heatmap_hz
        way = float(self._random.uniform(0.0, 2.0 * pi))
        wind = (wind_m_s * cos(way), wind_m_s * sin(way))
        physics = Physics(wind_to_m_s=wind, gust_m_s=gust_m_s, seed=seed)
        kind = Kind.PX4 if px4_errors > 0.0 else Kind.ARDUPILOT
        errors = EstimateErrors(PX4_ERRORS.times(px4_errors), seed)
        gnss = GnssAltitudeError(gnss_noise_m, seed)
        self._flight = hovering(physics, start_m, Personality(kind), errors, gnss)
        square = Camera.from_degrees(_PIXELS, _PIXELS, 73)
        self._camera = camera
        self._over_ground = self._seeing(square if camera is None else camera, mount)
        # What the frames are comes with them; the parameters of the landing describe the square.
        self._core = LandingCore(
            LandingParameters(), square, MapParameters(map_size_m=160.0), mount
        )
        self._core.engage()
        self._poses: deque[tuple[float, Pose, tuple[float, float, float]]] = deque()
        self._heatmaps: deque[tuple[float, Heatmap]] = deque()
        self._telemetry = Telemetry(received_ns=0)
        self._told_s = self._now_s
        self._due_s = dict.fromkeys(('pose', 'heatmap', 'step'), self._now_s)
        self._lowest_m = start_m
        self.track: list[tuple[float, float, float, Decision]] = []
        """Time, true north and east, and the decision of each step."""
        self._off: list[tuple[float, float]] = []
        """Reported minus true north and east of each step."""
        self.clearances_m = (0.0, 0.0)
        """At the end of the landing: of the site by the map, and the true one below the vehicle."""

    def map_error_m(self) -> float:
        """Return how far the middle of the largest safe ground of the map is from the island's."""
        layers = self._core.safety_map.layers(round(self._now_s * 1e9))
        safe = (layers.score > _SAFE_SCORE).astype(np.uint8)
        count, _, sizes, centres = cv2.connectedComponentsWithStats(safe)
        if count < 2:
            return inf
        column, row = centres[1 + int(np.argmax(sizes[1:, cv2.CC_STAT_AREA]))]
        north, east = layers.centre_of(row, column)
        return hypot(north - self.island_m[0], east - self.island_m[1])

    @property
    def _now_s(self) -> float:
        return self._flight.time_s

    def run(self) -> Landed:
        """Fly until the landing is over, and a little longer."""
        begin_s = self._now_s
        outcome = None
        while outcome is None and self._now_s < begin_s + _LIMIT_S:
            self._tick()
            outcome = self.track[-1][3].outcome if self.track else None
        over_s, at = self._now_s, len(self.track) - 1
        site = self.track[at][3].site
        physics = self._flight.physics
        true_m = self._over_ground.clearance_m(physics.north_m, physics.east_m)
        self.clearances_m = (0.0 if site is None else site.clearance_m, true_m or 0.0)
        while self._now_s < over_s + _AFTER_S:
            self._tick()
        return Landed(
            seed=self._seed,
            handed_over=outcome == 'handover',
            seconds=round(over_s - begin_s, 1),
            error_m=round(self._error_m(at, site), 3),
            off_m=round(hypot(*self._off[at]), 3),
            off_swing_m=round(self._swing_m(over_s, of_error=True), 3),
            clearance_m=round(true_m or 0.0, 3),
            worst_after_m=round(max(self._error_m(n, site) for n in range(at, len(self.track))), 3),
            lowest_m=round(self._lowest_m, 3),
            swing_m=round(self._swing_m(over_s), 3),
            attempts=self.track[-1][3].attempts,
        )

    def _tick(self) -> None:
        if self._is_due('pose', _POSE_S):
            self._report()
        if self._is_due('heatmap', self._heatmap_s):
            self._look()
        self._receive()
        if self._is_due('step', _STEP_S):
            self._decide()
        self._flight.step(_TICK_S)
        self._lowest_m = min(self._lowest_m, -self._flight.physics.down_m)

    def _is_due(self, name: str, period_s: float) -> bool:
        if self._now_s + 1e-9 < self._due_s[name]:
            return False
        self._due_s[name] += period_s
        return True

    def _pose(self) -> Pose:
        north, east, down = self._flight.position_m
        q = self._flight.physics.quaternion_ned_frd
        return Pose(round(self._now_s * 1e9), north, east, down, q, -down)

    def _seen_from(self) -> Pose:
        """Return the pose of now with the true height."""
        return replace(self._pose(), altitude_agl_m=-self._flight.physics.down_m)

    def _heights(self) -> tuple[HeightReport, ...]:
        """Return what other sources than the barometer report now."""
        return ()

    def _report(self) -> None:
        velocity = self._flight.velocity_m_s
        self._poses.append((self._now_s + _LINE_DELAY_S, self._pose(), velocity))

    def _look(self) -> None:
        pose = self._seen_from()
        size = (_PIXELS, _PIXELS)
        labels = self._over_ground.view(pose).labels
        safe = np.where(labels == Label.GRASS, np.float32(_SAFE), np.float32(_UNSAFE))
        true = cv2.resize(safe, size, interpolation=cv2.INTER_AREA)
        noise = cv2.GaussianBlur(self._random.standard_normal(size), (0, 0), _NOISE_PX)
        safety = np.clip(true + _NOISE * noise / noise.std(), 0.0, 1.0).astype(np.float32)
        seen_by = self._camera
        size_px = None if seen_by is None else (seen_by.width_px, seen_by.height_px)
        heatmap = Heatmap(safety, pose.stamp_ns, size_px, seen_by)
        self._heatmaps.append((self._now_s + _LATENCY_S, heatmap))

    def _receive(self) -> None:
        while self._poses and self._poses[0][0] <= self._now_s:
            _, pose, velocity = self._poses.popleft()
            self._core.add_pose(pose)
            self._told_s = self._now_s
            self._telemetry = Telemetry(
                received_ns=1,
                pose=pose,
                v_north_m_s=velocity[0],
                v_east_m_s=velocity[1],
                v_down_m_s=velocity[2],
                armed=True,
                in_control=True,
                mode='GUIDED',
                landed=False,
                heights=self._heights(),
            )
        while self._heatmaps and self._heatmaps[0][0] <= self._now_s:
            self._core.add_heatmap(self._heatmaps.popleft()[1])

    def _decide(self) -> None:
        age_s = self._now_s - self._told_s
        decision = self._core.step(round(self._now_s * 1e9), self._telemetry, age_s)
        physics = self._flight.physics
        self.track.append((self._now_s, physics.north_m, physics.east_m, decision))
        north, east, _ = self._flight.position_m
        self._off.append((north - physics.north_m, east - physics.east_m))
        self._flight.take_velocity(velocity_target(decision.setpoint))

    def _error_m(self, index: int, site: Site | None) -> float:
        _, north, east, _ = self.track[index]
        return inf if site is None else hypot(site.north_m - north, site.east_m - east)

    def _swing_m(self, over_s: float, *, of_error: bool = False) -> float:
        places = [
            off if of_error else (north, east)
            for (at_s, north, east, decision), off in zip(self.track, self._off, strict=True)
            if over_s - _LAST_S <= at_s <= over_s and decision.state is State.LANDING
        ]
        return to_and_fro_m(np.array(places).reshape(-1, 2))

    def _seeing(self, camera: Camera, mount: Mount) -> NadirCamera:
        """Return the camera over the ground, which is unsafe but for an island."""
        cells = round(2.0 * _HALF_M / _CELL_M)
        labels = np.full((cells, cells), Label.BUILDING, np.uint8)
        north, east = map(float, self._random.uniform(-15.0, 15.0, size=2))
        centre = (round((_HALF_M + east) / _CELL_M), round((_HALF_M - north) / _CELL_M))
        cv2.circle(labels, centre, round(ISLAND_M / _CELL_M), int(Label.GRASS), -1)
        world = World(np.repeat(labels[..., None], 3, axis=2), labels, _CELL_M, 'island')
        self.island_m = north, east
        # A smaller picture shows the same directions.
        scale = max(1.0, max(camera.width_px, camera.height_px) / _DRAWN_PX)
        size_px = round(camera.width_px / scale), round(camera.height_px / scale)
        return NadirCamera(world, camera.resized(*size_px), mount)


def to_and_fro_m(places_m: NDArray[np.float64]) -> float:
    """Return how far a way over the ground (N, 2) goes and comes back, the larger of both axes.

    A way in one direction counts nothing, however long: the site moves a little as the map grows.
    """
    if len(places_m) == 0:
        return 0.0
    rise = (places_m - np.minimum.accumulate(places_m)).max(axis=0)
    fall = (np.maximum.accumulate(places_m) - places_m).max(axis=0)
    return float(np.minimum(rise, fall).max())


def fly(
    seeds: int,
    wind_m_s: float,
    gust_m_s: float,
    heatmap_hz: float = 5.0,
    *,
    px4_errors: float = 0.0,
    tell: bool = False,
) -> list[Landed]:
    """Fly with each seed from 1 on."""
    flown: list[Landed] = []
    begun_s = monotonic()
    for seed in range(1, seeds + 1):
        flown.append(WindFlight(wind_m_s, gust_m_s, seed, heatmap_hz, px4_errors).run())
        if tell:
            sys.stderr.write(f'\r{seed} of {seeds} flights, {monotonic() - begun_s:.0f} s')
            sys.stderr.flush()
    if tell:
        sys.stderr.write('\n')
    return flown


def _line(each: Landed) -> str:
    return (
        f'{each.seed:4d}  {each.seconds:6.1f}  {each.error_m:7.2f}  {each.off_m:5.2f}  '
        f'{each.worst_after_m:7.2f}  {each.lowest_m:8.2f}  {each.swing_m:7.2f}  '
        f'{each.off_swing_m:5.2f}  {each.clearance_m:11.2f}'
        f'{"" if each.is_good else "  FAILED"}'
    )


def main(args: Sequence[str] | None = None) -> int:
    """Fly from the command line; 1 when a flight did not keep the limits."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.wind', description=(__doc__ or '').splitlines()[0]
    )
    parser.add_argument('--seeds', type=int, default=12)
    parser.add_argument('--wind', type=float, default=5.0, help='mean speed, m/s')
    parser.add_argument('--gust', type=float, default=1.5, help='standard deviation, m/s')
    parser.add_argument('--heatmaps', type=float, default=5.0, help='per second')
    parser.add_argument(
        '--px4-errors', type=float, default=0.0, help='as PX4, times its measured errors'
    )
    parser.add_argument('--json', type=Path, help='write the flights to this file')
    given = parser.parse_args(args)
    flown = fly(
        given.seeds, given.wind, given.gust, given.heatmaps, px4_errors=given.px4_errors, tell=True
    )
    if given.json is not None:
        write_whole(
            given.json, json.dumps([asdict(each) for each in flown], indent=2) + '\n', 'flights'
        )
    good = sum(each.is_good for each in flown)
    air = f'wind {given.wind:g} m/s, gusts {given.gust:g} m/s'
    kept = LandingParameters()
    limits = (
        f'error {ERROR_LIMIT_M:g} m and swing {SWING_LIMIT_M:g} m beside what the position is off '
        f'by, overshoot {OVERSHOOT_LIMIT_M:g} m, clearance {kept.safety_radius_m:g} m'
    )
    lines = [
        'seed  time s  error m    off  after m  lowest m  swing m    off  clearance m',
        *(_line(each) for each in flown),
        f'{air}: {good} of {len(flown)} within {limits}',
    ]
    sys.stdout.write('\n'.join(lines) + '\n')
    return 0 if good == len(flown) else 1


if __name__ == '__main__':
    sys.exit(main())
