# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the landing can be told, and the limits that nothing can cross."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import check, parameter

SAFETY_THRESHOLD_FLOOR = 0.65
"""No configuration lets ground of a lower safety score count as safe; NO_ZONE is an answer."""
CELL_SCORE_FLOOR = 0.5
"""A single cell below this is more likely unsafe than safe and is an obstacle whatever surrounds
it."""


@dataclass(frozen=True)
class LandingParameters:
    """Defaults are those of the released DOVESEI where the description says nothing else."""

    # Altitudes
    safe_altitude_m: float = parameter(
        50.0, 'At and above it lateral motion meets no obstacle.', unit='m', low=5.0, high=120.0
    )
    handover_altitude_m: float = parameter(
        20.0,
        'The vehicle is handed over here (paper) and goes no lower.',
        unit='m',
        low=1.5,
        high=100.0,
    )
    handover_tolerance_m: float = parameter(
        0.3,
        'HANDOVER this much above its altitude, so that the stop ends at it.',
        unit='m',
        low=0.05,
        high=2.0,
    )
    handover_error_m: float = parameter(
        1.0,
        'HANDOVER only this near to the middle of the site (and within its clearance).',
        unit='m',
        low=0.2,
        high=20.0,
    )
    altitude_limit_m: float = parameter(
        500.0, 'Altitudes beyond this are not believed.', unit='m', low=50.0, high=5000.0
    )
    # Sites
    safety_radius_m: float = parameter(
        1.5, 'Radius of the vehicle on the ground.', unit='m', low=0.2, high=20.0
    )
    position_margin_m: float = parameter(
        1.0,
        'Clearance added to the safety radius for errors of position.',
        unit='m',
        low=0.0,
        high=20.0,
    )
    projection_error: float = parameter(
        0.02,
        'Clearance added per metre of altitude for errors of attitude and projection.',
        low=0.0,
        high=0.2,
    )
    preferred_clearance_m: float = parameter(
        6.0,
        'Sites with less clearance are taken only when there is none with as much.',
        unit='m',
        low=0.5,
        high=100.0,
    )
    ample_clearance_m: float = parameter(
        12.0, 'More clearance than this makes a site no better.', unit='m', low=1.0, high=200.0
    )
    distance_scale_m: float = parameter(
        30.0,
        'A site this far away is worth half of one under the vehicle (released: 1 pixel).',
        unit='m',
        low=1.0,
        high=1000.0,
    )
    site_hysteresis: float = parameter(
        1.3, 'A new site must be worth this many times the present one.', low=1.0, high=10.0
    )
    safety_threshold: float = parameter(
        0.8,
        'Safety score from which ground counts as safe; log-odds of the map, not the heatmap.',
        low=SAFETY_THRESHOLD_FLOOR,
        high=0.98,
    )
    relaxation: bool = parameter(
        False,
        'Let the threshold sink while nothing is found, as the conservative gain of DOVESEI does; '
        'off: it stays, and NO_ZONE is the answer.',
    )
    relaxed_threshold: float = parameter(
        0.7,
        'With relaxation the threshold sinks to this (released: until 10 % of the image is safe, '
        'however unsafe that is; here never below a fixed floor).',
        low=SAFETY_THRESHOLD_FLOOR,
        high=0.98,
    )
    relax_after_s: float = parameter(
        60.0,
        'With relaxation: time without a site over which the threshold sinks.',
        unit='s',
        low=1.0,
        high=1200.0,
    )
    dynamic_threshold: float = parameter(
        0.10,
        'With relaxation: the threshold does not sink while this part of the known ground is safe.',
        low=0.0,
        high=1.0,
    )
    min_looks: int = parameter(3, 'Frames that must have seen safe ground.', low=2, high=100)
    sensor_warm_up_cycles: int = parameter(
        5, 'Heatmaps to see in SEARCHING before a site is chosen.', low=1, high=100
    )
    aiming_focus: float = parameter(
        6.0, 'Radius of the search in AIMING, in safety radii.', low=2.0, high=100.0
    )
    landing_focus: float = parameter(
        2.0, 'Radius of the search in LANDING, in safety radii.', low=1.0, high=100.0
    )
    focus_step: float = parameter(
        0.1, 'Part of the way that the focus and the site move per heatmap.', low=0.01, high=1.0
    )
    failed_site_radius_m: float = parameter(
        8.0,
        'No site is chosen this near to one that failed, nor within the clearance it had (up to '
        'what is ample).',
        unit='m',
        low=0.0,
        high=200.0,
    )
    failed_site_growth: float = parameter(
        1.5,
        'Each further failure within that radius multiplies the radius.',
        low=1.0,
        high=4.0,
    )
    failed_site_radius_limit_m: float = parameter(
        60.0, 'The radius grows no farther.', unit='m', low=0.0, high=1000.0
    )
    failed_site_memory_s: float = parameter(
        1200.0,
        'A failed site is forgiven after this (released: never remembered); a new engagement '
        'forgets it too.',
        unit='s',
        low=0.0,
        high=7200.0,
    )
    max_attempts: int = parameter(
        4, 'Descents that may fail; then budget_policy decides.', low=1, high=100
    )
    # Motion
    gain: float = parameter(
        0.5, 'Lateral speed per metre of error.', unit='1/s', low=0.05, high=1.0
    )
    aiming_gain_mult: float = parameter(
        0.7,
        'Multiplies the gain in AIMING (released: 0.5 with an integrator, which would outlive a '
        'stop; the autopilot holds against wind itself).',
        low=0.1,
        high=1.0,
    )
    z_speed_landing: float = parameter(
        3.0,
        'Highest speed of descent, and factor of the gain below.',
        unit='m/s',
        low=0.2,
        high=5.0,
    )
    z_gain_landing: float = parameter(
        0.02,
        'Descent speed per z_speed_landing and metre of altitude.',
        unit='1/m',
        low=0.001,
        high=0.2,
    )
    z_min_speed_landing: float = parameter(
        0.5, 'Lowest speed of descent away from the floor.', unit='m/s', low=0.1, high=1.0
    )
    aiming_floor: float = parameter(
        1.1, 'AIMING descends to this many safe altitudes.', low=1.0, high=3.0
    )
    z_speed_climbing: float = parameter(
        3.0, 'Speed of the climb (released: 6; tamer above people).', unit='m/s', low=0.2, high=6.0
    )
    lateral_speed_limit: float = parameter(
        5.0,
        'Highest lateral speed (released: 15; a fast vehicle tilts its camera away).',
        unit='m/s',
        low=0.2,
        high=15.0,
    )
    landing_lateral_speed_limit: float = parameter(
        1.5, 'Highest lateral speed below the safe altitude.', unit='m/s', low=0.1, high=5.0
    )
    acceleration_limit: float = parameter(
        3.0,
        'Fastest growth of each component of the set-point; it shrinks at once.',
        unit='m/s^2',
        low=0.2,
        high=20.0,
    )
    geofence_radius_m: float = parameter(
        0.0,
        'No motion outwards beyond this distance from where the landing began; 0 = none.',
        unit='m',
        low=0.0,
        high=10000.0,
    )
    # Search
    search_hold_s: float = parameter(
        6.0, 'SEARCHING looks this long before it moves.', unit='s', low=0.0, high=300.0
    )
    search_speed: float = parameter(
        4.0, 'Speed of the expanding square.', unit='m/s', low=0.2, high=15.0
    )
    search_spacing_m: float = parameter(
        60.0, 'Distance of the tracks of the expanding square.', unit='m', low=5.0, high=500.0
    )
    search_radius_m: float = parameter(
        150.0,
        'The expanding square goes no farther from where the landing began.',
        unit='m',
        low=0.0,
        high=2000.0,
    )
    search_distance_m: float = parameter(
        1500.0,
        'Way that may be flown in search; then the answer is no_zone and budget_policy decides.',
        unit='m',
        low=0.0,
        high=50000.0,
    )
    max_search_s: float = parameter(
        300.0,
        'Without any site for this long the answer is no_zone and budget_policy decides.',
        unit='s',
        low=5.0,
        high=3600.0,
    )
    # Times
    giveup_after_s: float = parameter(
        5.0, 'WAITING lasts this long before CLIMBING or RESTARTING.', unit='s', low=0.5, high=60.0
    )
    search4new_place_s: float = parameter(
        60.0, 'RESTARTING looks this long for another site near by.', unit='s', low=1.0, high=600.0
    )
    max_aiming_s: float = parameter(
        150.0,
        'AIMING that takes longer than this has failed (wind, fence).',
        unit='s',
        low=5.0,
        high=1200.0,
    )
    max_landing_s: float = parameter(
        300.0, 'LANDING that takes longer than this has failed.', unit='s', low=10.0, high=1200.0
    )
    max_total_s: float = parameter(
        1200.0,
        'Time of a whole landing; then budget_policy decides.',
        unit='s',
        low=10.0,
        high=7200.0,
    )
    battery_reserve: float = parameter(
        0.0,
        'Part of the battery at which budget_policy decides; 0 leaves it to the failsafe of the '
        'autopilot, which alone knows its battery.',
        low=0.0,
        high=0.9,
    )
    budget_policy: str = parameter(
        'hold',
        'When time, battery, way or attempts are used up: hold where it is; return to where the '
        'landing began and hold there; best_site makes one last attempt at the best place known, '
        'under all the usual checks, and holds when that fails.',
        choices=('hold', 'return', 'best_site'),
    )
    policy_time_s: float = parameter(
        180.0,
        'A policy other than hold has this long, then it holds.',
        unit='s',
        low=1.0,
        high=1200.0,
    )
    # Ages of data
    heatmap_age_limit_s: float = parameter(
        2.0, 'Older heatmaps lead to HOLD.', unit='s', low=0.2, high=5.0
    )
    descent_heatmap_age_limit_s: float = parameter(
        1.5, 'No descent on older heatmaps.', unit='s', low=0.2, high=5.0
    )
    telemetry_age_limit_s: float = parameter(
        0.7, 'Older telemetry leads to HOLD.', unit='s', low=0.1, high=2.0
    )
    site_age_limit_s: float = parameter(
        20.0, 'Ground not seen for this long is unknown.', unit='s', low=1.0, high=120.0
    )
    landing_site_age_limit_s: float = parameter(
        5.0, 'The same below the safe altitude.', unit='s', low=0.5, high=60.0
    )
    pose_wait_limit_s: float = parameter(
        1.0, 'A heatmap waits this long for the pose after its stamp.', unit='s', low=0.0, high=5.0
    )
    pose_gap_limit_s: float = parameter(
        0.5, 'Poses farther apart are not interpolated.', unit='s', low=0.05, high=2.0
    )
    future_tolerance_s: float = parameter(
        0.5, 'Stamps this far ahead of the clock are accepted.', unit='s', low=0.0, high=5.0
    )

    def __post_init__(self) -> None:
        check(self)
        self._in_order('handover_altitude_m', 'safe_altitude_m')
        self._in_order('relaxed_threshold', 'safety_threshold')
        self._in_order('preferred_clearance_m', 'ample_clearance_m')
        self._in_order('failed_site_radius_m', 'failed_site_radius_limit_m')
        self._in_order('landing_focus', 'aiming_focus')
        self._in_order('descent_heatmap_age_limit_s', 'heatmap_age_limit_s')
        self._in_order('z_min_speed_landing', 'z_speed_landing')

    def _in_order(self, lower: str, upper: str) -> None:
        low, high = getattr(self, lower), getattr(self, upper)
        if low > high:
            raise ConfigurationError(
                f'parameter {lower} = {low} must not exceed {upper} = {high}: change one of them'
            )

    def required_clearance_m(self, altitude_agl_m: float) -> float:
        """Return the clearance that a site needs when it is judged from this altitude."""
        margin = self.position_margin_m + self.projection_error * max(0.0, altitude_agl_m)
        return self.safety_radius_m + margin
