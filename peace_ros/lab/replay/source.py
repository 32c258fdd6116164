# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a replay gets its frames and poses: a bag, or a video with an assumed altitude."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Annotated, Protocol

from typer import Option

from peace_ros.core.domain import (
    NADIR,
    Camera,
    Frame,
    Mount,
    PeaceError,
    Pose,
    RecordingError,
    VehicleError,
)
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.core.messages import (
    diagnostic_values,
    frame_from_message,
    is_rectified,
    pose_from_message,
    stamp_ns_of,
)
from peace_ros.lab.replay.calibration import DEFAULT_FOV_DEG, RecordedCalibration
from peace_ros.recording import AltitudeProfile, BagReader, VideoReader
from peace_ros.recording.messages import IMAGE_TYPES, POSE_TYPES
from peace_ros.recording.storages import STORAGES, is_recording
from peace_ros.recording.video import VIDEO_SUFFIXES

DEFAULT_ALTITUDE = '100:20'
_LARGEST_TURN_DEG = 360.0
_CLOCKS_APART_S = 3600.0
"""A recording may begin long before its first image; clocks that differ, differ by more."""
_STATUS_TOPIC = '/landing/status'
_PREFERRED_IMAGES = ('/image', '/image/compressed')
_PREFERRED_POSES = ('/ground_truth/pose', '/pose')


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
        str, Option(metavar='START:END', help='Metres, linear over the file; for videos.')
    ] = DEFAULT_ALTITUDE
    ground_m: Annotated[
        float,
        Option(
            '--ground',
            metavar='M',
            help='z of the ground in the poses of a bag, where they do not count from there but '
            'from sea level or the place of arming.',
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

    def assumed_camera(self, width_px: int, height_px: int) -> Camera:
        """Return the camera of frames of a size that come without a calibration."""
        return Camera.from_degrees(width_px, height_px, self.fov_x_deg or DEFAULT_FOV_DEG)


@dataclass(frozen=True)
class Taken:
    """One frame of a recording, or why it could not be used."""

    stamp_ns: int
    frame: Frame | None
    fault: str = ''


class RecordingSource(Protocol):
    """A recording that is being replayed."""

    path: Path
    count: int
    """About how many frames :meth:`frames` yields."""
    options: SourceOptions
    mount: Mount
    """How the camera sits on the vehicle."""
    poses: list[Pose]
    """In the order of their stamps."""
    engage_ns: int | None
    """When the recorded landing began; None engages with the first frame."""
    remarks: list[str]
    """What the user has to know of the recording, such as what was left out of it."""

    def frames(self) -> Iterator[Taken]:
        """Yield the chosen frames in the order of their stamps."""
        ...


class _Picker:
    """Which frames are taken, by their number and stamp."""

    def __init__(self, options: SourceOptions) -> None:
        self._options = options
        self._seen = 0
        self._taken = 0
        self._next_ns: int | None = None

    @property
    def is_done(self) -> bool:
        return self._options.limit is not None and self._taken >= self._options.limit

    def takes(self, stamp_ns: int) -> bool:
        number, self._seen = self._seen, self._seen + 1
        if number % self._options.every:
            return False
        if self._options.hz is not None:
            if self._next_ns is not None and stamp_ns < self._next_ns:
                return False
            period_ns = round(1e9 / self._options.hz)
            self._next_ns = max(stamp_ns, self._next_ns or stamp_ns) + period_ns
        self._taken += 1
        return True

    def about(self, count: int) -> int:
        count = -(-count // self._options.every)
        return count if self._options.limit is None else min(count, self._options.limit)


class VideoSource:
    """A video, its camera assumed level above the origin."""

    def __init__(self, path: Path, options: SourceOptions) -> None:
        self.path = path
        self.options = options
        self.mount = options.mount or NADIR
        self._reader = VideoReader(path, AltitudeProfile.parse(options.altitude))
        self.count = _Picker(options).about(self._reader.count)
        self.poses = [self._reader.pose(index) for index in range(self._reader.count)]
        self.engage_ns: int | None = None
        self.remarks = [
            f'no altitude was recorded: {options.altitude} m is assumed, linear (--altitude)'
        ]
        self.frame_hz = self._reader.frame_hz / options.every

    def frames(self) -> Iterator[Taken]:
        """Yield the chosen frames; raises RecordingError when the file breaks off."""
        picker = _Picker(self.options)
        for _, frame in self._reader.frames():
            if picker.takes(frame.stamp_ns):
                yield Taken(frame.stamp_ns, frame)
            if picker.is_done:
                return


class BagSource:
    """An image topic, its camera_info, and a pose topic of a bag."""

    def __init__(self, path: Path, options: SourceOptions) -> None:
        self.path = path
        self.options = options
        with BagReader(path) as bag:
            self.image_topic = _choose(
                bag, options.image_topic, IMAGE_TYPES, _PREFERRED_IMAGES, '--image-topic'
            )
            self.pose_topic = _choose(
                bag, options.pose_topic, POSE_TYPES, _PREFERRED_POSES, '--pose-topic'
            )
            self.count = _Picker(options).about(bag.count(self.image_topic))
            if not self.count:
                raise RecordingError(
                    f'topic {self.image_topic} of bag {path} has 0 messages: choose another'
                )
            self.remarks = list(bag.remarks)
            self.poses = [
                replace(pose, altitude_agl_m=pose.altitude_agl_m - options.ground_m)
                for pose in _poses(bag, self.pose_topic, self.remarks)
            ]
            self._unstamped = _unstamped(bag, self.image_topic, self.poses, self.remarks)
            self._calibration = RecordedCalibration(
                bag, self.image_topic, is_wanted=options.fov_x_deg is None, remarks=self.remarks
            )
            self.mount = options.mount or self._calibration.mount
            self.engage_ns = _engaged_ns(bag)

    def frames(self) -> Iterator[Taken]:
        """Yield the chosen frames; those that cannot be decoded with their fault."""
        picker = _Picker(self.options)
        last_ns, info = -1, self._calibration.first
        topics = [self.image_topic, *self._calibration.topics]
        with BagReader(self.path) as bag:
            for topic, receipt_ns, message in bag.messages(topics):
                if topic != self.image_topic:
                    info = message
                    continue
                stamp_ns = receipt_ns if self._unstamped else stamp_ns_of(message)
                if not picker.takes(stamp_ns):
                    continue
                if stamp_ns <= last_ns:
                    fault = f'stamp {stamp_ns} ns is not after {last_ns} ns'
                    yield Taken(stamp_ns, None, fault)
                    continue
                last_ns = stamp_ns
                try:
                    rectified = is_rectified(self.image_topic)
                    frame = frame_from_message(message, info, rectified=rectified)
                    yield Taken(stamp_ns, replace(frame, stamp_ns=stamp_ns))
                except PeaceError as error:
                    yield Taken(stamp_ns, None, str(error))
                if picker.is_done:
                    return


def open_source(path: Path, options: SourceOptions) -> RecordingSource:
    """Open a bag (folder, ``.mcap``, ``.db3``) or a video file.

    Raises:
        RecordingError: neither, or the topics that are needed are not in it.
    """
    if not path.exists():
        raise RecordingError(f'{path} does not exist: give a bag or a video file')
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return VideoSource(path, options)
    if is_recording(path):
        return BagSource(path, options)
    raise RecordingError(
        f'{path} is neither a bag (folder, {", ".join(STORAGES)}) nor a video '
        f'({", ".join(VIDEO_SUFFIXES)}): give one of those'
    )


def _choose(
    bag: BagReader,
    given: str | None,
    types: tuple[str, ...],
    preferred: tuple[str, ...],
    option: str,
) -> str:
    if given is not None:
        bag.require(given, types)
        if not bag.count(given):
            raise RecordingError(
                f'topic {given} of bag {bag.path} has 0 messages: choose another with {option}'
            )
        return given
    found = [topic for topic in bag.find(types) if bag.count(topic)]
    for name in preferred:
        if name in found:
            return name
    if len(found) == 1:
        return found[0]
    listed = ', '.join(found) or f'none among {", ".join(bag.topics) or "no topics"}'
    raise RecordingError(f'bag {bag.path}: {option} is not clear, there is {listed}: name one')


def _poses(bag: BagReader, topic: str, remarks: list[str]) -> list[Pose]:
    """Return the poses in the order of their stamps; remark on those that cannot be used."""
    poses: list[Pose] = []
    faults: list[str] = []
    for _, _, message in bag.messages([topic]):
        try:
            poses.append(pose_from_message(message))
        except VehicleError as error:  # noqa: PERF203 (one bad pose among many)
            faults.append(str(error))
    if not poses:
        raise RecordingError(
            f'bag {bag.path}: none of {len(faults)} messages of {topic} is a pose; the first: '
            f'{faults[0] if faults else "there is none"}: choose another with --pose-topic'
        )
    if faults:
        remarks.append(f'{len(faults)} poses of {topic} left out; the first: {faults[0]}')
    poses.sort(key=lambda pose: pose.stamp_ns)
    return [
        poses[0],
        *(pose for before, pose in pairwise(poses) if pose.stamp_ns > before.stamp_ns),
    ]


def _unstamped(bag: BagReader, topic: str, poses: list[Pose], remarks: list[str]) -> bool:
    """Tell whether the images have no stamps, so that those of their receipt have to serve.

    Raises:
        RecordingError: images and poses are of different clocks.
    """
    first = next(iter(bag.messages([topic])), None)
    if first is None:
        return False
    _, receipt_ns, message = first
    unstamped = stamp_ns_of(message) == 0
    if unstamped:
        remarks.append(f'images of {topic} have the stamp 0: the time of their receipt is used')
    stamp_ns = receipt_ns if unstamped else stamp_ns_of(message)
    begin_ns, end_ns = poses[0].stamp_ns, poses[-1].stamp_ns
    apart_s = max(begin_ns - stamp_ns, stamp_ns - end_ns) * 1e-9
    if apart_s > _CLOCKS_APART_S:
        raise RecordingError(
            f'bag {bag.path}: poses are stamped {begin_ns * 1e-9:.1f} to {end_ns * 1e-9:.1f} s, '
            f'the first image {stamp_ns * 1e-9:.1f} s, which never meet: record both with one '
            'clock (synchronise the autopilot, or let the driver stamp in ROS time)'
        )
    return unstamped


def _engaged_ns(bag: BagReader) -> int | None:
    """Return when a recorded landing node began to act."""
    if bag.topics.get(_STATUS_TOPIC) != 'diagnostic_msgs/msg/DiagnosticArray':
        return None
    for _, _, message in bag.messages([_STATUS_TOPIC]):
        if diagnostic_values(message).get('state', 'IDLE') != 'IDLE':
            return stamp_ns_of(message)
    return None
