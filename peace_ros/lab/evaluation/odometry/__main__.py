# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.evaluation.odometry`` measures the visual-inertial odometry.

Without arguments it flies over a flat town and over one with hills, at four heights, and prints the
error of the velocity, the time per frame beside that of registration, and the memory. With
``--sequences N`` it flies N short flights drawn at random, and counts velocities that were told and
wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from math import inf
from time import monotonic

import cv2

from peace_ros.core.odometry import OdometryParameters
from peace_ros.lab.evaluation.odometry.flight import (
    CAMERA,
    FlightErrors,
    See,
    SeenMotion,
    fly,
    memory_mb,
    register_along,
    times_ms,
)
from peace_ros.lab.evaluation.odometry.ground import HillCamera, draw_hills
from peace_ros.lab.evaluation.odometry.motion import Motion
from peace_ros.lab.evaluation.odometry.random_sequences import (
    MOVING,
    Count,
    Grounds,
    run_sequence,
)
from peace_ros.simulation import NadirCamera, draw_world

HEIGHTS_M = (100.0, 60.0, 30.0, 20.0)
MOTIONS = {
    'level, 2 m/s': Motion(0.0, speed_m_s=2.0),
    'level, 5 m/s': Motion(0.0, speed_m_s=5.0),
    'leaning 15 deg, 2 m/s': Motion(0.0, speed_m_s=2.0, lean_deg=15.0),
    'yaw 20 deg/s, 2 m/s': Motion(0.0, speed_m_s=2.0, yaw_rate_deg_s=20.0),
    'all three, 5 m/s': Motion(0.0, speed_m_s=5.0, lean_deg=15.0, yaw_rate_deg_s=20.0),
}
LIMITS = {100.0: (0.01, 0.09), 60.0: (0.03, 0.08), 30.0: (0.01, 0.04), 20.0: (0.01, 0.03)}
"""Bias and standard deviation (m/s) of a prototype over flat ground, level, at 2 m/s. Its bias at
100 m was below 0.005 m/s."""
HILLS_M = 3.0
_SIZE_M, _GSD_M = 300.0, 0.1


def _grounds(seed: int) -> dict[str, See]:
    world = draw_world(seed, _SIZE_M, _GSD_M)
    flat, hills = NadirCamera(world, CAMERA), draw_hills(_SIZE_M, HILLS_M, seed)
    uneven = HillCamera(world, CAMERA, hills)
    return {
        'flat': lambda pose, _: flat.view(pose).image_rgb,
        f'hills of {HILLS_M:g} m': lambda pose, _: uneven.view(pose),
    }


def _over(motion: Motion, height_m: float, seconds: float) -> Motion:
    """Return a motion at a height, whose middle is near the middle of the world."""
    return Motion(
        **{
            **vars(motion),
            'height_m': height_m,
            'course_rad': 0.4,
            'north_m': -0.5 * motion.speed_m_s * seconds,
        }
    )


def _line(name: str, found: FlightErrors) -> str:
    largest = max(found.lengths_m_s, default=float('nan'))
    doubts = ', '.join(f'{key} {value}' for key, value in found.doubts.most_common())
    return (
        f'{name:42s}  {found.bias_m_s:5.2f}  {found.deviation_m_s:5.2f}  {largest:5.2f}  '
        f'{found.position_error_m:6.2f}  {len(found.errors_m_s) / max(1, found.frames):6.1%}  '
        f'{doubts}\n'
    )


def measure(seconds: float, seed: int, ground_error_m: float) -> bool:
    """Fly all motions and print their errors; return whether they keep the limits."""
    parameters = OdometryParameters(ground_error_m=ground_error_m)
    sys.stdout.write(
        'ground, height, motion                     bias   s.d.   max  m/s   end m  told   doubts\n'
    )
    grounds = _grounds(seed)
    fast = _over(MOTIONS['all three, 5 m/s'], 60.0, 6.0)
    grown_mb = memory_mb(SeenMotion(fast, grounds['flat'], seed), 60)
    flown: list[FlightErrors] = []
    good = grown_mb <= 40.0
    for ground, see in grounds.items():
        for height_m in HEIGHTS_M:
            for name, motion in MOTIONS.items():
                over = _over(motion, height_m, seconds)
                found = fly(SeenMotion(over, see, seed), seconds, parameters)
                flown.append(found)
                good &= max(found.lengths_m_s, default=0.0) <= 0.5
                sys.stdout.write(_line(f'{ground}, {height_m:g} m, {name}', found))
                sys.stdout.flush()
    sys.stdout.write(
        '\nflat, level, 2 m/s: bias / s.d.; limit; registration (0.4 s, true attitude)\n'
    )
    registered: list[FlightErrors] = []
    for row, height_m in enumerate(HEIGHTS_M):
        over = _over(MOTIONS['level, 2 m/s'], height_m, seconds)
        other = register_along(SeenMotion(over, grounds['flat'], seed), seconds)
        registered.append(other)
        found, (bias, deviation) = flown[row * len(MOTIONS)], LIMITS[height_m]
        good &= found.bias_m_s <= bias and found.deviation_m_s <= deviation
        sys.stdout.write(
            f'{height_m:5g} m: {found.bias_m_s:.3f} / {found.deviation_m_s:.3f};  '
            f'{bias:.2f} / {deviation:.2f};  {other.bias_m_s:.2f} / {other.deviation_m_s:.2f}\n'
        )
    sys.stdout.write(
        f'time of one core per frame: {times_ms(flown)}; registration: {times_ms(registered)}\n'
        f'memory: {grown_mb:.1f} MB more than before\n'
    )
    return good


def count(sequences: int, seed: int, minutes: float = inf) -> bool:
    """Fly sequences drawn at random; return whether none over ground at rest was wrong.

    Args:
        sequences: How many.
        seed: Same seed, same sequences.
        minutes: After so long no further sequence is begun.
    """
    grounds, counts, begun_s = Grounds(), defaultdict[str, Count](Count), monotonic()
    for number in range(sequences):
        if number > 0 and monotonic() - begun_s > 60.0 * minutes:
            break
        kind, found = run_sequence(grounds, number, seed)
        counts[kind].add(number, found)
        if number % 20 == 19:
            sys.stderr.write(f'\r{number + 1} of {sequences}, {monotonic() - begun_s:.0f} s')
            sys.stderr.flush()
    sys.stderr.write('\n')
    sys.stdout.write('ground         sequences  wrong  frames    told  largest m/s  doubts\n')
    for kind, each in counts.items():
        doubts = ', '.join(f'{key} {value}' for key, value in each.doubts.most_common(5))
        sys.stdout.write(
            f'{kind:13s}  {each.sequences:9d}  {len(each.wrong):5d}  {each.frames:6d}  '
            f'{each.told / max(1, each.frames):6.1%}  {each.largest_m_s:11.2f}  {doubts}\n'
        )
        if each.wrong:
            sys.stdout.write(f'  wrong: {" ".join(map(str, each.wrong[:20]))}\n')
    return not any(each.wrong for kind, each in counts.items() if kind != MOVING)


def main(args: Sequence[str] | None = None) -> int:
    """Measure from the command line; 1 when a limit was not kept."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.odometry',
        description=(__doc__ or '').splitlines()[0],
    )
    parser.add_argument('--seconds', type=float, default=10.0, help='of each flight')
    parser.add_argument('--seed', type=int, default=1, help='of the world and the noise')
    parser.add_argument(
        '--ground-error', type=float, default=1.5, help='parameter ground_error_m of the odometry'
    )
    parser.add_argument('--sequences', type=int, default=0, help='fly so many random ones instead')
    parser.add_argument(
        '--minutes', type=float, default=inf, help='begin no further sequence after so long'
    )
    given = parser.parse_args(args)
    cv2.setNumThreads(1)
    if given.sequences > 0:
        return 0 if count(given.sequences, given.seed, given.minutes) else 1
    return 0 if measure(given.seconds, given.seed, given.ground_error) else 1


if __name__ == '__main__':
    sys.exit(main())
