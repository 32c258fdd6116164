# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The usual loops of pymavlink's mavutil."""

import pytest

ACCEPTED, UNSUPPORTED = 0, 3
PLACE_COUNTS = 0x007


def test_the_loops_of_mavutil_fly_it(autopilot, flown):
    answers = flown('flown_by_pymavlink.py', 'udpout:127.0.0.1:{port}')
    assert answers['told'] == ['GPS_RAW_INT', 'SCALED_PRESSURE', 'SYS_STATUS', 'VFR_HUD']
    assert answers['parameters'] > 10
    assert answers['unknown command'] == UNSUPPORTED
    assert answers['upload'] == [ACCEPTED] * 3, 'mission, fence, rally points'
    assert answers['back'] == [True] * 3
    assert answers['cleared'] == [0] * 3
    assert answers['take-off'] == ACCEPTED
    assert answers['reposition'] == ACCEPTED
    mask, north_m, down_m = answers['target']
    assert not mask & PLACE_COUNTS
    assert (north_m, down_m) == pytest.approx((5.0, -6.0), abs=0.1)
    assert answers['modes until disarmed'] == ['RTL'], 'RTL stays RTL until it is disarmed'
