# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Signatures: ours against pymavlink's, forgeries, replays, time stamps over restarts."""

import hashlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import ConfigurationError, Setpoint, VehicleError
from peace_ros.core.vehicle import VehicleParameters, check_access, open_vehicle
from peace_ros.core.vehicle.signing import Signer, read_key
from peace_ros.core.vehicle.wire import Wire
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim

KEY = bytes(range(32))


def attitude(boot_ms=5):
    return mavlink.MAVLink_attitude_message(boot_ms, 0.1, 0.2, 0.3, 0, 0, 0)


def foreign_codec(key=KEY):
    codec = mavlink.MAVLink(None, 1, 1)
    codec.signing.secret_key = key
    codec.signing.sign_outgoing = True
    codec.signing.timestamp = 500
    return codec


def test_a_key_is_32_bytes_or_a_passphrase(tmp_path):
    file = tmp_path / 'key'
    file.write_bytes(KEY)
    assert read_key(str(file)) == KEY
    file.write_text('correct horse\n')
    assert read_key(str(file)) == hashlib.sha256(b'correct horse').digest()
    file.write_text(' \n')
    with pytest.raises(ConfigurationError, match='empty'):
        read_key(str(file))
    with pytest.raises(ConfigurationError, match='no-such'):
        read_key(str(tmp_path / 'no-such'))


def test_32_bytes_of_printable_text_are_a_passphrase(tmp_path):
    file, words = tmp_path / 'key', b'thirty-one-characters-passphras'
    file.write_bytes(words + b'\n')
    assert read_key(str(file)) == hashlib.sha256(words).digest()
    file.write_bytes(words + b'\0')
    assert read_key(str(file)) == words + b'\0'


@pytest.mark.parametrize('mode', [0o600, 0o640, 0o602, 0o666])
def test_a_key_that_others_may_read_or_write_is_said(tmp_path, mode):
    file = tmp_path / 'key'
    file.write_bytes(KEY)
    file.chmod(mode)
    assert ('chmod 600' in Signer.from_file(str(file), 1).warning) == (mode != 0o600)


@pytest.mark.parametrize(
    'content',
    ['', 'x', '1 2 3', '-1 0', '281474976710656 0', '1 1\n0 1 1 999999999999999999999', '\xff'],
)
def test_a_damaged_file_of_time_stamps_is_refused(tmp_path, content):
    file = tmp_path / 'key'
    file.write_bytes(KEY)
    (tmp_path / 'key.1.time').write_text(content, encoding='latin-1')
    with pytest.raises(ConfigurationError, match='could be replayed'):
        Signer.from_file(str(file), 1)
    with pytest.raises(ConfigurationError, match='could be replayed'):
        check_access('udpin:127.0.0.1:14550', 'auto', str(file), 1)


def test_the_largest_time_stamp_does_not_end_the_line(tmp_path):
    memory, theirs = tmp_path / 'key.time', foreign_codec()
    theirs.signing.timestamp = 2**48 - 2
    wire = Wire(1, Signer(KEY, memory), datagrams=True)
    assert wire.decode(attitude().pack(theirs))
    assert wire.pack(attitude())
    wire.keep(0.0, at_once=True)
    assert Wire(1, Signer(KEY, memory), datagrams=True).pack(attitude())


@pytest.mark.parametrize('at_once', [True, False], ids=['orderly end', 'sudden end'])
def test_nothing_that_was_seen_is_accepted_after_a_restart(tmp_path, at_once):
    memory, theirs, radio = tmp_path / 'key.time', foreign_codec(), foreign_codec()
    radio.signing.link_id, radio.signing.timestamp = 7, 2000
    seen = [attitude(i).pack(each) for i in range(5) for each in (theirs, radio)]
    wire = Wire(1, Signer(KEY, memory), datagrams=True)
    assert all(wire.decode(each) for each in seen[:4])
    wire.keep(0.0, at_once=at_once)
    assert all(wire.decode(each) for each in seen[4:])
    if at_once:
        wire.keep(0.0, at_once=True)
    again = Wire(1, Signer(KEY, memory), datagrams=True)
    assert [each for each in seen if again.decode(each)] == []
    theirs.signing.timestamp += 200_000
    assert again.decode(attitude(9).pack(theirs)), 'the next second is heard'


def test_pymavlink_accepts_what_we_sign_and_we_what_it_signs():
    ours = Wire(1, Signer(KEY), datagrams=True)
    theirs = foreign_codec()
    assert theirs.parse_buffer(bytearray(ours.pack(attitude())))[0].get_type() == 'ATTITUDE'
    assert theirs.signing.goodsig_count == 1
    assert [m.get_type() for m in ours.decode(attitude().pack(theirs))] == ['ATTITUDE']


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_message_changed_anywhere_is_not_believed(data):
    wire = Wire(1, Signer(KEY), datagrams=True)
    packed = bytearray(attitude().pack(foreign_codec()))
    place = data.draw(st.integers(0, len(packed) - 1))
    packed[place] ^= 1 << data.draw(st.integers(0, 7))
    assert wire.decode(bytes(packed)) == []


def test_unsigned_and_wrongly_signed_messages_are_counted_not_believed():
    wire = Wire(1, Signer(KEY), datagrams=True)
    assert wire.decode(attitude().pack(mavlink.MAVLink(None, 1, 1))) == []
    assert wire.decode(attitude().pack(foreign_codec(bytes(32)))) == []
    assert wire.refused == (1, 1)


def test_a_replay_is_not_believed_nor_does_a_forgery_spoil_the_stream():
    wire = Wire(1, Signer(KEY), datagrams=True)
    theirs, forger = foreign_codec(), foreign_codec(bytes(32))
    first, second = attitude(1).pack(theirs), attitude(2).pack(theirs)
    forger.signing.timestamp = 2**40
    assert wire.decode(first)
    assert not wire.decode(attitude(3).pack(forger))
    assert wire.decode(second), 'the time stamp of a forgery counts for nothing'
    assert not wire.decode(first)
    assert not wire.decode(second)


def test_time_stamps_go_on_after_a_restart_with_a_clock_that_was_set_back(tmp_path):
    memory = tmp_path / 'key.time'
    theirs = foreign_codec()
    wire = Wire(1, Signer(KEY, memory, wall_s=lambda: 2e9), datagrams=True)
    theirs.parse_buffer(bytearray(wire.pack(attitude())))
    wire.keep(0.0, at_once=True)
    again = Wire(1, Signer(KEY, memory, wall_s=lambda: 1.5e9), datagrams=True)
    heard = theirs.parse_buffer(bytearray(again.pack(attitude())))
    assert heard[0].get_type() == 'ATTITUDE'
    assert theirs.signing.goodsig_count == 2


def test_recordings_of_an_earlier_flight_are_not_believed(tmp_path):
    memory = tmp_path / 'key.time'
    recorded = attitude().pack(foreign_codec())
    later = foreign_codec()
    later.signing.timestamp = 10**9
    wire = Wire(1, Signer(KEY, memory), datagrams=True)
    assert wire.decode(attitude().pack(later))
    wire.keep(0.0, at_once=True)
    assert Wire(1, Signer(KEY, memory), datagrams=True).decode(recorded) == []


def test_a_disk_that_fails_does_not_stop_the_link(tmp_path):
    signer = Signer(KEY, tmp_path / 'gone' / 'key.time')
    signer.save(0.0, at_once=True)
    assert signer.sign(b'x' * 20)
    assert 'cannot be written' in signer.warning


@pytest.fixture
def key_file(tmp_path):
    file = tmp_path / 'key'
    file.write_text('secret')
    return str(file)


def test_the_simulated_autopilot_obeys_only_who_has_the_key(key_file, eventually):
    signed = AutopilotParameters(port=0, speed=40.0, signing_key_file=key_file)
    with AutopilotSim(signed) as sim:
        with pytest.raises(VehicleError, match='no HEARTBEAT'):
            open_vehicle(sim.url, timeout_s=1.0)
        link = open_vehicle(sim.url, parameters=VehicleParameters(signing_key_file=key_file))
        assert eventually(lambda: link.telemetry().pose is not None, 8.0)
        link.send_velocity(Setpoint(0))
        assert eventually(lambda: sim.flight.setpoints == 1)
        stranger = Wire(1, None, datagrams=True)
        setpoint = link.dialect.velocity_message(Setpoint(0, 9.0), 0, (1, 1))
        link._transport.write(stranger.pack(setpoint), None)
        other = Wire(1, Signer(bytes(32)), datagrams=True)
        link._transport.write(other.pack(setpoint), None)
        assert eventually(lambda: sim.refused_signatures >= 3), 'the stranger before, and these'
        assert not eventually(lambda: sim.flight.setpoints > 1, 0.3)
        link.close()


def test_an_autopilot_without_the_key_is_not_believed(key_file):
    with AutopilotSim(AutopilotParameters(port=0, speed=5.0)) as sim:
        parameters = VehicleParameters(signing_key_file=key_file)
        with pytest.raises(VehicleError, match='not rightly signed'):
            open_vehicle(sim.url, parameters=parameters, timeout_s=1.5)
