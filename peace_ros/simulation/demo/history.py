# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What happened in a run, as it was heard on the topics; the summary and pictures rest on it."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose


@dataclass(frozen=True)
class Status:
    """What the landing node said at one moment."""

    stamp_ns: int
    values: dict[str, str]
    """The key/value pairs of ``landing/status``."""
    sentence: str = ''

    @property
    def state(self) -> str:
        """Name of the state, empty when the node has not said it."""
        return self.values.get('state', '')

    def number(self, key: str) -> float | None:
        """Return a value as a number; None when it is absent or no number."""
        try:
            return float(self.values[key])
        except (KeyError, ValueError):
            return None


@dataclass
class StateSpan:
    """One visit of a state."""

    name: str
    begin_ns: int
    end_ns: int
    status: Status
    frame_rgb: NDArray[np.uint8] | None = None
    heatmap: NDArray[np.uint8] | None = None
    prompt: str = ''
    pose: Pose | None = None

    @property
    def seconds(self) -> float:
        """How long it lasted, by the node clock."""
        return max(0.0, (self.end_ns - self.begin_ns) * 1e-9)


@dataclass
class History:
    """Everything that the summary needs, fed from the topics in order of receipt."""

    engaged_ns: int | None = None
    """Node clock when the landing node accepted the engagement."""
    spans: list[StateSpan] = field(default_factory=list)
    prompts: list[str] = field(default_factory=list)
    """Distinct templates, in order."""
    heatmap_stamps_ns: list[int] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    """Ground truth, in local NED."""
    sites: list[tuple[float, float, float]] = field(default_factory=list)
    """Distinct sites: north, east, clearance (m)."""
    status: Status | None = None
    prompt: str = ''
    frame_rgb: NDArray[np.uint8] | None = None
    heatmap: NDArray[np.uint8] | None = None

    def add_heatmap(
        self, stamp_ns: int, heatmap: NDArray[np.uint8], frame_rgb: NDArray[np.uint8] | None
    ) -> None:
        """Count a heatmap; its frame is None when it was not heard."""
        self.heatmap_stamps_ns.append(stamp_ns)
        self.heatmap = heatmap
        self.frame_rgb = frame_rgb if frame_rgb is not None else self.frame_rgb

    def add_prompt(self, template: str) -> None:
        """Remember a prompt template when it is new."""
        self.prompt = template
        if template not in self.prompts:
            self.prompts.append(template)

    def add_pose(self, pose: Pose) -> None:
        """Append a pose of the ground truth; older ones than the last are dropped."""
        if not self.poses or pose.stamp_ns > self.poses[-1].stamp_ns:
            self.poses.append(pose)

    def add_status(self, status: Status) -> None:
        """Follow the landing node from state to state."""
        self.status = status
        if not status.state:
            return
        if self.spans:
            self.spans[-1].end_ns = status.stamp_ns
        if not self.spans or self.spans[-1].name != status.state:
            self.spans.append(
                StateSpan(
                    status.state,
                    status.stamp_ns,
                    status.stamp_ns,
                    status,
                    self.frame_rgb,
                    self.heatmap,
                    self.prompt,
                    self.poses[-1] if self.poses else None,
                )
            )
        self._add_site(status)

    def _add_site(self, status: Status) -> None:
        north, east = status.number('site_north_m'), status.number('site_east_m')
        if north is None or east is None:
            return
        clearance = status.number('site_clearance_m') or 0.0
        near = self.sites and abs(self.sites[-1][0] - north) + abs(self.sites[-1][1] - east) < 5.0
        if near:
            self.sites[-1] = (north, east, clearance)
        else:
            self.sites.append((north, east, clearance))

    def pose_at(self, stamp_ns: int) -> Pose | None:
        """Return the pose of the ground truth nearest to a stamp."""
        if not self.poses:
            return None
        stamps = [pose.stamp_ns for pose in self.poses]
        after = bisect_left(stamps, stamp_ns)
        near = self.poses[max(0, after - 1) : after + 1]
        return min(near, key=lambda pose: abs(pose.stamp_ns - stamp_ns))

    def engaged_spans(self) -> list[StateSpan]:
        """Return the visits of states since the engagement, IDLE left out."""
        since = self.engaged_ns
        if since is None:
            return []
        return [span for span in self.spans if span.end_ns >= since and span.name != 'IDLE']

    def frames_until(self, end_ns: int | None) -> int:
        """Return how many heatmaps the landing node could rest its decisions on."""
        since = self.engaged_ns
        if since is None or end_ns is None:
            return 0
        return sum(since <= stamp <= end_ns for stamp in self.heatmap_stamps_ns)

    def heatmap_hz(self, window_s: float = 5.0) -> float:
        """Return heatmaps per second of the node clock over the last seconds."""
        if len(self.heatmap_stamps_ns) < 2:
            return 0.0
        last = self.heatmap_stamps_ns[-1]
        begin = last - round(window_s * 1e9)
        recent = [stamp for stamp in self.heatmap_stamps_ns if stamp >= begin]
        span_s = (recent[-1] - recent[0]) * 1e-9
        return (len(recent) - 1) / span_s if span_s > 0.0 else 0.0
