# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The relay between companion and autopilot: what passes, what does not, what it measures."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.lab.faults import line, tamper
from peace_ros.lab.faults.line import RelayedLine, messages_of


class Ends:
    """A companion and an autopilot with a line between them."""

    def __init__(self) -> None:
        self.autopilot = self._open()
        self.autopilot.bind(('127.0.0.1', 0))
        self.line = RelayedLine(self.autopilot.getsockname()[1])
        self.companion = self._open()
        self.companion.connect(('127.0.0.1', self.line.port))
        self._heard_from: tuple[str, int] | None = None

    def _open(self) -> socket.socket:
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        opened.settimeout(0.3)
        return opened

    def up(self, data: bytes) -> None:
        self.companion.send(data)

    def arrived(self, limit: int = 10) -> list[bytes]:
        """Return what the autopilot hears until it is silent."""
        found = []
        with suppress(TimeoutError):
            while len(found) < limit:
                data, self._heard_from = self.autopilot.recvfrom(2000)
                found.append(data)
        return found

    def down(self, data: bytes) -> None:
        assert self._heard_from is not None
        self.autopilot.sendto(data, self._heard_from)

    def came_back(self) -> list[bytes]:
        found = []
        with suppress(TimeoutError):
            while True:
                found.append(self.companion.recv(2000))
        return found

    def close(self) -> None:
        self.line.close()
        self.autopilot.close()
        self.companion.close()


@pytest.fixture
def ends() -> Iterator[Ends]:
    both = Ends()
    yield both
    both.close()


def velocity(down_m_s: float) -> bytes:
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0x5C7, 0.0, 0.0, 0.0, 0.0, 0.0, down_m_s, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    return bytes(message.pack(mavlink.MAVLink(None, 1, 191)))


def test_both_directions_pass(ends: Ends) -> None:
    ends.up(b'question')
    assert ends.arrived(1) == [b'question']
    ends.down(b'answer')
    assert ends.came_back() == [b'answer']


def test_a_lost_line_loses_and_a_mended_one_does_not(ends: Ends) -> None:
    ends.up(b'first')
    ends.arrived(1)
    ends.line.up = ends.line.down = tamper.nothing
    ends.up(b'lost')
    ends.down(b'lost too')
    assert ends.arrived() == []
    assert ends.came_back() == []
    ends.line.mend()
    ends.up(b'again')
    assert ends.arrived(1) == [b'again']


def test_late_datagrams_arrive_late_and_in_order(ends: Ends) -> None:
    ends.line.up = tamper.late(0.15)
    began = time.monotonic()
    ends.up(b'1')
    ends.up(b'2')
    assert ends.arrived(2) == [b'1', b'2']
    assert time.monotonic() - began >= 0.14


def test_set_points_are_measured_even_when_they_are_lost(ends: Ends) -> None:
    ends.line.up = tamper.nothing
    began = time.monotonic()
    for speed in (0.0, 1.5):
        ends.up(velocity(speed))
    ends.up(b'noise')
    ends.arrived(1)
    sent = ends.line.sent_since(began)
    assert [each.v_down_m_s for each in sent] == [0.0, 1.5]
    assert [each.is_zero for each in sent] == [True, False]
    # The kernel's stamp lies between the sending and now.
    assert began - 0.05 <= sent[0].at_s <= sent[1].at_s <= time.monotonic() + 0.05
    ends.line.forget()
    assert ends.line.sent_since(0.0) == []


def test_forged_datagrams_come_from_elsewhere(ends: Ends) -> None:
    ends.up(b'hello')
    ends.arrived(1)
    ends.companion.close()
    ends.companion = ends._open()
    ends.companion.bind(('127.0.0.1', 0))
    ends.companion.sendto(b'hello', ('127.0.0.1', ends.line.port))
    ends.arrived(1)
    ends.line.tell_companion(b'forged', from_elsewhere=True)
    data, address = ends.companion.recvfrom(100)
    assert data == b'forged'
    assert address[1] != ends.line.port


def collect(what: line.Tamper, count: int) -> list[tuple[float, bytes]]:
    return [each for n in range(count) for each in what(bytes([n]) * 8)]


@pytest.mark.parametrize(
    ('what', 'delays'),
    [
        (line.doubled, [0.0, 0.0, 0.0, 0.0]),
        (line.shuffled(0.1), [0.1, 0.0]),
    ],
)
def test_doubles_and_shuffles(
    what: Callable[[bytes], list[line.Late]], delays: list[float]
) -> None:
    assert [delay for delay, _ in collect(what, 2)] == delays


def test_every_fourth_datagram_has_a_wrong_bit() -> None:
    seen = [data for _, data in collect(line.damaged(4), 8)]
    wrong = [n for n, data in enumerate(seen) if data != bytes([n]) * 8]
    assert wrong == [3, 7]


def test_a_damaged_message_is_no_message() -> None:
    whole = velocity(1.0)
    assert len(messages_of(whole)) == 1
    for bit in range(0, 8 * len(whole), 5):
        broken = bytearray(whole)
        broken[bit // 8] ^= 1 << (bit % 8)
        kinds = [m.get_type() for m in messages_of(bytes(broken))]
        assert 'SET_POSITION_TARGET_LOCAL_NED' not in kinds or bytes(broken)[1:] != whole[1:]
