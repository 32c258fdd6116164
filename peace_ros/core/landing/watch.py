# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conditions of every motion: control, telemetry, heatmaps, budgets."""

from __future__ import annotations

from math import hypot, isfinite

from peace_ros.core.domain import Pose, Telemetry
from peace_ros.core.landing.parameters import LandingParameters

_NS = 1e-9
_EXPLAINED_NS = 2_000_000_000
"""How long after a takeover the autopilot may report what explains it."""
_AT_ALTITUDE = 0.98
"""An altitude counts as reached at this part of it."""


def valid_pose(telemetry: Telemetry | None, parameters: LandingParameters) -> Pose | None:
    """Return the pose of telemetry when it is valid, else None."""
    pose = None if telemetry is None else telemetry.pose
    if pose is None or not pose.has_position:
        return None
    return pose if 0.0 < pose.altitude_agl_m <= parameters.altitude_limit_m else None


def at_safe_altitude(
    pose: Pose | None, parameters: LandingParameters, above_lowest_m: float = 0.0
) -> bool:
    """Return whether lateral motion meets no obstacle ``above_lowest_m`` below the pose."""
    if pose is None:
        return False
    return pose.altitude_agl_m - above_lowest_m >= _AT_ALTITUDE * parameters.safe_altitude_m


class ControlWatch:
    """Notices when a pilot or a failsafe takes over; one per engagement."""

    def __init__(self) -> None:
        self._had_control = self._was_armed = False
        self._what = self._why = ''
        self._lost_ns = 0

    @property
    def taken_over(self) -> str:
        """Why we are no longer in control of the vehicle; once set, it stays."""
        return f'{self._what} (the autopilot reports: {self._why})' if self._why else self._what

    def see(self, telemetry: Telemetry | None) -> None:
        """Check telemetry, even old: a take-over that was reported once counts."""
        if telemetry is None:
            return
        if self._what:
            # What explains it may come a moment later.
            if not self._why and telemetry.received_ns - self._lost_ns < _EXPLAINED_NS:
                self._why = telemetry.explanation
            return
        if self._had_control and not telemetry.in_control:
            self._what = (
                f'the autopilot changed to mode {telemetry.mode or "unknown"} without our request: '
                'a pilot or a failsafe is in control'
            )
        elif self._was_armed and not telemetry.armed:
            self._what = 'the vehicle was disarmed'
        if self._what:
            self._why, self._lost_ns = telemetry.explanation, telemetry.received_ns
        self._had_control |= telemetry.in_control and telemetry.armed
        self._was_armed |= telemetry.armed


def bad_vehicle(telemetry: Telemetry | None, age_s: float, parameters: LandingParameters) -> str:
    """Return why the vehicle does not fly at a known, valid position, empty when it does."""
    p = parameters
    if telemetry is None or telemetry.pose is None:
        silent = 'no telemetry: the autopilot has not said where it is; check its streams'
        return silent if telemetry is None else telemetry.position_problem or silent
    if not age_s <= p.telemetry_age_limit_s:
        limit_s = p.telemetry_age_limit_s
        return f'telemetry is {age_s:.1f} s old, limit {limit_s:.1f} s: check the connection'
    if not telemetry.armed:
        return 'the vehicle is not armed: it must be in the air'
    if telemetry.landed:
        return 'the vehicle is on the ground: it must be in the air'
    pose = telemetry.pose
    if valid_pose(telemetry, p) is None:
        return (
            f'position {pose.north_m:.6g}, {pose.east_m:.6g} m at {pose.altitude_agl_m:.6g} m '
            f'above ground is not valid: altitude must lie within 0 to {p.altitude_limit_m:.0f} m, '
            'position within 1000 km'
        )
    return ''


def bad_telemetry(telemetry: Telemetry | None, age_s: float, parameters: LandingParameters) -> str:
    """Return why set-points must stop for what telemetry says, empty when they may go on."""
    problem = bad_vehicle(telemetry, age_s, parameters)
    if problem or telemetry is None:
        return problem
    if not telemetry.in_control:
        return f'the autopilot is in mode {telemetry.mode or "unknown"}, in which it ignores us'
    if not telemetry.mode_known:
        return 'the connection was silent: nothing is sent until the autopilot reports its mode'
    return telemetry.other_commander


def bad_map(map_age_s: float, last_rejection: str, parameters: LandingParameters) -> str:
    """Return what is wrong with the stream of heatmaps, empty when it can be trusted."""
    limit = parameters.heatmap_age_limit_s
    if map_age_s <= limit:
        return ''
    why = f'the last one was rejected: {last_rejection}' if last_rejection else ''
    if not isfinite(map_age_s):
        why = why or 'is segmentation running, with the same clock?'
        return f'no heatmap yet: {why}'
    why = why or 'is segmentation running?'
    return f'the newest heatmap is {map_age_s:.1f} s old, limit {limit:.1f} s: {why}'


class Budget:
    """Counts what an engagement uses: time, distance, attempts and battery."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._begun_ns: int | None = None
        self._last_ns = 0
        self._spent_ns = 0
        self._last_at: tuple[float, float] | None = None
        self._ever_site = False
        self._policy_done = False
        self._failed_because = ''
        self.without_site_s = 0.0
        """Time in search since a site was last known."""
        self.searched_s = 0.0
        """Time in search altogether."""
        self.search_m = 0.0
        """Distance flown in search."""
        self.attempts = 0
        """Descents that failed."""
        self.outcome = ''
        """`no_zone`, `timeout` or `battery` once one of them is used up."""
        self.reason = ''
        """Which one, in words."""

    def spend(
        self, now_ns: int, telemetry: Telemetry | None, *, looking: bool, site_known: bool
    ) -> None:
        """Count one step; ``looking`` is whether a site is searched with good data."""
        if self._begun_ns is None:
            self._begun_ns = self._last_ns = now_ns
        elapsed_s = max(0.0, (now_ns - self._last_ns) * _NS)
        self._last_ns = max(now_ns, self._last_ns)
        self._ever_site |= site_known
        self._measure_way(telemetry, looking=looking)
        if looking:
            self.searched_s += elapsed_s
        if site_known:
            self.without_site_s = 0.0
        elif looking:
            self.without_site_s += elapsed_s
        if not self.outcome:
            self.outcome, self.reason = self._used_up(telemetry)
            self._spent_ns = self._last_ns

    def fail_attempt(self, why: str = '') -> None:
        """Count a descent that failed; once a budget is used up there is no further one."""
        self.attempts += 1
        self._failed_because = f' (the last: {why})' if why else ''
        if self.outcome:
            self.finish_policy()

    def finish_policy(self) -> None:
        """Note that the policy for a used-up budget has nothing more to do."""
        self._policy_done = True

    @property
    def policy_open(self) -> bool:
        """The policy for a used-up budget has something to do before it holds."""
        if not self.outcome or self._policy_done or self._p.budget_policy == 'hold':
            return False
        return (self._last_ns - self._spent_ns) * _NS <= self._p.policy_time_s

    def _measure_way(self, telemetry: Telemetry | None, *, looking: bool) -> None:
        pose = valid_pose(telemetry, self._p)
        at = None if pose is None or not looking else (pose.north_m, pose.east_m)
        if at is not None and self._last_at is not None:
            self.search_m += hypot(at[0] - self._last_at[0], at[1] - self._last_at[1])
        self._last_at = at

    def _used_up(self, telemetry: Telemetry | None) -> tuple[str, str]:
        p = self._p
        total_s = (self._last_ns - (self._begun_ns or 0)) * _NS
        battery = None if telemetry is None else telemetry.battery_remaining
        if self.attempts >= p.max_attempts:
            failed = f'{self.attempts} descents failed, limit {p.max_attempts}'
            return 'no_zone', failed + self._failed_because
        if self.without_site_s > p.max_search_s:
            return 'no_zone', f'no safe place was found in {p.max_search_s:.0f} s of searching'
        if self.search_m > p.search_distance_m:
            return 'no_zone', f'no safe place was found on {p.search_distance_m:.0f} m of searching'
        # `not >`: a level that is not a number counts as empty.
        if p.battery_reserve > 0.0 and battery is not None and not battery > p.battery_reserve:
            return 'battery', f'battery at {battery:.0%}, reserve {p.battery_reserve:.0%}'
        if total_s > p.max_total_s:
            outcome = 'timeout' if self._ever_site else 'no_zone'
            return outcome, f'not landed within {p.max_total_s:.0f} s'
        return '', ''
