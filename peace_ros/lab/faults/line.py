# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MAVLink line between companion and autopilot: a relay that can fail, and that measures.

What is on the wire is timed by the kernel, so that a busy machine does not blur it.
"""

from __future__ import annotations

import heapq
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.lab.faults.record import Sent
from peace_ros.lab.faults.tamper import Late, Tamper, always, untouched

_POLL_S = 0.05
_TIMESTAMPNS = 35
"""SO_TIMESTAMPNS of Linux, which Python's socket module does not name."""
_TIMESPEC = struct.Struct('@qq')
_LARGEST = 65535
_HOST = '127.0.0.1'


def doubled(data: bytes) -> Iterable[Late]:
    """Deliver every datagram twice."""
    return ((0.0, data), (0.0, data))


def shuffled(step_s: float) -> Tamper:
    """Hold every second datagram back, so that it comes after those that follow it."""
    count = [0]

    def tamper(data: bytes) -> Iterable[Late]:
        count[0] += 1
        return ((step_s if count[0] % 2 else 0.0, data),)

    return tamper


def damaged(every: int) -> Tamper:
    """Turn one bit over in every so many datagrams, anywhere in it."""
    count = [0]

    def tamper(data: bytes) -> Iterable[Late]:
        count[0] += 1
        if count[0] % every:
            return ((0.0, data),)
        broken = bytearray(data)
        broken[(count[0] * 7) % len(broken)] ^= 1 << (count[0] % 8)
        return ((0.0, bytes(broken)),)

    return tamper


TAMPERS: dict[str, Callable[..., Tamper]] = {
    'doubled': always(doubled),
    'shuffled': shuffled,
    'damaged': damaged,
}
"""Name -> factory of what happens to datagrams, beside what happens to any message."""


class RelayedLine:
    """Relays datagrams between one companion and one autopilot, in a thread of its own."""

    def __init__(self, autopilot_port: int) -> None:
        self._autopilot = (_HOST, autopilot_port)
        self._near = _socket()
        self._near.bind((_HOST, 0))
        self._far = _socket()
        self._far.bind((_HOST, 0))
        self._companion: tuple[str, int] | None = None
        self.up: Tamper = untouched
        """Companion to autopilot."""
        self.down: Tamper = untouched
        """Autopilot to companion."""
        self._sent: list[Sent] = []
        self._lock = threading.Lock()
        self._queue: list[tuple[float, int, bool, bytes]] = []
        self._count = 0
        self._stop = threading.Event()
        # The kernel stamps in wall time, which may be stepped; the offset is taken once.
        self._wall_offset_s = time.time() - time.monotonic()
        self._thread = threading.Thread(target=self._run, name='line', daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """UDP port that the companion calls."""
        return int(self._near.getsockname()[1])

    def mend(self) -> None:
        """Let everything through again."""
        self.up = self.down = untouched

    def sent_since(self, begin_s: float) -> list[Sent]:
        """Return the velocity set-points since a moment of the steady clock, timed by it."""
        with self._lock:
            return [each for each in self._sent if each.at_s >= begin_s]

    def forget(self) -> None:
        """Forget the set-points so far; the next companion may call from another address."""
        with self._lock:
            self._sent.clear()
        self._companion = None

    def close(self) -> None:
        """Stop the thread and release the ports."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        self._near.close()
        self._far.close()

    def tell_companion(self, data: bytes, *, from_elsewhere: bool) -> None:
        """Forge a datagram of the autopilot; from its own address, or from another one."""
        if self._companion is None:
            return
        with suppress(OSError):
            (self._far if from_elsewhere else self._near).sendto(data, self._companion)

    def _run(self) -> None:
        while not self._stop.is_set():
            due_s = self._queue[0][0] - time.monotonic() if self._queue else _POLL_S
            wait_s = min(_POLL_S, max(0.0, due_s))
            for ready in select.select([self._near, self._far], [], [], wait_s)[0]:
                self._take(ready)
            while self._queue and self._queue[0][0] <= time.monotonic():
                _, _, is_up, data = heapq.heappop(self._queue)
                self._deliver(data, is_up=is_up)

    def _take(self, ready: socket.socket) -> None:
        try:
            data, ancillary, _, address = ready.recvmsg(_LARGEST, 64)
        except OSError:
            return
        is_up = ready is self._near
        if is_up:
            self._companion = address
            self._note(data, self._stamp_s(ancillary))
        elif address != self._autopilot:
            return
        for delay_s, each in (self.up if is_up else self.down)(data):
            if delay_s <= 0.0:
                self._deliver(each, is_up=is_up)
            else:
                self._count += 1
                item = (time.monotonic() + delay_s, self._count, is_up, each)
                heapq.heappush(self._queue, item)

    def _deliver(self, data: bytes, *, is_up: bool) -> None:
        to = self._autopilot if is_up else self._companion
        if to is None:
            return
        with suppress(OSError):
            (self._far if is_up else self._near).sendto(data, to)

    def _stamp_s(self, ancillary: list[tuple[int, int, bytes]]) -> float:
        for level, kind, value in ancillary:
            if level == socket.SOL_SOCKET and kind == _TIMESTAMPNS:
                seconds, nanoseconds = _TIMESPEC.unpack(value[: _TIMESPEC.size])
                return float(seconds - self._wall_offset_s + nanoseconds * 1e-9)
        return time.monotonic()

    def _note(self, data: bytes, at_s: float) -> None:
        found = [
            Sent(at_s, m.vx, m.vy, m.vz)
            for m in messages_of(data)
            if m.get_type() == 'SET_POSITION_TARGET_LOCAL_NED'
        ]
        if found:
            with self._lock:
                self._sent.extend(found)


class Stranger:
    """A second companion that talks to the same autopilot, and forges messages of both."""

    def __init__(self, autopilot_port: int, system_id: int = 1) -> None:
        self._to = (_HOST, autopilot_port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._codec = mavlink.MAVLink(None, system_id, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER2)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def send(self, message: Any) -> None:
        """Send one message to the autopilot."""
        data = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        with suppress(OSError):
            self._socket.sendto(data, self._to)

    def stream(self, make: Callable[[], Any], rate_hz: float) -> None:
        """Go on sending until closed."""

        def run() -> None:
            while not self._stop.wait(1.0 / rate_hz):
                self.send(make())

        self._thread = threading.Thread(target=run, name='stranger', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Fall silent."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
        self._socket.close()


def messages_of(data: bytes) -> list[Any]:
    """Return the MAVLink messages of a datagram, none when it is damaged."""
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    try:
        found = parser.parse_buffer(bytearray(data)) or []
    except mavlink.MAVError:
        return []
    return [m for m in found if m.get_msgId() >= 0]


def _socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with suppress(OSError):
        made.setsockopt(socket.SOL_SOCKET, _TIMESTAMPNS, 1)
    return made
