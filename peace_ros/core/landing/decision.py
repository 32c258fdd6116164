# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Result of one step of the landing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from peace_ros.core.domain import Setpoint, Site
from peace_ros.core.landing.states import State


class VerdictKind(str, Enum):
    """Is there a place to land?"""

    SITE = 'SITE'
    NO_ZONE = 'NO_ZONE'


@dataclass(frozen=True)
class Verdict:
    """SITE with a site, or NO_ZONE with a reason."""

    kind: VerdictKind
    reason: str
    """A sentence."""
    site: Site | None = None

    @classmethod
    def found(cls, site: Site) -> Verdict:
        """Build SITE."""
        reason = f'site with {site.clearance_m:.1f} m of clearance'
        return cls(VerdictKind.SITE, reason, site)

    @classmethod
    def no_zone(cls, reason: str) -> Verdict:
        """Build NO_ZONE."""
        return cls(VerdictKind.NO_ZONE, reason)


@dataclass(frozen=True)
class Focus:
    """Circle on the ground in which a site may be chosen."""

    north_m: float
    east_m: float
    radius_m: float


@dataclass(frozen=True)
class RefusedPlace:
    """A place where no site is chosen, and the first condition that it does not meet."""

    north_m: float
    east_m: float
    clearance_m: float
    """Distance to ground that was never seen, or is more likely unsafe than safe."""
    distance_m: float
    """From the point below the vehicle."""
    reason: str


@dataclass(frozen=True)
class Decision:
    """Result of one step, for the vehicle, the status topic and the display."""

    state: State
    reason: str
    """Why the landing is in this state, and what motion waits for."""
    setpoint: Setpoint
    """After the guard: this may be sent."""
    verdict: Verdict
    effective_threshold: float
    """Safety score from which ground counts as safe now."""
    map_age_s: float
    """Age of the newest heatmap in the map; infinite without one."""
    focus: Focus | None
    """None while no position is known."""
    guard_notes: tuple[str, ...] = ()
    """Limits that made the motion smaller."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """Heatmaps by result: used, or the reason of the rejection."""
    outcome: str | None = None
    """`handover`, `no_zone`, `timeout`, `battery` or `aborted` once it is over."""
    time_in_state_s: float = 0.0
    failed_sites: int = 0
    """Places that are excluded because they failed."""
    attempts: int = 0
    """Descents that failed."""
    heights_m: Mapping[str, float] = field(default_factory=dict)
    """Height above ground by each source that the altitude was compared with."""
    refused: tuple[RefusedPlace, ...] = ()
    """The best places that are no sites, the best first."""
    relaxed: bool = False
    """The threshold has sunk below safety_threshold, which only relaxation allows."""

    @property
    def site(self) -> Site | None:
        """The site of the verdict: target of AIMING and LANDING, candidate while SEARCHING."""
        return self.verdict.site
