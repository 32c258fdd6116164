# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which part of a recording is replayed, and what the user says that it does not say itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Annotated

from typer import Option

from peace_ros.core.domain import Camera, Mount, Pose, RecordingError
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.lab.replay.calibration import DEFAULT_FOV_DEG
from peace_ros.recording.flight_log import LOG_SUFFIXES, LogClock, read_flight_log

DEFAULT_ALTITUDE = '100:20'
_LARGEST_TURN_DEG = 360.0
_MOST_OFFSET_S = 1e10


@dataclass(frozen=True)
class SourceOptions:
    """Which part of a recording is replayed, and what it does not say itself."""

    image_topic: Annotated[
        str | None, Option(help='Image or CompressedImage; default: the only one, or /image.')
    ] = None
    pose_topic: Annotated[
        str | None,
        Option(
            help='PoseStamped, PoseWithCovarianceStamped or Odometry, in ENU; default: the only '
            'one, or /ground_truth/pose.'
        ),
    ] = None
    fov_x_deg: Annotated[
        float | None,
        Option(
            '--fov',
            metavar='DEG',
            help='Full horizontal field of view; default: the camera_info beside the image, '
            'else 73.',
        ),
    ] = None
    mount_roll_deg: Annotated[
        float | None,
        Option('--mount-roll', metavar='DEG', help='The camera looks so far to the left.'),
    ] = None
    mount_pitch_deg: Annotated[
        float | None,
        Option('--mount-pitch', metavar='DEG', help='The camera looks so far ahead.'),
    ] = None
    mount_yaw_deg: Annotated[
        float | None,
        Option(
            '--mount-yaw',
            metavar='DEG',
            help='The top of the image is so far to the right of the nose; default of all three: '
            '/tf_static from base_link to the frame_id of the images, else 0.',
        ),
    ] = None
    altitude: Annotated[
        str | None,
        Option(
            metavar='START:END',
            help='Metres above ground, linear over a video; default: the .SRT of DJI beside it, '
            f'else {DEFAULT_ALTITUDE}.',
        ),
    ] = None
    log: Annotated[
        Path | None,
        Option(
            metavar='FILE',
            help=f'Log of the flight with the poses: {", ".join(LOG_SUFFIXES)}.',
        ),
    ] = None
    time_offset_s: Annotated[
        float,
        Option(
            '--time-offset',
            metavar='S',
            help='Added to the times of --log. Without it the log of a video begins with the '
            'first frame, and that of a bag has its clock.',
        ),
    ] = 0.0
    ground_m: Annotated[
        float,
        Option(
            '--ground',
            metavar='M',
            help='Height of the ground in the poses: z = 0 is the ground, unless they count from '
            'sea level or the place of arming.',
        ),
    ] = 0.0
    every: Annotated[int, Option(metavar='N', help='Take every N-th frame.')] = 1
    hz: Annotated[
        float | None, Option(metavar='HZ', help='Take at most HZ frames per recorded second.')
    ] = None
    limit: Annotated[int | None, Option(metavar='N', help='Stop after N frames.')] = None

    def __post_init__(self) -> None:
        if self.every < 1:
            raise RecordingError(f'--every {self.every}: give 1 or more')
        if not isfinite(self.ground_m):
            raise RecordingError(f'--ground {self.ground_m}: give the metres of z at the ground')
        if not abs(self.time_offset_s) <= _MOST_OFFSET_S:
            raise RecordingError(
                f'--time-offset {self.time_offset_s} s: give up to {_MOST_OFFSET_S:g}'
            )
        if self.hz is not None and not 0.0 < self.hz <= 1000.0:
            raise RecordingError(f'--hz {self.hz}: give more than 0 and at most 1000')
        if self.limit is not None and self.limit < 1:
            raise RecordingError(f'--limit {self.limit}: give 1 or more')
        if self.fov_x_deg is not None and not 5.0 <= self.fov_x_deg <= 150.0:
            raise RecordingError(f'--fov {self.fov_x_deg} deg: give 5 to 150')
        for name, turn_deg in zip(('roll', 'pitch', 'yaw'), self._turns_deg, strict=True):
            if turn_deg is not None and not abs(turn_deg) <= _LARGEST_TURN_DEG:
                raise RecordingError(
                    f'--mount-{name} {turn_deg} deg: give -{_LARGEST_TURN_DEG:g} to '
                    f'{_LARGEST_TURN_DEG:g}'
                )

    @property
    def _turns_deg(self) -> tuple[float | None, float | None, float | None]:
        return self.mount_roll_deg, self.mount_pitch_deg, self.mount_yaw_deg

    @property
    def mount(self) -> Mount | None:
        """How the user says that the camera is mounted, None where nothing was said."""
        roll, pitch, yaw = self._turns_deg
        if roll is pitch is yaw is None:
            return None
        return mount_from_degrees((roll or 0.0, pitch or 0.0, yaw or 0.0), (0.0, 0.0, 0.0))

    def above_ground(self, poses: list[Pose]) -> list[Pose]:
        """Return poses with the altitude above the ground that the user gives."""
        ground_m = self.ground_m
        return [replace(each, altitude_agl_m=each.altitude_agl_m - ground_m) for each in poses]

    def read_log(self, path: Path, remarks: list[str], begin_ns: int | None = None) -> list[Pose]:
        """Return the poses of a log in the clock of the recording.

        Args:
            path: of the log.
            remarks: is told what was taken from it.
            begin_ns: stamp of the first frame of a video, None for a bag.

        Raises:
            RecordingError: it cannot be read.
        """
        log = read_flight_log(path)
        shift_ns, first_ns = round(self.time_offset_s * 1e9), log.poses[0].stamp_ns
        if begin_ns is not None:
            shift_ns += begin_ns - (0 if log.clock is LogClock.VIDEO else first_ns)
        told = f'{len(log.poses)} poses of {path.name}, times from {log.clock.value}'
        if begin_ns is not None:
            begins_s = (first_ns + shift_ns - begin_ns) * 1e-9
            told += f'; its first is {begins_s:.1f} s after the first frame (--time-offset)'
        remarks += [told, *log.remarks]
        if log.modes:
            listed = ', '.join(
                f'{mode} at {(at_ns - first_ns) * 1e-9:.1f} s' for at_ns, mode in log.modes
            )
            remarks.append(f'modes in {path.name} after its first pose: {listed}')
        poses = [replace(each, stamp_ns=each.stamp_ns + shift_ns) for each in log.poses]
        if poses[0].stamp_ns < 0:
            raise RecordingError(f'--time-offset {self.time_offset_s} s: times become negative')
        return self.above_ground(poses)

    def assumed_camera(self, width_px: int, height_px: int) -> Camera:
        """Return the camera of frames of a size that come without a calibration."""
        return Camera.from_degrees(width_px, height_px, self.fov_x_deg or DEFAULT_FOV_DEG)
