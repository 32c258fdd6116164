# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicle is, what the autopilot says, where to go: Pose, Telemetry, Site, Setpoint.

The local frame is NED: metres north, east and down of the autopilot's local origin.
Quaternions are (w, x, y, z) and rotate body FRD vectors into local NED.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

FARTHEST_M = 1e6
"""No position or height of a multicopter is farther from the local origin; others are rejected."""


@dataclass(frozen=True)
class Pose:
    """Position and attitude at one moment; north and east are NaN where they are not known."""

    stamp_ns: int
    north_m: float
    east_m: float
    down_m: float
    """Down of the local origin: negative in the air."""
    quaternion_ned_frd: tuple[float, float, float, float]
    altitude_agl_m: float
    """Above the ground under the vehicle."""

    @property
    def has_position(self) -> bool:
        """It tells where the vehicle can be, not only its attitude and altitude."""
        return abs(self.north_m) <= FARTHEST_M and abs(self.east_m) <= FARTHEST_M

    @property
    def has_height(self) -> bool:
        """Down and altitude are numbers that can be."""
        return abs(self.down_m) <= FARTHEST_M and abs(self.altitude_agl_m) <= FARTHEST_M

    @property
    def has_attitude(self) -> bool:
        """The quaternion is a rotation."""
        return 0.98 < sum(part * part for part in self.quaternion_ned_frd) < 1.02


@dataclass(frozen=True)
class HeightReport:
    """A height that does not rest on the barometer."""

    source: str
    """Its name in a sentence."""
    height_m: float
    error_m: float
    """Standard deviation."""
    above_ground: bool = True
    """Above the ground below; otherwise only its changes count (GNSS: above the sea)."""
    is_narrow: bool = False
    """It measures one spot of the ground, which may be a roof or a tree."""


@dataclass(frozen=True)
class GimbalReport:
    """How a gimbal is turned; its axes are forward (the view of its camera), right and down."""

    stamp_ns: int
    quaternion: tuple[float, float, float, float]
    """Unit quaternion w, x, y, z; straight ahead and level is (1, 0, 0, 0)."""
    in_earth: bool
    """Turned from NED; otherwise from level axes that are turned to the heading of the vehicle."""
    problem: str = ''
    """Why it must not be used; empty when it may."""


@dataclass(frozen=True)
class Telemetry:
    """What the autopilot last said; a field it has not said yet is None."""

    received_ns: int
    """Steady clock, when the newest of the parts arrived."""
    pose: Pose | None = None
    v_north_m_s: float = 0.0
    v_east_m_s: float = 0.0
    v_down_m_s: float = 0.0
    armed: bool = False
    in_control: bool = False
    """The autopilot is in the mode in which it obeys our set-points (GUIDED, OFFBOARD)."""
    mode: str = ''
    """The autopilot's own name of its mode."""
    landed: bool | None = None
    status_text: str = ''
    """The newest STATUSTEXT."""
    battery_remaining: float | None = None
    """Part of the battery that is left, 0 to 1; None where the autopilot does not say."""
    heights: tuple[HeightReport, ...] = ()
    """Fresh heights by other sources than that of the pose."""
    gimbal: GimbalReport | None = None
    """The newest of the gimbal that is followed, None while none is fresh."""
    position_problem: str = ''
    """Why what it said of its position is not believed; empty while it is, and before it said
    anything."""
    mode_known: bool = True
    """The mode was reported after the last silence of the line that may have changed it."""
    fence: str = ''
    """What a fence of the autopilot does to the vehicle now; empty when nothing is reported."""
    other_commander: str = ''
    """Who else commands the vehicle by set-points; empty when nobody was seen."""
    explanation: str = ''
    """What the autopilot reports that may explain why the vehicle does not follow, or why it left
    our mode: fence, battery, STATUSTEXT; empty when it reports nothing."""


@dataclass(frozen=True)
class Site:
    """A place on the ground to land on."""

    north_m: float
    east_m: float
    clearance_m: float
    """Distance from its centre to the nearest ground that is not known to be safe."""
    area_m2: float
    """Area of the connected safe ground around it."""
    confidence: float
    """Mean safety score inside the clearance circle, 0 to 1."""
    age_s: float
    """Age of the newest look at its centre."""

    def distance_m(self, pose: Pose) -> float:
        """Horizontal distance from the point below the vehicle."""
        return hypot(self.north_m - pose.north_m, self.east_m - pose.east_m)


@dataclass(frozen=True)
class Setpoint:
    """A velocity command in the local frame; heading is held."""

    stamp_ns: int
    """Stamp of the frame that it rests on (0 when it rests on none)."""
    v_north_m_s: float = 0.0
    v_east_m_s: float = 0.0
    v_down_m_s: float = 0.0
    """Positive descends."""

    @property
    def is_zero(self) -> bool:
        """All three components are exactly zero."""
        return self.v_north_m_s == 0.0 and self.v_east_m_s == 0.0 and self.v_down_m_s == 0.0
