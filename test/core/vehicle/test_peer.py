# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is believed to be our autopilot, with the clock in the test's hand."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.control import Control
from peace_ros.core.vehicle.peer import Peer

SECOND = 10**9
HERE, THERE = ('127.0.0.1', 1), ('127.0.0.1', 2)


def voice(system=1, component=1, *, kind=2, autopilot=3):
    """Return a HEARTBEAT as it is heard from a system."""
    codec = mavlink.MAVLink(None, system, component)
    packed = mavlink.MAVLink_heartbeat_message(kind, autopilot, 81, 4, 4, 3).pack(codec)
    return mavlink.MAVLink(None).parse_buffer(bytearray(packed))[0]


@pytest.mark.parametrize(
    ('vehicle_id', 'message', 'at_s', 'taken'),
    [
        (0, voice(), 0, True),
        (0, voice(7), 1, False),
        (0, voice(7), 3, True),
        (7, voice(7), 0, True),
        (7, voice(1), 30, False),
        (0, voice(1, 2), 30, False),
        (0, voice(1, kind=6), 30, False),
        (0, voice(1, 191, kind=18, autopilot=8), 30, False),
    ],
)
def test_chooses_component_1_of_the_system_asked_for(vehicle_id, message, at_s, taken):
    peer = Peer(vehicle_id, 0)
    assert peer.is_candidate(message, HERE, at_s * SECOND) == taken


def test_says_who_else_was_heard():
    peer = Peer(7, 0)
    peer.is_candidate(voice(1), HERE, 0)
    assert '1/1' in peer.heard_instead()
    assert 'vehicle_id' in peer.heard_instead()


def test_a_new_address_is_believed_after_three_seconds_of_silence():
    peer = Peer(0, 0)
    assert not peer.is_ours(voice(), HERE, 0), 'nobody is, before one was chosen'
    peer.choose(voice(), HERE, 0)
    assert peer.is_ours(voice(), HERE, 2 * SECOND)
    assert peer.warning == ''
    assert not peer.is_ours(voice(), THERE, 4 * SECOND)
    assert 'two addresses' in peer.warning
    assert f'{THERE[0]}:{THERE[1]} is ignored' in peer.warning
    assert peer.is_ours(voice(), THERE, 5 * SECOND)
    assert peer.source == THERE
    assert 'followed after 3 s of silence' in peer.warning
    assert not peer.is_ours(voice(2), THERE, 60 * SECOND)


def test_only_the_mode_that_we_asked_for_is_no_takeover():
    control = Control()
    control.leave_to('BRAKE', 3 * SECOND)
    control.left_for('BRAKE', 2 * SECOND)
    assert not control.taken_over
    control.left_for('BRAKE', 2 * SECOND)
    assert control.taken_over, 'the second time nobody asked for it'
    control.ask_anew()
    control.leave_to('BRAKE', 3 * SECOND)
    control.left_for('LOITER', 2 * SECOND)
    assert control.taken_over, 'a pilot was quicker'
    control.ask_anew()
    control.leave_to('BRAKE', 3 * SECOND)
    control.stay()
    control.left_for('BRAKE', 2 * SECOND)
    assert control.taken_over, 'ours was refused, so somebody else chose it'
