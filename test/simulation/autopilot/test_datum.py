# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places on the globe and places from home."""

from math import nan

import pytest

from peace_ros.simulation.autopilot.datum import Datum

DATUM = Datum(48.858, 2.342, 35.0)
GLOBAL, RELATIVE, TERRAIN, LOCAL = 0, 6, 11, 1


@pytest.mark.parametrize(('north_m', 'east_m'), [(0.0, 0.0), (120.0, -80.0), (-3000.0, 10.0)])
def test_a_place_on_the_globe_leads_back_to_where_it_came_from(north_m, east_m):
    latitude, longitude = (each / 1e7 for each in DATUM.geodetic_e7(north_m, east_m))
    assert DATUM.local_m(RELATIVE, latitude, longitude, 9.0) == pytest.approx(
        (north_m, east_m, -9.0), abs=0.01
    )


@pytest.mark.parametrize(('frame', 'down_m'), [(GLOBAL, -5.0), (RELATIVE, -40.0), (TERRAIN, -40.0)])
def test_the_frame_says_from_where_an_altitude_counts(frame, down_m):
    assert DATUM.local_m(frame, 48.858, 2.342, 40.0) == pytest.approx((0.0, 0.0, down_m))


@pytest.mark.parametrize(
    'place', [(LOCAL, 48.0, 2.0, 9.0), (GLOBAL, 91.0, 2.0, 9.0), (GLOBAL, 48.0, 181.0, 9.0)]
)
def test_an_impossible_place_is_none(place):
    assert DATUM.local_m(*place) is None
    assert DATUM.local_m(GLOBAL, 48.0, 2.0, nan) is None
    assert DATUM.local_m(GLOBAL, nan, 2.0, 9.0) is None
