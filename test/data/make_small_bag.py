# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Write small.mcap: a scripted descent over a drawn world, as a camera and an autopilot see it.

    python test/data/make_small_bag.py [OUTPUT]

The bag is committed; it need not be written again unless the scene itself shall change.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from math import exp, pi, sin
from pathlib import Path

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import (
    attitude_ned_frd_to_enu_flu,
    ned_to_enu,
    quaternion_from_euler,
)
from peace_ros.recording import TYPESTORE, BagWriter
from peace_ros.recording.messages import header, jpeg_message, pose_stamped
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.world import draw_world

SEED = 1
START = (-60.0, 20.0)
"""North and east of the centre of the world, over the meadow in its south."""
SECONDS = 22.0
FRAME_HZ = 2.0
POSE_HZ = 10.0
CAMERA = Camera.from_degrees(352, 352, 73.0)
FIRST_NS = 1_000_000_000


def poses() -> Iterator[Pose]:
    """Yield a descent from 100 m that slows down with the altitude, swaying a little."""
    for k in range(round(SECONDS * POSE_HZ) + 1):
        t = k / POSE_HZ
        altitude_m = 100.0 if t < 6.0 else 20.0 + 80.0 * exp(-(t - 6.0) / 9.0)
        sway = sin(2.0 * pi * t / 8.0)
        yield Pose(
            stamp_ns=FIRST_NS + round(t * 1e9),
            north_m=0.8 * sway,
            east_m=0.3 * t,
            down_m=-altitude_m,
            quaternion_ned_frd=quaternion_from_euler(0.02 * sway, 0.015 * sway, 0.3),
            altitude_agl_m=altitude_m,
        )


def main() -> None:
    """Draw the world and write the bag."""
    default = Path(__file__).parent / 'small.mcap'
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    world = draw_world(SEED, 400.0, 0.2)
    view = NadirCamera(replace(world, centre_north_m=-START[0], centre_east_m=-START[1]), CAMERA)
    every = round(POSE_HZ / FRAME_HZ)
    path.unlink(missing_ok=True)
    with BagWriter(path) as bag:
        for number, pose in enumerate(poses()):
            enu = ned_to_enu(pose.north_m, pose.east_m, pose.down_m)
            turn = attitude_ned_frd_to_enu_flu(pose.quaternion_ned_frd)
            bag.write('/ground_truth/pose', pose.stamp_ns, pose_stamped(pose.stamp_ns, enu, turn))
            if number % every:
                continue
            picture = view.view(pose).image_rgb
            bag.write(
                '/image/compressed', pose.stamp_ns, jpeg_message(picture, pose.stamp_ns, quality=85)
            )
            bag.write('/camera_info', pose.stamp_ns, camera_info(pose.stamp_ns))


def camera_info(stamp_ns: int) -> object:
    """Return the CameraInfo of the camera."""
    f, (u, v) = CAMERA.focal_px, CAMERA.centre_px
    types = TYPESTORE.types
    import numpy as np

    return types['sensor_msgs/msg/CameraInfo'](
        header=header(stamp_ns, 'camera'),
        height=CAMERA.height_px,
        width=CAMERA.width_px,
        distortion_model='plumb_bob',
        d=np.zeros(5),
        k=np.array([f, 0.0, u, 0.0, f, v, 0.0, 0.0, 1.0]),
        r=np.eye(3).reshape(-1),
        p=np.array([f, 0.0, u, 0.0, 0.0, f, v, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=types['sensor_msgs/msg/RegionOfInterest'](
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        ),
    )


if __name__ == '__main__':
    main()
