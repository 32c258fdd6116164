# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay found, counted while it runs."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from peace_ros.core.pipeline import SegmentedFrame
from peace_ros.lab.replay.line import Step
from peace_ros.recording.run_folder import write_whole

SAFE_FROM = 0.5
"""Heatmap value from which the counts call a pixel safe."""


@dataclass
class ReplayReport:
    """What ``summary.json`` of a replay holds."""

    source: str
    config: str
    frames: int = 0
    """Frames that got a heatmap."""
    unusable_frames: int = 0
    first_fault: str = ''
    """Why the first unusable frame was one."""
    remarks: list[str] = field(default_factory=list)
    """What the user has to know of the recording, such as what was left out of it."""
    altitudes_m: tuple[float, float] | None = None
    """Highest and lowest altitude above ground of the poses."""
    recorded_s: float = 0.0
    """From the first frame to the last."""
    elapsed_s: float = 0.0
    """Wall clock."""
    prompts: list[str] = field(default_factory=list)
    """Distinct templates, in order."""
    states: list[dict[str, float | str]] = field(default_factory=list)
    """Visits of states: name, seconds and the first reason."""
    verdicts: dict[str, int] = field(default_factory=dict)
    """SITE and NO_ZONE -> decisions."""
    heatmaps: dict[str, int] = field(default_factory=dict)
    """Fate in the landing core -> heatmaps."""
    outcome: str | None = None
    """Of the landing core; null while it was still busy at the end."""
    mean_safe_fraction: float = 0.0
    """Mean part of the heatmaps at or above 0.5."""

    @property
    def was_engaged(self) -> bool:
        """The landing core acted: heatmaps reached its map and it left IDLE."""
        return bool(self.heatmaps.get('used')) and any(
            state['name'] != 'IDLE' for state in self.states
        )

    @property
    def faster_than_life(self) -> float:
        """Recorded seconds per second of the wall clock."""
        return self.recorded_s / self.elapsed_s if self.elapsed_s > 0.0 else 0.0

    def write(self, path: Path) -> None:
        """Write ``summary.json``, whole or not at all.

        Raises:
            RecordingError: the place cannot be written to.
        """
        content = {
            **asdict(self),
            'recorded_s': round(self.recorded_s, 3),
            'elapsed_s': round(self.elapsed_s, 3),
            'faster_than_life': round(self.faster_than_life, 2),
            'mean_safe_fraction': round(self.mean_safe_fraction, 4),
            'was_engaged': self.was_engaged,
        }
        write_whole(path, json.dumps(content, indent=2) + '\n', 'summary')


class ReportBuilder:
    """Follows a replay and fills its report."""

    def __init__(
        self, source: str, config: str, remarks: list[str], altitudes_m: tuple[float, float] | None
    ) -> None:
        self.report = ReplayReport(source, config, remarks=remarks, altitudes_m=altitudes_m)
        self._verdicts: Counter[str] = Counter()
        self._safe_sum = 0.0
        self._span_ns: tuple[int, int] | None = None
        self._state_since_ns = 0

    def add_fault(self, fault: str) -> None:
        """Count a frame that could not be used, and keep the first reason."""
        self.report.unusable_frames += 1
        self.report.first_fault = self.report.first_fault or fault

    def add_look(self, look: SegmentedFrame) -> None:
        """Count a heatmap."""
        report, stamp_ns = self.report, look.frame.stamp_ns
        report.frames += 1
        if look.prompt.template not in report.prompts:
            report.prompts.append(look.prompt.template)
        self._safe_sum += float(np.mean(look.heatmap.safety >= SAFE_FROM))
        report.mean_safe_fraction = self._safe_sum / report.frames
        self._span_ns = (self._span_ns[0] if self._span_ns else stamp_ns, stamp_ns)
        report.recorded_s = (self._span_ns[1] - self._span_ns[0]) * 1e-9

    def add_step(self, step: Step) -> None:
        """Follow the landing core from state to state."""
        report, decision = self.report, step.decision
        name = decision.state.value
        if report.states:
            elapsed_s = (step.stamp_ns - self._state_since_ns) * 1e-9
            report.states[-1]['seconds'] = round(elapsed_s, 3)
        if not report.states or report.states[-1]['name'] != name:
            report.states.append({'name': name, 'seconds': 0.0, 'reason': decision.reason})
            self._state_since_ns = step.stamp_ns
        self._verdicts[decision.verdict.kind.value] += 1
        report.verdicts = dict(self._verdicts)
        report.heatmaps = dict(decision.counts)
        report.outcome = decision.outcome
