# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stray bytes on a stream cost the message that they strike, not those after it."""

from __future__ import annotations

import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.wire import Wire

COUNT = 20


def attitudes(version: int = 2) -> list[bytes]:
    sender = mavlink.MAVLink(None, 1, 1)
    return [
        bytes(
            mavlink.MAVLink_attitude_message(k, 0.1, 0.2, 0.3, 0, 0, 0).pack(
                sender, force_mavlink1=version == 1
            )
        )
        for k in range(COUNT)
    ]


def received(data: bytes, chunk: int) -> set[int]:
    wire = Wire(1, None, datagrams=False)
    found = [m for at in range(0, len(data), chunk) for m in wire.decode(data[at : at + chunk])]
    assert len({m.time_boot_ms for m in found}) == len(found)
    return {m.time_boot_ms for m in found}


@pytest.mark.parametrize('version', [1, 2])
@pytest.mark.parametrize('chunk', [1, 7, 4096])
@pytest.mark.parametrize('stray', [0xFD, 0xFE, 0x00])
def test_a_stray_byte_anywhere_costs_at_most_the_message_that_it_strikes(
    version, chunk, stray
) -> None:
    messages = attitudes(version)
    data, length = b''.join(messages), len(messages[0])
    # What it claims is complete only when enough has followed.
    tail = bytes(600)
    for at in range(0, 3 * length, 3):
        found = received(data[:at] + bytes([stray]) + data[at:] + tail, chunk=4096)
        assert len(set(range(COUNT)) - found) <= 1
    at = length + 5
    assert received(data[:at] + bytes([stray]) + data[at:] + tail, chunk) == {0, *range(2, COUNT)}


@pytest.mark.parametrize('chunk', [1, 5, 300, 4096])
def test_a_stream_cut_anywhere_loses_nothing(chunk) -> None:
    data = b''.join(attitudes()) + b''.join(attitudes(1))
    wire = Wire(1, None, datagrams=False)
    found = [m for at in range(0, len(data), chunk) for m in wire.decode(data[at : at + chunk])]
    assert [m.time_boot_ms for m in found] == [*range(COUNT), *range(COUNT)]


def test_half_a_datagram_does_not_hide_the_next() -> None:
    wire = Wire(1, None, datagrams=True)
    first, second, *_ = attitudes()
    assert wire.decode(first[:-5]) == []
    (message,) = wire.decode(second)
    assert message.time_boot_ms == 1


@pytest.mark.parametrize('stray', [b'\xfd', b'\xfe', b'\xfd\xff\x00\x00', b'\x00'])
def test_a_stray_byte_in_a_datagram_does_not_hide_the_messages_after_it(stray) -> None:
    wire = Wire(1, None, datagrams=True)
    found = wire.decode(stray + b''.join(attitudes()[:3]))
    assert [m.time_boot_ms for m in found] == [0, 1, 2]


@pytest.mark.parametrize('datagrams', [False, True])
def test_bytes_that_all_look_like_a_start_take_little_time(datagrams) -> None:
    wire = Wire(1, None, datagrams=datagrams)
    began_s = time.process_time()
    wire.decode(b'\xfd' * 65_535)
    assert time.process_time() - began_s < 0.5
    wire.decode(bytes(600))
    assert len(wire.decode(b''.join(attitudes()))) == COUNT
