# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replay one recording into one output folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from peace_ros.core.domain import PeaceError, RecordingError
from peace_ros.core.pipeline import SegmentedFrame
from peace_ros.core.presets import DEFAULT_PRESET, load_preset
from peace_ros.lab.replay.altitude_check import AltitudeCheck
from peace_ros.lab.replay.line import ReplayLine, Step
from peace_ros.lab.replay.outputs import ReplayOutputs
from peace_ros.lab.replay.report import ReplayReport, ReportBuilder
from peace_ros.lab.replay.source import (
    RecordingSource,
    Taken,
    VideoSource,
    open_source,
)
from peace_ros.lab.replay.source_options import SourceOptions
from peace_ros.recording.run_folder import create_run_folder

Progress = Callable[[int, int, str], None]
"""Called with frames done, frames in all, and what the landing core does."""

_TAIL_NS = 1_000_000_000
"""Decisions go on for this long after the last frame."""


@dataclass(frozen=True)
class ReplayOptions:
    """What a user may ask of ``peace replay``."""

    source: Path
    config: str = DEFAULT_PRESET
    out: Path | None = None
    """Folder of the results; None: ``runs/<name of the source>_replay`` where the user stands."""
    part: SourceOptions = field(default_factory=SourceOptions)

    def new_folder(self) -> Path:
        """Return the output folder, created.

        Raises:
            ConfigurationError: it holds something already or cannot be created.
        """
        return create_run_folder(self.out, f'{self.source.resolve().stem}_replay', '--out')


def replay(options: ReplayOptions, progress: Progress | None = None) -> tuple[ReplayReport, Path]:
    """Replay a recording; return what was found and the folder of the results.

    Raises:
        PeaceError: source, configuration, models or output folder cannot be used, or no frame
            of the recording can.
    """
    source = open_source(options.source, options.part)
    replayer = Replayer(source, options.config)
    folder = options.new_folder()
    title = f'{options.source.name}, {options.config}'
    video_hz = source.frame_hz if isinstance(source, VideoSource) else None
    with ReplayOutputs(folder, source.count, video_hz, title) as outputs:
        newest: Step | None = None
        for each in replayer.events():
            if isinstance(each, Step):
                newest = each
                outputs.add_step(each)
                continue
            outputs.add_look(each, newest)
            if progress is not None:
                doing = newest.decision.state.value if newest is not None else ''
                progress(replayer.report.frames, source.count, doing)
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
        self, source: RecordingSource, config: str = DEFAULT_PRESET, *, threads: int = 1
    ) -> None:
        self._source = source
        self._preset = load_preset(config)
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
        frames = self._source.frames()
        line: ReplayLine | None = None
        altitudes: AltitudeCheck | None = None
        last_ns = 0
        for taken in frames:
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

    def _line(self, taken: Taken) -> ReplayLine:
        """Load the models when the size of the images is known."""
        if taken.frame is None:
            raise RecordingError(f'frame at {taken.stamp_ns} ns cannot be used: {taken.fault}')
        width, height = taken.frame.size_px
        return ReplayLine(
            self._preset,
            self._source.options.assumed_camera(width, height),
            self._source.mount,
            self._source.poses,
            self._source.engage_ns,
            threads=self._threads,
        )
