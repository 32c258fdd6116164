# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Video files: frames with their own times, an assumed altitude, and overlays as a video.

Files are read with PyAV (libav), which comes with the extra ``video`` and is imported only here.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from heapq import heappop, heappush
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, final

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose, RecordingError
from peace_ros.core.images import MAX_PIXELS

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

VIDEO_SUFFIXES = ('.mp4', '.avi', '.mkv', '.mov', '.webm', '.m4v', '.ts')
FIRST_STAMP_NS = 1_000_000_000
"""Of the first frame of a video."""
LONGEST_S = 12 * 3600.0
"""Longest video: longer ones are files with damaged times."""

_FORMATS = 'mov,matroska,avi,mpegts'
"""Containers of libav. Not its play lists: they may name other files and addresses."""
_ASSUMED_HZ = 25.0
_ENDS_EARLY_S = 2.0
"""Sound may end after the last picture, and the last picture is shown for a while."""
_ONE_FRAME_PER_PACKET = ('h264', 'hevc')
"""Codecs whose decoders may leave out a damaged frame without an error."""
_POSE_STEP_NS = 100_000_000
_QUARTER_DEG = 90
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

    def poses(self, begin_ns: int, end_ns: int) -> list[Pose]:
        """Return poses at 10 Hz from the first to the last frame: level, nose north, one place."""
        steps = max(1, -((begin_ns - end_ns) // _POSE_STEP_NS))
        stamps = np.linspace(begin_ns, max(end_ns, begin_ns + 1), steps + 1)
        found = []
        for step, stamp in enumerate(stamps):
            altitude = self.at(step / steps)
            found.append(Pose(round(stamp), 0.0, 0.0, -altitude, _LEVEL_NORTH, altitude))
        return found


class VideoPicture(NamedTuple):
    """One frame of a video."""

    stamp_ns: int
    rgb: NDArray[np.uint8] | None
    """Height x width x 3, turned as the file says; None where it cannot be decoded."""
    fault: str = ''
    """Why it cannot be decoded."""


@final
class VideoReader:
    """The frames of a video file, one at a time, at the times that the file gives them.

    Frames are counted by reading the file: the header of a live recording does not tell their
    number, and with a variable frame rate it does not tell their times.
    """

    def __init__(self, path: Path) -> None:
        """Read the times of all frames.

        Raises:
            RecordingError: the file is missing or not a video, or its codec is not known here.
        """
        self.path = path
        self.remarks: list[str] = []
        """What the user has to know of the file, such as where it breaks off."""
        with self._opened() as (container, stream):
            times = sorted(_packet_times(container, stream))
            if not times:
                raise RecordingError(
                    f'video {path} holds no frames: give an intact file of '
                    f'{", ".join(VIDEO_SUFFIXES)}'
                )
            self._begin_s = times[0]
            self.count = len(times)
            announced_s = (container.duration or 0) * 1e-6
            if stream.frames > self.count or announced_s > times[-1] - times[0] + _ENDS_EARLY_S:
                self.remarks.append(
                    f'the video announces {stream.frames or "some"} frames in {announced_s:.1f} s, '
                    f'{self.count} are there in {times[-1] - times[0]:.1f} s: it is cut short'
                )
            self.codec = stream.codec_context.codec.canonical_name
        span_s = times[-1] - times[0]
        if span_s > LONGEST_S:
            raise RecordingError(
                f'video {path}: its frames span {span_s / 3600.0:.3g} h, the limit is '
                f'{LONGEST_S / 3600.0:g} h: cut it, or repair its times'
            )
        self.end_ns = self._stamp_ns(times[-1])
        self.frame_hz = (self.count - 1) / span_s if span_s > 0.0 else _ASSUMED_HZ
        """Mean rate of the frames."""

    def pictures(self) -> Iterator[VideoPicture]:
        """Yield the frames in the order of their times.

        A frame that cannot be decoded comes with its fault, and so do those after it up to the
        next key frame, which are changes of it.

        Raises:
            RecordingError: none can be decoded, or the file cannot be read any more.
        """
        last_s, decoded, lost = self._begin_s - 1.0 / self.frame_hz, 0, 0
        damaged = told = ''
        with self._opened() as (container, stream):
            for frame in _decoded(container, stream):
                if isinstance(frame, Exception):
                    lost += 1
                    damaged = told = f'{self.codec} data cannot be decoded ({_reason(frame)})'
                    continue
                time_s = last_s + 1.0 / self.frame_hz if frame.time is None else frame.time
                last_s, stamp_ns = time_s, self._stamp_ns(time_s)
                decoded += 1
                damaged = '' if frame.key_frame and not frame.is_corrupt else damaged
                if damaged or frame.is_corrupt:
                    fault = damaged or f'{self.codec} data is damaged'
                    yield VideoPicture(stamp_ns, None, f'{fault}: give an intact file')
                    continue
                yield VideoPicture(stamp_ns, self._upright(frame))
        if lost:
            self.remarks.append(f'{lost} places of the video cannot be decoded; the last: {told}')
        if not decoded:
            raise RecordingError(
                f'video {self.path}: none of {self.count} frames can be decoded, codec '
                f'{self.codec}{f": {told}" if told else ""}: convert it to H.264'
            )

    def _stamp_ns(self, time_s: float) -> int:
        return FIRST_STAMP_NS + round((time_s - self._begin_s) * 1e9)

    def _upright(self, frame: Any) -> NDArray[np.uint8]:
        turn_deg = int(frame.rotation) % 360
        if turn_deg % _QUARTER_DEG:
            raise RecordingError(
                f'video {self.path} is to be turned by {turn_deg} deg: only quarter turns are '
                'known; remove the rotation, or convert it'
            )
        if turn_deg and not any('turned' in each for each in self.remarks):
            self.remarks.append(
                f'frames are turned by {turn_deg} deg, counter-clockwise, as the file says'
            )
        rgb: NDArray[np.uint8] = np.asarray(frame.to_ndarray(format='rgb24'), np.uint8)
        return np.ascontiguousarray(np.rot90(rgb, turn_deg // _QUARTER_DEG))

    @contextmanager
    def _opened(self) -> Iterator[tuple[InputContainer, VideoStream]]:
        """Open the file and choose its stream; errors of libav become a RecordingError."""
        import av  # noqa: PLC0415 -- optional: the extra "video"

        if not self.path.is_file():
            raise RecordingError(f'video {self.path} is not a file: give a video file')
        try:
            options = {'format_whitelist': _FORMATS, 'protocol_whitelist': 'file'}
            with av.open(f'file:{self.path}', options=options) as container:
                yield container, self._stream(container)
        except (av.FFmpegError, ValueError, MemoryError) as error:
            raise RecordingError(
                f'video {self.path} cannot be read ({_reason(error)}): give an intact file of '
                f'{", ".join(VIDEO_SUFFIXES)}'
            ) from error

    def _stream(self, container: InputContainer) -> VideoStream:
        # Cover pictures are streams as well, of one frame.
        streams = [each for each in container.streams.video if not _is_cover(each)]
        if not streams:
            raise RecordingError(f'video {self.path} holds no stream of pictures: give another')
        stream = streams[0]
        if stream.codec_context is None:
            raise RecordingError(
                f'video {self.path}: this libav cannot decode its codec: convert it to H.264'
            )
        width, height = stream.codec_context.width, stream.codec_context.height
        if width * height > MAX_PIXELS:
            raise RecordingError(
                f'video {self.path} of {width} x {height} px: the limit is {MAX_PIXELS} pixels: '
                'give a smaller one'
            )
        # A decoder that goes on after an error invents what is missing.
        stream.codec_context.options = {'err_detect': 'explode'}
        return stream


def _is_cover(stream: VideoStream) -> bool:
    return 'attached_pic' in str(stream.disposition)


def _packet_times(container: InputContainer, stream: VideoStream) -> Iterator[float]:
    """Yield the times of the packets that hold frames, in seconds, in the order of the file."""
    for number, packet in enumerate(container.demux(stream)):
        if not packet.size:
            continue
        ticks = packet.dts if packet.pts is None else packet.pts
        hz = float(stream.average_rate or _ASSUMED_HZ)
        yield number / hz if ticks is None else float(ticks * packet.time_base)


def _decoded(container: InputContainer, stream: VideoStream) -> Iterator[Any]:
    """Yield frames, and an error in place of each packet that gives none."""
    import av  # noqa: PLC0415 -- optional

    is_whole = stream.codec_context.codec.canonical_name in _ONE_FRAME_PER_PACKET
    waiting: list[int] = []
    for packet in container.demux(stream):
        if is_whole and packet.size and packet.pts is not None:
            heappush(waiting, packet.pts)
        try:
            for frame in packet.decode():
                # Frames come in the order of their times, so that earlier ones are lost.
                lost = 0
                while waiting and frame.pts is not None and waiting[0] <= frame.pts:
                    lost += heappop(waiting) < frame.pts
                if lost:
                    yield ValueError(f'{lost} frames are missing')
                yield frame
        except av.FFmpegError as error:
            yield error


def _reason(error: Exception) -> str:
    return str(getattr(error, 'strerror', None) or error).strip()


@final
class VideoWriter:
    """Write an MPEG-4 file that appears under its name only when whole."""

    def __init__(self, path: Path, frame_hz: float) -> None:
        self.path = path
        self._hz = frame_hz
        self._partial = path.with_name(f'.{path.stem}.partial{path.suffix}')
        self._writer: cv2.VideoWriter | None = None
        self._size: tuple[int, int] | None = None
        self._written = 0

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
        self._written += 1

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        """Put the file in its place, or remove it after an error.

        Raises:
            RecordingError: the file is not whole, such as on a full disk.
        """
        writer, self._writer = self._writer, None
        if writer is None:
            return
        writer.release()
        try:
            if error_type is None:
                self._check()
                self._partial.replace(self.path)
        finally:
            self._partial.unlink(missing_ok=True)

    def _check(self) -> None:
        """Count the frames in the file: OpenCV gives no error when the disk takes no more."""
        written = cv2.VideoCapture(str(self._partial))
        count = round(written.get(cv2.CAP_PROP_FRAME_COUNT)) if written.isOpened() else 0
        written.release()
        if count != self._written:
            raise RecordingError(
                f'video {self.path} cannot be written, {count} of {self._written} frames are in '
                'the file: give a folder that has room'
            )
