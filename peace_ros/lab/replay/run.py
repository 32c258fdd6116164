# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replay one recording into one output folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from peace_ros.core.domain import NADIR, Mount, PeaceError, RecordingError
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.core.pipeline import SegmentedFrame
from peace_ros.core.presets import DEFAULT_PRESET, Preset, load_preset
from peace_ros.lab.replay.altitude_check import AltitudeCheck
from peace_ros.lab.replay.assignments import with_assignments
from peace_ros.lab.replay.excerpt import Excerpt
from peace_ros.lab.replay.line import ReplayLine, Step
from peace_ros.lab.replay.outputs import ReplayOutputs
from peace_ros.lab.replay.recorded import recorded_preset
from peace_ros.lab.replay.report import ReplayReport, ReportBuilder
from peace_ros.lab.replay.source import (
    RecordingSource,
    Taken,
    VideoSource,
    open_source,
)
from peace_ros.lab.replay.source_options import SourceOptions
from peace_ros.lab.replay.trace import TraceBuilder
from peace_ros.recording.run_folder import create_run_folder

Progress = Callable[[int, int, str], None]
"""Called with frames done, frames in all, and what the landing core does."""

_WHOLE = Excerpt()
_TAIL_NS = 1_000_000_000
"""Decisions go on for this long after the last frame."""


@dataclass(frozen=True)
class ReplayOptions:
    """What a user may ask of ``peace replay``."""

    source: Path
    config: str | None = None
    """Preset; None: the parameters in a file of the flight recorder, else the default preset."""
    out: Path | None = None
    """Folder of the results; None: ``runs/<name of the source>_replay`` where the user stands."""
    part: SourceOptions = field(default_factory=SourceOptions)
    assignments: tuple[str, ...] = ()
    """Parameters in place of those of the preset, each ``NODE.PARAMETER=VALUE``."""
    segment: Excerpt = field(default_factory=Excerpt)
    engage_at_s: float | None = None
    """When the landing begins, in seconds since the first frame; None: as recorded, else with the
    first frame that is replayed."""

    def __post_init__(self) -> None:
        if self.engage_at_s is not None and not 0.0 <= self.engage_at_s < inf:
            raise RecordingError(
                f'--engage-at {self.engage_at_s}: give seconds since the first frame, 0 or more'
            )

    @property
    def preset(self) -> Preset:
        """The parameters of the three nodes.

        Raises:
            ConfigurationError: one of them cannot be used.
        """
        recorded = recorded_preset(self.source) if self.config is None else None
        return with_assignments(
            recorded or load_preset(self.config or DEFAULT_PRESET), self.assignments
        )

    def new_folder(self) -> Path:
        """Return the output folder, created.

        Raises:
            ConfigurationError: it holds something already or cannot be created.
        """
        return create_run_folder(self.out, f'{self.source.resolve().stem}_replay', '--out')


def replay(
    options: ReplayOptions, progress: Progress | None = None, trace: TraceBuilder | None = None
) -> tuple[ReplayReport, Path]:
    """Replay a recording; return what was found and the folder of the results.

    Args:
        options: what is replayed, and how.
        progress: is told how far the replay is.
        trace: gets every answer.

    Raises:
        PeaceError: source, configuration, models or output folder cannot be used, or no frame
            of the recording can.
    """
    preset = options.preset
    source = open_source(options.source, options.part)
    replayer = Replayer(source, preset, segment=options.segment, engage_at_s=options.engage_at_s)
    folder = options.new_folder()
    title = f'{options.source.name}, {preset.name}'
    video_hz = source.frame_hz if isinstance(source, VideoSource) else None
    with ReplayOutputs(folder, source.count, video_hz, title) as outputs:
        newest: Step | None = None
        for each in replayer.events():
            if isinstance(each, Step):
                newest = each
                outputs.add_step(each)
                if trace is not None:
                    trace.add_step(each)
                continue
            outputs.add_look(each, newest)
            if trace is not None:
                trace.add_look(each)
            if progress is not None:
                doing = newest.decision.state.value if newest is not None else ''
                progress(replayer.read, source.count, doing)
        if not replayer.report.frames and not replayer.report.unusable_frames:
            raise RecordingError(
                f'{options.source}: no frame lies in the segment, the last one is '
                f'{replayer.last_s:.1f} s after the first'
            )
        if not replayer.report.frames:
            raise RecordingError(
                f'{options.source}: none of {replayer.report.unusable_frames} frames can be used; '
                f'the first: {replayer.report.first_fault}'
            )
    replayer.report.write(folder / 'summary.json')
    return replayer.report, folder


class Replayer:
    """Runs the line over a source and counts what it finds."""

    def __init__(
        self,
        source: RecordingSource,
        preset: Preset | str = DEFAULT_PRESET,
        *,
        threads: int = 1,
        segment: Excerpt = _WHOLE,
        engage_at_s: float | None = None,
    ) -> None:
        self._source, self._segment, self._engage_at_s = source, segment, engage_at_s
        self.read = 0
        """Frames that have been read, also outside of the segment."""
        self.last_s = 0.0
        """The last of them, in seconds since the first."""
        self._first_ns: int | None = None
        self._preset = preset if isinstance(preset, Preset) else load_preset(preset)
        self._threads = threads
        heights = [round(pose.altitude_agl_m, 1) for pose in source.poses]
        self._builder = ReportBuilder(
            str(source.path),
            self._preset.name,
            list(source.remarks),
            (max(heights), min(heights)) if heights else None,
        )

    @property
    def report(self) -> ReplayReport:
        """What has been found so far."""
        return self._builder.report

    def events(self) -> Iterator[SegmentedFrame | Step]:
        """Yield looks and decisions in the order of their stamps.

        Raises:
            PeaceError: models or parameters cannot be used, or the recording breaks off.
        """
        began = time.monotonic()
        line: ReplayLine | None = None
        altitudes: AltitudeCheck | None = None
        last_ns = 0
        for taken in self._frames():
            if taken.frame is None:
                self._builder.add_fault(taken.fault)
                continue
            if line is None:
                line = self._line(taken)
                altitudes = AltitudeCheck(
                    self._source.options.assumed_camera(*taken.frame.size_px),
                    are_recorded=self._source.altitudes_are_recorded,
                )
            last_ns = taken.stamp_ns
            if gap_s := line.skip_gap(taken.stamp_ns):
                self.report.remarks.append(f'nothing was recorded for {gap_s:.0f} s: left out')
            for step in line.steps_until(taken.stamp_ns):
                self._builder.add_step(step)
                yield step
            try:
                look = line.look(taken.frame)
            except PeaceError as error:
                self._builder.add_fault(str(error))
                continue
            self._builder.add_look(look)
            if (pose := line.camera_pose_at(taken.stamp_ns)) is not None and altitudes is not None:
                altitudes.add(taken.frame, pose)
            self.report.elapsed_s = time.monotonic() - began
            yield look
        if line is not None:
            for step in line.steps_until(last_ns + _TAIL_NS):
                self._builder.add_step(step)
                yield step
        told = self.report.remarks
        told += [each for each in self._source.remarks if each not in told]
        if altitudes is not None and (doubt := altitudes.remark()) is not None:
            told.insert(0, doubt)
        self.report.elapsed_s = time.monotonic() - began

    def _frames(self) -> Iterator[Taken]:
        """Yield the frames of the segment."""
        for taken in self._source.frames():
            self.read += 1
            if self._first_ns is None:
                self._first_ns = taken.stamp_ns
            self.last_s = (taken.stamp_ns - self._first_ns) * 1e-9
            if self.last_s > self._segment.end_s:
                return
            if self.last_s >= self._segment.start_s:
                yield taken

    def _engage_ns(self) -> int | None:
        if self._engage_at_s is None:
            return self._source.engage_ns
        return (self._first_ns or 0) + round(self._engage_at_s * 1e9)

    def _line(self, taken: Taken) -> ReplayLine:
        """Load the models when the size of the images is known."""
        if taken.frame is None:
            raise RecordingError(f'frame at {taken.stamp_ns} ns cannot be used: {taken.fault}')
        width, height = taken.frame.size_px
        return ReplayLine(
            self._preset,
            self._source.options.assumed_camera(width, height),
            self._mount(),
            self._source.poses,
            self._engage_ns(),
            threads=self._threads,
        )

    def _mount(self) -> Mount:
        """Return how the camera sits: by the user, /tf_static, or the parameters of the landing."""
        if self._source.options.mount is None and self._source.mount == NADIR:
            return self._preset.fill('landing', CameraOptions).mount
        return self._source.mount
