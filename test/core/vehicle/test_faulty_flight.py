# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link in a flying simulation while something is wrong."""

import math
import socket
import threading
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import Setpoint
from peace_ros.core.vehicle import SenderState, SetpointSender, VehicleParameters, open_vehicle
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.simulation.autopilot.faults import inject


@pytest.fixture
def sent(flying):
    """A sender whose decisions are renewed by the test."""
    sim, link = flying
    sender = SetpointSender(link)
    sender.start()
    yield sim, link, sender
    sender.stop()


def test_a_line_that_comes_back_finds_the_mode_unchanged_and_goes_on(sent, eventually):
    sim, link, sender = sent
    sender.submit(Setpoint(0, v_north_m_s=1.0))
    assert eventually(lambda: sim.flight.setpoints > 2)
    inject(sim, 'silence')
    assert eventually(lambda: link.telemetry().pose is None, 2.0), 'hold without a position'
    assert eventually(lambda: sim.flight.setpoint_age_s > 3.5, 3.0)
    assert eventually(lambda: abs(sim.flight.physics.velocity_ned_m_s[0]) < 0.1, 3.0)
    assert link.telemetry().in_control, 'silence is no takeover'
    inject(sim, 'mend')
    assert eventually(lambda: link.telemetry().pose is not None, 3.0)
    assert not link.taken_over
    sender.resume()
    sender.submit(Setpoint(0, v_north_m_s=1.0))
    assert eventually(lambda: sender.statistics().state is SenderState.SENDING)


def test_a_mode_that_changed_during_the_silence_is_a_takeover(flying, eventually):
    sim, link = flying
    inject(sim, 'silence')
    sim.pilot_mode('LOITER')
    inject(sim, 'mend')
    assert eventually(lambda: link.taken_over, 3.0)


@pytest.mark.parametrize('mode', ['LOITER', 'BRAKE', 'LAND', 'RTL'])
def test_a_ground_station_that_takes_over_has_the_last_word(sent, eventually, mode):
    sim, link, sender = sent
    station = open_vehicle(sim.url, parameters=VehicleParameters(system_id=255))

    def decides():
        sender.submit(Setpoint(0, v_north_m_s=1.0))

    def heard_within(seconds):
        count, last = sim.flight.setpoints, 0.0
        begun = time.monotonic()
        while time.monotonic() - begun < seconds:
            decides()
            if sim.flight.setpoints != count:
                count, last = sim.flight.setpoints, time.monotonic() - begun
            time.sleep(0.002)
        return last

    assert eventually(lambda: decides() or sim.flight.setpoints > 5)
    assert station.set_mode('GUIDED'), 'chosen again it changes nothing, and nobody can see it'
    assert heard_within(0.3) > 0.0
    assert not link.taken_over
    asking = threading.Thread(target=station.set_mode, args=(mode,))
    asking.start()
    assert eventually(lambda: decides() or sim.mode_name == mode)
    assert heard_within(1.0) < 0.3
    asking.join()
    assert link.taken_over
    assert not link.request_control()
    assert sim.mode_name == mode
    assert station.set_mode('GUIDED')
    assert eventually(lambda: link.telemetry().in_control)
    assert heard_within(0.5) == 0.0, 'given back is not engaged'
    station.close()


def test_a_landing_that_was_asked_for_is_not_asked_again_after_a_pilot_took_over(
    flying, eventually
):
    sim, link = flying
    inject(sim, 'refuse', modes=['LAND'], silently=True)
    results = []
    asking = threading.Thread(target=lambda: results.append(link.request_land()))
    asking.start()
    time.sleep(0.2)
    sim.pilot_mode('LOITER')
    assert eventually(lambda: link.taken_over, 2.0)
    inject(sim, 'refuse', modes=[])
    asking.join(1.0)
    assert not asking.is_alive(), 'it does not wait for an answer any more'
    assert not results[0]
    assert 'withdrawn' in results[0].reason
    time.sleep(1.0)
    assert sim.mode_name == 'LOITER', 'the pilot has the last word'


def test_a_landing_that_was_withdrawn_is_not_asked_again(flying):
    sim, link = flying
    inject(sim, 'refuse', modes=['LAND'], silently=True)
    withdrawn = threading.Event()
    asking = threading.Thread(target=link.request_land, args=(lambda: not withdrawn.is_set(),))
    asking.start()
    time.sleep(0.2)
    withdrawn.set()
    inject(sim, 'refuse', modes=[])
    asking.join(1.0)
    assert not asking.is_alive()
    time.sleep(1.0)
    assert sim.mode_name == 'GUIDED'


def test_a_mode_that_is_reached_counts_although_the_answer_was_lost(flying):
    sim, link = flying
    inject(sim, 'telemetry_stop', messages=['COMMAND_ACK'])
    assert link.request_land()
    assert sim.mode_name == 'LAND'


def test_a_reboot_in_flight_is_a_takeover(flying, eventually):
    sim, link = flying
    inject(sim, 'reboot')
    assert eventually(lambda: link.taken_over, 3.0)
    assert eventually(lambda: link.telemetry().pose is None, 3.0)
    assert link.telemetry().mode == 'STABILIZE'


@pytest.mark.parametrize(
    ('fault', 'arguments'),
    [
        ('altitude', {'kind': 'nan'}),
        ('altitude', {'kind': 'jump', 'offset_m': 15.0}),
        ('altitude', {'kind': 'sign'}),
        ('frame', {'kind': 'enu'}),
        ('frame', {'kind': 'msl'}),
        ('position', {'north_m': 30.0}),
        ('telemetry_stop', {'messages': ['LOCAL_POSITION_NED']}),
        ('gps_loss', {'stale': True}),
    ],
)
def test_a_wrong_position_becomes_no_position_and_a_right_one_is_believed_again(
    flying, eventually, fault, arguments
):
    sim, link = flying
    inject(sim, fault, **arguments)
    assert eventually(lambda: link.telemetry().pose is None, 2.0)
    altitudes = [pose.altitude_agl_m for pose in link.take_poses()]
    assert all(abs(altitude - 20.0) < 1.5 for altitude in altitudes), 'no pose was made of it'
    inject(sim, 'clear')
    assert eventually(lambda: link.telemetry().pose is not None, 4.0)


def test_a_bad_line_is_flown_through(flying, eventually):
    sim, link = flying
    inject(sim, 'line', drop=0.1, duplicate=0.2, reorder=0.2, corrupt=0.1)
    time.sleep(1.0)
    link.take_poses()
    time.sleep(0.5)
    poses = link.take_poses()
    assert len(poses) > 10
    stamps = [pose.stamp_ns for pose in poses]
    assert stamps == sorted(stamps)
    assert link.counts.late > 0
    assert link.set_mode('LOITER')
    assert not link.taken_over


@pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])
def test_altitude_is_above_home_wherever_the_origin_lies(hovering, eventually, autopilot):
    with hovering(20.0, 10.0, autopilot=autopilot, origin_above_home_m=-7.0) as sim:
        link = open_vehicle(sim.url)

        def agrees():
            pose = link.telemetry().pose
            return pose is not None and abs(pose.altitude_agl_m - sim.truth().altitude_agl_m) < 0.3

        assert eventually(agrees)
        link.close()


@pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])
def test_dead_reckoning_after_the_loss_of_gnss_is_not_flown_by(hovering, eventually, autopilot):
    """The filter goes on for 7.1 s (PX4: 5.4 s), and its flags stay as they were."""
    with hovering(20.0, 1.0, autopilot=autopilot) as sim:
        link = open_vehicle(sim.url)
        assert eventually(lambda: link.telemetry().pose is not None)
        sim.lose_gps()
        begun_s = time.monotonic()
        assert eventually(lambda: link.telemetry().pose is None)
        assert time.monotonic() - begun_s < 1.0
        assert sim.flight.estimator.reports_position(sim.flight.time_s)
        assert 'GNSS has lost its fix' in link.telemetry().position_problem
        sim.restore_gps()
        assert eventually(lambda: link.telemetry().pose is not None)
        link.close()


def test_attitude_and_altitude_go_on_when_the_position_is_lost(flying, eventually):
    sim, link = flying
    sim.lose_gps()
    assert eventually(lambda: link.telemetry().pose is None)
    link.take_poses()
    assert eventually(lambda: any(not pose.has_position for pose in link.take_poses()))
    bare = []
    assert eventually(lambda: bare.extend(link.take_poses()) or len(bare) > 20)
    assert not any(pose.has_position for pose in bare)
    assert bare[-1].altitude_agl_m == pytest.approx(sim.truth().altitude_agl_m, abs=1.5)
    assert [pose.stamp_ns for pose in bare] == sorted({pose.stamp_ns for pose in bare})


@pytest.mark.parametrize('speed', [0.1, 0.7, 4.0])
def test_a_simulation_slower_or_faster_than_time_is_believed(hovering, eventually, speed):
    with hovering(20.0, speed) as sim:
        link = open_vehicle(sim.url, parameters=VehicleParameters(heartbeat_limit_s=20.0))
        assert eventually(lambda: link.telemetry().pose is not None, 15.0)
        link.take_poses()
        begun_ns, high_m = time.monotonic_ns(), sim.truth().altitude_agl_m
        problems, told, poses = set(), [], []
        while time.monotonic_ns() - begun_ns < 5e9 and sim.truth().altitude_agl_m > 8.0:
            link.send_velocity(Setpoint(0, v_down_m_s=1.0))
            told.append(link.telemetry().pose)
            problems.add(link.position_problem)
            poses += link.take_poses()
            time.sleep(0.04)
        assert problems == {''}
        assert None not in told
        assert sim.truth().altitude_agl_m < high_m - 0.02
        ended_ns = time.monotonic_ns()
        ages_s = [(ended_ns - pose.stamp_ns) / 1e9 for pose in poses]
        assert ages_s == sorted(ages_s, reverse=True)
        assert ages_s[-1] < 1.0
        span_s = (poses[-1].stamp_ns - poses[0].stamp_ns) / 1e9
        assert span_s == pytest.approx((ended_ns - begun_ns) / 1e9, abs=1.0)
        link.close()


def test_a_second_companion_is_not_believed(flying, eventually):
    sim, link = flying
    other = open_vehicle(sim.url)
    before = link.counts.ignored
    voice = mavlink.MAVLink(None, 1, 191)
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    beat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 5, 4, 3)
    line.sendto(beat.pack(voice), ('127.0.0.1', int(sim.url.rpartition(':')[2])))
    assert other.set_mode('LOITER')
    assert eventually(lambda: link.taken_over), 'somebody else chose a mode: it is theirs now'
    assert eventually(lambda: link.counts.ignored > before), 'it hands on what others say'
    other.close()
    line.close()


def test_battery_and_clock_come_along(flying, eventually):
    sim, link = flying
    inject(sim, 'battery', remaining=0.42)
    assert eventually(lambda: link.telemetry().battery_remaining == pytest.approx(0.42), 3.0)
    assert eventually(lambda: link._clock.samples > 0 or link._clock.steps > 0)


def test_a_refusal_and_a_silence_are_told_apart(flying):
    sim, link = flying
    inject(sim, 'refuse', modes=['LOITER'])
    refused = link.set_mode('LOITER')
    assert refused.code == 4
    assert 'LOITER failed' in refused.reason
    inject(sim, 'refuse', modes=['LOITER'], silently=True)
    assert 'no COMMAND_ACK' in link.set_mode('LOITER').reason


def test_without_a_position_it_holds_level_and_never_descends(flying, eventually):
    sim, link = flying
    inject(sim, 'gps_loss')
    assert eventually(lambda: link.position_problem != '', 3.0)
    altitude_m = sim.truth().altitude_agl_m
    result = link.request_level_hold()
    assert result, result.reason
    assert eventually(lambda: link.telemetry().mode == 'GUIDED_NOGPS')
    time.sleep(1.5)
    assert sim.truth().altitude_agl_m == pytest.approx(altitude_m, abs=1.0)
    assert sim.flight.physics.tilt_rad < 0.02
    inject(sim, 'gps_restore')
    assert eventually(lambda: link.position_problem == '', 3.0)
    assert link.request_control(by_person=True)
    assert link.telemetry().in_control


def test_our_heartbeat_says_how_we_are(free_port, mock_autopilot, eventually):
    import threading

    peer = mock_autopilot(free_port)
    threading.Timer(0.1, peer.heartbeat).start()
    link = open_vehicle(f'udpin:127.0.0.1:{free_port}', timeout_s=5.0)
    beats = []

    def states():
        beats.extend(m for m in peer.hear() if m.get_type() == 'HEARTBEAT')
        return [m.system_status for m in beats]

    assert eventually(lambda: mavlink.MAV_STATE_STANDBY in states(), 2.0)
    link.report_health(mavlink.MAV_STATE_CRITICAL)
    begin = time.monotonic()
    assert eventually(lambda: states()[-1] == mavlink.MAV_STATE_CRITICAL, 2.0)
    assert time.monotonic() - begin < 0.5, 'a change is told at once'
    assert {m.type for m in beats} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}
    link.close()


def test_landing_targets_are_in_the_frame_that_each_autopilot_takes(flying):
    _, link = flying
    pose = link.telemetry().pose
    site = (pose.north_m + 3.0, pose.east_m - 4.0, 0.0)
    ours = ArduPilot().landing_target_message(site, pose, 7)
    assert ours.frame == mavlink.MAV_FRAME_BODY_FRD
    assert (ours.x, ours.y, ours.z) == pytest.approx((3.0, -4.0, 20.0), abs=0.7)
    assert ours.distance == pytest.approx(math.hypot(3, 4, 20), abs=0.7)
    assert (ours.angle_x < 0.0, ours.angle_y < 0.0) == (True, True)
    theirs = Px4().landing_target_message(site, pose, 7)
    assert theirs.frame == mavlink.MAV_FRAME_LOCAL_NED
    assert (theirs.x, theirs.y, theirs.z) == pytest.approx(site)
    link.send_landing_target(site, pose)
