# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a replay gets its frames and poses: a bag, or a video with an assumed altitude."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol

from typer import Option

from peace_ros.core.domain import (
    NADIR,
    Camera,
    ConfigurationError,
    Frame,
    Mount,
    PeaceError,
    Pose,
    RecordingError,
    VehicleError,
)
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.core.messages import (
    camera_info_topic,
    diagnostic_values,
    frame_from_message,
    is_rectified,
    pose_from_message,
    stamp_ns_of,
)
from peace_ros.core.transforms import StaticTransforms
from peace_ros.recording import AltitudeProfile, BagReader, VideoReader
from peace_ros.recording.messages import IMAGE_TYPES, POSE_TYPES
from peace_ros.recording.video import VIDEO_SUFFIXES

DEFAULT_FOV_DEG = 73.0
DEFAULT_ALTITUDE = '100:20'
_CAMERA_INFO = 'sensor_msgs/msg/CameraInfo'
_TF_STATIC, _VEHICLE_FRAME = '/tf_static', 'base_link'
_LARGEST_TURN_DEG = 360.0
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
    every: Annotated[int, Option(metavar='N', help='Take every N-th frame.')] = 1
    hz: Annotated[
        float | None, Option(metavar='HZ', help='Take at most HZ frames per recorded second.')
    ] = None
    limit: Annotated[int | None, Option(metavar='N', help='Stop after N frames.')] = None

    def __post_init__(self) -> None:
        if self.every < 1:
            raise RecordingError(f'--every {self.every}: give 1 or more')
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
            self.poses = _poses(bag, self.pose_topic)
            frame_id = _first(bag, self.image_topic).header.frame_id
            self._info_topic = _info_topic(bag, self.image_topic, frame_id, options)
            self._first_info = None if self._info_topic is None else _first(bag, self._info_topic)
            self.mount = options.mount or _recorded_mount(bag, frame_id)
            self.engage_ns = _engaged_ns(bag)

    def frames(self) -> Iterator[Taken]:
        """Yield the chosen frames; those that cannot be decoded with their fault."""
        picker = _Picker(self.options)
        last_ns, info = -1, self._first_info
        topics = [self.image_topic, *([] if self._info_topic is None else [self._info_topic])]
        with BagReader(self.path) as bag:
            for topic, _, message in bag.messages(topics):
                if topic == self._info_topic:
                    info = message
                    continue
                stamp_ns = stamp_ns_of(message)
                if not picker.takes(stamp_ns):
                    continue
                if stamp_ns <= last_ns:
                    fault = f'stamp {stamp_ns} ns is not after {last_ns} ns'
                    yield Taken(stamp_ns, None, fault)
                    continue
                last_ns = stamp_ns
                try:
                    rectified = is_rectified(self.image_topic)
                    yield Taken(stamp_ns, frame_from_message(message, info, rectified=rectified))
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
    if path.is_dir() or path.suffix in {'.mcap', '.db3'}:
        return BagSource(path, options)
    raise RecordingError(
        f'{path} is neither a bag (folder, .mcap, .db3) nor a video '
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
        return given
    found = [topic for topic in bag.find(types) if bag.count(topic)]
    for name in preferred:
        if name in found:
            return name
    if len(found) == 1:
        return found[0]
    listed = ', '.join(found) or f'none among {", ".join(bag.topics) or "no topics"}'
    raise RecordingError(f'bag {bag.path}: {option} is not clear, there is {listed}: name one')


def _poses(bag: BagReader, topic: str) -> list[Pose]:
    try:
        poses = [pose_from_message(message) for _, _, message in bag.messages([topic])]
    except VehicleError as error:
        raise RecordingError(f'bag {bag.path}: {error}') from error
    poses.sort(key=lambda pose: pose.stamp_ns)
    return [
        pose
        for before, pose in zip([None, *poses[:-1]], poses, strict=True)
        if before is None or pose.stamp_ns > before.stamp_ns
    ]


def _first(bag: BagReader, topic: str) -> Any:
    for _, _, message in bag.messages([topic]):
        return message
    raise RecordingError(f'topic {topic} of bag {bag.path} has 0 messages: choose another')


def _info_topic(
    bag: BagReader, image_topic: str, frame_id: str, options: SourceOptions
) -> str | None:
    """Return the topic of the calibration of the images, None where there is none to be used.

    Raises:
        RecordingError: it holds no calibration, or there are only those of other cameras.
    """
    if options.fov_x_deg is not None:
        return None
    found = [topic for topic in bag.find([_CAMERA_INFO]) if bag.count(topic)]
    own = camera_info_topic(image_topic)
    if own not in found:
        same = [each for each in found if _first(bag, each).header.frame_id == frame_id]
        if len(same) != 1:
            if not found:
                return None
            raise RecordingError(
                f'bag {bag.path}: none of {", ".join(found)} is beside {image_topic}, and '
                f'{len(same)} of them have its frame_id {frame_id!r}: give --fov'
            )
        own = same[0]
    info = _first(bag, own)
    focal_px = float((info.p if is_rectified(image_topic) else info.k)[0])
    if not focal_px > 0.0:
        raise RecordingError(
            f'{own} of bag {bag.path} with focal length {focal_px} px is not calibrated: give --fov'
        )
    return own


def _recorded_mount(bag: BagReader, frame_id: str) -> Mount:
    """Return the mount by /tf_static, nadir where it says nothing of the camera."""
    transforms = StaticTransforms()
    if bag.topics.get(_TF_STATIC) == 'tf2_msgs/msg/TFMessage':
        for _, _, message in bag.messages([_TF_STATIC]):
            transforms.add(message)
    try:
        return transforms.mount(_VEHICLE_FRAME, frame_id)
    except ConfigurationError:
        return NADIR


def _engaged_ns(bag: BagReader) -> int | None:
    """Return when a recorded landing node began to act."""
    if bag.topics.get(_STATUS_TOPIC) != 'diagnostic_msgs/msg/DiagnosticArray':
        return None
    for _, _, message in bag.messages([_STATUS_TOPIC]):
        if diagnostic_values(message).get('state', 'IDLE') != 'IDLE':
            return stamp_ns_of(message)
    return None
