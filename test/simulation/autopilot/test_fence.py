# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A fence of the simulated autopilot stops the vehicle 2 m before it; FENCE_STATUS reports it."""

from math import hypot

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.fence import Fence, FenceKind
from peace_ros.simulation.autopilot.physics import VelocityCommand

NAMES = ('breach_status', 'breach_type', 'breach_mitigation')


def flown(fence, command, start_m, seconds=60.0):
    """Let a vehicle follow the kept command at once; return where it ends and the last command."""
    position, kept = start_m, command
    for step in range(round(seconds / 0.05)):
        kept = fence.kept(command, position, step * 0.05)
        speeds = (kept.v_north_m_s, kept.v_east_m_s, kept.v_down_m_s)
        position = tuple(p + 0.05 * v for p, v in zip(position, speeds, strict=True))
    return position, kept


@pytest.mark.parametrize(
    ('fence', 'v_down_m_s', 'stops_at_m'),
    [
        (Fence(FenceKind.FLOOR, 30.0), 3.0, 32.0),
        (Fence(FenceKind.CEILING, 80.0), -3.0, 78.0),
    ],
)
def test_the_vehicle_stops_two_metres_before_an_altitude(fence, v_down_m_s, stops_at_m):
    command = VelocityCommand(v_north_m_s=1.0, v_down_m_s=v_down_m_s)
    (north, _, down), kept = flown(fence, command, (0.0, 0.0, -50.0))
    assert -down == pytest.approx(stops_at_m, abs=0.1)
    assert kept.v_down_m_s == pytest.approx(0.0, abs=0.05)
    assert north == pytest.approx(60.0), 'motion along the fence stays'


def test_the_vehicle_stops_two_metres_before_a_circle_and_slides_along_it():
    fence = Fence(FenceKind.CIRCLE, 20.0, (5.0, -5.0))
    (north, east, _), _ = flown(fence, VelocityCommand(2.0, 0.5), (5.0, -5.0, -50.0))
    assert hypot(north - 5.0, east + 5.0) == pytest.approx(18.0, abs=0.1)
    assert east > -4.0


@pytest.mark.parametrize(
    'command',
    [VelocityCommand(v_down_m_s=-2.0), VelocityCommand(v_down_m_s=2.0, lean_rad=(0.0, 0.0))],
    ids=['away from it', 'no velocity'],
)
def test_what_leads_away_or_is_no_velocity_stays(command):
    fence = Fence(FenceKind.FLOOR, 30.0)
    assert fence.kept(command, (0.0, 0.0, -31.0), 1.0) == command
    assert not fence.limits(1.0)


def test_no_fence_changes_nothing_and_reports_nothing():
    fence, command = Fence(), VelocityCommand(9.0, 9.0, 9.0)
    assert fence.kept(command, (0.0, 0.0, 0.0), 1.0) == command
    assert fence.status((0.0, 0.0, 0.0), 1.0) is None


@pytest.mark.parametrize(
    ('altitude_m', 'expected'),
    [
        (60.0, (0, mavlink.FENCE_BREACH_NONE, mavlink.FENCE_MITIGATE_NONE)),
        (32.0, (0, mavlink.FENCE_BREACH_NONE, mavlink.FENCE_MITIGATE_VEL_LIMIT)),
        (29.0, (1, mavlink.FENCE_BREACH_MINALT, mavlink.FENCE_MITIGATE_VEL_LIMIT)),
    ],
)
def test_the_status_has_the_limit_before_the_fence_and_the_type_beyond_it(altitude_m, expected):
    fence, position = Fence(FenceKind.FLOOR, 30.0), (0.0, 0.0, -altitude_m)
    fence.kept(VelocityCommand(v_down_m_s=1.0), position, 5.0)
    status = fence.status(position, 5.4)
    assert tuple(getattr(status, name) for name in NAMES) == expected


def test_a_limit_is_over_half_a_second_after_it():
    fence, position = Fence(FenceKind.FLOOR, 30.0), (0.0, 0.0, -32.0)
    fence.kept(VelocityCommand(v_down_m_s=1.0), position, 5.0)
    assert fence.limits(5.5)
    assert not fence.limits(5.51)
