# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording as a regression test: its replay is kept in a file, and later ones compared."""

from __future__ import annotations

import json
from bisect import bisect_right
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from peace_ros.core.domain import Frame, Heatmap, RecordingError
from peace_ros.core.segmentation import draw_overlay
from peace_ros.lab.replay.golden import Check, compare, first_difference_ns
from peace_ros.lab.replay.junit import write_junit
from peace_ros.lab.replay.report import ReplayReport
from peace_ros.lab.replay.run import Progress, ReplayOptions, replay
from peace_ros.lab.replay.source import open_source
from peace_ros.lab.replay.trace import Trace, TraceBuilder
from peace_ros.recording import save_picture
from peace_ros.recording.contact_sheet import Cell, draw_contact_sheet
from peace_ros.recording.run_folder import write_whole


@dataclass(frozen=True)
class GoldenOptions:
    """What a replay is compared with."""

    file: Path
    """Made when it does not exist."""
    remake: bool = False
    """Make it although it exists."""
    junit: Path | None = None
    """JUnit XML of the comparison, for continuous integration."""

    def expected(self) -> Trace | None:
        """Return the golden replay, None when it is to be made.

        Raises:
            RecordingError: it cannot be read; or it does not exist, and a continuous integration
                would approve whatever it finds.
        """
        if self.remake:
            return None
        if self.junit is not None and not self.file.exists():
            raise RecordingError(
                f'golden file {self.file} does not exist, so there is nothing to compare for '
                '--junit: make it without --junit, look at it, and commit it'
            )
        return Trace.read(self.file) if self.file.exists() else None


@dataclass(frozen=True)
class Regression:
    """A replay, compared with the golden one or made into it."""

    report: ReplayReport
    folder: Path
    found: Trace
    golden: Trace | None
    """None: the replay was made into the golden file."""
    checks: list[Check]
    first_ns: int | None
    """Stamp of the first difference."""

    @property
    def passed(self) -> bool:
        """Every check passed."""
        return all(each.passed for each in self.checks)


def replay_regression(
    options: ReplayOptions, golden: GoldenOptions, progress: Progress | None = None
) -> Regression:
    """Replay a recording, and compare it with the golden file or make that.

    The folder of the results gets ``golden.json`` with every check, and ``difference.png`` with
    the pictures of the first difference.

    Raises:
        PeaceError: the replay or a file fails, or nothing was engaged that could be golden.
    """
    expected = golden.expected()
    builder = TraceBuilder()
    report, folder = replay(options, progress, builder)
    found = builder.trace(options.preset, report)
    if expected is None:
        if not found.was_engaged:
            raise RecordingError(
                f'{options.source}: no heatmap reached the map of the landing core, so the replay '
                f'proves nothing and {golden.file} was not written: see the results in {folder}'
            )
        found.write(golden.file)
        return Regression(report, folder, found, None, [], None)
    checks = compare(found, expected)
    first_ns = first_difference_ns(checks)
    if first_ns is not None:
        _draw_difference(options, found, expected, first_ns, folder / 'difference.png')
    told = {
        'passed': all(each.passed for each in checks),
        'first_difference_ns': first_ns,
        'checks': [asdict(each) for each in checks],
        'golden_made_with': dict(expected.made_with),
        'made_with': dict(found.made_with),
    }
    write_whole(folder / 'golden.json', json.dumps(told, indent=2) + '\n', 'report')
    if golden.junit is not None:
        write_junit(golden.junit, f'replay {options.source.name}', checks, report.elapsed_s)
    return Regression(report, folder, found, expected, checks, first_ns)


def _draw_difference(
    options: ReplayOptions, found: Trace, golden: Trace, at_ns: int, path: Path
) -> None:
    """Write the frame of a moment with what each replay made of it."""
    frame = _frame_at(options, at_ns)
    if frame is None:
        return
    cells = [
        Cell(frame.image_rgb, f'frame at {frame.stamp_ns * 1e-9:.1f} s', options.source.name),
        _cell('golden', golden, frame, at_ns),
        _cell('now', found, frame, at_ns),
    ]
    save_picture(draw_contact_sheet(cells, f'first difference at {at_ns * 1e-9:.1f} s'), path)


def _frame_at(options: ReplayOptions, at_ns: int) -> Frame | None:
    """Return the last usable frame up to a moment, or the first one."""
    newest: Frame | None = None
    for taken in open_source(options.source, options.part).frames():
        if newest is not None and taken.stamp_ns > at_ns:
            break
        newest = taken.frame or newest
    return newest


def _cell(name: str, trace: Trace, frame: Frame, at_ns: int) -> Cell:
    """Return the frame as a replay saw it, with its decision of the moment."""
    index = int(np.searchsorted(trace.frame_stamps_ns, frame.stamp_ns))
    is_there = index < len(trace.masks) and trace.frame_stamps_ns[index] == frame.stamp_ns
    step = bisect_right(trace.step_stamps_ns.tolist(), at_ns) - 1
    state, told = 'no decision', ''
    if step >= 0:
        north_m, east_m = trace.sites_m[step]
        state = trace.states[step]
        place = f'site {north_m:.1f} N, {east_m:.1f} E m' if np.isfinite(north_m) else 'no site'
        north, east, down = trace.setpoints_m_s[step]
        told = f'{place}; set-point {north:.2f} N, {east:.2f} E, {down:.2f} down m/s; '
    if not is_there:
        return Cell(frame.image_rgb, f'{name}: {state}, no heatmap', told)
    heatmap = Heatmap(trace.safe(index).astype(np.float32), frame.stamp_ns)
    return Cell(draw_overlay(frame, heatmap), f'{name}: {state}', told + trace.prompts[index])
