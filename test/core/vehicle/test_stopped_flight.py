# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A flying vehicle that something stops: the link names it, and the position is not accused."""

import socket
import threading
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import Setpoint
from peace_ros.core.vehicle import SetpointSender, open_vehicle
from peace_ros.simulation.autopilot.faults import inject


@pytest.fixture
def flown(hovering, eventually):
    """ArduPilot in GUIDED at 40 m, and a sender that goes on sending one velocity."""
    with hovering(40.0, 1.0) as sim:
        link = open_vehicle(sim.url)
        assert eventually(lambda: link.telemetry().pose is not None)
        sender = SetpointSender(link)
        sender.start()

        def fly(setpoint, seconds, until=lambda _told: False):
            told = []
            end = time.monotonic() + seconds
            while time.monotonic() < end and not (told and until(told[-1])):
                sender.submit(setpoint)
                told.append(link.telemetry())
                time.sleep(0.05)
            return told

        yield sim, link, fly
        sender.stop()
        link.close()


def test_a_fence_that_stops_the_vehicle_is_named_and_accuses_no_altitude(flown):
    sim, _, fly = flown
    inject(sim, 'fence', kind='floor', at_m=36.0)
    told = fly(Setpoint(0, v_down_m_s=2.0), 8.0)
    assert sim.truth().altitude_agl_m == pytest.approx(38.0, abs=0.5)
    assert 'a fence limits the speed' in told[-1].fence
    assert [each.position_problem for each in told if each.position_problem] == []
    assert told[-1].pose is not None
    told = fly(Setpoint(0, v_down_m_s=-2.0), 3.0)
    assert told[-1].fence == ''


def test_a_vehicle_that_stands_before_a_fence_accuses_no_position_once_it_turns_away(flown):
    _, _, fly = flown
    inject(flown[0], 'fence', kind='circle', at_m=8.0, around_vehicle=True)
    told = fly(Setpoint(0, v_north_m_s=5.0), 6.0)
    assert 'a fence limits the speed' in told[-1].fence
    told += fly(Setpoint(0), 3.0)
    told += fly(Setpoint(0, v_north_m_s=-3.0), 3.0)
    assert [each.position_problem for each in told if each.position_problem] == []
    assert told[-1].v_north_m_s < -2.0


def test_a_vehicle_that_slides_along_a_fence_accuses_nobody(flown):
    sim, _, fly = flown
    north, east = sim.truth().north_m, sim.truth().east_m
    told = fly(Setpoint(0, v_north_m_s=2.0), 2.0)
    inject(sim, 'fence', kind='circle', at_m=14.0, north_m=north, east_m=east - 6.0)
    told += fly(Setpoint(0, v_north_m_s=3.0), 8.0)
    assert any(each.fence for each in told)
    assert abs(sim.truth().east_m - east) > 1.0, 'it was turned aside'
    accused = [each for each in told if each.other_commander or each.position_problem]
    assert [each.other_commander + each.position_problem for each in accused] == []


def test_a_doubt_of_before_stays_when_a_fence_comes(flown):
    sim, _, fly = flown
    inject(sim, 'altitude', kind='freeze')
    told = fly(Setpoint(0, v_down_m_s=2.0), 8.0, until=lambda each: bool(each.position_problem))
    assert told[-1].position_problem
    inject(sim, 'fence', kind='floor', at_m=200.0)
    told = fly(Setpoint(0, v_down_m_s=2.0), 2.0)
    assert told[-1].fence
    assert told[-1].position_problem


def test_a_second_commander_is_named_while_it_commands_and_accuses_no_position(flown):
    sim, _, fly = flown
    told = fly(Setpoint(0, v_north_m_s=1.0), 2.0)
    assert [each.other_commander for each in told if each.other_commander] == []
    inject(sim, 'commander', v_north_m_s=-2.0, rate_hz=50.0)
    told = fly(Setpoint(0, v_north_m_s=1.0), 6.0)
    assert 'a second commander' in told[-1].other_commander
    assert [each.position_problem for each in told if each.position_problem] == []
    inject(sim, 'commander', rate_hz=0.0)
    told = fly(Setpoint(0), 6.0, until=lambda each: not each.other_commander)
    assert told[-1].other_commander == ''


def test_a_second_commander_that_sends_places_is_named(flown):
    sim, _, fly = flown
    told = fly(Setpoint(0, v_north_m_s=1.0), 2.0)
    ended = threading.Event()

    def command():
        station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        codec = mavlink.MAVLink(None, 255, 190)
        place_only, target = 0xDF8, (30.0, 30.0, -40.0)
        place = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, place_only, *target, *(0.0,) * 8
        )
        while not ended.wait(0.02):
            station.sendto(place.pack(codec), ('127.0.0.1', int(sim.url.rpartition(':')[2])))
        station.close()

    rival = threading.Thread(target=command)
    rival.start()
    told = fly(Setpoint(0, v_north_m_s=1.0), 6.0, until=lambda each: bool(each.other_commander))
    ended.set()
    rival.join()
    assert 'a second commander' in told[-1].other_commander
    assert 'a place' in told[-1].other_commander


def test_a_vehicle_that_does_not_follow_is_accused_with_what_the_autopilot_reports(flown):
    sim, link, fly = flown
    inject(sim, 'altitude', kind='freeze')
    inject(sim, 'battery', remaining=0.1)
    told = fly(Setpoint(0, v_down_m_s=2.0), 8.0, until=lambda each: bool(each.position_problem))
    assert 'its altitude is not believed' in told[-1].position_problem
    assert 'the battery is low (BATTERY_STATUS)' in told[-1].position_problem
    assert 'the battery is low' in link.warning
