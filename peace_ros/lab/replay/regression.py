# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording as a regression test: its replay is kept in a file, and later ones compared."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from peace_ros.core.domain import RecordingError
from peace_ros.lab.replay.golden import Check, compare, first_difference_ns
from peace_ros.lab.replay.junit import write_junit
from peace_ros.lab.replay.moments import moment_sheets
from peace_ros.lab.replay.report import ReplayReport
from peace_ros.lab.replay.run import Progress, ReplayOptions, replay
from peace_ros.lab.replay.trace import Trace, TraceBuilder
from peace_ros.recording import save_picture
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
        traces = {'golden': expected, 'now': found}
        for sheet in moment_sheets(options, traces, [first_ns], 'first difference'):
            save_picture(sheet, folder / 'difference.png')
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
