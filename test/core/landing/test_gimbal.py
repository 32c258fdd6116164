# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A camera on a gimbal: the ground is seen where the gimbal points; unknown, the vehicle holds."""

from math import radians, tan

import numpy as np
import pytest

from peace_ros.core.domain import (
    NADIR,
    Camera,
    GimbalReport,
    Heatmap,
    Pose,
    Telemetry,
)
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.landing import LandingCore, LandingParameters, State

S = 1_000_000_000
CAMERA = Camera.from_degrees(352, 352, 73.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
AHEAD_M = 50.0 * tan(radians(15.0))


@pytest.fixture
def core() -> LandingCore:
    return LandingCore(LandingParameters(), CAMERA, on_gimbal=True)


def telemetry(time_s, gimbal):
    pose = Pose(round(time_s * S), 0.0, 0.0, -50.0, LEVEL, 50.0)
    return Telemetry(
        0, pose=pose, armed=True, in_control=True, mode='GUIDED', landed=False, gimbal=gimbal
    )


def pitched(time_s, pitch_deg, **changes):
    q = quaternion_from_euler(0.0, radians(pitch_deg), 0.0)
    return GimbalReport(round(time_s * S), q, in_earth=False, **changes)


def fly(core, begin_s, end_s, gimbal_at):
    """Give poses at 20 Hz, heatmaps at 5 Hz, and what the gimbal says; return the decision."""
    decision = None
    for tick, time_s in enumerate(np.arange(begin_s, end_s, 0.05)):
        told = telemetry(time_s, gimbal_at(time_s))
        core.add_pose(told.pose)
        if tick % 4 == 0:
            core.add_heatmap(Heatmap(np.full((48, 48), 0.9, np.float32), round(time_s * S)))
        decision = core.step(round(time_s * S), told, 0.1)
    return decision


def middle_of_what_was_seen(core):
    layers = core.safety_map.layers(core.safety_map.stamp_ns)
    return layers.centre_of(*np.argwhere(layers.looks).mean(axis=0))


def test_the_ground_is_seen_where_the_gimbal_points(core):
    fly(core, 1.0, 3.0, lambda time_s: pitched(time_s, -75.0))
    north, east = middle_of_what_was_seen(core)
    assert north > 0.8 * AHEAD_M
    assert east == pytest.approx(0.0, abs=0.5)


def test_reports_that_are_rarer_than_poses_are_interpolated(core):
    def at_5_hz(time_s):
        moment = np.floor(time_s * 5.0) / 5.0
        return pitched(moment, -90.0 + 5.0 * (moment - 1.0))

    fly(core, 1.0, 3.0, at_5_hz)
    assert core.safety_map.stamp_ns > round(2.5 * S)
    assert core.step(round(3.0 * S), telemetry(3.0, at_5_hz(3.0)), 0.1).counts['used'] >= 8


def test_a_silent_gimbal_is_a_hold_with_a_reason_and_nothing_is_engaged(core):
    fly(core, 1.0, 3.0, lambda time_s: pitched(time_s, -90.0))
    assert core.engagement_problem(3 * S, telemetry(3.0, None), 0.1) == ''
    core.engage()
    assert fly(core, 3.0, 4.0, lambda time_s: pitched(time_s, -90.0)).state is not State.HOLD
    silent = fly(core, 4.0, 4.1, lambda _time_s: None)
    assert silent.state is State.HOLD
    assert 'does not report how the gimbal is turned' in silent.reason
    assert silent.setpoint.is_zero
    problem = core.engagement_problem(round(4.1 * S), telemetry(4.1, None), 0.1)
    assert 'GIMBAL_DEVICE_ATTITUDE_STATUS' in problem
    again = fly(core, 4.1, 6.0, lambda time_s: pitched(time_s, -90.0))
    assert again.state is not State.HOLD


def test_a_silent_vehicle_is_not_blamed_on_its_gimbal(core):
    fly(core, 1.0, 3.0, lambda time_s: pitched(time_s, -90.0))
    core.engage()
    fly(core, 3.0, 4.0, lambda time_s: pitched(time_s, -90.0))
    silent = core.step(5 * S, telemetry(4.0, None), 1.0)
    assert silent.state is State.HOLD
    assert 'telemetry' in silent.reason
    assert 'gimbal' not in silent.reason
    core.disengage()
    core.step(5 * S, None, 1.0)
    assert 'gimbal' not in core.engagement_problem(5 * S, None, 1.0)


def test_a_failure_that_the_gimbal_reports_is_the_reason(core):
    told = fly(core, 1.0, 2.0, lambda time_s: pitched(time_s, -90.0, problem='it is broken'))
    assert core.engagement_problem(2 * S, telemetry(2.0, None), 0.1) == 'it is broken'
    assert core.safety_map.stamp_ns is None
    assert told.counts['it is broken'] > 0


def test_a_vehicle_without_a_gimbal_does_not_ask_for_one():
    core = LandingCore(LandingParameters(), CAMERA, None, NADIR)
    fly(core, 1.0, 3.0, lambda _time_s: None)
    assert core.engagement_problem(3 * S, telemetry(3.0, None), 0.1) == ''
