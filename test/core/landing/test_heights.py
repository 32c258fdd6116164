# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When other heights put the altitude in doubt, for how long, and where the floor is then."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import HeightReport, Pose
from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.heights import HeightSight, HeightWatch

S = 1_000_000_000
P = LandingParameters(height_share=0.1)


def pose_of(altitude_m: float) -> Pose:
    return Pose(0, 0.0, 0.0, -altitude_m, (1.0, 0.0, 0.0, 0.0), altitude_m)


def pictures(height_m: float) -> HeightReport:
    return HeightReport('pictures', height_m, 0.0)


def gnss(height_m: float, error_m: float = 2.0) -> HeightReport:
    return HeightReport('GNSS', height_m, error_m, above_ground=False)


def laser(height_m: float) -> HeightReport:
    return HeightReport('rangefinder', height_m, 0.1, is_narrow=True)


class Watched:
    """A watch and its clock."""

    def __init__(self) -> None:
        self.watch = HeightWatch(P)
        self.at_s = 100.0

    def see(
        self,
        altitude_m: float | None,
        *reports: HeightReport,
        for_s: float = 0.1,
        site: bool = True,
    ) -> HeightSight:
        """Say the same for a while; return the last answer."""
        for _ in range(max(1, round(for_s / 0.1))):
            self.at_s += 0.1
            pose = None if altitude_m is None else pose_of(altitude_m)
            seen = self.watch.see(round(self.at_s * S), pose, reports, over_site=site)
        return seen


@pytest.fixture
def watched() -> Watched:
    return Watched()


def test_without_another_source_the_altitude_counts(watched: Watched) -> None:
    assert watched.see(20.0, for_s=9.0) == HeightSight()


@pytest.mark.parametrize('height_m', [36.0, 44.5])
def test_a_difference_that_lasts_is_said_with_both_figures(
    watched: Watched, height_m: float
) -> None:
    assert not watched.see(40.0, pictures(height_m), for_s=0.9).problem
    problem = watched.see(40.0, pictures(height_m), for_s=0.3).problem
    assert '40.0 m by the autopilot' in problem
    assert f'{height_m:.1f} m by pictures' in problem


@pytest.mark.parametrize('height_m', [36.5, 43.9])
def test_a_difference_within_the_share_is_none(watched: Watched, height_m: float) -> None:
    assert not watched.see(40.0, pictures(height_m), for_s=9.0).problem


def test_an_outlier_is_no_difference(watched: Watched) -> None:
    for _ in range(20):
        assert not watched.see(40.0, pictures(10.0), for_s=0.8).problem
        assert not watched.see(40.0, pictures(40.0)).problem


def test_heights_agree_again_within_a_smaller_limit_and_after_a_while(watched: Watched) -> None:
    assert watched.see(40.0, pictures(30.0), for_s=2.0).problem
    assert watched.see(40.0, pictures(37.0), for_s=9.0).problem, 'within the limit, barely'
    assert watched.see(40.0, pictures(38.0), for_s=2.9).problem
    assert not watched.see(40.0, pictures(38.0), for_s=0.3).problem


def test_who_is_silent_in_between_does_not_agree_for_so_long(watched: Watched) -> None:
    assert watched.see(40.0, pictures(30.0), for_s=2.0).problem
    for _ in range(4):
        assert watched.see(40.0, pictures(40.0)).problem
        assert watched.see(40.0, for_s=5.0).problem


def test_gaps_of_the_position_do_not_delay_a_doubt(watched: Watched) -> None:
    watched.see(40.0, pictures(30.0), for_s=0.6)
    watched.see(None, pictures(30.0))
    assert watched.see(40.0, pictures(30.0), for_s=0.6).problem


def test_a_doubt_outlives_its_source(watched: Watched) -> None:
    assert watched.see(40.0, pictures(30.0), for_s=2.0).problem
    assert watched.see(40.0, for_s=60.0).problem
    assert watched.see(None, pictures(40.0), for_s=60.0).problem, 'no altitude to agree with'


def test_an_engagement_begins_without_doubts(watched: Watched) -> None:
    watched.see(40.0, pictures(30.0), gnss(140.0), for_s=2.0)
    watched.watch.begin()
    assert not watched.see(40.0, gnss(170.0), for_s=9.0).problem


def test_of_gnss_only_changes_count_and_its_noise_is_allowed_for(watched: Watched) -> None:
    assert watched.see(60.0, gnss(135.0)).heights_m == {'GNSS': 60.0}
    assert not watched.see(40.0, gnss(106.0), for_s=9.0).problem, '9 m: 10 % and three errors'
    assert '30.0 m by GNSS' in watched.see(40.0, gnss(105.0), for_s=2.0).problem


def test_a_rangefinder_counts_over_a_site_only(watched: Watched) -> None:
    assert watched.see(30.0, laser(20.0), for_s=9.0, site=False) == HeightSight()
    assert watched.see(30.0, laser(20.0), for_s=2.0).problem
    assert not watched.see(30.0, laser(30.0), for_s=4.0, site=False).problem, 'it agrees again'


def test_the_floor_counts_from_the_lowest(watched: Watched) -> None:
    seen = watched.see(25.0, pictures(23.0), laser(24.0))
    assert seen.above_lowest_m == pytest.approx(2.0)
    assert watched.see(25.0, pictures(27.0)).above_lowest_m == 0.0
    watched.see(25.0, gnss(100.0))
    alone = watched.see(25.0, gnss(92.0)).above_lowest_m
    assert alone == pytest.approx(6.0), '8 m, 2 of them noise'
    beside = watched.see(25.0, gnss(92.0), pictures(25.0)).above_lowest_m
    assert beside == pytest.approx(2.0), 'a more precise source speaks: 6 of the 8 m may be noise'


def test_a_low_vehicle_is_not_held_for_the_noise_of_a_barometer(watched: Watched) -> None:
    assert not watched.see(2.0, pictures(1.1), for_s=9.0).problem


def test_a_hand_over_waits_until_every_source_was_heard(watched: Watched) -> None:
    assert not watched.see(25.0, pictures(25.0), for_s=5.0).may_hand_over
    assert not watched.see(20.2, pictures(20.4), for_s=1.4).may_hand_over
    assert watched.see(20.2, pictures(20.4), for_s=0.3).may_hand_over
    assert not watched.see(20.2, pictures(24.0)).may_hand_over, 'at once, before it is a doubt'
    assert not watched.see(20.2, pictures(20.4), for_s=1.0).may_hand_over
    assert watched.see(22.0, pictures(20.2), for_s=2.0).may_hand_over, 'the lowest counts'


def test_at_a_limit_heights_agree(watched: Watched) -> None:
    assert not watched.see(40.0, pictures(44.0), for_s=9.0).problem, '4 m apart, 4 m allowed'
    assert watched.see(20.0, pictures(22.0), for_s=9.0).may_hand_over, '2 m apart, 2 m allowed'
    assert watched.see(100.0, pictures(150.0), for_s=2.0).problem
    assert not watched.see(100.0, pictures(107.0), for_s=4.0).problem, '7 of 10 m end a doubt'


def at(watch: HeightWatch, at_s: float, altitude_m: float, *reports: HeightReport) -> HeightSight:
    return watch.see(round(at_s * S), pose_of(altitude_m), reports, over_site=True)


def test_a_doubt_needs_a_second_counted_from_the_first_difference() -> None:
    watch = HeightWatch(P)
    assert not at(watch, 100.0, 40.0, pictures(40.0)).problem
    assert not at(watch, 100.5, 40.0, pictures(30.0)).problem
    assert not at(watch, 101.25, 40.0, pictures(30.0)).problem
    assert at(watch, 101.5, 40.0, pictures(30.0)).problem
    # The very next report may agree.
    assert at(watch, 102.0, 40.0, pictures(40.0)).problem
    assert at(watch, 104.75, 40.0, pictures(40.0)).problem
    assert not at(watch, 105.0, 40.0, pictures(40.0)).problem


def test_at_the_hand_over_altitude_a_second_and_a_half_are_enough() -> None:
    limit_m = P.handover_altitude_m + P.handover_tolerance_m
    watch = HeightWatch(P)
    assert not at(watch, 100.0, limit_m, pictures(limit_m)).may_hand_over
    assert not at(watch, 101.25, limit_m, pictures(limit_m)).may_hand_over
    assert at(watch, 101.5, limit_m, pictures(limit_m)).may_hand_over


def test_one_source_that_differs_is_enough_against_a_hand_over(watched: Watched) -> None:
    seen = watched.see(20.0, pictures(30.0), laser(20.0), for_s=2.0)
    assert not seen.may_hand_over


def test_each_doubt_is_said(watched: Watched) -> None:
    problem = watched.see(40.0, pictures(30.0), laser(31.0), for_s=2.0).problem
    first, second = problem.split('; ')
    assert 'by pictures' in first
    assert second.startswith('the altitude above ground is 40.0 m')
    assert 'by rangefinder' in second


def test_a_rangefinder_that_does_not_count_hides_no_other_source(watched: Watched) -> None:
    seen = watched.see(40.0, laser(20.0), pictures(41.0), site=False)
    assert seen.heights_m == {'pictures': 41.0}


def test_without_a_position_nothing_is_compared(watched: Watched) -> None:
    assert watched.see(None, pictures(0.5)).heights_m == {}
