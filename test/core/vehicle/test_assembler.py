# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Telemetry and poses out of messages, without a line."""

from math import cos, inf, nan, radians

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.parameters import VehicleParameters

SECOND = 10**9


@pytest.fixture
def assembler():
    return Assembler(ArduPilot(), VehicleParameters())


def position(boot_ms=1000, *, x=1.0, z=-30.0, vx=0.0, vz=0.0):
    return mavlink.MAVLink_local_position_ned_message(boot_ms, x, 2.0, z, vx, 0.0, vz)


def attitude(boot_ms=1000, roll=0.0, pitch=0.0, yaw=0.0):
    return mavlink.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0, 0, 0)


def heartbeat(mode, base=129):
    return mavlink.MAVLink_heartbeat_message(2, 3, base, mode, 4, 3)


def test_a_field_that_was_not_said_is_none(assembler):
    told = assembler.telemetry(0)
    assert (told.pose, told.landed, told.mode, told.in_control) == (None, None, '', False)


def test_a_pose_has_the_node_clock_of_its_attitude_and_position_brought_to_it(assembler):
    assembler.take(position(1000, vx=4.0), 70, 0)
    assembler.take(attitude(1050, yaw=0.5), 99, 50_000_000)
    (pose,) = assembler.poses
    assert pose.stamp_ns == 99
    assert pose.north_m == pytest.approx(1.2)
    assert (pose.east_m, pose.down_m, pose.altitude_agl_m) == (2.0, -30.0, 30.0)


@pytest.mark.parametrize('bad', [nan, inf, -inf])
def test_numbers_that_are_none_are_counted_and_not_believed(assembler, bad):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    for message in (
        position(x=bad),
        position(vz=bad),
        attitude(roll=bad),
        mavlink.MAVLink_attitude_quaternion_message(1000, bad, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_attitude_quaternion_message(1000, 0, 0, 0, 0, 0, 0, 0),
    ):
        assembler.take(message, 0, 0)
    assert assembler.rejected == 5
    assert assembler.late == 0
    assembler.take(position(1040), 0, 0)
    assert assembler.telemetry(0).pose.north_m == 1.0


def test_an_old_position_is_no_position(assembler):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    assert assembler.telemetry(SECOND // 2).pose is not None
    assembler.take(attitude(2500), 0, int(1.5 * SECOND))
    told = assembler.telemetry(int(1.5 * SECOND))
    assert told.pose is None, 'a fresh attitude must not refresh an old position'
    assert told.received_ns == int(1.5 * SECOND)


def test_control_is_the_mode_that_was_said_last(assembler):
    assembler.take(heartbeat(4), 0, 0)
    assert assembler.telemetry(0).in_control
    assembler.take(heartbeat(5, base=1), 0, 4 * SECOND)
    told = assembler.telemetry(4 * SECOND)
    assert (told.in_control, told.mode, told.armed) == (False, 'LOITER', False)


@pytest.mark.parametrize(('state', 'landed'), [(0, None), (1, True), (2, False), (3, False)])
def test_landed_is_what_the_autopilot_says(assembler, state, landed):
    assembler.take(mavlink.MAVLink_extended_sys_state_message(0, state), 0, 0)
    assert assembler.telemetry(0).landed is landed


def fly(assembler, boot_ms, at_ns, seconds=0.5, **where):
    """Report position and attitude at 20 Hz for a while; return both clocks at the end."""
    for _ in range(round(20 * seconds)):
        boot_ms, at_ns = boot_ms + 50, at_ns + SECOND // 20
        assembler.take(position(boot_ms, **where), 0, at_ns)
        assembler.take(attitude(boot_ms), 0, at_ns)
    return boot_ms, at_ns


def airborne(boot_ms=100_000):
    """Return an assembler that has heard of 40 m above home, and both clocks."""
    assembler = Assembler(ArduPilot(), VehicleParameters())
    assembler.take(heartbeat(4), 0, 0)
    assembler.take(mavlink.MAVLink_extended_sys_state_message(0, 2), 0, 0)
    for message in (origin(110.0), home(100.0)):
        assembler.take(message, 0, 0)
    return assembler, *fly(assembler, boot_ms, 0)


@pytest.mark.parametrize('late_ms', [1200, 5000, 90_000, 100_400])
def test_one_late_message_is_dropped_and_no_reboot(late_ms):
    assembler, boot_ms, at_ns = airborne()
    assembler.take(attitude(boot_ms - late_ms), 0, at_ns)
    assembler.take(position(boot_ms - late_ms, x=500.0), 0, at_ns)
    assert (assembler.reboots, assembler.late, assembler.landed_state) == (0, 2, 2)
    assert assembler.telemetry(at_ns).pose.altitude_agl_m == pytest.approx(40.0)
    assembler.take(position(boot_ms + 50, x=500.0), 0, at_ns + SECOND // 20)
    told = assembler.telemetry(at_ns + SECOND // 20)
    assert 'jumped by 499.0 m' in told.position_problem, 'the jump watch stays'


def test_a_reboot_is_several_messages_of_a_young_clock_and_a_heartbeat():
    assembler, _, at_ns = airborne()
    at_ns += 2 * SECOND
    _, at_ns = fly(assembler, 1000, at_ns, x=300.0)
    assert assembler.reboots == 0, 'its mode has not been reported yet'
    assembler.take(heartbeat(0), 0, at_ns)
    _, at_ns = fly(assembler, 1500, at_ns, x=300.0)
    assert assembler.reboots == 1
    assert assembler.landed_state == 0
    pose = assembler.telemetry(at_ns).pose
    assert (pose.north_m, pose.altitude_agl_m) == (300.0, 30.0), 'home is learnt anew'


def test_a_clock_that_is_set_back_without_a_reboot_keeps_home_and_jump_watch():
    assembler, boot_ms, at_ns = airborne()
    for _ in range(3):
        boot_ms, at_ns = fly(assembler, boot_ms - 10_000, at_ns, 0.5, x=500.0)
        assembler.take(heartbeat(4), 0, at_ns)
        boot_ms, at_ns = fly(assembler, boot_ms, at_ns, 2.0, x=500.0)
    assert assembler.reboots == 0
    assert 'jumped by 499.0 m' in assembler.position_problem(at_ns)
    _, at_ns = fly(assembler, boot_ms, at_ns)
    assert assembler.telemetry(at_ns).pose.altitude_agl_m == pytest.approx(40.0)


def test_time_that_was_left_out_costs_a_moment():
    assembler, boot_ms, at_ns = airborne()
    _, at_ns = fly(assembler, boot_ms + 60_000, at_ns)
    assert assembler.reboots == 0
    assert assembler.telemetry(at_ns).pose is not None


def test_a_boot_time_that_runs_over_costs_a_moment_and_no_more():
    assembler, _, at_ns = airborne(2**32 - 600)
    boot_ms, at_ns = fly(assembler, 0, at_ns)
    assembler.take(heartbeat(4), 0, at_ns)
    _, at_ns = fly(assembler, boot_ms, at_ns)
    assert assembler.reboots == 1
    assert assembler.telemetry(at_ns).pose is not None


@pytest.mark.parametrize('absurd', [{'x': 1e20}, {'z': -1e20}, {'vx': 1e9}])
def test_an_absurd_position_is_rejected_with_a_sentence(absurd):
    assembler, boot_ms, at_ns = airborne()
    assembler.take(position(boot_ms + 50, **absurd), 0, at_ns)
    told = assembler.telemetry(at_ns)
    assert told.pose is None
    assert 'LOCAL_POSITION_NED has' in told.position_problem
    assert assembler.rejected == 1
    fly(assembler, boot_ms + 50, at_ns)
    assert assembler.telemetry(at_ns).pose is not None


def test_neither_place_nor_speed_of_one_message_is_believed():
    """Twenty metres in a second are possible, and so is a speed of 50 m/s for somebody."""
    assembler, boot_ms, at_ns = airborne()
    for told in ({'x': 15.0}, {'vx': 50.0}, {'x': 15.0, 'vx': 40.0}):
        boot_ms, at_ns = fly(assembler, boot_ms, at_ns)
        assembler.take(position(boot_ms + 990, **told), 0, at_ns)
        assembler.take(attitude(boot_ms + 991), 0, at_ns)
        assert assembler.poses[-1].north_m == pytest.approx(1.0)
        boot_ms += 1000


def test_one_height_without_a_position_is_not_believed(assembler):
    for i, above_m in enumerate((40.0, 40.0, 90.0, 40.0, 40.0)):
        assembler.take(height(1000 + 50 * i, above_m), 0, 0)
        assembler.take(attitude(1000 + 50 * i), 0, 0)
    assert {pose.altitude_agl_m for pose in assembler.poses} == {40.0}


def test_a_home_that_moves_on_the_ground_needs_two_reports(assembler):
    assembler.take(origin(0.0), 0, 0)
    assembler.take(home(0.0), 0, 0)
    assert assembler.arrived_ns.get(mavlink.MAVLINK_MSG_ID_HOME_POSITION) == 0
    assembler.take(home(-40.0), 0, 0)
    assert mavlink.MAVLINK_MSG_ID_HOME_POSITION not in assembler.arrived_ns, 'asked for again'
    assert altitude_of(assembler) == pytest.approx(30.0)
    assembler.take(home(-40.0), 0, 0)
    assembler.take(attitude(1050), 0, 0)
    assert assembler.telemetry(0).pose.altitude_agl_m == pytest.approx(70.0)


def gnss(fix_type):
    return mavlink.MAVLink_gps_raw_int_message(0, fix_type, 0, 0, 0, 0, 0, 0, 0, 0)


def test_a_position_by_gnss_ends_with_its_fix(assembler):
    for i, fix_type in enumerate((3, 3, 1, 3, 1, 3, 3)):
        boot_ms, at_ns = 1000 + 500 * i, i * SECOND // 2
        fly(assembler, boot_ms, at_ns)
        assembler.take(gnss(fix_type), 0, at_ns + SECOND // 2)
        lost = 'GNSS has lost its fix' in assembler.telemetry(at_ns + SECOND // 2).position_problem
        assert lost == (2 <= i <= 5), 'back when two messages in a row say so'


def home(msl_m=0.0, down_m=0.0):
    msl_mm = round(msl_m * 1000)
    return mavlink.MAVLink_home_position_message(0, 0, msl_mm, 0, 0, down_m, [1, 0, 0, 0], 0, 0, 0)


def origin(msl_m):
    return mavlink.MAVLink_gps_global_origin_message(0, 0, round(msl_m * 1000))


def altitude_of(assembler):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    return assembler.telemetry(0).pose.altitude_agl_m


def test_altitude_is_above_home_where_px4_says_it_is():
    assembler = Assembler(Px4(), VehicleParameters())
    assembler.take(home(500.0, -4.0), 0, 0)
    assert altitude_of(assembler) == pytest.approx(26.0)


@pytest.mark.parametrize('origin_first', [True, False])
def test_altitude_is_above_home_where_the_origin_lies_higher(assembler, origin_first):
    said = [origin(587.0), home(584.0)]
    for message in said if origin_first else reversed(said):
        assembler.take(message, 0, 0)
    assert altitude_of(assembler) == pytest.approx(33.0), '30 m above the origin, 3 m above home'


def test_an_origin_first_heard_of_in_flight_corrects_the_altitude(assembler):
    assembler.take(heartbeat(4), 0, 0)
    assembler.take(mavlink.MAVLink_extended_sys_state_message(0, 2), 0, 0)
    assembler.take(home(584.0), 0, 0)
    assert altitude_of(assembler) == pytest.approx(30.0)
    assembler.take(origin(587.0), 0, 0)
    assembler.take(attitude(1100), 0, 0)
    assert assembler.telemetry(0).pose.altitude_agl_m == pytest.approx(33.0)


def range_message(distance_cm, orientation=25):
    return mavlink.MAVLink_distance_sensor_message(0, 20, 4000, distance_cm, 0, 0, orientation, 255)


def take_twice(assembler, message):
    """A first message that no other one confirms is not used."""
    for _ in range(2):
        assembler.take(message, 0, 0)


@pytest.mark.parametrize(
    ('message', 'altitude_m'),
    [
        (range_message(2500), 25.0 * cos(radians(20))),
        (range_message(4100), 30.0),
        (range_message(5), 30.0),
        (range_message(2500, orientation=0), 30.0),
    ],
)
def test_the_rangefinder_counts_downward_and_in_range(message, altitude_m):
    assembler = Assembler(ArduPilot(), VehicleParameters(altitude_source='rangefinder'))
    take_twice(assembler, message)
    assembler.take(position(), 0, 0)
    assembler.take(attitude(roll=radians(20)), 0, 0)
    assert assembler.telemetry(0).pose.altitude_agl_m == pytest.approx(altitude_m)


def fix(alt_m, fix_type=3, v_acc_m=0.0):
    return mavlink.MAVLink_gps_raw_int_message(
        0, fix_type, 0, 0, round(alt_m * 1e3), 0, 0, 0, 0, 9, v_acc=round(v_acc_m * 1e3)
    )


def terrain(height_m, spacing=100):
    return mavlink.MAVLink_terrain_report_message(0, 0, spacing, 580.0, height_m, 0, 9)


@pytest.mark.parametrize(
    ('message', 'source', 'height_m', 'error_m'),
    [
        (fix(615.0), 'GNSS', 615.0, 3.0),
        (fix(615.0, v_acc_m=1.7), 'GNSS', 615.0, 1.7),
        (fix(615.0, v_acc_m=0.02), 'GNSS', 615.0, 1.0),
        (terrain(33.0), 'terrain data', 33.0, 5.0),
        (range_message(2500), 'rangefinder', 25.0 * cos(radians(20)), 0.3),
    ],
)
def test_other_heights_are_reported_while_they_are_fresh(
    assembler, message, source, height_m, error_m
):
    take_twice(assembler, message)
    for second in (0, 1, 2, 3):
        assembler.take(position(1000 + 1000 * second), 0, second * SECOND)
        assembler.take(attitude(1000 + 1000 * second, roll=radians(20)), 0, second * SECOND)
        heights = assembler.telemetry(second * SECOND).heights
        assert len(heights) == (second < 3)
    first = assembler.telemetry(2 * SECOND).heights[0]
    assert first.source == source
    assert first.height_m == pytest.approx(height_m)
    assert first.error_m == error_m
    assert first.above_ground is (source != 'GNSS')
    assert first.is_narrow is (source == 'rangefinder')


@pytest.mark.parametrize(
    ('good', 'bad', 'rejected'),
    [
        (fix(615.0), fix(0.0, fix_type=2), 0),
        (range_message(3900), range_message(4100), 0),
        (None, range_message(900, 0), 0),
        (None, terrain(33.0, spacing=0), 0),
        (None, terrain(nan), 2),
        (None, fix(3e5), 2),
    ],
)
def test_what_is_no_height_is_not_reported(assembler, good, bad, rejected):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    if good is not None:
        take_twice(assembler, good)
        assert assembler.telemetry(0).heights
    take_twice(assembler, bad)
    assert not assembler.telemetry(0).heights
    assert assembler.rejected == rejected


def test_a_single_message_moves_no_other_height(assembler):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    take_twice(assembler, fix(615.0))
    told = []
    for altitude_m in (615.0, 700.0, 616.0, 616.0, 640.0, 640.0):
        assembler.take(fix(altitude_m), 0, 0)
        told.append(assembler.telemetry(0).heights[0].height_m)
    assert told == [615.0, 615.0, 615.0, 616.0, 616.0, 640.0]


@pytest.mark.parametrize(('roll_deg', 'count'), [(55, 1), (65, 0), (172, 0)])
def test_a_rangefinder_that_looks_aside_says_nothing(assembler, roll_deg, count):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(roll=radians(roll_deg)), 0, 0)
    take_twice(assembler, range_message(2500))
    assert len(assembler.telemetry(0).heights) == count


def test_a_time_stamp_that_is_ahead_leads_a_position_no_farther(assembler):
    """At 3 m/s, 990 ms ahead, 5 m beside where that leads: 7.9 m beside the vehicle."""
    for tick in range(5):
        assembler.take(position(1000 + 50 * tick, x=0.15 * tick, vx=3.0), 0, tick * SECOND // 20)
    at_ns = 5 * SECOND // 20
    forged = position(1200 + 990, x=0.6 + 2.97 + 4.9, vx=3.0)
    assembler.take(forged, 0, at_ns)
    assembler.take(attitude(1210), 0, at_ns)
    assert assembler.telemetry(at_ns).pose.north_m == pytest.approx(0.6, abs=0.2)


@pytest.mark.parametrize('message', [fix(615.0), terrain(33.0), range_message(2500)])
def test_the_first_message_of_a_height_is_not_used_alone(message):
    """A vehicle without a rangefinder gets its first distance from a forger."""
    assembler = Assembler(ArduPilot(), VehicleParameters(altitude_source='rangefinder'))
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    barometer_m = assembler.telemetry(0).pose.altitude_agl_m
    assembler.take(message, 0, 0)
    told = assembler.telemetry(0)
    assert told.heights == ()
    assert told.pose.altitude_agl_m == barometer_m
    assembler.take(message, 0, 0)
    assert len(assembler.telemetry(0).heights) == 1


def test_long_texts_are_put_together(assembler):
    for chunk, text in enumerate((b'x' * 50, b'yz')):
        assembler.take(mavlink.MAVLink_statustext_message(4, text, 7, chunk), 0, 0)
    assembler.take(mavlink.MAVLink_statustext_message(4, b'short'), 0, 0)
    assert [text for _, text in assembler.texts.entries] == ['x' * 50 + 'yz', 'short']


def test_a_text_is_one_line_without_escapes(assembler):
    text = b'\x1b[2Jlow\r\n[INFO] forged\x7f'
    assembler.take(mavlink.MAVLink_statustext_message(4, text), 0, 0)
    assert assembler.telemetry(0).status_text == '?[2Jlow??[INFO] forged?'


def test_nothing_is_believed_of_an_autopilot_whose_heartbeat_is_silent(assembler):
    assembler.take(heartbeat(4), 0, 0)
    for second in (1, 3, 4):
        assembler.take(position(1000 * second), 0, second * SECOND)
        assembler.take(attitude(1000 * second), 0, second * SECOND)
        known = assembler.telemetry(second * SECOND).pose is not None
        assert known == (second < 4), 'its mode may have changed since'
    told = assembler.telemetry(4 * SECOND)
    assert told.in_control, 'silence is no takeover'
    assert 'no HEARTBEAT for more than 3.5 s' in told.position_problem


def test_what_comes_twice_or_late_is_dropped(assembler):
    assembler.take(position(2000, x=5.0), 0, 0)
    assembler.take(attitude(2000), 0, 0)
    assembler.take(position(1960, x=4.0), 0, 0)
    assembler.take(attitude(2000, roll=0.3), 0, 0)
    assert assembler.late == 2
    assert len(assembler.poses) == 1
    assert assembler.telemetry(0).pose.north_m == 5.0


def jump(assembler, count=150, mode=4, begin_ms=1100, **to):
    """Report a place 20 m away for a while; return when it is believed."""
    for i in range(count):
        boot_ms = begin_ms + 33 * i
        if i % 30 == 0:
            assembler.take(heartbeat(mode), 0, i * SECOND // 30)
        assembler.take(position(boot_ms, **({'x': 21.0} | to)), 0, i * SECOND // 30)
        assembler.take(attitude(boot_ms), 0, i * SECOND // 30)
        if assembler.telemetry(i * SECOND // 30).pose is not None:
            return i / 30
    return None


def test_a_jump_is_not_believed_while_we_fly(assembler):
    assembler.take(heartbeat(4), 0, 0)
    assembler.take(position(1000), 0, 0)
    assembler.take(attitude(1000), 0, 0)
    assert assembler.poses
    assembler.poses.clear()
    assert jump(assembler) is None
    assert 'jumped by 20.0 m' in assembler.telemetry(0).position_problem
    assert not assembler.poses, 'the map must not see it either'
    assembler.take(heartbeat(4), 0, 5 * SECOND)
    assembler.take(position(6100), 0, 5 * SECOND)
    assembler.take(attitude(6100), 0, 5 * SECOND)
    assert assembler.telemetry(5 * SECOND).pose is not None, 'back where it was'


def test_a_position_that_stays_where_it_jumped_to_is_believed_in_the_end(assembler):
    """GNSS came back: nobody else could tell the vehicle to go on."""
    assembler.take(position(1000), 0, 0)
    assembler.take(attitude(1000), 0, 0)
    assert jump(assembler, count=600) == pytest.approx(15.0, abs=0.2)
    assert assembler.position_problem(0) == ''


def test_sinking_to_a_stop_after_a_jump_is_no_jump_of_the_height(assembler):
    assembler.take(position(1000, vz=2.0), 0, 0)
    assembler.take(attitude(1000), 0, 0)
    assembler.take(heartbeat(4), 0, 0)
    for i in range(45):
        sunk_m = 2.0 * (0.1 + i / 30)
        assembler.take(position(1100 + 33 * i, x=21.0, z=-30.0 + sunk_m, vz=2.0), 0, 0)
    assert jump(assembler, count=600, begin_ms=2600, z=-27.0) == pytest.approx(15.0, abs=2.0)


def test_a_height_that_jumped_is_never_believed_while_we_fly(assembler):
    assembler.take(position(1000), 0, 0)
    assembler.take(attitude(1000), 0, 0)
    assert jump(assembler, count=900, z=-33.0) is None
    assert 'the same height' in assembler.position_problem(0)


def test_a_position_that_goes_on_jumping_is_not_believed(assembler):
    assembler.take(position(1000), 0, 0)
    assembler.take(attitude(1000), 0, 0)
    for start in range(3):
        begin_ms = 1100 + 10_000 * start
        assert jump(assembler, count=300, begin_ms=begin_ms, x=21.0 + 20.0 * start) is None


def test_a_jump_is_believed_after_two_seconds_when_a_person_flies(assembler):
    assembler.take(position(1000), 0, 0)
    assembler.take(attitude(1000), 0, 0)
    assert jump(assembler, mode=5) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize(
    ('flags', 'problem'),
    [(0x33F, False), (0x2D, False), (0xA5, True), (0x3FF, False), (0xAF, True)],
)
def test_the_filter_says_whether_there_is_a_position(assembler, flags, problem):
    assembler.take(position(), 0, 0)
    report = mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0)
    assembler.take(report, 0, 0)
    assembler.take(attitude(), 0, 0)
    assert bool(assembler.position_problem(0)) == problem
    assert (assembler.telemetry(0).pose is None) == problem


@pytest.mark.parametrize(('said', 'remaining'), [(-1, None), (0, 0.0), (37, 0.37), (100, 1.0)])
def test_battery_is_a_part_of_one_or_unknown(assembler, said, remaining):
    message = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12000, -1, said, 0, 0, 0, 0, 0, 0)
    assembler.take(message, 0, 0)
    assert assembler.telemetry(0).battery_remaining == remaining


@pytest.mark.parametrize('moved', [home(15.0), origin(-15.0)])
def test_a_home_that_moves_in_flight_does_not_move_the_ground(assembler, moved):
    assembler.take(origin(0.0), 0, 0)
    assembler.take(home(0.0), 0, 0)
    assembler.take(heartbeat(4), 0, 0)
    assembler.take(mavlink.MAVLink_extended_sys_state_message(0, 2), 0, 0)
    assembler.take(moved, 0, 0)
    assert altitude_of(assembler) == pytest.approx(30.0)
    assert assembler.rejected == 1


def height(boot_ms, above_m, climb_m_s=0.0):
    return mavlink.MAVLink_global_position_int_message(
        boot_ms, 0, 0, 0, round(above_m * 1000), 0, 0, round(-climb_m_s * 100), 0
    )


def test_without_a_position_poses_tell_attitude_and_altitude_only(assembler):
    assembler.take(height(1000, 40.0, climb_m_s=-2.0), 0, 0)
    assembler.take(attitude(1100, yaw=0.5), 99, 0)
    (pose,) = assembler.poses
    assert not pose.has_position
    assert (pose.stamp_ns, pose.altitude_agl_m) == (99, pytest.approx(39.8))
    assert pose.quaternion_ned_frd == quaternion_from_euler(0.0, 0.0, 0.5)
    assert assembler.telemetry(0).pose is None, 'nobody flies by it'


def test_the_altitude_of_px4_needs_no_position_either():
    assembler = Assembler(Px4(), VehicleParameters())
    assembler.take(mavlink.MAVLink_altitude_message(10**6, 0, 0, 0, 40.0, nan, nan), 0, 0)
    assembler.take(attitude(1000), 99, 0)
    assert assembler.poses[0].altitude_agl_m == pytest.approx(40.0)
    assembler.take(mavlink.MAVLink_altitude_message(10**6, 0, 0, 0, nan, nan, nan), 0, 0)
    assembler.take(attitude(1050), 100, 0)
    assert len(assembler.poses) == 1


def test_an_old_altitude_makes_no_pose_and_a_position_makes_a_whole_one(assembler):
    assembler.take(height(1000, 40.0), 0, 0)
    assembler.take(attitude(2500), 99, int(1.5 * SECOND))
    assert not assembler.poses
    assembler.take(position(2600), 0, int(1.6 * SECOND))
    assembler.take(attitude(2600), 100, int(1.6 * SECOND))
    assert [pose.has_position for pose in assembler.poses] == [True]


def test_poses_get_the_moment_at_which_they_were_true():
    clock = TimeMap()
    assembler = Assembler(ArduPilot(), VehicleParameters(), clock)
    for i in range(5):
        clock.add(i * SECOND, i * SECOND + 500_000_000, i * SECOND + 4_000_000)
    assembler.take(position(6000), 0, 0)
    assembler.take(attitude(6000), int(5.54 * SECOND), 0)
    assert assembler.poses[0].stamp_ns == pytest.approx(5.502 * SECOND, abs=1_000_000)
