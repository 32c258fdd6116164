# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A fence that stops the vehicle makes the place fail; one that only slows it does not."""

from dataclasses import replace

import pytest

from peace_ros.core.domain import Pose, Setpoint, Telemetry
from peace_ros.core.landing.blockade import Blockade

POSE = Pose(0, 0.0, 0.0, -50.0, (1.0, 0.0, 0.0, 0.0), 50.0)
STOPPED = Telemetry(0, POSE, armed=True, in_control=True, fence='a fence limits the speed')
NORTH, DOWN = Setpoint(0, 2.0), Setpoint(0, 0.0, 0.0, 1.0)


def after(seconds, telemetry, told, blockade=None):
    blockade = blockade or Blockade()
    for tenth in range(round(seconds * 10) + 1):
        blockade.see(tenth * 100_000_000, telemetry, told)
    return blockade.reason


@pytest.mark.parametrize('told', [NORTH, DOWN, Setpoint(0, 0.0, -0.3)])
def test_a_vehicle_that_a_fence_has_stopped_for_three_seconds_does_not_get_farther(told):
    assert after(2.9, STOPPED, told) == ''
    assert 'a fence limits the speed' in after(3.0, STOPPED, told)


def test_the_speeds_stand_in_the_reason():
    drifting = replace(STOPPED, v_north_m_s=0.3)
    assert 'told 2.0 m/s, it reports 0.3 m/s that way' in after(3.0, drifting, NORTH)


@pytest.mark.parametrize(
    ('telemetry', 'told'),
    [
        pytest.param(replace(STOPPED, fence=''), NORTH, id='no fence'),
        pytest.param(replace(STOPPED, v_north_m_s=1.1), NORTH, id='moves, only slower'),
        pytest.param(STOPPED, Setpoint(0), id='told to stand'),
        pytest.param(STOPPED, Setpoint(0, 0.1, 0.1), id='told to creep'),
        pytest.param(replace(STOPPED, pose=None), NORTH, id='position not known'),
        pytest.param(None, NORTH, id='nothing heard'),
    ],
)
def test_nothing_is_concluded_from(telemetry, told):
    assert after(10.0, telemetry, told) == ''


def test_a_vehicle_that_moves_again_was_only_slowed_down():
    blockade = Blockade()
    after(2.9, STOPPED, NORTH, blockade)
    blockade.see(3_000_000_000, replace(STOPPED, v_north_m_s=2.0), NORTH)
    blockade.see(3_100_000_000, STOPPED, NORTH)
    assert blockade.reason == ''


def test_motion_the_other_way_is_no_progress():
    assert after(3.0, replace(STOPPED, v_north_m_s=-2.0), NORTH)


def test_it_waits_again_towards_another_place():
    blockade = Blockade()
    assert after(3.0, STOPPED, NORTH, blockade)
    blockade.forget()
    assert blockade.reason == ''
    blockade.see(3_100_000_000, STOPPED, NORTH)
    assert blockade.reason == ''
