# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Landings with a barometer that steps or drifts: is it noticed before the hand-over?

``python -m peace_ros.lab.evaluation.heights`` flies the landing core against the physics of the
simulated autopilots, as ``wind`` does, with camera pictures of a drawn world and the altitude of a
noisy GNSS receiver besides. In each flight the barometer becomes wrong at one height. Flights
without a fault count the holds that nothing justifies.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from time import monotonic

import numpy as np

from peace_ros.core.domain import Camera, Frame, HeightReport
from peace_ros.core.landing import State
from peace_ros.core.vehicle.heights import RANGE_ERROR_M
from peace_ros.lab.evaluation.wind import WindFlight
from peace_ros.recording.run_folder import write_whole
from peace_ros.simulation import draw_world
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.world import World

SOURCES = ('pictures', 'GNSS', 'rangefinder')
OFF_LIMIT_M, FLOOR_M = 3.0, 15.0
"""A hand-over may be so far off in height without a warning, and is never below the second."""
ERRORS_M = (3.0, 5.0, 8.0, 15.0)
HEIGHTS_M = (90.0, 60.0, 40.0, 25.0)
DRIFT_M_S = 0.25
GNSS_NOISE_M = 2.5
RANGE_M = 40.0
_START = 1.1
"""The flight begins this many times higher than the fault; at the safe altitude at least."""
_LEAST_START_M = 60.0
_TICK_S = 0.01
_PIXELS = 176
_PICTURE_S = 0.33
_PICTURE_DELAY_S = 0.15
_GREY_NOISE = 2.0
_GSD_M, _WORLD_M = 0.25, 300.0
_LIMIT_S = 240.0
_HELD = 'the altitude above ground is'
_HELD_S = 15.0
"""A landing that has held for so long because of its heights holds for good."""


@dataclass(frozen=True)
class BarometerFault:
    """The barometer becomes wrong when the vehicle first comes down to a height."""

    error_m: float
    """Reported minus true height."""
    at_m: float
    """True height."""
    rate_m_s: float = inf
    """Infinite: a step."""

    def __str__(self) -> str:
        kind = 'step' if self.rate_m_s == inf else 'drift'
        return f'{kind} of {self.error_m:+g} m at {self.at_m:g} m'


@dataclass(frozen=True)
class HeightResult:
    """One flight."""

    fault: str
    """Empty: none."""
    seed: int
    warned: str
    """The first sentence about heights, empty when there was none."""
    warned_after_s: float | None
    """From the fault to that sentence."""
    handed_over_m: float | None
    """True height of the hand-over, None without one."""
    off_m: float
    """Reported minus true height at the hand-over, or at the end."""
    lowest_m: float
    """True height."""
    picture_error: float
    """Largest error of the height by pictures over the true height, before the fault."""

    @property
    def is_good(self) -> bool:
        """Whether it kept the limits."""
        if self.handed_over_m is None:
            return bool(self.warned)
        off = abs(self.off_m) > OFF_LIMIT_M and not self.warned
        return not off and self.handed_over_m >= FLOOR_M


class HeightFlight(WindFlight):
    """A landing with pictures and other heights.

    Args:
        world: What the camera sees.
        fault: None: no fault.
        seed: Of wind, gusts and noise.
        wind_m_s: Mean speed.
        sources: Of :data:`SOURCES`.
        px4: Fly as PX4, with its measured errors.
    """

    def __init__(
        self,
        world: World,
        fault: BarometerFault | None,
        seed: int,
        wind_m_s: float = 5.0,
        sources: Sequence[str] = SOURCES[:2],
        *,
        px4: bool = False,
    ) -> None:
        start_m = _LEAST_START_M if fault is None else max(_LEAST_START_M, _START * fault.at_m)
        super().__init__(
            wind_m_s,
            0.3 * wind_m_s,
            seed,
            px4_errors=float(px4),
            start_m=start_m,
            gnss_noise_m=GNSS_NOISE_M,
        )
        self._fault, self._fault_s = fault, inf
        self._sources = sources
        self._eye = NadirCamera(world, Camera.from_degrees(_PIXELS, _PIXELS, 73))
        self._frames: deque[tuple[float, Frame]] = deque()
        self._due_s['picture'] = self._now_s
        self._warned, self._warned_s, self._held_s = '', 0.0, 0.0
        self._picture_error = 0.0

    def result(self) -> HeightResult:
        """Fly until the hand-over, or until the landing holds for good."""
        until_s, state = self._now_s + _LIMIT_S, State.IDLE
        while self._now_s < until_s and self._held_s < _HELD_S and state is not State.HANDOVER:
            self._tick()
            state = self._watch()
        true_m = -self._flight.physics.down_m
        return HeightResult(
            fault=str(self._fault or ''),
            seed=self._seed,
            warned=self._warned,
            warned_after_s=round(self._warned_s - self._fault_s, 1) if self._warned else None,
            handed_over_m=round(true_m, 2) if state is State.HANDOVER else None,
            off_m=round(self._flight.barometer.height_m, 2),
            lowest_m=round(self._lowest_m, 2),
            picture_error=round(self._picture_error, 4),
        )

    def _watch(self) -> State:
        """Note what the newest decision says about heights; return its state."""
        decision, true_m = self.track[-1][3], -self._flight.physics.down_m
        held = decision.state is State.HOLD and decision.reason.startswith(_HELD)
        self._held_s = self._held_s + _TICK_S if held else 0.0
        if held and not self._warned:
            self._warned, self._warned_s = decision.reason, self._now_s
        if self._fault_s == inf and 'pictures' in decision.heights_m:
            error = decision.heights_m['pictures'] / true_m - 1.0
            self._picture_error = max(self._picture_error, abs(error))
        return decision.state

    def _tick(self) -> None:
        fault, true_m = self._fault, -self._flight.physics.down_m
        if fault is not None and self._fault_s == inf and true_m <= fault.at_m:
            self._flight.barometer.become(fault.error_m, fault.rate_m_s)
            self._fault_s = self._now_s
        if 'pictures' in self._sources and self._is_due('picture', _PICTURE_S):
            self._shoot()
        while self._frames and self._frames[0][0] <= self._now_s:
            self._core.add_view(self._frames.popleft()[1])
        super()._tick()

    def _shoot(self) -> None:
        pose = self._seen_from()
        image = self._eye.view(pose).image_rgb
        noise = self._random.standard_normal((_PIXELS, _PIXELS, 1), np.float32)
        noisy = image + _GREY_NOISE * noise
        frame = Frame(np.clip(noisy, 0.0, 255.0).astype(np.uint8), pose.stamp_ns)
        self._frames.append((self._now_s + _PICTURE_DELAY_S, frame))

    def _heights(self) -> tuple[HeightReport, ...]:
        true_m, reports = -self._flight.physics.down_m, []
        if 'GNSS' in self._sources:
            gnss = self._flight.gnss
            altitude_m = true_m + gnss.error_m
            reports.append(HeightReport('GNSS', altitude_m, gnss.size_m, above_ground=False))
        if 'rangefinder' in self._sources and true_m <= RANGE_M:
            reports.append(HeightReport('rangefinder', true_m, RANGE_ERROR_M, is_narrow=True))
        return tuple(reports)


def faults() -> Iterator[BarometerFault]:
    """Yield steps and drifts, up and down, at every height."""
    for rate_m_s in (inf, DRIFT_M_S):
        for at_m in HEIGHTS_M:
            for size_m in ERRORS_M:
                for error_m in (size_m, -size_m):
                    yield BarometerFault(error_m, at_m, rate_m_s)


def fly(
    flights: Sequence[BarometerFault | None],
    sources: Sequence[str],
    *,
    px4: bool = False,
    wind_m_s: float = 5.0,
    tell: bool = False,
) -> list[HeightResult]:
    """Fly once with each fault, with seeds from 1 on."""
    world, flown, begun_s = draw_world(1, _WORLD_M, _GSD_M), list[HeightResult](), monotonic()
    for seed, fault in enumerate(flights, start=1):
        flown.append(HeightFlight(world, fault, seed, wind_m_s, sources, px4=px4).result())
        if tell:
            sys.stderr.write(f'\r{seed} of {len(flights)} flights, {monotonic() - begun_s:.0f} s')
            sys.stderr.flush()
    if tell:
        sys.stderr.write('\n')
    return flown


def _line(each: HeightResult) -> str:
    over = '-' if each.handed_over_m is None else f'{each.handed_over_m:.2f}'
    after = '-' if each.warned_after_s is None else f'{each.warned_after_s:.1f}'
    bad = '' if each.is_good else '  FAILED'
    return (
        f'{each.fault or "none":28s}  {each.seed:4d}  {over:>11s}  {each.off_m:6.2f}  {after:>8s}  '
        f'{each.lowest_m:8.2f}{bad}  {each.warned}'
    )


def main(args: Sequence[str] | None = None) -> int:
    """Fly from the command line; 1 when a fault went unnoticed or a hold had no cause."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.heights',
        description=(__doc__ or '').splitlines()[0],
    )
    parser.add_argument('--px4', action='store_true', help='as PX4, with its measured errors')
    parser.add_argument('--wind', type=float, default=5.0, help='mean speed, m/s')
    parser.add_argument('--sources', nargs='*', choices=SOURCES, default=SOURCES[:2])
    parser.add_argument('--sound', type=int, default=24, help='flights without a fault')
    parser.add_argument('--every', type=int, default=1, help='fly each Nth of the 64 faults')
    parser.add_argument('--json', type=Path, help='write the flights to this file')
    given = parser.parse_args(args)
    broken = list(faults())[:: given.every]
    settings = {'px4': given.px4, 'wind_m_s': given.wind, 'tell': True}
    flown = fly([*broken, *[None] * given.sound], given.sources, **settings)
    if given.json is not None:
        write_whole(
            given.json, json.dumps([asdict(each) for each in flown], indent=2) + '\n', 'flights'
        )
    found = [each for each in flown if each.fault]
    sound = [each for each in flown if not each.fault]
    unnoticed = sum(not each.is_good for each in found)
    false = sum(bool(each.warned) for each in sound)
    over = sum(each.handed_over_m is not None for each in sound)
    error = max((each.picture_error for each in flown), default=0.0)
    sys.stdout.write(
        'fault                         seed  hand-over m   off m  warned s  lowest m\n'
        + ''.join(f'{_line(each)}\n' for each in flown)
        + f'{len(found) - unnoticed} of {len(found)} faults: warned, or off by {OFF_LIMIT_M:g} m '
        f'at most; lowest hand-over {_lowest_m(found)}\n'
        f'{len(sound)} flights without a fault: {false} holds for heights, {over} hand-overs, '
        f'lowest {_lowest_m(sound)}; height by pictures off by {error:.1%} at most\n'
    )
    return 0 if unnoticed == false == 0 else 1


def _lowest_m(flown: Sequence[HeightResult]) -> str:
    heights_m = [each.handed_over_m for each in flown if each.handed_over_m is not None]
    return f'{min(heights_m):.2f} m' if heights_m else 'none'


if __name__ == '__main__':
    sys.exit(main())
