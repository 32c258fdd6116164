# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink 2 over UDP and TCP: any number of peers, each with its own message intervals."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.commands import (
    VehicleCommand,
    read_command,
    run_command,
    run_message,
)
from peace_ros.simulation.autopilot.disturbance import BadLine, Disturbance
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.lines import Address, Lines
from peace_ros.simulation.autopilot.missions import Missions
from peace_ros.simulation.autopilot.modes import Mode, Result, Severity
from peace_ros.simulation.autopilot.parameters import AutopilotParameters
from peace_ros.simulation.autopilot.personality import Personality
from peace_ros.simulation.autopilot.signing import Signing
from peace_ros.simulation.autopilot.stream_rates import PX4_UNASKED_HZ, members
from peace_ros.simulation.autopilot.streams import Streams

COMPONENT_ID = mavlink.MAV_COMP_ID_AUTOPILOT1
HEARTBEAT_S = 1.0
TIMESYNC_S = 10.0
MAX_PEERS = 32
REQUESTS: dict[int, int] = {
    mavlink.MAV_CMD_REQUEST_MESSAGE: 0,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: 0,
    mavlink.MAV_CMD_GET_HOME_POSITION: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
}
"""Commands that ask for a message; 0: their first parameter says which."""
TEXT_BYTES = 50
FTP_NAK, FTP_NO_FILE = 129, 10


def no_file(message: Any) -> Any:
    """Refuse a request of MAVLink FTP, so that clients ask by the other protocols at once.

    The real ones have files, such as ``@PARAM/param.pck`` of ArduPilot.
    """
    request = bytes(message.payload)
    sequence = (int.from_bytes(request[:2], 'little') + 1) % 65536
    head = sequence.to_bytes(2, 'little') + bytes([request[2], FTP_NAK, 1, request[3], 0, 0])
    payload = (head + bytes(4) + bytes([FTP_NO_FILE])).ljust(len(request), b'\0')
    who = (0, message.get_srcSystem(), message.get_srcComponent())
    return mavlink.MAVLink_file_transfer_protocol_message(*who, payload)


@dataclass
class GroundStation:
    """Somebody who has spoken to the server."""

    codec: Any
    parser: Any
    address: Address
    inward: BadLine
    outward: BadLine
    interval_s: dict[int, float] = field(default_factory=dict)
    due_s: dict[int, float] = field(default_factory=dict)
    turn: int = 0
    """Number of the message that was heard last, for finding who is silent longest."""


class MavlinkServer:
    """Single-threaded: call :meth:`receive` and :meth:`send_due` from the loop that steps."""

    def __init__(
        self,
        parameters: AutopilotParameters,
        personality: Personality | None = None,
        disturbance: Disturbance | None = None,
    ) -> None:
        self._parameters = parameters
        self._personality = personality or Personality()
        self._disturbance = disturbance or Disturbance()
        self._missions = Missions(self._personality, parameters.datum)
        self._streams = Streams(parameters, self._personality, self._disturbance, self._missions)
        unasked_hz = PX4_UNASKED_HZ if self._personality.is_px4 else {}
        self._unasked_s = {each: 1.0 / hz for each, hz in unasked_hz.items()}
        self._signing = Signing(parameters.signing_key_file)
        self._peers: dict[Address, GroundStation] = {}
        self._turn = 0
        self._text_id = 0
        self._seen = (0, 0)
        self._heartbeat_due_s = 0.0
        self._timesync_due_s = TIMESYNC_S
        self._lines = Lines(
            parameters.host, parameters.port, parameters.tcp_port, parameters.serial_port
        )

    @property
    def port(self) -> int:
        """UDP port that it listens on."""
        return self._lines.port

    @property
    def waits_for_client(self) -> bool:
        """The autopilot boots when the first client has come."""
        return self._lines.waits_for_client

    @property
    def refused_signatures(self) -> int:
        """Messages that were not signed with the key, when there is one."""
        return self._signing.refused

    def call(self, address: Address) -> None:
        """Send to a UDP address from now on, before anybody there has spoken."""
        self._peer(address)

    def close(self) -> None:
        """Release the ports."""
        self._lines.close()

    def restart(self) -> None:
        """Forget intervals and schedules, as a reboot does; addresses stay known."""
        self._seen = (0, 0)
        self._heartbeat_due_s, self._timesync_due_s = 0.0, TIMESYNC_S
        for peer in self._peers.values():
            peer.interval_s = dict(self._unasked_s)
            peer.due_s = dict.fromkeys(self._unasked_s, 0.0)
        self._missions.forget_uploads()

    def wait(self, seconds: float) -> None:
        """Sleep until a datagram arrives, at most so long."""
        self._lines.wait(seconds)

    def receive(self, flight: Flight) -> None:
        """Take what has arrived; what is not MAVLink is dropped."""
        for address, data, whole in self._lines.hear():
            if self._disturbance.silent:
                continue
            known = self._peers.get(address)
            for arrived in [data] if known is None else known.inward.carry(data):
                for message in self._decode(address, arrived, whole=whole):
                    self._handle(flight, self._peer(address), message)

    def send_due(self, flight: Flight) -> None:
        """Send what the clock and the flight's news ask for."""
        self._signing.keep_time()
        news = (flight.mode_changes, flight.home_changes)
        # ArduPilot tells a new mode at once, PX4 with the next regular HEARTBEAT.
        mode_is_news = news[0] != self._seen[0] and not self._personality.is_px4
        if flight.time_s >= self._heartbeat_due_s or mode_is_news:
            self._heartbeat_due_s = flight.time_s + HEARTBEAT_S
            self._tell_all(self._streams.build(mavlink.MAVLINK_MSG_ID_HEARTBEAT, flight))
        if news[1] != self._seen[1]:
            self._tell_all(self._streams.home_position(flight))
        self._seen = news
        if flight.time_s >= self._timesync_due_s:
            self._timesync_due_s = flight.time_s + TIMESYNC_S
            self._tell_all(mavlink.MAVLink_timesync_message(0, self._clock_ns(flight)))
        while self._peers and flight.texts:
            severity, text = flight.texts.popleft()
            self._tell_text(severity, text.encode('ascii', 'replace'))
        for address, message in self._missions.due(flight.time_s):
            if address in self._peers:
                self._tell(self._peers[address], message)
        for peer in list(self._peers.values()):
            self._send_streams(flight, peer)

    def _send_streams(self, flight: Flight, peer: GroundStation) -> None:
        for message_id, interval in peer.interval_s.items():
            due = peer.due_s[message_id]
            if flight.time_s < due:
                continue
            late = flight.time_s - due > interval
            peer.due_s[message_id] = (flight.time_s if late else due) + interval
            self._tell(peer, self._streams.build(message_id, flight))

    def _decode(self, address: Address, data: bytes, *, whole: bool) -> list[Any]:
        # A parser for each datagram: a broken one must not swallow the beginning of the next.
        parser = self._signing.codec() if whole else self._peer(address).parser
        try:
            messages = self._signing.parse(parser, data)
        except mavlink.MAVError:
            return []
        return [m for m in messages if m.get_msgId() >= 0]

    def _peer(self, address: Address) -> GroundStation:
        peer = self._peers.get(address)
        if peer is None:
            if len(self._peers) >= MAX_PEERS:
                silent = min(self._peers.values(), key=lambda each: each.turn)
                self._forget(silent.address)
            codec = self._signing.codec(self._parameters.system_id, COMPONENT_ID)
            peer = self._peers[address] = GroundStation(
                codec,
                self._signing.codec(),
                address,
                BadLine(self._disturbance, 2 * self._turn),
                BadLine(self._disturbance, 2 * self._turn + 1),
                dict(self._unasked_s),
                dict.fromkeys(self._unasked_s, 0.0),
            )
        self._turn += 1
        peer.turn = self._turn
        return peer

    def _handle(self, flight: Flight, peer: GroundStation, message: Any) -> None:
        target = getattr(message, 'target_system', 0)
        if target == 0:
            self._forward(peer, message)
        if target not in {0, self._parameters.system_id}:
            return
        kind = message.get_type()
        if kind in {'COMMAND_LONG', 'COMMAND_INT'}:
            self._command(flight, peer, message)
        elif kind == 'TIMESYNC':
            if message.tc1 == 0:
                now = max(1, self._clock_ns(flight))  # zero would be a question, not an answer
                self._tell(peer, mavlink.MAVLink_timesync_message(now, message.ts1))
        elif kind.startswith('PARAM_'):
            values, is_news = flight.parameters.take(message)
            for value in values:
                self._tell_all(value) if is_news else self._tell(peer, value)
        elif kind.startswith('MISSION_'):
            for answer in self._missions.take(peer.address, message, flight.time_s):
                self._tell(peer, answer)
        elif kind == 'REQUEST_DATA_STREAM':
            self._request_stream(flight, peer, message)
        elif kind == 'FILE_TRANSFER_PROTOCOL':
            self._tell(peer, no_file(message))
        else:
            run_message(flight, message)

    def _command(self, flight: Flight, peer: GroundStation, m: Any) -> None:
        command = read_command(m)
        wanted: Any = None
        if self._refuses(flight, command):
            if self._disturbance.refuse_silently:
                return
            result = self._personality.refused
        elif m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            result = self._set_interval(flight, peer, command)
        elif m.command in REQUESTS:
            wanted, result = self._requested(flight, peer, command)
        elif m.command == mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
            chosen = isfinite(m.param1) and self._missions.choose(int(m.param1))
            result = Result.ACCEPTED if chosen else Result.FAILED
        else:
            result = run_command(flight, command)
        # MAVLink 2 extension fields say who asked.
        self._tell(
            peer,
            mavlink.MAVLink_command_ack_message(
                m.command, int(result), 0, 0, m.get_srcSystem(), m.get_srcComponent()
            ),
        )
        self._tell(peer, wanted)

    def _requested(
        self, flight: Flight, peer: GroundStation, command: VehicleCommand
    ) -> tuple[Any, Result]:
        """Return the message that a command asks for, and the answer to it."""
        message_id = REQUESTS[command.number] or command.params[0]
        if not isfinite(message_id) or not self._streams.knows(int(message_id)):
            return None, Result.FAILED
        if command.number == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            interval_s = peer.interval_s.get(int(message_id))
            interval_us = -1 if interval_s is None else round(interval_s * 1e6)
            told = mavlink.MAVLink_message_interval_message(int(message_id), interval_us)
            return told, Result.ACCEPTED
        return self._streams.build(int(message_id), flight), Result.ACCEPTED

    def _request_stream(self, flight: Flight, peer: GroundStation, m: Any) -> None:
        """Take REQUEST_DATA_STREAM; PX4 knows none."""
        if self._personality.is_px4:
            return
        interval_s = 1.0 / m.req_message_rate if m.start_stop and m.req_message_rate else -1.0
        for message_id in members(m.req_stream_id):
            self._set_rate(flight, peer, message_id, interval_s)

    def _refuses(self, flight: Flight, command: VehicleCommand) -> bool:
        """Whether a fault refuses the mode that a command asks for."""
        refused = self._disturbance.refused_modes
        if not refused or command.number != mavlink.MAV_CMD_DO_SET_MODE:
            return False
        number = self._personality.mode_of_command(command.value(1), command.value(2))
        names = [self._personality.mode_name(mode) for mode in Mode if mode == number]
        if not refused.intersection(names):
            return False
        flight.say(Severity.WARNING, f'Mode change to {names[0]} failed: not now')
        return True

    def _clock_ns(self, flight: Flight) -> int:
        return round((flight.time_s + self._disturbance.clock_step_s) * 1e9)

    def _forget(self, address: Address) -> None:
        del self._peers[address]
        self._lines.hang_up(address)

    def _set_interval(self, flight: Flight, peer: GroundStation, command: VehicleCommand) -> Result:
        """Take SET_MESSAGE_INTERVAL: an interval of 0 asks for the default, -1 for none."""
        message_id, interval_us = command.params[:2]
        if not (isfinite(message_id) and isfinite(interval_us)):
            return Result.DENIED
        if not self._streams.knows(int(message_id)):
            return Result.DENIED
        by_default_s = self._unasked_s.get(int(message_id), -1.0)
        interval_s = interval_us * 1e-6 if interval_us else by_default_s
        self._set_rate(flight, peer, int(message_id), interval_s)
        return Result.ACCEPTED

    def _set_rate(
        self, flight: Flight, peer: GroundStation, message_id: int, interval_s: float
    ) -> None:
        if interval_s <= 0.0:
            peer.interval_s.pop(message_id, None)
        elif self._streams.knows(message_id):
            shortest_s = 1.0 / self._parameters.physics_rate_hz
            peer.interval_s[message_id] = max(interval_s, shortest_s)
            peer.due_s[message_id] = flight.time_s

    def _tell_text(self, severity: int, raw: bytes) -> None:
        """Tell a STATUSTEXT, in numbered chunks when it is long."""
        self._text_id = self._text_id % 65535 + 1
        for number, begin in enumerate(range(0, max(1, len(raw)), TEXT_BYTES)):
            chunk = raw[begin : begin + TEXT_BYTES]
            text_id = self._text_id if len(raw) > TEXT_BYTES else 0
            self._tell_all(mavlink.MAVLink_statustext_message(severity, chunk, text_id, number))

    def _tell_all(self, message: Any) -> None:
        for peer in list(self._peers.values()):
            self._tell(peer, message)

    def _tell(self, peer: GroundStation, message: Any) -> None:
        if message is None or self._disturbance.silent:
            return
        if self._disturbance.mutes(message.get_type()):
            return
        data = message.pack(peer.codec)
        peer.codec.seq = (peer.codec.seq + 1) % 256
        self._tell_bytes(peer, data)

    def _forward(self, sender: GroundStation, message: Any) -> None:
        """Hand what is meant for anybody to the other peers, as a real autopilot does."""
        if self._disturbance.silent:
            return
        for peer in list(self._peers.values()):
            if peer is not sender:
                self._tell_bytes(peer, bytes(message.get_msgbuf()))

    def _tell_bytes(self, peer: GroundStation, data: bytes) -> None:
        for leaving in peer.outward.carry(data):
            # A full buffer loses a datagram; a TCP line that stalls is closed.
            self._lines.tell(peer.address, leaving)
