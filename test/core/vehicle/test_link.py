# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link against MAVLink bytes over loopback."""

import random
import threading
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import Setpoint, VehicleError
from peace_ros.core.vehicle import Answer, VehicleParameters, open_vehicle

QUICK = VehicleParameters(request_limit_s=0.6)


@pytest.fixture
def spoken(free_port, mock_autopilot):
    """A link whose autopilot is spoken by the test."""
    peer = mock_autopilot(free_port)
    timer = threading.Timer(0.1, peer.heartbeat)
    timer.start()
    link = open_vehicle(f'udpin:127.0.0.1:{free_port}', parameters=QUICK, timeout_s=5.0)
    timer.join()
    yield peer, link, free_port
    link.close()


def kinds(peer):
    return [m.get_type() for m in peer.hear()]


def test_only_an_autopilot_is_believed_not_a_ground_station(free_port, mock_autopilot):
    gcs, gimbal = mock_autopilot(free_port, system=255), mock_autopilot(free_port, component=154)

    def speak():
        gcs.heartbeat(kind=6, autopilot=8)
        gimbal.heartbeat(kind=26, autopilot=8)

    threading.Timer(0.1, speak).start()
    with pytest.raises(VehicleError, match='no HEARTBEAT of an autopilot'):
        open_vehicle(f'udpin:127.0.0.1:{free_port}', timeout_s=0.5)


def test_another_autopilot_than_asked_for_is_an_error(free_port, mock_autopilot):
    peer = mock_autopilot(free_port)
    threading.Timer(0.1, peer.heartbeat).start()
    with pytest.raises(VehicleError, match='px4'):
        open_vehicle(f'udpin:127.0.0.1:{free_port}', dialect='px4', timeout_s=5.0)


def test_a_forged_second_system_is_not_believed(spoken, mock_autopilot, eventually):
    peer, link, port = spoken
    peer.position(1000, north=1.0)
    assert eventually(lambda: link.telemetry().pose is not None)
    for ids in ({'system': 2}, {'component': 2}, {}):  # the last: same ids from elsewhere
        forger = mock_autopilot(port, **ids)
        forger.heartbeat(mode=5, armed=False)
        forger.position(1001, north=500.0)
    assert eventually(lambda: link.counts.ignored >= 9)
    told = link.telemetry()
    assert (told.mode, told.armed, told.pose.north_m) == ('GUIDED', True, 1.0)
    assert not link.taken_over


@pytest.mark.parametrize('ids', [(2, 1), (1, 2)])
def test_another_system_on_the_same_line_is_not_believed(spoken, eventually, ids):
    peer, link, _ = spoken
    peer.position(1000, north=1.0)
    assert eventually(lambda: link.telemetry().pose is not None)
    own, peer.codec = peer.codec, mavlink.MAVLink(None, *ids)
    peer.heartbeat(mode=5, armed=False)
    peer.position(1001, north=500.0)
    peer.codec = own
    assert eventually(lambda: link.counts.ignored >= 3)
    told = link.telemetry()
    assert (told.mode, told.armed, told.pose.north_m) == ('GUIDED', True, 1.0)


def test_asks_for_its_streams_and_again_after_silence_and_reboot(spoken, eventually):
    peer, link, _ = spoken

    def asked():
        return {
            int(m.param1)
            for m in peer.hear()
            if m.get_type() == 'COMMAND_LONG' and m.command == 511
        }

    seen = set()
    optional = {124, 132, 136}
    assert eventually(lambda: seen.update(asked()) or {32, 30, 245, 24, *optional} <= seen)
    peer.position(90_000)
    seen.clear()
    assert eventually(lambda: seen.update(asked()) or {32, 30, 24} <= seen, 4.0), 'after silence'
    assert not optional & seen, 'what not every vehicle has is seldom asked for again'
    peer.position(91_000)
    assert eventually(lambda: link.telemetry().pose is not None)
    asked()
    peer.position(500)
    seen.clear()
    assert not eventually(lambda: seen.update(asked()) or {32, 30} <= seen, 0.3), 'one is late'
    for boot_ms in range(550, 900, 50):
        peer.position(boot_ms)
        peer.heartbeat()
    assert eventually(lambda: seen.update(asked()) or {32, 30} <= seen, 0.5), 'after a reboot'


def test_sends_its_own_heartbeat(spoken, eventually):
    peer, _, _ = spoken
    beats = []
    assert eventually(
        lambda: beats.extend(m for m in peer.hear() if m.get_type() == 'HEARTBEAT') or beats
    )
    assert (beats[0].type, beats[0].autopilot) == (18, 8)
    assert beats[0].get_srcComponent() == 191


@pytest.mark.parametrize('bad', [float('nan'), float('inf')])
def test_a_setpoint_that_is_no_number_never_leaves(spoken, bad):
    peer, link, _ = spoken
    peer.hear()
    with pytest.raises(VehicleError, match='finite'):
        link.send_velocity(Setpoint(0, 1.0, bad))
    link.send_velocity(Setpoint(0, 50.0))
    time.sleep(0.05)
    heard = [m for m in peer.hear() if m.get_type() == 'SET_POSITION_TARGET_LOCAL_NED']
    assert [m.vx for m in heard] == [50.0], 'clamping is the work of the guard'


def answer(peer, eventually, result, text=None, mode=None):
    """Answer the next DO_SET_MODE while the request waits in a thread."""
    asked = []
    assert eventually(
        lambda: asked.extend(m for m in peer.hear() if getattr(m, 'command', 0) == 176) or asked
    )
    peer.send(mavlink.MAVLink_command_ack_message(176, result, 0, 0, 1, 191))
    if text:
        peer.send(mavlink.MAVLink_statustext_message(4, text))
    if mode is not None:
        peer.heartbeat(mode)


def in_background(function):
    results = []
    thread = threading.Thread(target=lambda: results.append(function()))
    thread.start()
    return thread, results


def test_a_refusal_carries_the_words_of_the_autopilot(spoken, eventually):
    peer, link, _ = spoken
    thread, results = in_background(link.request_control)
    answer(peer, eventually, 4, b'requires position')
    thread.join(3.0)
    assert (results[0].answer, results[0].code) == (Answer.REFUSED, 4)
    assert results[0].reason == 'requires position'
    assert not results[0]


def test_no_answer_ends_at_its_limit_after_asking_again(spoken):
    peer, link, _ = spoken
    peer.hear()
    begin = time.monotonic()
    result = link.request_hold()
    assert result.answer is Answer.NO_ANSWER
    assert 0.5 < time.monotonic() - begin < 1.5
    assert '0.6 s' in result.reason


def test_an_acknowledgement_for_somebody_else_is_not_ours(spoken, eventually):
    peer, link, _ = spoken
    thread, results = in_background(link.request_hold)
    assert eventually(lambda: 176 in [getattr(m, 'command', 0) for m in peer.hear()])
    peer.send(mavlink.MAVLink_command_ack_message(176, 0, 0, 0, 255, 190))
    thread.join(3.0)
    assert results[0].answer is Answer.NO_ANSWER


def test_our_own_hold_is_no_takeover(spoken, eventually):
    peer, link, _ = spoken
    thread, results = in_background(link.request_hold)
    answer(peer, eventually, 0, mode=17)
    thread.join(3.0)
    assert results[0]
    assert not link.taken_over
    assert link.telemetry().mode == 'BRAKE'


def test_a_pilot_who_is_quicker_than_our_hold_has_taken_over(spoken, eventually):
    peer, link, _ = spoken
    thread, results = in_background(link.request_hold)
    assert eventually(lambda: 176 in map(_command, peer.hear()))
    peer.heartbeat(mode=5)
    assert eventually(lambda: link.taken_over)
    thread.join(3.0)
    assert not results[0]


def test_after_a_takeover_only_a_person_gets_control_back(spoken, eventually):
    peer, link, _ = spoken
    peer.heartbeat(mode=5)
    assert eventually(lambda: link.taken_over)
    peer.hear()
    result = link.request_control()
    assert (result.answer, result.code) == (Answer.REFUSED, None)
    assert 'LOITER' in result.reason
    time.sleep(0.05)
    assert 176 not in [getattr(m, 'command', 0) for m in peer.hear()], 'not even asked'
    thread, results = in_background(lambda: link.request_control(by_person=True))
    answer(peer, eventually, 0, mode=4)
    thread.join(3.0)
    assert results[0]
    assert not link.taken_over


def test_px4_gets_setpoints_before_it_is_asked_for_offboard(free_port, mock_autopilot, eventually):
    peer = mock_autopilot(free_port)
    threading.Timer(0.1, lambda: peer.heartbeat(3 << 16, autopilot=12)).start()
    link = open_vehicle(f'udpin:127.0.0.1:{free_port}', parameters=QUICK, timeout_s=5.0)
    peer.hear()
    thread, results = in_background(link.request_control)
    heard = []
    assert eventually(lambda: heard.extend(peer.hear()) or 176 in map(_command, heard))
    before = [m for m in heard if m.get_type() == 'SET_POSITION_TARGET_LOCAL_NED']
    assert len(before) >= 5
    assert all((m.vx, m.vy, m.vz) == (0, 0, 0) for m in before)
    peer.send(mavlink.MAVLink_command_ack_message(176, 0))
    peer.heartbeat(6 << 16, autopilot=12)
    thread.join(3.0)
    assert results[0]
    assert link.telemetry().in_control
    link.close()


def _command(message):
    return getattr(message, 'command', 0)


def test_random_and_damaged_bytes_never_stop_it(spoken, eventually):
    peer, link, _ = spoken
    source = random.Random(5)
    good = mavlink.MAVLink_local_position_ned_message(1000, 1, 2, 3, 4, 5, 6)
    for i in range(400):
        data = bytearray(good.pack(peer.codec)) if i % 2 else bytearray(source.randbytes(60))
        data[source.randrange(len(data))] ^= 1 << source.randrange(8)
        peer.socket.sendto(bytes(data[: source.randrange(1, len(data) + 1)]), peer.to)
        if i % 50 == 0:
            time.sleep(0.01)
    peer.position(2000, north=9.0)
    peer.heartbeat(4)
    assert eventually(lambda: link.telemetry().pose is not None)
    assert link.telemetry().pose.north_m == pytest.approx(9.0)


def test_poses_are_stamped_with_the_node_clock_and_taken_once(
    free_port, mock_autopilot, eventually
):
    peer = mock_autopilot(free_port)
    threading.Timer(0.1, peer.heartbeat).start()
    link = open_vehicle(f'udpin:127.0.0.1:{free_port}', clock_ns=lambda: 4242, timeout_s=5.0)
    peer.position(1000)
    assert eventually(lambda: link.telemetry().pose is not None)
    assert [pose.stamp_ns for pose in link.take_poses()] == [4242]
    assert link.take_poses() == []
    link.close()
