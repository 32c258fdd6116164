# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MAVLink connection: who answers, how often, and by which clock.

It asks for the same message streams as the landing node, and for the version. It cannot send a
set-point, change a mode or a parameter, or arm: no such message is made here.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import PeaceError, VehicleError
from peace_ros.core.vehicle import Dialect, VehicleParameters
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.dialects import AUTO, choose_dialect
from peace_ros.core.vehicle.housekeeping import Housekeeping
from peace_ros.core.vehicle.peer import Peer
from peace_ros.core.vehicle.signing import Signer
from peace_ros.core.vehicle.streams import MAYBE, StreamKeeper
from peace_ros.core.vehicle.transport import Transport, open_transport
from peace_ros.core.vehicle.wire import Wire
from peace_ros.lab.doctor.finding import Findings, fine, mend, of_error

SILENCE_S = 5.0
"""Wait for the first HEARTBEAT, which comes once a second."""
SETTLE_S = 1.2
"""From the requests to the first count: streams begin within a second."""
COUNT_S = 2.0
CONNECT_S = 3.0
NEEDED_SHARE = 0.4
"""Of the rate that is asked for. GNSS receivers of 5 Hz give half of the 10 Hz, and autopilots
round to parts of their loop."""
SLOW_TRIP_MS = 100.0
"""A third of a metre at 3 m/s: the half of it is the error that the time of a pose may have."""
COMPANION = int(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
_READ_S = 0.05
_VERSION_AGAIN_S = 0.7
_BOARD_TYPES = {0: 'development', 64: 'alpha', 128: 'beta', 192: 'release candidate', 255: ''}
"""FIRMWARE_VERSION_TYPE of common.xml; the official one needs no word."""


@dataclass
class Heard:
    """What came from one autopilot."""

    dialect: Dialect
    system_id: int
    needed_hz: Mapping[int, float]
    """Message id -> lowest useful rate."""
    counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    """Message id -> messages in the time of counting."""
    counted_s: float = 0.0
    mode: str = ''
    armed: bool = False
    version: tuple[int, int, int, int] | None = None
    """Major, minor, patch, FIRMWARE_VERSION_TYPE; None: not told."""
    position_problem: str = ''
    has_twin: bool = False
    """Somebody else speaks as our companion."""
    offset_ns: int | None = None
    round_trip_ms: float | None = None

    def rate_hz(self, message_id: int) -> float:
        """Return how often a message came."""
        return self.counts.get(message_id, 0) / max(self.counted_s, 1e-3)


class AutopilotListener:
    """Listens to one autopilot for a few seconds."""

    def __init__(self, url: str, parameters: VehicleParameters, dialect: str = AUTO) -> None:
        """Open the connection.

        Args:
            url: As the landing node takes it.
            parameters: Of the vehicle: rates, signing.
            dialect: ``auto`` or a registered name.

        Raises:
            ConfigurationError: The signing key cannot be read.
            VehicleError: The connection cannot be opened.
        """
        self._parameters, self._wanted = parameters, dialect
        key_file = parameters.signing_key_file
        signer = Signer.from_file(key_file, parameters.system_id) if key_file else None
        self._transport: Transport = open_transport(url, CONNECT_S)
        self._wire = Wire(parameters.system_id, signer, datagrams=self._transport.datagrams)
        self._clock = TimeMap()
        self._house = Housekeeping(self._clock, time.time_ns)
        self._peer = Peer(parameters.vehicle_id, time.monotonic_ns())
        self._assembler: Assembler | None = None
        self._heard: Heard | None = None
        self._bytes = 0
        self._has_twin = False
        self._counts_from_s = float('inf')

    def listen(self) -> Heard:
        """Return what was heard.

        Raises:
            VehicleError: Nothing that can be used came, or the connection broke.
        """
        deadline_s = time.monotonic() + SILENCE_S
        version_due_s = 0.0
        while (now_s := time.monotonic()) < deadline_s:
            for data, source in self._transport.read(_READ_S):
                self._bytes += len(data)
                for message in self._wire.decode(data):
                    self._take(message, source)
            if self._heard is not None and self._counts_from_s == float('inf'):
                self._counts_from_s = time.monotonic() + SETTLE_S
                deadline_s = self._counts_from_s + COUNT_S
            self._send_due(now_s)
            if self._heard is not None and self._heard.version is None and now_s >= version_due_s:
                version_due_s = now_s + _VERSION_AGAIN_S
                self._ask_version()
        if self._heard is None or self._assembler is None:
            raise self._silence()
        return self._summary(self._heard, self._assembler)

    def close(self) -> None:
        """Release the connection."""
        self._transport.close()
        self._wire.keep(time.monotonic(), at_once=True)

    def _take(self, message: Any, source: Any) -> None:
        now_ns = time.monotonic_ns()
        who = (message.get_srcSystem(), message.get_srcComponent())
        self._has_twin |= who == (self._parameters.system_id, COMPANION)
        if self._assembler is None:
            if not self._peer.is_candidate(message, source, now_ns):
                return
            self._meet(message, source, now_ns)
        if self._assembler is None or self._heard is None:
            return
        if not self._peer.is_ours(message, source, now_ns):
            return
        kind = message.get_type()
        if kind == 'TIMESYNC':
            self._house.take_time(message)
        elif kind == 'AUTOPILOT_VERSION':
            self._heard.version = _version(message.flight_sw_version)
        self._assembler.take(message, time.time_ns(), now_ns)
        if now_ns >= self._counts_from_s * 1e9:
            self._heard.counts[message.get_msgId()] += 1

    def _meet(self, message: Any, source: Any, now_ns: int) -> None:
        dialect = choose_dialect(
            self._wanted, message.autopilot, self._parameters.hold_mode, message.type
        )
        self._peer.choose(message, source, now_ns)
        streams = StreamKeeper(self._parameters, dialect)
        self._house.streams = streams
        self._assembler = Assembler(dialect, self._parameters, self._clock)
        needed = {
            each: NEEDED_SHARE * rate_hz
            for each, rate_hz in streams.rates_hz.items()
            if each not in MAYBE
        }
        self._heard = Heard(dialect, message.get_srcSystem(), needed)

    def _send_due(self, now_s: float) -> None:
        now_ns = round(now_s * 1e9)
        messages = [self._house.heartbeat(now_ns)]
        if self._assembler is not None:
            messages += self._house.requests(now_ns, self._assembler, self._peer.target)
        for message in messages:
            if message is not None:
                self._transport.write(self._wire.pack(message), self._peer.source)

    def _ask_version(self) -> None:
        wanted = (float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION), *(0.0,) * 6)
        command = mavlink.MAV_CMD_REQUEST_MESSAGE
        request = mavlink.MAVLink_command_long_message(*self._peer.target, command, 0, *wanted)
        self._transport.write(self._wire.pack(request), self._peer.source)

    def _summary(self, heard: Heard, assembler: Assembler) -> Heard:
        heard.counted_s = COUNT_S
        heard.has_twin = self._has_twin
        heard.mode, heard.armed = assembler.mode, assembler.armed
        heard.position_problem = assembler.position_problem(time.monotonic_ns())
        if not heard.position_problem and not assembler.poses:
            heard.position_problem = 'the autopilot reports no position'
        trip_ns = self._clock.round_trip_ns
        heard.offset_ns = self._clock.offset_ns
        heard.round_trip_ms = None if trip_ns is None else trip_ns / 1e6
        return heard

    def _silence(self) -> VehicleError:
        refused = sum(self._wire.refused)
        if refused:
            found = f'{refused} messages were not rightly signed'
            remedy = 'set the same signing key on both sides'
        elif others := self._peer.heard_instead():
            found, remedy = others.removeprefix('; '), 'set vehicle.vehicle_id'
        elif self._bytes:
            found = f'{self._bytes} bytes came, but no HEARTBEAT of an autopilot'
            remedy = 'check the baud rate, and that this port sends MAVLink 2'
        else:
            found = 'nothing came'
            remedy = (
                'check power and cable, address and port, and that the autopilot or its router '
                'sends MAVLink 2 to this computer'
            )
        return VehicleError(f'no autopilot was heard within {SILENCE_S:g} s, {found}: {remedy}')


def check_autopilot(url: str, parameters: VehicleParameters, dialect: str = AUTO) -> Findings:
    """Yield what is found on the connection.

    Args:
        url: As the landing node takes it.
        parameters: Of the vehicle.
        dialect: ``auto`` or a registered name.
    """
    try:
        listener = AutopilotListener(url, parameters, dialect)
    except PeaceError as error:
        yield of_error(error)
        return
    try:
        heard = listener.listen()
    except PeaceError as error:
        yield of_error(error)
        return
    finally:
        listener.close()
    yield from _who(heard, url)
    yield from _streams(heard)
    yield from _time(heard)
    if heard.has_twin:
        yield mend(
            f'another companion speaks as system {parameters.system_id}, component {COMPANION}: '
            'two of them would both send set-points',
            'end it, or give one of them another vehicle.system_id',
        )
    if heard.position_problem:
        yield mend(
            f'engaging would be refused: {heard.position_problem}',
            'wait for GNSS under an open sky, or feed external navigation',
        )
    else:
        yield fine('the autopilot has a position')


def _who(heard: Heard, url: str) -> Findings:
    name = 'ArduPilot' if heard.dialect.name == 'ardupilot' else heard.dialect.name.upper()
    armed = 'armed' if heard.armed else 'not armed'
    found = f'{name} at {url}, system {heard.system_id}, mode {heard.mode}, {armed}'
    yield fine(found, autopilot=heard.dialect.name, mode=heard.mode, armed=heard.armed)
    if heard.version is None:
        yield mend(
            'the autopilot does not report its firmware version (AUTOPILOT_VERSION)',
            'check that the router forwards commands of this computer to it',
        )
        return
    *numbers, kind = heard.version
    version = '.'.join(map(str, numbers))
    stage = _BOARD_TYPES.get(kind, '')
    yield fine(f'firmware {version}{f" ({stage})" if stage else ""}', firmware=version)


def _streams(heard: Heard) -> Findings:
    names = {each: _message_name(each) for each in heard.needed_hz}
    rates = {names[each]: round(heard.rate_hz(each), 1) for each in heard.needed_hz}
    slow = [
        f'{names[each]} {heard.rate_hz(each):.1f} of {needed_hz:g} Hz'
        for each, needed_hz in heard.needed_hz.items()
        if heard.rate_hz(each) < needed_hz
        # Without a position there is none to send, which is a finding of its own.
        and not (heard.position_problem and each == mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    ]
    if not slow:
        pose = (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ATTITUDE)
        shown = ', '.join(f'{names[each]} {heard.rate_hz(each):.0f} Hz' for each in pose)
        yield fine(f'{len(rates)} message streams are fast enough ({shown})', rates_hz=rates)
        return
    yield mend(
        f'message streams are missing or too slow: {", ".join(slow)}',
        'raise the baud rate of the port, or find out who else asks for other rates on it',
        rates_hz=rates,
    )


def _time(heard: Heard) -> Findings:
    trip_ms = heard.round_trip_ms
    if heard.offset_ns is None or trip_ms is None:
        yield mend(
            'the clock offset is not known: TIMESYNC is not answered, or the clocks drift apart',
            'let the router forward TIMESYNC; until then a pose has the time of its receipt',
        )
        return
    found = f'clock offset {heard.offset_ns / 1e9:.3f} s, round trip {trip_ms:.1f} ms'
    figures = {'clock_offset_s': heard.offset_ns / 1e9, 'round_trip_ms': round(trip_ms, 2)}
    if trip_ms <= SLOW_TRIP_MS:
        yield fine(found, **figures)
    else:
        yield mend(
            found,
            f'more than {SLOW_TRIP_MS:g} ms: use a faster port, and no radio in between',
            **figures,
        )


def _message_name(message_id: int) -> str:
    return str(mavlink.mavlink_map[message_id].msgname)


def _version(packed: int) -> tuple[int, int, int, int]:
    """Return major, minor, patch and FIRMWARE_VERSION_TYPE of AUTOPILOT_VERSION."""
    return (packed >> 24 & 0xFF, packed >> 16 & 0xFF, packed >> 8 & 0xFF, packed & 0xFF)
