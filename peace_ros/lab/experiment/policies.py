# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What flies the vehicle in an experiment: our landing core, or another over the same heatmaps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from peace_ros.core.domain import Camera, Heatmap, Pose, Setpoint, Telemetry
from peace_ros.core.landing import LandingCore
from peace_ros.core.pipeline import create_landing
from peace_ros.core.presets import Preset


@dataclass(frozen=True)
class Command:
    """What a policy wants now."""

    state: str
    reason: str
    setpoint: Setpoint
    outcome: str | None = None
    """`handover`, `no_zone`, `timeout`, `battery` or `aborted` once it is over."""
    attempts: int = 0
    """Descents that failed."""


class Policy(Protocol):
    """Lands a vehicle; times are nanoseconds of one simulated clock."""

    def add_pose(self, pose: Pose) -> None:
        """Take a pose, in the order of stamps."""

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Take a heatmap, when it is ready."""

    def step(self, now_ns: int, telemetry: Telemetry, age_s: float) -> Command:
        """Decide what to do now."""


class OurPolicy:
    """The landing core with the parameters of a preset."""

    def __init__(self, preset: Preset, camera: Camera) -> None:
        self._core: LandingCore = create_landing(preset, camera)
        self._core.engage()

    def add_pose(self, pose: Pose) -> None:
        """See :class:`Policy`."""
        self._core.add_pose(pose)

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """See :class:`Policy`."""
        self._core.add_heatmap(heatmap)

    def step(self, now_ns: int, telemetry: Telemetry, age_s: float) -> Command:
        """See :class:`Policy`."""
        decision = self._core.step(now_ns, telemetry, age_s)
        return Command(
            state=decision.state.value,
            reason=decision.reason,
            setpoint=decision.setpoint,
            outcome=decision.outcome,
            attempts=decision.attempts,
        )
