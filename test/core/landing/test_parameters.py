# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters: bounds, order, and the floor that none can cross."""

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import describe
from peace_ros.core.landing import SAFETY_THRESHOLD_FLOOR, LandingParameters
from peace_ros.core.mapping import MapParameters


@pytest.mark.parametrize('name', ['safety_threshold', 'relaxed_threshold'])
def test_no_configuration_crosses_the_floor_of_safety(name):
    with pytest.raises(ConfigurationError, match=name):
        LandingParameters(**{name: SAFETY_THRESHOLD_FLOOR - 0.01})


@pytest.mark.parametrize(
    'wrong',
    [
        {'handover_altitude_m': 60.0},
        {'relaxed_threshold': 0.9},
        {'preferred_clearance_m': 20.0},
        {'landing_focus': 8.0},
        {'failed_site_radius_m': 80.0},
        {'budget_policy': 'land anyway'},
        {'descent_heatmap_age_limit_s': 3.0},
        {'min_looks': 1},
    ],
)
def test_contradictions_are_refused_with_the_remedy(wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        LandingParameters(**wrong)


def test_the_released_values():
    p = LandingParameters()
    assert (p.safe_altitude_m, p.handover_altitude_m, p.safety_radius_m) == (50.0, 20.0, 1.5)
    assert (p.aiming_focus, p.landing_focus, p.focus_step) == (6.0, 2.0, 0.1)
    assert (p.giveup_after_s, p.search4new_place_s, p.max_total_s) == (5.0, 60.0, 1200.0)


def test_what_weakens_or_extends_a_landing_is_off_until_asked_for():
    p = LandingParameters()
    assert p.relaxation is False
    assert p.budget_policy == 'hold'


@pytest.mark.parametrize(
    ('altitude_m', 'clearance_m'), [(100.0, 4.5), (20.0, 2.9), (0.5, 2.51), (0.0, 2.5), (-9.0, 2.5)]
)
def test_clearance_needed_grows_with_altitude(altitude_m, clearance_m):
    p = LandingParameters(safety_radius_m=1.5, position_margin_m=1.0, projection_error=0.02)
    assert p.required_clearance_m(altitude_m) == pytest.approx(clearance_m)


@pytest.mark.parametrize('parameters', [LandingParameters, MapParameters])
def test_every_parameter_is_described_and_bounded(parameters):
    for info in describe(parameters):
        assert info.description.endswith('.')
        bounded = info.low is not None and info.high is not None
        assert bounded or info.choices or isinstance(info.default, bool)


def test_landing_and_map_share_no_name():
    """One node declares both."""
    names = [info.name for each in (LandingParameters, MapParameters) for info in describe(each)]
    assert len(names) == len(set(names))
