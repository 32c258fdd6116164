# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Flight logs: each format is written here as its own writer does, and read back as poses."""

from __future__ import annotations

import socket
import struct
import time
from collections import Counter
from math import cos, degrees, radians
from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import RecordingError
from peace_ros.core.domain.geometry import quaternion_from_euler, yaw_from_quaternion
from peace_ros.recording.flight_log import LogClock, read_flight_log, subtitles_of
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim

UNIX_S = 1_700_000_000
LATITUDE, LONGITUDE = 48.0, 11.0
SECONDS = 20
M_PER_DEG = radians(1.0) * 6_378_137.0


def track():
    """20 s of 2 m/s to the north-east from 60 m down, nose turning past south."""
    for k in range(SECONDS * 10):
        at_s = 0.1 * k
        yield at_s, 2.0 * at_s, 2.0 * at_s, 60.0 - at_s, radians(170.0 + at_s)


def place(north_m: float, east_m: float) -> tuple[float, float]:
    latitude = LATITUDE + north_m / M_PER_DEG
    return latitude, LONGITUDE + east_m / M_PER_DEG / cos(radians(LATITUDE))


def write_tlog(path: Path) -> Path:
    vehicle, other = mavlink.MAVLink(None, 7, 1), mavlink.MAVLink(None, 255, 190)
    with path.open('wb') as file:

        def put(at_s: float, message, sender=vehicle) -> None:
            file.write(struct.pack('>Q', round((UNIX_S + at_s) * 1e6)) + message.pack(sender))

        for at_s, north, east, height, yaw in track():
            mode = 4 if at_s < 10.0 else 5  # GUIDED, LOITER
            put(at_s, mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), other)
            put(at_s, mavlink.MAVLink_heartbeat_message(2, 3, 0x81, mode, 4, 3))
            heading = ((yaw + 3.14159) % 6.28318) - 3.14159
            boot_ms = round(at_s * 1e3)
            put(at_s, mavlink.MAVLink_attitude_message(boot_ms, 0.1, 0.0, heading, 0, 0, 0))
            latitude, longitude = (round(each * 1e7) for each in place(north, east))
            height_mm = round(height * 1e3)
            position = mavlink.MAVLink_global_position_int_message(
                boot_ms, latitude, longitude, height_mm + 300_000, height_mm, 0, 0, 0, 0
            )
            put(at_s, position)
            put(at_s, position, other)
    return path


def write_dataflash(path: Path) -> Path:
    head = b'\xa3\x95'
    formats = {
        'FMT': (128, 'BBnNZ', 'Type,Length,Name,Format,Columns', '<BB4s16s64s'),
        'GPS': (130, 'QBIHLLe', 'TimeUS,Status,GMS,GWk,Lat,Lng,Alt', '<QBIHiii'),
        'POS': (131, 'QLLfff', 'TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt', '<Qiifff'),
        'ATT': (132, 'Qccccc', 'TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw', '<Qhhhhh'),
        'MODE': (133, 'QMBB', 'TimeUS,Mode,ModeNum,Rsn', '<QBBB'),
        'MSG': (134, 'QZ', 'TimeUS,Message', '<Q64s'),
    }
    with path.open('wb') as file:

        def put(name: str, *values) -> None:
            number, _, _, layout = formats[name]
            file.write(head + bytes([number]) + struct.pack(layout, *values))

        for name, (number, kinds, columns, layout) in formats.items():
            size = struct.calcsize(layout) + 3
            put('FMT', number, size, name.encode(), kinds.encode(), columns.encode())
        put('MSG', 1_000_000, b'ArduCopter V4.5.7')
        gnss_s = UNIX_S - 315_964_800 + 18  # since 1980-01-06, leap seconds
        for at_s, north, east, height, yaw in track():
            time_us = round((5.0 + at_s) * 1e6)
            latitude, longitude = (round(each * 1e7) for each in place(north, east))
            week, ms = divmod(round((gnss_s + at_s) * 1e3), 7 * 86_400_000)
            put('GPS', time_us, 3, ms, week, latitude, longitude, 0)
            put('POS', time_us, latitude, longitude, 360.0, height, height)
            heading = round(degrees(yaw) * 100) % 36_000
            put('ATT', time_us, 0, round(degrees(0.1) * 100), 0, 0, min(heading, 32_767))
            if at_s in (0.0, 10.0):
                mode = 4 if at_s < 10.0 else 5
                put('MODE', time_us, mode, mode, 0)
    return path


def write_ulog(path: Path) -> Path:
    formats = {
        'vehicle_local_position': ('uint64_t timestamp;float x;float y;float z;', '<Qfff'),
        'vehicle_attitude': ('uint64_t timestamp;float[4] q;', '<Qffff'),
        'vehicle_status': ('uint64_t timestamp;uint8_t nav_state;', '<QB'),
        'home_position': ('uint64_t timestamp;float z;', '<Qf'),
        'vehicle_gps_position': ('uint64_t timestamp;uint64_t time_utc_usec;', '<QQ'),
    }
    names = list(formats)
    with path.open('wb') as file:

        def put(kind: bytes, content: bytes) -> None:
            file.write(struct.pack('<Hc', len(content), kind) + content)

        def add(name: str, *values) -> None:
            layout = struct.pack(formats[name][1], *values)
            put(b'D', struct.pack('<H', names.index(name)) + layout)

        file.write(b'ULog\x01\x12\x35\x01' + struct.pack('<Q', 5_000_000))
        put(b'B', bytes(40))
        for name, (fields, _) in formats.items():
            put(b'F', f'{name}:{fields}'.encode())
        for number, name in enumerate(names):
            put(b'A', struct.pack('<BH', 0, number) + name.encode())
        add('home_position', 5_000_000, 2.0)
        for at_s, north, east, height, yaw in track():
            time_us = round((5.0 + at_s) * 1e6)
            add('vehicle_gps_position', time_us, round((UNIX_S + at_s) * 1e6))
            add('vehicle_attitude', time_us, *quaternion_from_euler(0.1, 0.0, yaw))
            add('vehicle_local_position', time_us, north, east, 2.0 - height)
            add('vehicle_status', time_us, 14 if at_s < 10.0 else 4)
    return path


@pytest.mark.parametrize(
    ('name', 'write', 'modes'),
    [
        ('a.tlog', write_tlog, ['GUIDED', 'LOITER']),
        ('a.bin', write_dataflash, ['GUIDED', 'LOITER']),
        ('a.BIN', write_dataflash, ['GUIDED', 'LOITER']),
        ('a.ulg', write_ulog, ['OFFBOARD', 'AUTO_LOITER']),
    ],
)
def test_poses_and_modes_of_each_format(tmp_path, name, write, modes) -> None:
    log = read_flight_log(write(tmp_path / name))
    assert log.clock is LogClock.UNIX
    assert log.poses[0].stamp_ns == pytest.approx(UNIX_S * 1e9, abs=0.15e9)
    assert len(log.poses) > 0.9 * SECONDS * 10
    for pose in log.poses[:: len(log.poses) // 5]:
        at_s = pose.stamp_ns * 1e-9 - UNIX_S
        assert (pose.north_m, pose.east_m) == pytest.approx((2.0 * at_s, 2.0 * at_s), abs=0.3)
        assert pose.altitude_agl_m == pytest.approx(60.0 - at_s, abs=0.15)
        wanted = (170.0 + at_s + 180.0) % 360.0 - 180.0
        turned = degrees(yaw_from_quaternion(pose.quaternion_ned_frd)) - wanted
        if wanted > 0.0 or write is not write_dataflash:
            assert abs((turned + 180.0) % 360.0 - 180.0) < 0.3
        assert pose.quaternion_ned_frd[1:3] != (0.0, 0.0)
    assert [mode for _, mode in log.modes] == modes
    assert (log.modes[1][0] - log.poses[0].stamp_ns) * 1e-9 == pytest.approx(10.0, abs=0.2)


def cues(times_s, fields) -> str:
    return '\n'.join(
        f'{k + 1}\n00:00:{int(t):02d},{round(t % 1 * 1000):03d} --> 00:00:{int(t):02d},999\n'
        f'<font size="28">FrameCnt: {k}\n2024-01-01 10:00:00.000\n{fields(t)}</font>\n'
        for k, t in enumerate(times_s)
    )


def test_subtitles_of_dji_give_height_place_and_gimbal(tmp_path) -> None:
    def fields(at_s: float) -> str:
        latitude, longitude = place(at_s, 0.0)
        return (
            f'[latitude: {latitude:.7f}] [longitude: {longitude:.7f}] '
            f'[rel_alt: {50.0 - at_s:.3f} abs_alt: 350.0] '
            '[gb_yaw: 90.0 gb_pitch: -60.0 gb_roll: 0.0]'
        )

    (tmp_path / 'DJI_1.SRT').write_text(cues((0.0, 1.0, 2.0), fields), newline='\r\n')
    assert subtitles_of(tmp_path / 'DJI_1.MP4') == tmp_path / 'DJI_1.SRT'
    log = read_flight_log(tmp_path / 'DJI_1.SRT')
    assert log.clock is LogClock.VIDEO
    assert [pose.stamp_ns for pose in log.poses] == [0, 1_000_000_000, 2_000_000_000]
    assert [pose.altitude_agl_m for pose in log.poses] == [50.0, 49.0, 48.0]
    assert [pose.north_m for pose in log.poses] == pytest.approx([0.0, 1.0, 2.0], abs=0.01)
    expected = quaternion_from_euler(0.0, radians(30.0), radians(90.0))
    assert log.poses[1].quaternion_ned_frd == pytest.approx(expected, abs=1e-6)


def test_subtitles_without_heading_say_what_is_assumed(tmp_path) -> None:
    path = tmp_path / 'a.srt'
    path.write_text(cues((0.0, 1.0), lambda t: f'[latitude: {10 + t}] [rel_alt: 60.0 abs_alt: 9]'))
    log = read_flight_log(path)
    assert [(pose.north_m, pose.altitude_agl_m) for pose in log.poses] == [(0.0, 60.0)] * 2
    assert log.remarks == [
        'a.srt has no heading: the camera is taken to stay above one place, up is north'
    ]


def test_text_for_people_is_not_taken_for_telemetry(tmp_path) -> None:
    (tmp_path / 'film.srt').write_text(cues((0.0, 1.0), lambda _: 'Where are you?'))
    with pytest.raises(RecordingError, match='0 positions with a height above home'):
        read_flight_log(tmp_path / 'film.srt')


@pytest.mark.parametrize('name', ['a.tlog', 'a.bin', 'a.ulg', 'a.srt', 'a.txt', 'none.bin'])
@pytest.mark.parametrize('content', [b'', b'\xa3\x95\x80' * 60, b'ULog\x01\x12\x35' + bytes(90)])
def test_what_is_not_a_log_is_one_sentence(tmp_path, name, content) -> None:
    if name != 'none.bin':
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError) as told:
        read_flight_log(tmp_path / name)
    assert name in str(told.value)
    assert '\n' not in str(told.value)


@pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])
def test_what_a_simulated_autopilot_sends_is_read_as_a_telemetry_log(tmp_path, autopilot) -> None:
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    parameters = AutopilotParameters(autopilot=autopilot, port=0, tcp_port=port, speed=2.0)
    sim = AutopilotSim(parameters)
    sim.step(43.0)
    if autopilot == 'ardupilot':
        sim.pilot_mode('GUIDED')
    sim.flight.arm()
    sim.flight.take_off(26.0 + (parameters.home_altitude_msl_m if autopilot == 'px4' else 0.0))
    sim.step(25.0)
    path = tmp_path / 'a.tlog'
    with sim:
        record_telemetry(port, path, positions=20)
        truth = sim.truth()
    log = read_flight_log(path)
    assert log.clock is LogClock.UNIX
    assert len(log.poses) > 10
    assert log.poses[-1].altitude_agl_m == pytest.approx(truth.altitude_agl_m, abs=1.5)
    assert truth.altitude_agl_m > 20.0
    assert log.modes[0][1] == ('GUIDED' if autopilot == 'ardupilot' else 'LOITER')
    assert not any('damaged' in remark for remark in log.remarks)


def record_telemetry(port: int, path: Path, positions: int) -> None:
    """Write what a ground station hears, until it has some positions."""
    line = mavutil.mavlink_connection(
        f'tcp:127.0.0.1:{port}', source_system=255, autoreconnect=False
    )
    counts: Counter[str] = Counter()
    end_s = time.monotonic() + 20.0
    with path.open('wb') as file:
        while counts['GLOBAL_POSITION_INT'] < positions and time.monotonic() < end_s:
            message = line.recv_match(blocking=True, timeout=0.5)
            if message is None:
                line.mav.heartbeat_send(6, 8, 0, 0, 0)
                continue
            if message.get_type() == 'HEARTBEAT' and not counts['HEARTBEAT']:
                for number in (30, 33):  # ATTITUDE, GLOBAL_POSITION_INT
                    line.mav.command_long_send(1, 1, 511, 0, number, 50_000, 0, 0, 0, 0, 0)
            counts[message.get_type()] += 1
            file.write(struct.pack('>Q', round(time.time() * 1e6)) + message.get_msgbuf())
    line.close()


@pytest.mark.parametrize('stray', [b'x', b'\xfd', bytes(4), b'\xfe' * 8, bytes(range(40))])
@pytest.mark.parametrize('at', [0.0, 0.3, 0.5])
def test_stray_bytes_in_telemetry_cost_two_messages_and_are_said(tmp_path, stray, at) -> None:
    whole = write_tlog(tmp_path / 'whole.tlog')
    content = whole.read_bytes()
    for shift in range(0, 50, 9):  # in a time, a header, a payload, between messages
        place = round(len(content) * at) + shift
        path = tmp_path / 'a.tlog'
        path.write_bytes(content[:place] + stray + content[place:])
        log = read_flight_log(path)
        assert len(log.poses) >= len(read_flight_log(whole).poses) - 2
        assert log.poses[-1].stamp_ns == pytest.approx((UNIX_S + SECONDS) * 1e9, abs=0.3e9)
        assert any('of a.tlog in 1 places are damaged' in each for each in log.remarks)
    assert read_flight_log(whole).remarks == []


def test_a_damaged_time_in_telemetry_costs_its_message_and_a_set_clock_none(tmp_path) -> None:
    content = write_tlog(tmp_path / 'a.tlog').read_bytes()
    whole = read_flight_log(tmp_path / 'a.tlog')
    place = content.index(struct.pack('>Q', round((UNIX_S + 10.0) * 1e6)))
    damaged = bytearray(content)
    damaged[place] ^= 0x40
    (tmp_path / 'b.tlog').write_bytes(damaged)
    log = read_flight_log(tmp_path / 'b.tlog')
    assert log.poses[-1] == whole.poses[-1]
    assert any('of b.tlog in 1 places are damaged' in each for each in log.remarks)
    # A ground station without a clock gets the time by GNSS: 1970 becomes this century.
    early = bytearray(content)
    for at_s, *_ in track():
        old, new = (struct.pack('>Q', round((unix + at_s) * 1e6)) for unix in (UNIX_S, 1000))
        if at_s < 10.0:
            early = early.replace(old, new)
    (tmp_path / 'c.tlog').write_bytes(early)
    log = read_flight_log(tmp_path / 'c.tlog')
    assert len(log.poses) == len(whole.poses)
    assert log.poses[-1].stamp_ns == whole.poses[-1].stamp_ns
    assert not any('damaged messages' in each for each in log.remarks)


def test_what_is_mostly_not_telemetry_is_refused_before_all_of_it_is_searched(tmp_path) -> None:
    with (tmp_path / 'a.tlog').open('wb') as file:
        file.write(b'\xfd\x00\x00' * 400_000)
        file.truncate(3 << 30)
    with pytest.raises(RecordingError, match='are no MAVLink with times of receipt'):
        read_flight_log(tmp_path / 'a.tlog')


def test_damage_within_a_dataflash_log_is_said(tmp_path) -> None:
    content = write_dataflash(tmp_path / 'a.bin').read_bytes()
    assert read_flight_log(tmp_path / 'a.bin').remarks == []
    middle = len(content) // 2
    (tmp_path / 'a.bin').write_bytes(content[:middle] + bytes(900) + content[middle:])
    log = read_flight_log(tmp_path / 'a.bin')
    assert any('bytes of a.bin are damaged' in each for each in log.remarks)


@pytest.mark.parametrize(
    ('damage', 'told'),
    [
        (b'\xff' * 90, 'are no whole message'),
        (bytes(90), 'a.ulg is damaged in places'),
        (b'x' * 8, 'are no whole message'),
    ],
)
def test_damage_within_a_ulog_is_said(tmp_path, damage, told) -> None:
    content = write_ulog(tmp_path / 'a.ulg').read_bytes()
    assert read_flight_log(tmp_path / 'a.ulg').remarks == []
    middle = len(content) // 2
    (tmp_path / 'a.ulg').write_bytes(content[:middle] + damage + content[middle:])
    log = read_flight_log(tmp_path / 'a.ulg')
    assert any(told in remark for remark in log.remarks)
    assert len(log.poses) > 0.4 * SECONDS * 10


def test_a_ulog_that_was_cut_short_is_read_up_to_there_and_said(tmp_path) -> None:
    content = write_ulog(tmp_path / 'a.ulg').read_bytes()
    (tmp_path / 'a.ulg').write_bytes(content[: len(content) // 2])
    log = read_flight_log(tmp_path / 'a.ulg')
    assert 'it was cut short, or is damaged' in log.remarks[0]
    assert len(log.poses) > 0.4 * SECONDS * 10
