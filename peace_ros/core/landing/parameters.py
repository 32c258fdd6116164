# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the landing, and limits that no configuration can cross."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import ParameterSet, parameter

SAFETY_THRESHOLD_FLOOR = 0.65
"""No configuration lets ground of a lower safety score count as safe."""
CELL_SCORE_FLOOR = 0.5
"""A cell below this is more likely unsafe than safe: it is an obstacle, whatever surrounds it."""


@dataclass(frozen=True)
class LandingParameters(ParameterSet):
    """Defaults are those of the released DOVESEI unless the description says otherwise."""

    # Altitudes
    safe_altitude_m: float = parameter(
        50.0, 'At this altitude and above, lateral motion meets no obstacle.', low=5.0, high=120.0
    )
    handover_altitude_m: float = parameter(
        20.0, 'HANDOVER happens here (paper), and the vehicle goes no lower.', low=1.5, high=100.0
    )
    handover_tolerance_m: float = parameter(
        0.3,
        'HANDOVER starts this far above, so that the vehicle stops in time.',
        low=0.05,
        high=2.0,
    )
    handover_error_m: float = parameter(
        1.0, 'Largest distance to the middle of the site at HANDOVER.', low=0.2, high=20.0
    )
    altitude_limit_m: float = parameter(
        500.0, 'Higher altitudes are taken for an error.', low=50.0, high=5000.0
    )
    height_share: float = parameter(
        0.12,
        'HOLD when another source of height (pictures, rangefinder, terrain data, GNSS) differs '
        'from the altitude by more than this part of it, and three standard errors of the source.',
        low=0.05,
        high=1.0,
    )
    # Sites
    safety_radius_m: float = parameter(
        1.5, 'Radius of the vehicle on the ground.', low=0.2, high=20.0
    )
    position_margin_m: float = parameter(
        1.0, 'Clearance added to the safety radius for position errors.', low=0.0, high=20.0
    )
    projection_error: float = parameter(
        0.02, 'Clearance added per metre of altitude for attitude errors.', low=0.0, high=0.2
    )
    preferred_clearance_m: float = parameter(
        6.0, 'Sites with less clearance are a last choice.', low=0.5, high=100.0
    )
    ample_clearance_m: float = parameter(
        12.0, 'More clearance than this makes a site no better.', low=1.0, high=200.0
    )
    distance_scale_m: float = parameter(
        30.0, 'At this distance a site is worth half (released: 1 pixel).', low=1.0, high=1000.0
    )
    site_hysteresis: float = parameter(
        1.3, 'A new site must be worth this many times the present one.', low=1.0, high=10.0
    )
    safety_threshold: float = parameter(
        0.8,
        'Ground counts as safe from this score of the map, not the heatmap.',
        low=SAFETY_THRESHOLD_FLOOR,
        high=0.98,
        live=True,
    )
    relaxation: bool = parameter(
        False,
        'Let the threshold sink while no site is found, as the conservative gain of DOVESEI does. '
        'Off: NO_ZONE is the answer.',
    )
    relaxed_threshold: float = parameter(
        0.7,
        'With relaxation the threshold sinks to this (released: until 10 % of the image is safe, '
        'without a floor).',
        low=SAFETY_THRESHOLD_FLOOR,
        high=0.98,
    )
    relax_after_s: float = parameter(
        60.0, 'With relaxation: time without a site until it has sunk.', low=1.0, high=1200.0
    )
    dynamic_threshold: float = parameter(
        0.10,
        'With relaxation: no sinking while this part of the ground is safe.',
        low=0.0,
        high=1.0,
    )
    min_looks: int = parameter(
        3, 'Ground must be seen safe in at least this many frames.', low=2, high=100
    )
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
        0.1, 'Focus and site move this part of their way per heatmap.', low=0.01, high=1.0
    )
    failed_site_radius_m: float = parameter(
        8.0,
        'A failed site closes at least this radius around it; more if its clearance was larger.',
        low=0.0,
        high=200.0,
    )
    failed_site_growth: float = parameter(
        1.5, 'Each further failure in that circle multiplies the radius.', low=1.0, high=4.0
    )
    failed_site_radius_limit_m: float = parameter(
        60.0, 'The radius grows no further.', low=0.0, high=1000.0
    )
    failed_site_memory_s: float = parameter(
        1200.0, 'A failed site is closed for this time (released: never).', low=0.0, high=7200.0
    )
    max_attempts: int = parameter(
        4, 'Descents that may fail; then budget_policy decides.', low=1, high=100
    )
    # Motion
    gain: float = parameter(
        0.5, 'Lateral speed per metre of error.', unit='1/s', low=0.05, high=1.0
    )
    aiming_gain_mult: float = parameter(
        0.7, 'Multiplies the gain in AIMING (released: 0.5 and an integrator).', low=0.1, high=1.0
    )
    z_speed_landing: float = parameter(
        3.0,
        'Highest speed of descent, and factor of z_gain_landing.',
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
        3.0, 'Speed of the climb (released: 6).', unit='m/s', low=0.2, high=6.0
    )
    lateral_speed_limit: float = parameter(
        5.0,
        'Highest lateral speed (released: 15, which tilts the camera).',
        unit='m/s',
        low=0.2,
        high=15.0,
    )
    landing_lateral_speed_limit: float = parameter(
        1.5, 'Highest lateral speed below the safe altitude.', unit='m/s', low=0.1, high=5.0
    )
    acceleration_limit: float = parameter(
        3.0,
        'Fastest growth of each set-point component; it shrinks at once.',
        unit='m/s^2',
        low=0.2,
        high=20.0,
    )
    geofence_radius_m: float = parameter(
        0.0, 'Fence around where the landing began; 0 means no fence.', low=0.0, high=10000.0
    )
    # Search
    search_hold_s: float = parameter(
        6.0, 'SEARCHING hovers and looks this long before it moves.', low=0.0, high=300.0
    )
    search_low_after_s: float = parameter(
        60.0,
        'After this time in search it goes on lower down, where more is seen of each place.',
        low=0.0,
        high=3600.0,
    )
    search_floor: float = parameter(
        1.2, 'That search descends to this many safe altitudes.', low=1.0, high=24.0
    )
    search_speed: float = parameter(
        4.0, 'Speed along the expanding square.', unit='m/s', low=0.2, high=15.0
    )
    search_spacing_m: float = parameter(
        60.0, 'Distance between the tracks of the expanding square.', low=5.0, high=500.0
    )
    search_radius_m: float = parameter(
        150.0, 'Radius of the search around where the landing began.', low=0.0, high=2000.0
    )
    search_distance_m: float = parameter(
        1500.0,
        'Way to fly in search; then no_zone, and budget_policy decides.',
        low=0.0,
        high=50000.0,
    )
    max_search_s: float = parameter(
        300.0, 'Time without a site; then no_zone, and budget_policy decides.', low=5.0, high=3600.0
    )
    # Times
    giveup_after_s: float = parameter(
        5.0, 'WAITING lasts this long before CLIMBING or RESTARTING.', low=0.5, high=60.0
    )
    giveup_looks: int = parameter(
        10,
        'WAITING also lasts this many heatmaps: at a low rate, ground that was closed by mistake '
        'would not be seen safe again in time.',
        low=1,
        high=100,
    )
    search4new_place_s: float = parameter(
        60.0, 'RESTARTING looks this long for another site nearby.', low=1.0, high=600.0
    )
    max_aiming_s: float = parameter(
        150.0, 'AIMING that takes longer has failed (wind, fence).', low=5.0, high=1200.0
    )
    max_landing_s: float = parameter(
        300.0, 'LANDING that takes longer has failed.', low=10.0, high=1200.0
    )
    max_total_s: float = parameter(
        1200.0, 'Time of a whole landing; then budget_policy decides.', low=10.0, high=7200.0
    )
    battery_reserve: float = parameter(
        0.0,
        'Part of the battery at which budget_policy decides; 0 leaves it to the autopilot.',
        low=0.0,
        high=0.9,
    )
    budget_policy: str = parameter(
        'hold',
        'When time, battery, way or attempts are used up: hold: stop here; return: fly to where '
        'the landing began, and hold; best_site: one last attempt at the best known place, with '
        'all checks, then hold.',
        choices=('hold', 'return', 'best_site'),
    )
    policy_time_s: float = parameter(
        180.0, 'Time for return or best_site; then hold.', low=1.0, high=1200.0
    )
    # Ages of data
    heatmap_age_limit_s: float = parameter(
        2.0, 'HOLD when the newest heatmap is older.', low=0.2, high=5.0
    )
    descent_heatmap_age_limit_s: float = parameter(
        1.5, 'No descent when the newest heatmap is older.', low=0.2, high=5.0
    )
    telemetry_age_limit_s: float = parameter(
        0.7, 'HOLD when telemetry is older.', low=0.1, high=2.0
    )
    site_age_limit_s: float = parameter(
        20.0, 'Ground not seen for this long is unknown.', low=1.0, high=120.0
    )
    landing_site_age_limit_s: float = parameter(
        5.0, 'The same below the safe altitude.', low=0.5, high=60.0
    )
    pose_wait_limit_s: float = parameter(
        1.0, 'A heatmap waits this long for the pose after its stamp.', low=0.0, high=5.0
    )
    pose_gap_limit_s: float = parameter(
        0.5, 'Poses farther apart in time are not interpolated.', low=0.05, high=2.0
    )
    future_tolerance_s: float = parameter(
        0.5, 'Stamps may lie this far ahead of the clock.', low=0.0, high=5.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
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
