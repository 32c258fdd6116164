# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each fault changes what the line tells or what the vehicle does, and can be taken away again."""

import math
import socket
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import VehicleError
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.autopilot.faults import FAULTS, FaultClient, inject


class Listener:
    """Hears LOCAL_POSITION_NED, ATTITUDE and whatever comes, while the simulation is stepped."""

    def __init__(self, sim):
        self.sim = sim
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(('127.0.0.1', int(sim.url.rpartition(':')[2])))
        self.socket.setblocking(False)
        self.codec = mavlink.MAVLink(None, 1, 191)
        self.codec.robust_parsing = True
        for number in (32, 30):
            self.command(511, number, 100_000)
        self.hear(0.1)

    def send(self, message):
        self.socket.send(message.pack(self.codec))

    def command(self, number, *params):
        values = (*params, *(0.0,) * (7 - len(params)))
        self.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *values))

    def hear(self, seconds):
        heard = []
        for _ in range(max(1, round(seconds / 0.5))):
            self.sim.step(min(seconds, 0.5))
            heard += self.waiting()
        return heard

    def waiting(self):
        heard = []
        while True:
            try:
                data = self.socket.recv(65535)
            except BlockingIOError:
                return heard
            heard += self.codec.parse_buffer(bytearray(data)) or []

    def of(self, kind, seconds=0.5):
        return [m for m in self.hear(seconds) if m.get_type() == kind]

    def position(self, seconds=0.5):
        return self.of('LOCAL_POSITION_NED', seconds)[-1]


@pytest.fixture
def sim():
    sim = AutopilotSim(AutopilotParameters(port=0, start_north_m=30.0, start_east_m=10.0))
    sim.step(43.0)
    inject(sim, 'pilot_mode', mode='GUIDED')
    sim.flight.arm()
    sim.flight.take_off(12.0)
    sim.step(14.0)
    yield sim
    sim.close()


@pytest.fixture
def ear(sim):
    listener = Listener(sim)
    yield listener
    listener.socket.close()


@pytest.mark.parametrize(
    ('arguments', 'down'),
    [
        ({'kind': 'nan'}, math.nan),
        ({'kind': 'sign'}, 12.0),
        ({'kind': 'jump', 'offset_m': 7.0}, -19.0),
        ({'kind': 'freeze'}, -12.0),
    ],
)
def test_altitude_is_distorted_until_cleared(sim, ear, arguments, down):
    inject(sim, 'altitude', **arguments)
    assert ear.position().z == pytest.approx(down, abs=0.3, nan_ok=True)
    inject(sim, 'clear')
    assert ear.position().z == pytest.approx(-12.0, abs=0.3)


@pytest.mark.parametrize('error_m', [6.0, -6.0])
def test_a_barometer_that_steps_takes_the_vehicle_along(sim, ear, error_m):
    inject(sim, 'barometer', error_m=error_m)
    told = [m.z for m in ear.of('LOCAL_POSITION_NED', 2.0)]
    assert max(abs(b - a) for a, b in pairwise(told)) < 0.5, 'no jump'
    assert 1.0 < abs(sim.truth().altitude_agl_m - 12.0) < 5.5, 'it glides'
    sim.step(12.0)
    assert ear.position().z == pytest.approx(-12.0, abs=0.4), 'it holds what it estimates'
    assert sim.truth().altitude_agl_m == pytest.approx(12.0 - error_m, abs=0.4)
    inject(sim, 'clear')
    sim.step(15.0)
    assert sim.truth().altitude_agl_m == pytest.approx(12.0, abs=0.4)


def test_a_barometer_drifts(sim):
    inject(sim, 'barometer', error_m=4.0, rate_m_s=0.5)
    sim.step(4.0)
    assert 0.5 < sim.flight.barometer.height_m < 2.0
    sim.step(20.0)
    assert sim.flight.barometer.height_m == pytest.approx(4.0, abs=0.1)
    for wrong in ({'error_m': math.nan}, {'rate_m_s': 0.0}):
        with pytest.raises(VehicleError, match='must be finite'):
            inject(sim, 'barometer', **wrong)


def test_gnss_knows_nothing_of_the_barometer(sim, ear):
    ear.command(511, 24, 200_000)
    before = ear.of('GPS_RAW_INT')[-1]
    assert before.v_acc == 2500
    inject(sim, 'barometer', error_m=6.0)
    sim.step(12.0)
    after = ear.of('GPS_RAW_INT')[-1]
    fell_m = (before.alt - after.alt) / 1e3
    assert fell_m == pytest.approx(6.0, abs=4.0), 'with the noise of 12 s'


@pytest.mark.parametrize(
    ('kind', 'expected'),
    [('enu', (10, 30, 12)), ('msl', (30, 10, -47)), ('south', (-30, -10, -12))],
)
def test_a_wrong_frame_is_told(sim, ear, kind, expected):
    inject(sim, 'frame', kind=kind)
    told = ear.position()
    assert (told.x, told.y, told.z) == pytest.approx(expected, abs=0.4)


def test_the_position_jumps(sim, ear):
    inject(sim, 'position', north_m=8.0, east_m=-3.0)
    told = ear.position()
    assert (told.x, told.y) == pytest.approx((38.0, 7.0), abs=0.4)


def test_messages_stop_and_come_again(sim, ear):
    inject(sim, 'telemetry_stop', messages=['LOCAL_POSITION_NED'])
    kinds = {m.get_type() for m in ear.hear(1.5)}
    assert 'LOCAL_POSITION_NED' not in kinds
    assert {'ATTITUDE', 'HEARTBEAT'} <= kinds
    inject(sim, 'telemetry_stop')
    assert ear.hear(2.0) == []
    inject(sim, 'telemetry_resume')
    assert ear.position()


def test_silence_is_in_both_directions_and_mends_itself(sim, ear, eventually_true):
    inject(sim, 'silence', seconds=0.3)
    ear.command(176, 1.0, 5.0)
    assert ear.hear(1.0) == []
    assert sim.mode_name == 'GUIDED'
    assert eventually_true(lambda: ear.hear(0.5), 3.0)


@pytest.fixture
def eventually_true():
    import time

    def wait(predicate, limit_s):
        deadline = time.monotonic() + limit_s
        while time.monotonic() < deadline:
            if predicate():
                return True
            time.sleep(0.02)
        return False

    return wait


def test_a_bad_line_loses_doubles_and_damages(sim, ear):
    usual = len(ear.of('ATTITUDE', 20.0))
    inject(sim, 'line', drop=0.5)
    assert 0.2 * usual < len(ear.of('ATTITUDE', 20.0)) < 0.8 * usual
    inject(sim, 'line', duplicate=1.0)
    assert len(ear.of('ATTITUDE', 20.0)) > 1.8 * usual
    inject(sim, 'line', corrupt=1.0)
    assert len(ear.of('ATTITUDE', 20.0)) < 0.2 * usual
    inject(sim, 'line', reorder=0.5)
    stamps = [m.time_boot_ms for m in ear.of('ATTITUDE', 20.0)]
    assert stamps != sorted(stamps)
    inject(sim, 'mend')
    ear.hear(1.0)
    stamps = [m.time_boot_ms for m in ear.of('ATTITUDE', 5.0)]
    assert stamps == sorted(stamps)


def test_a_reboot_in_the_air_keeps_the_motors_running(sim, ear):
    inject(sim, 'reboot')
    assert sim.flight.armed
    assert sim.mode_name == 'STABILIZE'
    assert sim.flight.time_s < 1.0
    assert ear.of('LOCAL_POSITION_NED', 2.0) == [], 'intervals are forgotten'
    inject(sim, 'reboot', in_the_air=False)
    sim.step(6.0)
    assert sim.truth().altitude_agl_m == 0.0


def test_the_boot_clock_steps(sim, ear):
    before_ms = ear.position().time_boot_ms
    inject(sim, 'boot_clock', step_s=30.0)
    assert ear.position().time_boot_ms - before_ms > 29_000


def test_a_mode_is_refused_to_the_line_but_not_to_the_pilot(sim, ear):
    inject(sim, 'refuse', modes=['LOITER'])
    ear.command(176, 1.0, 5.0)
    heard = ear.hear(0.3)
    assert [m.result for m in heard if m.get_type() == 'COMMAND_ACK'] == [4]
    assert any('LOITER failed' in m.text for m in heard if m.get_type() == 'STATUSTEXT')
    inject(sim, 'refuse', modes=['LOITER'], silently=True)
    ear.command(176, 1.0, 5.0)
    assert ear.of('COMMAND_ACK') == []
    assert inject(sim, 'pilot_mode', mode='LOITER') == {'accepted': True}


def test_wind_battery_text_and_disarm(sim, ear):
    inject(sim, 'wind', to_north_m_s=8.0)
    inject(sim, 'battery', remaining=0.15)
    inject(sim, 'text', text='hello', severity=3)
    texts = [m.text for m in ear.of('STATUSTEXT', 3.0)]
    assert 'hello' in texts
    assert any('low' in text for text in texts)
    assert abs(sim.flight.physics.tilt_rad) == pytest.approx(math.radians(22), abs=0.05)
    ear.command(512, 1)
    assert ear.of('SYS_STATUS')[0].battery_remaining == 15
    inject(sim, 'disarm')
    sim.step(5.0)
    assert inject(sim, 'state')['altitude_agl_m'] == 0.0


def test_gps_loss_lands_and_the_filter_says_why(sim, ear):
    ear.command(511, 193, 200_000)
    ear.command(511, 24, 200_000)
    assert ear.of('EKF_STATUS_REPORT')[-1].flags & 16
    inject(sim, 'gps_loss')
    assert ear.of('EKF_STATUS_REPORT')[-1].flags & 16, 'dead reckoning'
    assert ear.of('GPS_RAW_INT')[-1].fix_type == 1, 'told at once'
    sim.step(6.7)
    report = ear.of('EKF_STATUS_REPORT')[-1]
    assert report.flags & 128
    assert not report.flags & 24
    sim.step(2.0)
    assert sim.mode_name == 'LAND'
    inject(sim, 'gps_restore')
    assert sim.flight.has_position


@pytest.mark.parametrize(
    ('fault', 'arguments', 'says'),
    [
        ('explode', {}, 'choose one of altitude'),
        ('wind', {'up': 3}, 'it takes to_north_m_s'),
        ('altitude', {'kind': 'odd'}, 'choose one of true'),
        ('line', {'drop': 2.0}, 'between 0 and 1'),
        ('battery', {'remaining': -1.0}, 'between 0 and 1'),
        ('pilot_mode', {'mode': 'HOVER'}, 'HOVER'),
    ],
)
def test_a_wrong_request_says_what_is_right(sim, fault, arguments, says):
    with pytest.raises(VehicleError, match=says):
        inject(sim, fault, **arguments)


def test_every_fault_says_what_it_does():
    assert all(function.__doc__ for function in FAULTS.values())
    assert len(FAULTS) >= 20


@pytest.fixture
def fault_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def test_another_process_can_inject_over_the_port(fault_port):
    with AutopilotSim(AutopilotParameters(port=0, fault_port=fault_port)):
        client = FaultClient(fault_port)
        assert client.inject('pilot_mode', mode='ALT_HOLD') == {'accepted': True}
        assert client.state()['mode'] == 'ALT_HOLD'
        with pytest.raises(VehicleError, match='unknown'):
            client.inject('explode')
        client._socket.send(b'no json')
        assert client.state()['armed'] is False
        client.close()


def test_without_a_port_nobody_answers_and_it_says_so(fault_port):
    client = FaultClient(fault_port, timeout_s=0.3)
    with pytest.raises(VehicleError, match='fault_port'):
        client.state()
    client.close()


def test_px4_refuses_a_frame_and_offboard_without_a_stream():
    sim = AutopilotSim(AutopilotParameters(port=0, autopilot='px4'))
    ear = Listener(sim)
    sim.step(45.0)
    ear.hear(0.1)
    ear.command(176, 1.0, 6.0)
    heard = ear.hear(0.3)
    assert [m.result for m in heard if m.get_type() == 'COMMAND_ACK'] == [1]
    for frame, text in ((9, True), (1, False)):
        ear.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, 0x5C7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0
            )
        )
        texts = ear.of('STATUSTEXT', 0.1)
        assert ('frame 9 unsupported' in ''.join(m.text for m in texts)) == text
    ear.command(176, 1.0, 6.0)
    heard = ear.hear(0.2)
    assert [m.result for m in heard if m.get_type() == 'COMMAND_ACK'] == [0]
    ear.socket.close()
    sim.close()


def asked(ear, *numbers):
    """Ask for messages at 10 Hz."""
    for number in numbers:
        ear.command(511, number, 100_000)
    ear.hear(0.5)


def test_a_fence_stops_guided_silently_and_reports_when_it_is_asked(sim, ear):
    asked(ear, 162)
    assert ear.of('FENCE_STATUS') == [], 'without a fence there is no status'
    inject(sim, 'fence', kind='floor', at_m=6.0)
    for _ in range(40):
        steer(ear, 0.0, 0.0, 1.0)
        heard = ear.hear(0.3)
    assert sim.truth().altitude_agl_m == pytest.approx(8.0, abs=0.3)
    statuses = [m for m in heard if m.get_type() == 'FENCE_STATUS']
    assert statuses[-1].breach_mitigation == mavlink.FENCE_MITIGATE_VEL_LIMIT
    assert statuses[-1].breach_status == 0
    assert not [m for m in heard if m.get_type() == 'STATUSTEXT']
    inject(sim, 'clear')
    for _ in range(10):
        steer(ear, 0.0, 0.0, 1.0)
        ear.hear(0.3)
    assert sim.truth().altitude_agl_m < 7.0


def test_the_circle_lies_around_the_vehicle_where_that_is_asked_for(sim):
    inject(sim, 'fence', kind='circle', at_m=9.0, around_vehicle=True, north_m=2.0)
    assert sim.flight.fence.centre_m == pytest.approx((32.0, 10.0), abs=0.5)


def steer(ear, north, east, down):
    ear.send(
        mavlink.MAVLink_set_position_target_local_ned_message(
            *(0, 1, 1, 1, 0x5C7), *(0.0, 0.0, 0.0), *(north, east, down), *(0.0,) * 5
        )
    )


def test_the_target_that_is_followed_is_reported_in_guided_only(sim, ear):
    asked(ear, 85)
    steer(ear, 1.0, -0.5, 0.25)
    target = ear.of('POSITION_TARGET_LOCAL_NED')[-1]
    assert (target.vx, target.vy, target.vz) == (1.0, -0.5, 0.25)
    assert target.type_mask & 0x038 == 0, 'the velocity counts'
    target = ear.of('POSITION_TARGET_LOCAL_NED', 4.0)[-1]
    assert (target.vx, target.vy, target.vz) == (0.0, 0.0, 0.0), 'after GUID_TIMEOUT'
    inject(sim, 'pilot_mode', mode='LOITER')
    ear.hear(0.5)
    assert ear.of('POSITION_TARGET_LOCAL_NED') == []


def test_a_second_commander_is_obeyed_and_reported_until_it_ends(sim, ear):
    asked(ear, 85)
    inject(sim, 'commander', v_north_m_s=2.0)
    ear.hear(3.0)
    target = ear.of('POSITION_TARGET_LOCAL_NED')[-1]
    assert (target.vx, target.vy, target.vz) == (2.0, 0.0, 0.0)
    assert inject(sim, 'state')['v_north_m_s'] > 1.5
    inject(sim, 'clear')
    ear.hear(6.0)
    assert inject(sim, 'state')['v_north_m_s'] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(('remaining', 'charge'), [(0.5, 1), (0.19, 2), (0.09, 3)])
def test_a_low_battery_has_its_state_of_charge(sim, ear, remaining, charge):
    asked(ear, 147)
    inject(sim, 'battery', remaining=remaining)
    status = ear.of('BATTERY_STATUS')[-1]
    assert (status.charge_state, status.battery_remaining) == (charge, round(remaining * 100))
    assert sim.mode_name == 'GUIDED'


def test_a_low_battery_enters_the_mode_of_its_failsafe(sim):
    inject(sim, 'battery', remaining=0.3, failsafe='RTL')
    assert sim.mode_name == 'GUIDED'
    inject(sim, 'battery', remaining=0.1, failsafe='RTL')
    assert sim.mode_name == 'RTL'


@pytest.mark.parametrize('arguments', [{'kind': 'wall'}, {}])
def test_an_unknown_fence_is_refused(sim, arguments):
    with pytest.raises(VehicleError, match='kind'):
        inject(sim, 'fence', **arguments)
