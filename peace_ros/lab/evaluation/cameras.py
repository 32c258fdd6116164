# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Landings with other cameras: wide frames, lenses with distortion, a mount that looks ahead.

``python -m peace_ros.lab.evaluation.cameras --seeds 20`` flies as ``wind`` does, in lock step, and
compares with the ground truth: where the vehicle is at the hand-over, how far unsafe ground truly
is from there, and how far the safe ground of the map is from the true one.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

from peace_ros.core.domain import NADIR, Camera, Distortion, Mount
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.lab.evaluation.wind import ISLAND_M, Landed, WindFlight

LIMIT_M = 1.0
"""Of the distance to the believed place, of clearance that was believed and is not there, and of
the error of the map."""
WIND_M_S, GUST_M_S = 3.0, 1.0
AHEAD = mount_from_degrees((0.0, 15.0, 0.0), (0.15, 0.0, 0.05))
"""Looking 15 degrees ahead, a little before the middle of the vehicle."""


@dataclass(frozen=True)
class CameraCase:
    """A camera and how it is mounted."""

    name: str
    camera: Camera
    mount: Mount = NADIR


CASES = (
    CameraCase('352 x 352, 73 deg, pinhole, nadir', Camera.from_degrees(352, 352, 73.0)),
    CameraCase(
        '640 x 480, 75 deg, plumb_bob, 15 deg ahead',
        replace(
            Camera.from_degrees(640, 480, 75.0),
            distortion=Distortion('plumb_bob', (-0.2, 0.04, 0.0005, -0.0005, 0.0)),
        ),
        AHEAD,
    ),
    CameraCase(
        '1280 x 720, 90 deg, rational_polynomial, 15 deg ahead',
        replace(
            Camera.from_degrees(1280, 720, 90.0),
            distortion=Distortion(
                'rational_polynomial', (0.4, 0.1, 0.0005, 0.0, 0.01, 0.7, 0.2, 0.02)
            ),
        ),
        AHEAD,
    ),
    CameraCase(
        '1920 x 1080, 95 deg, equidistant, 15 deg ahead',
        replace(
            Camera.from_degrees(1920, 1080, 95.0),
            distortion=Distortion('equidistant', (0.05, -0.01, 0.002, -0.001)),
        ),
        AHEAD,
    ),
)


@dataclass(frozen=True)
class CameraLanding:
    """One flight."""

    landed: Landed
    believed_m: float
    """Clearance of the site at the hand-over, by the map."""
    clearance_m: float
    """True clearance of the point below the vehicle then."""
    map_error_m: float
    """From the middle of the safe ground of the map to that of the island."""

    @property
    def missing_m(self) -> float:
        """By how much the believed clearance is too large; below 0: there is more than that."""
        return min(self.believed_m, ISLAND_M) - self.clearance_m

    @property
    def is_good(self) -> bool:
        """Whether it ended over the believed place, which is where it was believed to be."""
        errors_m = self.landed.error_m, self.missing_m, self.map_error_m
        return self.landed.handed_over and max(errors_m) <= LIMIT_M


def land(case: CameraCase, seed: int) -> CameraLanding:
    """Fly once."""
    flight = WindFlight(WIND_M_S, GUST_M_S, seed, camera=case.camera, mount=case.mount)
    landed = flight.run()
    return CameraLanding(landed, *flight.clearances_m, flight.map_error_m())


def main(args: Sequence[str] | None = None) -> int:
    """Fly from the command line; 1 when a flight did not keep the limits."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.cameras',
        description=(__doc__ or '').splitlines()[0],
    )
    parser.add_argument('--seeds', type=int, default=20)
    given = parser.parse_args(args)
    all_good = True
    for case in CASES:
        flown = [land(case, seed) for seed in range(1, given.seeds + 1)]
        good = sum(each.is_good for each in flown)
        all_good &= good == len(flown)
        sys.stdout.write(
            f'{case.name}: {good} of {len(flown)} within {LIMIT_M:g} m; at most '
            f'{max(each.landed.error_m for each in flown):.2f} m beside the site, '
            f'{max(each.map_error_m for each in flown):.2f} m error of the map, '
            f'{max(each.missing_m for each in flown):.2f} m less clearance than believed\n'
        )
        sys.stdout.flush()
    return 0 if all_good else 1


if __name__ == '__main__':
    sys.exit(main())
