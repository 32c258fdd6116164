# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink bytes over loopback, with the simulation stepped by hand."""

import random
import socket

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import VehicleError
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim


class GroundStation:
    """A peer that sends and keeps what it hears."""

    def __init__(self, sim):
        self.sim = sim
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.socket.setblocking(False)
        self.codec = mavlink.MAVLink(None, 255, 190)
        self.codec.robust_parsing = True

    def raw(self, data):
        self.socket.sendto(data, ('127.0.0.1', int(self.sim.url.rpartition(':')[2])))

    def send(self, message):
        self.raw(message.pack(self.codec))

    def command(self, number, *params):
        values = (*params, *(0.0,) * (7 - len(params)))
        self.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *values))

    def hear(self, seconds=0.1):
        heard = []
        for _ in range(max(1, round(seconds / 0.1))):
            self.sim.step(0.1)
            while True:
                try:
                    data = self.socket.recv(65535)
                except BlockingIOError:
                    break
                heard += self.codec.parse_buffer(bytearray(data)) or []
        return heard

    def kinds(self, seconds=0.1):
        return [m.get_type() for m in self.hear(seconds)]


@pytest.fixture
def sim():
    sim = AutopilotSim(AutopilotParameters(port=0, start_north_m=3.0))
    yield sim
    sim.close()


@pytest.fixture
def gcs(sim):
    station = GroundStation(sim)
    station.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    yield station
    station.socket.close()


def test_sends_only_four_kinds_unasked_and_a_heartbeat_each_second(gcs):
    kinds = gcs.kinds(50.0)
    assert set(kinds) == {'HEARTBEAT', 'STATUSTEXT', 'TIMESYNC', 'HOME_POSITION'}
    assert kinds.count('HEARTBEAT') == pytest.approx(50, abs=2)


def test_home_is_told_on_the_globe_only_and_the_origin_when_asked():
    sim = AutopilotSim(AutopilotParameters(port=0, start_north_m=3.0, origin_above_home_m=7.0))
    gcs = GroundStation(sim)
    gcs.command(511, 32, 200_000)
    gcs.command(512, 49)
    assert 'GPS_GLOBAL_ORIGIN' not in {m.get_type() for m in gcs.hear(15.0)}, 'none yet'
    heard = gcs.hear(30.0)
    gcs.command(512, 49)
    told = {m.get_type(): m for m in [*heard, *gcs.hear(1.0)]}
    home, origin = told['HOME_POSITION'], told['GPS_GLOBAL_ORIGIN']
    assert (home.x, home.y, home.z) == (0.0, 0.0, 0.0), 'as ArduPilot has it'
    assert (origin.altitude - home.altitude) / 1000.0 == pytest.approx(7.0)
    assert told['LOCAL_POSITION_NED'].z == pytest.approx(7.0), 'home is below the origin'
    gcs.socket.close()
    sim.close()


def test_the_barometer_goes_on_without_a_position(gcs, sim):
    gcs.hear(45.0)
    gcs.command(511, 33, 200_000)
    gcs.hear(1.0)
    sim.lose_gps()
    gcs.hear(8.0)
    sim.flight.physics.north_m += 50.0
    sim.flight.physics.down_m = -12.0
    heard = [m for m in gcs.hear(1.0) if m.get_type() == 'GLOBAL_POSITION_INT']
    assert heard[0].relative_alt == pytest.approx(12_000, abs=500)
    assert heard[0].lat == pytest.approx(round((48.858 + 3.0 / 111_319.49) * 1e7), abs=70)


def test_delivers_20_hz_in_full_once_asked(gcs):
    gcs.hear(45.0)
    gcs.command(511, 32, 50_000)
    kinds = gcs.kinds(10.0)
    assert kinds.count('LOCAL_POSITION_NED') == pytest.approx(200, abs=3)
    gcs.command(511, 32, -1)
    gcs.hear(0.2)
    assert 'LOCAL_POSITION_NED' not in gcs.kinds(2.0)


def test_local_position_is_silent_before_the_origin_and_after_gps_loss(gcs, sim):
    gcs.command(511, 32, 50_000)
    assert 'LOCAL_POSITION_NED' not in gcs.kinds(15.0)
    positions = [m for m in gcs.hear(30.0) if m.get_type() == 'LOCAL_POSITION_NED']
    assert positions[-1].x == 3.0
    sim.lose_gps()
    gcs.hear(7.2)
    assert 'LOCAL_POSITION_NED' not in gcs.kinds(2.0)


@pytest.mark.parametrize('number', [30, 31, 33, 245, 1, 148, 24, 242])
def test_answers_requests_for_a_message(gcs, number):
    gcs.hear(45.0)
    gcs.command(512, number)
    heard = gcs.hear(0.2)
    assert number in [m.get_msgId() for m in heard]
    assert [m.result for m in heard if m.get_type() == 'COMMAND_ACK'] == [0]


@pytest.mark.parametrize(
    ('command', 'params', 'result'),
    [
        (31010, (), 3),
        (511, (9999, 1000), 2),
        (512, (9999,), 4),
        (400, (1.0,), 4),
        (176, (1.0, 4.0), 0),
        (176, (1.0, 0.0), 0),
        (176, (1.0, 77.0), 4),
        (22, (0, 0, 0, 0, 0, 0, 10.0), 4),
        (42007, (2.0,), 0),
        (42007, (9.0,), 2),
        (192, (-1, 0, 0, 0, 48.8, 2.3, 20.0), 2),
        (178, (1, 3.0), 4),
        (115, (90.0, 0, 0, 0), 0),
        (115, (400.0, 0, 0, 0), 4),
        (300, (), 4),
        (410, (), 0),
        (520, (), 0),
    ],
)
def test_acknowledges_with_a_meaningful_result(gcs, command, params, result):
    gcs.command(command, *params)
    acks = [m for m in gcs.hear(0.2) if m.get_type() == 'COMMAND_ACK']
    assert [(m.command, m.result) for m in acks] == [(command, result)]


def test_takes_command_int_too(gcs):
    gcs.hear(45.0)
    gcs.send(mavlink.MAVLink_command_int_message(1, 1, 0, 176, 0, 0, 1.0, 4.0, 0, 0, 0, 0, 0))
    heard = gcs.hear(0.2)
    assert 0 in [m.result for m in heard if m.get_type() == 'COMMAND_ACK']
    assert 4 in [m.custom_mode for m in heard if m.get_type() == 'HEARTBEAT']


def test_the_armed_bit_follows_the_acknowledgement_within_a_second(gcs):
    gcs.hear(45.0)
    gcs.command(400, 1.0)
    armed_after = None
    for i in range(12):
        bits = [m.base_mode & 128 for m in gcs.hear(0.1) if m.get_type() == 'HEARTBEAT']
        if any(bits):
            armed_after = i * 0.1
            break
    assert armed_after is not None
    assert armed_after <= 1.0


def test_answers_timesync_and_parameters(gcs):
    gcs.send(mavlink.MAVLink_timesync_message(0, 123))
    gcs.send(mavlink.MAVLink_param_request_read_message(1, 1, b'GUID_TIMEOUT', -1))
    heard = {m.get_type(): m for m in gcs.hear(0.2)}
    assert heard['TIMESYNC'].ts1 == 123
    assert heard['TIMESYNC'].tc1 != 0
    assert heard['PARAM_VALUE'].param_value == 3.0


def test_a_data_stream_has_its_messages_at_its_rate_until_it_is_stopped(gcs):
    gcs.hear(45.0)
    gcs.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 5, 1))
    kinds = gcs.kinds(4.0)
    for kind in ('ATTITUDE', 'VFR_HUD', 'RAW_IMU', 'SYS_STATUS', 'BATTERY_STATUS', 'RC_CHANNELS'):
        assert kinds.count(kind) == pytest.approx(20, abs=1), kind
    gcs.send(mavlink.MAVLink_request_data_stream_message(1, 1, 10, 5, 0))
    gcs.hear(0.2)
    kinds = gcs.kinds(2.0)
    assert 'ATTITUDE' not in kinds
    assert 'VFR_HUD' in kinds


def test_px4_sends_unasked_and_knows_no_data_streams():
    sim = AutopilotSim(AutopilotParameters(port=0, autopilot='px4'))
    gcs = GroundStation(sim)
    gcs.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    gcs.hear(45.0)
    assert gcs.kinds(4.0).count('ATTITUDE') == pytest.approx(60, abs=2)
    gcs.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 50, 1))
    assert gcs.kinds(4.0).count('ATTITUDE') == pytest.approx(60, abs=2)
    gcs.command(511, 30, -1)
    gcs.hear(0.2)
    assert 'ATTITUDE' not in gcs.kinds(2.0)
    gcs.command(511, 30, 0)
    assert gcs.kinds(4.0).count('ATTITUDE') == pytest.approx(60, abs=2), 'the default again'
    gcs.command(510, 30)
    (told,) = [m for m in gcs.hear(0.3) if m.get_type() == 'MESSAGE_INTERVAL']
    assert told.interval_us == pytest.approx(66_667, abs=1)
    gcs.socket.close()
    sim.close()


def test_a_request_for_a_file_is_refused_at_once(gcs):
    open_file = 4
    payload = bytes([7, 0, 9, open_file, 3, 0, 0, 0, 0, 0, 0, 0]) + b'@PA'
    message = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload.ljust(251, b'\0'))
    gcs.send(message)
    (told,) = [m for m in gcs.hear(0.2) if m.get_type() == 'FILE_TRANSFER_PROTOCOL']
    nak, no_file = 129, 10
    assert list(told.payload[:6]) == [8, 0, 9, nak, 1, open_file]
    assert told.payload[12] == no_file


def test_a_global_place_is_flown_to_and_told_back(gcs, sim):
    gcs.hear(45.0)
    gcs.command(176, 1.0, 4.0)
    gcs.command(400, 1.0)
    gcs.command(22, 0, 0, 0, 0, 0, 0, 10.0)
    gcs.hear(12.0)
    latitude, longitude = 488_581_000, 23_421_000
    target = (0, 1, 1, 6, 0xDF8, latitude, longitude, 12.0, *(0.0,) * 8)
    gcs.send(mavlink.MAVLink_set_position_target_global_int_message(*target))
    gcs.command(511, 87, 200_000)
    gcs.command(511, 85, 200_000)
    told = {m.get_type(): m for m in gcs.hear(15.0)}
    globe, local = told['POSITION_TARGET_GLOBAL_INT'], told['POSITION_TARGET_LOCAL_NED']
    assert (globe.lat_int, globe.lon_int) == pytest.approx((latitude, longitude), abs=1)
    assert globe.alt == pytest.approx(47.0)
    truth = sim.truth()
    assert (local.x, local.y, local.z) == pytest.approx(
        (truth.north_m, truth.east_m, truth.down_m), abs=0.3
    )
    assert local.type_mask == 0xDF8


def test_each_peer_has_its_own_streams(gcs, sim):
    other = GroundStation(sim)
    other.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    gcs.command(511, 30, 100_000)
    assert 'ATTITUDE' in gcs.kinds(1.0)
    assert 'ATTITUDE' not in other.kinds(1.0)
    other.socket.close()


def test_commands_for_another_system_are_not_ours(gcs):
    gcs.send(mavlink.MAVLink_command_long_message(7, 1, 176, 0, 1, 0, 0, 0, 0, 0, 0))
    assert 'COMMAND_ACK' not in gcs.kinds(0.3)


def test_a_port_in_use_is_an_error_with_a_remedy(sim):
    port = int(sim.url.rpartition(':')[2])
    with pytest.raises(VehicleError, match=f'{port}.*choose another'):
        AutopilotSim(AutopilotParameters(port=port))


@pytest.fixture(scope='module')
def fuzzed():
    sim = AutopilotSim(AutopilotParameters(port=0))
    station = GroundStation(sim)
    yield station
    station.socket.close()
    sim.close()


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300), st.booleans())
def test_random_bytes_never_stop_it(fuzzed, data, magic):
    fuzzed.raw((b'\xfd' if magic else b'') + data)
    fuzzed.command(512, 30)
    assert 'ATTITUDE' in fuzzed.kinds(0.1)


def test_damaged_messages_never_stop_it(fuzzed):
    source = random.Random(3)
    good = mavlink.MAVLink_command_long_message(1, 1, 511, 0, 32, 5e4, 0, 0, 0, 0, 0)
    for _ in range(100):
        data = bytearray(good.pack(fuzzed.codec))
        data[source.randrange(len(data))] ^= 1 << source.randrange(8)
        fuzzed.raw(bytes(data[: source.randrange(1, len(data) + 1)]))
    fuzzed.send(
        mavlink.MAVLink_command_long_message(
            1, 1, 511, 0, float('nan'), float('inf'), 0, 0, 0, 0, 0
        )
    )
    fuzzed.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, float('nan'), 0, 0, 0, 0, 0))
    fuzzed.kinds(0.2)
    fuzzed.command(512, 30)
    assert 'ATTITUDE' in fuzzed.kinds(0.2)
