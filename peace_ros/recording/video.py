# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Video files: frames with an assumed altitude profile, and writing overlays as a video."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Pose, RecordingError

VIDEO_SUFFIXES = ('.mp4', '.avi', '.mkv', '.mov', '.webm', '.m4v')

_LEVEL_NORTH = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class AltitudeProfile:
    """Assumed altitude of a video without telemetry: linear from its first to its last frame."""

    start_m: float
    end_m: float

    def __post_init__(self) -> None:
        for value in (self.start_m, self.end_m):
            if not 0.0 < value <= 10_000.0:
                raise RecordingError(
                    f'altitude {value} m of the video: give START:END in metres above the ground, '
                    'each above 0 and up to 10000'
                )

    @classmethod
    def parse(cls, text: str) -> AltitudeProfile:
        """Read ``START:END`` in metres, e.g. ``100:20``.

        Raises:
            RecordingError: anything else.
        """
        start, colon, end = text.partition(':')
        try:
            return cls(float(start), float(end if colon else start))
        except ValueError as error:
            raise RecordingError(
                f'altitude profile {text!r}: give START:END in metres, e.g. 100:20'
            ) from error

    def at(self, fraction: float) -> float:
        """Return metres above the ground at a fraction (0 to 1) of the video."""
        return self.start_m + fraction * (self.end_m - self.start_m)


class VideoReader:
    """The frames of a video file, one at a time, with level poses at the origin."""

    def __init__(
        self, path: Path, altitude: AltitudeProfile, frame_hz: float | None = None
    ) -> None:
        """Open a file.

        ``frame_hz`` is the rate at which the camera took the frames, where the file was written
        to play faster than real time; the file's own rate when None.

        Raises:
            RecordingError: the file is missing or no video that OpenCV reads.
        """
        if not path.is_file():
            raise RecordingError(f'video {path} does not exist: give a video file')
        self.path = path
        self._altitude = altitude
        capture = cv2.VideoCapture(str(path))
        self.count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
        file_hz = capture.get(cv2.CAP_PROP_FPS) if capture.isOpened() else 0.0
        capture.release()
        if self.count < 1:
            raise RecordingError(
                f'video {path} holds no frames that OpenCV can read: give H.264 or MPEG-4 in one '
                f'of {", ".join(VIDEO_SUFFIXES)}'
            )
        self.frame_hz = frame_hz or (file_hz if file_hz > 0.0 else 25.0)

    def frames(self) -> Iterator[tuple[int, Frame]]:
        """Yield (index, frame) from the first to the last; stamps begin at one second.

        Raises:
            RecordingError: decoding breaks off in the middle.
        """
        capture = cv2.VideoCapture(str(self.path))
        try:
            index = 0
            while True:
                there, image = capture.read()
                if not there or image is None:
                    break
                rgb = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)
                yield index, Frame(rgb, self.stamp_ns(index))
                index += 1
        finally:
            capture.release()
        # Containers count a frame or two more than they hold; a broken file lacks many.
        if index < 0.9 * self.count:
            raise RecordingError(
                f'video {self.path} breaks off after {index} of {self.count} frames: give an '
                'intact file'
            )

    def stamp_ns(self, index: int) -> int:
        """Return the stamp of a frame."""
        return 1_000_000_000 + round(index * 1e9 / self.frame_hz)

    def pose(self, index: int) -> Pose:
        """Return the assumed pose of a frame: level, nose north, above the origin."""
        altitude = self._altitude.at(min(1.0, index / max(1, self.count - 1)))
        return Pose(self.stamp_ns(index), 0.0, 0.0, -altitude, _LEVEL_NORTH, altitude)


@final
class VideoWriter:
    """Write an MPEG-4 file that appears under its name only when whole."""

    def __init__(self, path: Path, frame_hz: float) -> None:
        self.path = path
        self._hz = frame_hz
        self._partial = path.with_name(f'.{path.stem}.partial{path.suffix}')
        self._writer: cv2.VideoWriter | None = None
        self._size: tuple[int, int] | None = None

    def __enter__(self) -> VideoWriter:
        """Return itself; the file is created with the first frame, which gives its size."""
        return self

    def write(self, image_rgb: NDArray[np.uint8]) -> None:
        """Append a height x width x 3 uint8 RGB frame; all must have one size.

        Raises:
            RecordingError: OpenCV has no encoder, or the size changed.
        """
        size = (image_rgb.shape[1], image_rgb.shape[0])
        if self._writer is None:
            self._size = size
            self._writer = cv2.VideoWriter(
                str(self._partial), cv2.VideoWriter.fourcc(*'mp4v'), self._hz, size
            )
        if not self._writer.isOpened():
            raise RecordingError(
                f'video {self.path} of {size[0]} x {size[1]} px cannot be written: this OpenCV '
                'has no MPEG-4 encoder, or the folder is not writable'
            )
        if size != self._size:
            raise RecordingError(
                f'video {self.path}: frame of {size} px after ones of {self._size}'
            )
        self._writer.write(cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR))

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        """Put the file in its place, or remove it after an error."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
        writer.release()
        if error_type is None:
            self._partial.replace(self.path)
        else:
            self._partial.unlink(missing_ok=True)
