# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What must be true before anything moves: control, telemetry, heatmaps, time."""

from __future__ import annotations

from math import isfinite

from peace_ros.domain import Pose, Telemetry
from peace_ros.landing.parameters import LandingParameters

_NS = 1e-9


def valid_pose(telemetry: Telemetry | None, parameters: LandingParameters) -> Pose | None:
    """Return the pose of telemetry when it can be believed."""
    pose = None if telemetry is None else telemetry.pose
    if pose is None:
        return None
    numbers = (pose.north_m, pose.east_m, pose.altitude_agl_m)
    if not all(isfinite(number) for number in numbers):
        return None
    return pose if 0.0 < pose.altitude_agl_m <= parameters.altitude_limit_m else None


class ControlWatch:
    """Notices when somebody else takes over; one per engagement."""

    def __init__(self) -> None:
        self._had_control = self._was_armed = False
        self.taken_over = ''
        """Why the vehicle is no longer ours; never emptied again."""

    def see(self, telemetry: Telemetry | None) -> None:
        """Look at telemetry, even old: a take-over that was said once is believed."""
        if telemetry is None or self.taken_over:
            return
        if self._had_control and not telemetry.in_control:
            self.taken_over = (
                f'the autopilot went to mode {telemetry.mode or "unknown"} unasked: '
                'a pilot or a failsafe flies now'
            )
        elif self._was_armed and not telemetry.armed:
            self.taken_over = 'the vehicle was disarmed'
        self._had_control |= telemetry.in_control and telemetry.armed
        self._was_armed |= telemetry.armed


def bad_telemetry(telemetry: Telemetry | None, age_s: float, parameters: LandingParameters) -> str:
    """Return what is wrong with telemetry in a sentence, empty when it can be trusted."""
    p = parameters
    if telemetry is None or telemetry.pose is None:
        return 'the autopilot has not said where it is: check its streams'
    if not age_s <= p.telemetry_age_limit_s:
        return f'telemetry is {age_s:.1f} s old, limit {p.telemetry_age_limit_s:.1f} s'
    pose = telemetry.pose
    if valid_pose(telemetry, p) is None:
        return (
            f'position {pose.north_m:.1f}, {pose.east_m:.1f} m at {pose.altitude_agl_m:.1f} m '
            f'above ground is not valid: altitude must lie within 0 to {p.altitude_limit_m:.0f} m'
        )
    if not telemetry.armed or telemetry.landed:
        return 'the vehicle is not in the air'
    if not telemetry.in_control:
        return f'the autopilot obeys mode {telemetry.mode or "unknown"}, not us'
    return ''


def bad_map(map_age_s: float, last_rejection: str, parameters: LandingParameters) -> str:
    """Return what is wrong with the stream of heatmaps, empty when it can be trusted."""
    limit = parameters.heatmap_age_limit_s
    if map_age_s <= limit:
        return ''
    why = f'; the last one was rejected: {last_rejection}' if last_rejection else ''
    if not isfinite(map_age_s):
        return f'no heatmap has come yet{why}'
    return f'the newest heatmap is {map_age_s:.1f} s old, limit {limit:.1f} s{why}'


class TimeBudget:
    """Counts the time of an engagement, and the time without any site."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._begun_ns: int | None = None
        self._last_ns = 0
        self._ever_site = False
        self.without_site_s = 0.0
        self.outcome = ''
        """`no_zone` or `timeout` once the time is used up."""
        self.reason = ''

    def spend(self, now_ns: int, *, looking: bool, site_known: bool) -> None:
        """Tell the time; ``looking`` is whether a site is looked for with good data."""
        if self._begun_ns is None:
            self._begun_ns = self._last_ns = now_ns
        elapsed_s = max(0.0, (now_ns - self._last_ns) * _NS)
        self._last_ns = max(now_ns, self._last_ns)
        self._ever_site |= site_known
        if site_known:
            self.without_site_s = 0.0
        elif looking:
            self.without_site_s += elapsed_s
        if self.outcome:
            return
        total_s = (self._last_ns - self._begun_ns) * _NS
        if self.without_site_s > self._p.max_search_s:
            self.outcome = 'no_zone'
            self.reason = f'no safe place was found in {self._p.max_search_s:.0f} s of searching'
        elif total_s > self._p.max_total_s:
            self.outcome = 'timeout' if self._ever_site else 'no_zone'
            self.reason = f'not landed within {self._p.max_total_s:.0f} s'
