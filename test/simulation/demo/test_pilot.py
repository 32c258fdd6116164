# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pilot, link, sender and simulated autopilot together, over loopback."""

import time

import pytest

from peace_ros.core.domain import Setpoint, VehicleError
from peace_ros.core.vehicle import (
    SenderParameters,
    SetpointSender,
    VehicleParameters,
    open_vehicle,
)
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.demo.pilot import Pilot


def test_flies_with_the_timed_sender_and_comes_to_rest_when_decisions_stop(flying, eventually):
    _, link = flying
    sender = SetpointSender(link, parameters=SenderParameters(handover_s=0.6))
    sender.start()
    sender.submit(Setpoint(0, v_north_m_s=2.0))

    def speeds_up():
        sender.submit(Setpoint(0, v_north_m_s=2.0))
        return link.telemetry().v_north_m_s > 1.8

    assert eventually(speeds_up, 5.0)
    assert eventually(lambda: link.telemetry().mode == 'BRAKE', 5.0), 'hands over by itself'
    assert eventually(lambda: abs(link.telemetry().v_north_m_s) < 0.1, 3.0)
    assert not link.taken_over
    sender.stop()


def test_a_pilots_mode_change_shows_within_0_3_s_and_silences_the_sender(flying, eventually):
    sim, link = flying
    sender = SetpointSender(link)
    sender.start()
    sender.submit(Setpoint(0, v_down_m_s=0.5))
    assert eventually(lambda: sender.statistics().sent > 1)
    reactions_s = []
    for _ in range(3):  # a busy machine may be late once
        assert link.request_control(by_person=True)
        assert sim.pilot_mode('LOITER')
        begin = time.monotonic()
        assert eventually(lambda: not link.telemetry().in_control, 2.0)
        reactions_s.append(time.monotonic() - begin)
    assert min(reactions_s) < 0.3
    assert link.taken_over
    count = sender.statistics().sent
    sender.submit(Setpoint(0, v_down_m_s=0.5))
    time.sleep(0.2)
    assert sender.statistics().sent <= count + 1
    assert not link.request_control()
    assert link.telemetry().mode == 'LOITER'
    sender.stop()


def test_position_loss_takes_the_pose_away_and_guided_is_refused(flying, eventually):
    sim, link = flying
    sim.lose_gps()
    assert eventually(lambda: link.telemetry().mode == 'LAND', 3.0)
    result = link.request_control(by_person=True)
    assert not result
    assert 'no estimate of its position' in result.reason
    assert 'external navigation or optical flow' in link.position_problem
    forced = link.set_mode('GUIDED')
    assert forced.code == 4
    assert 'requires position' in forced.reason
    assert eventually(lambda: link.telemetry().pose is None, 3.0)


def test_survives_a_reboot_and_a_silence(eventually):
    with AutopilotSim(AutopilotParameters(port=0, speed=20.0)) as sim:
        link = open_vehicle(sim.url, parameters=VehicleParameters(pose_limit_s=0.3))
        Pilot(link).wait_ready(20.0)
        sim.reboot()
        assert eventually(lambda: link.telemetry().pose is None, 3.0)
        assert eventually(lambda: link.telemetry().pose is not None, 8.0)
        sim.silence()
        assert eventually(lambda: link.telemetry().pose is None, 3.0)
        sim.silence(silent=False)
        assert eventually(lambda: link.telemetry().pose is not None, 3.0)
        link.close()


def test_takes_off_from_boot_and_tells_what_it_waits_for():
    said = []
    with AutopilotSim(AutopilotParameters(port=0, speed=20.0)) as sim:
        link = open_vehicle(sim.url)
        Pilot(link, said.append, retry_s=0.1).take_off(10.0, timeout_s=40.0, arm=True)
        assert sim.truth().altitude_agl_m == pytest.approx(10.0, abs=0.6)
        link.close()
    assert any('GPS 1: Bad fix' in text for text in said), 'boot was waited out'
    assert 'armed' in said


def test_take_off_does_not_arm_unless_told(eventually):
    with AutopilotSim(AutopilotParameters(port=0, speed=20.0)) as sim:
        link = open_vehicle(sim.url)
        Pilot(link).wait_ready(20.0)
        with pytest.raises(VehicleError, match='not armed'):
            Pilot(link, retry_s=0.1).take_off(10.0, timeout_s=10.0)
        assert not sim.flight.armed
        link.close()


def test_a_limit_ends_with_the_reason(eventually):
    with AutopilotSim(AutopilotParameters(port=0, speed=1.0)) as sim:
        link = open_vehicle(sim.url)
        with pytest.raises(VehicleError, match=r'position: not within.*STABILIZE'):
            Pilot(link).wait_ready(0.3)
        with pytest.raises(VehicleError, match='arming: refused, Arm: GPS 1: Bad fix'):
            Pilot(link, retry_s=0.1).arm(0.3)
        link.close()
