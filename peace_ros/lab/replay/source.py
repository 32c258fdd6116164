# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a replay gets its frames and poses: a bag or a video, and maybe a log of the flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Protocol

from peace_ros.core.domain import (
    NADIR,
    Frame,
    Mount,
    PeaceError,
    Pose,
    RecordingError,
    VehicleError,
)
from peace_ros.core.messages import (
    diagnostic_values,
    frame_from_message,
    is_rectified,
    pose_from_message,
    stamp_ns_of,
)
from peace_ros.lab.replay.calibration import RecordedCalibration
from peace_ros.lab.replay.source_options import DEFAULT_ALTITUDE, SourceOptions
from peace_ros.recording import AltitudeProfile, BagReader, VideoReader
from peace_ros.recording.flight_log import subtitles_of
from peace_ros.recording.messages import IMAGE_TYPES, POSE_TYPES
from peace_ros.recording.storages import STORAGES, is_recording
from peace_ros.recording.video import FIRST_STAMP_NS, VIDEO_SUFFIXES

_CLOCKS_APART_S = 3600.0
"""A recording may begin long before its first image; clocks that differ, differ by more."""
_STATUS_TOPIC = '/landing/status'
_PREFERRED_IMAGES = ('/image', '/image/compressed')
_PREFERRED_POSES = ('/ground_truth/pose', '/pose')


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
    altitudes_are_recorded: bool
    """Otherwise the user or a default gave them."""
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
    """A video; its poses come from a log, else it is assumed to look straight down."""

    def __init__(self, path: Path, options: SourceOptions) -> None:
        self.path = path
        self.options = options
        self.mount = options.mount or NADIR
        self._reader = VideoReader(path)
        self.count = _Picker(options).about(self._reader.count)
        self.remarks: list[str] = []
        self.altitudes_are_recorded = True
        self.poses = self._poses()
        self.remarks += self._reader.remarks
        self.engage_ns: int | None = None
        self.frame_hz = self._reader.frame_hz / options.every

    def frames(self) -> Iterator[Taken]:
        """Yield the chosen frames; those that cannot be decoded with their fault."""
        picker, told, last_ns = _Picker(self.options), len(self._reader.remarks), -1
        for stamp_ns, rgb, fault in self._reader.pictures():
            if picker.takes(stamp_ns):
                told_fault = _order_fault(stamp_ns, last_ns) or fault
                frame = None if rgb is None or told_fault else Frame(rgb, stamp_ns)
                last_ns = max(last_ns, stamp_ns)
                yield Taken(stamp_ns, frame, told_fault)
            if picker.is_done:
                break
        self.remarks += self._reader.remarks[told:]

    def _poses(self) -> list[Pose]:
        options, end_ns = self.options, self._reader.end_ns
        log = options.log
        if log is None and options.altitude is None:
            log = subtitles_of(self.path)
        if log is None:
            self.altitudes_are_recorded = False
            altitude = options.altitude or DEFAULT_ALTITUDE
            self.remarks.append(
                f'no altitude was recorded: {altitude} m is assumed, linear (--altitude)'
            )
            return AltitudeProfile.parse(altitude).poses(FIRST_STAMP_NS, end_ns)
        poses = options.read_log(log, self.remarks, FIRST_STAMP_NS)
        if not poses or poses[0].stamp_ns > end_ns or poses[-1].stamp_ns < FIRST_STAMP_NS:
            raise RecordingError(
                f'no pose of {log} is within the {(end_ns - FIRST_STAMP_NS) * 1e-9:.1f} s of '
                f'{self.path}: give --time-offset'
            )
        return poses


class BagSource:
    """An image topic, its camera_info, and a pose topic of a bag."""

    altitudes_are_recorded = True

    def __init__(self, path: Path, options: SourceOptions) -> None:
        self.path = path
        self.options = options
        with BagReader(path) as bag:
            self.image_topic = _choose(
                bag, options.image_topic, IMAGE_TYPES, _PREFERRED_IMAGES, '--image-topic'
            )
            self.count = _Picker(options).about(bag.count(self.image_topic))
            if not self.count:
                raise RecordingError(
                    f'topic {self.image_topic} of bag {path} has 0 messages: choose another'
                )
            self.remarks = list(bag.remarks)
            self.poses = self._poses(bag)
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
                if fault := _order_fault(stamp_ns, last_ns) or self._clock_fault(stamp_ns):
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

    def _clock_fault(self, stamp_ns: int) -> str:
        """Return why a stamp is not of the clock of the poses: one alone would end the replay."""
        after_s = (stamp_ns - self.poses[-1].stamp_ns) * 1e-9
        if after_s <= _CLOCKS_APART_S:
            return ''
        return f'stamp {stamp_ns} ns is {after_s:.0f} s after the last pose: its clock jumped'

    def _poses(self, bag: BagReader) -> list[Pose]:
        options = self.options
        if options.log is not None:
            return options.read_log(options.log, self.remarks)
        topic = _choose(bag, options.pose_topic, POSE_TYPES, _PREFERRED_POSES, '--pose-topic')
        return options.above_ground(_poses(bag, topic, self.remarks))


def _order_fault(stamp_ns: int, last_ns: int) -> str:
    return '' if stamp_ns > last_ns else f'stamp {stamp_ns} ns is not after {last_ns} ns'


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
            'clock (synchronise the autopilot, or let the driver stamp in ROS time), or give '
            '--time-offset with --log'
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
