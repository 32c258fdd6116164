# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink 2 over UDP and TCP: any number of peers, each with its own message intervals."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.commands import Params, run_command, run_message
from peace_ros.simulation.autopilot.disturbance import BadLine, Disturbance
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.lines import Address, Lines
from peace_ros.simulation.autopilot.modes import Mode, Result, Severity
from peace_ros.simulation.autopilot.parameters import AutopilotParameters
from peace_ros.simulation.autopilot.personality import Personality
from peace_ros.simulation.autopilot.signing import Signing
from peace_ros.simulation.autopilot.streams import Streams

COMPONENT_ID = mavlink.MAV_COMP_ID_AUTOPILOT1
HEARTBEAT_S = 1.0
TIMESYNC_S = 10.0
MAX_PEERS = 32
TEXT_BYTES = 50


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
        self._streams = Streams(parameters, self._personality, self._disturbance)
        self._signing = Signing(parameters.signing_key_file)
        self._peers: dict[Address, GroundStation] = {}
        self._values: dict[str, float] = {
            'GUID_TIMEOUT': 3.0,
            'GUID_OPTIONS': 0.0,
            'LAND_SPEED': 50.0,
            'RTL_ALT': 1500.0,
            'FRAME_CLASS': 1.0,
            'SYSID_THISMAV': float(parameters.system_id),
            'FS_THR_ENABLE': 1.0,
            'FS_EKF_ACTION': 1.0,
        }
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
            peer.interval_s.clear()
            peer.due_s.clear()

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
            self._parameter(peer, message)
        else:
            run_message(flight, message)

    def _command(self, flight: Flight, peer: GroundStation, m: Any) -> None:
        if m.get_type() == 'COMMAND_INT':
            p: Params = (m.param1, m.param2, m.param3, m.param4, float(m.x), float(m.y), m.z)
        else:
            p = (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
        wanted: int | None = None
        if self._refuses(flight, m.command, p):
            if self._disturbance.refuse_silently:
                return
            result = self._personality.refused
        elif m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            result = self._set_interval(flight, peer, p)
        elif m.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            known = isfinite(p[0]) and self._streams.knows(int(p[0]))
            wanted = int(p[0]) if known else None
            result = Result.ACCEPTED if known else Result.FAILED
        else:
            result = run_command(flight, m.command, p)
        # MAVLink 2 extension fields say who asked.
        self._tell(
            peer,
            mavlink.MAVLink_command_ack_message(
                m.command, int(result), 0, 0, m.get_srcSystem(), m.get_srcComponent()
            ),
        )
        if wanted is not None:
            self._tell(peer, self._streams.build(wanted, flight))

    def _refuses(self, flight: Flight, command: int, p: Params) -> bool:
        """Whether a fault refuses the mode that a command asks for."""
        refused = self._disturbance.refused_modes
        if not refused or command != mavlink.MAV_CMD_DO_SET_MODE:
            return False
        number = self._personality.mode_of_command(p[1], p[2])
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

    def _set_interval(self, flight: Flight, peer: GroundStation, p: Params) -> Result:
        if not (isfinite(p[0]) and isfinite(p[1])) or not self._streams.knows(int(p[0])):
            return Result.DENIED
        message_id = int(p[0])
        if p[1] <= 0.0:
            peer.interval_s.pop(message_id, None)
            return Result.ACCEPTED
        peer.interval_s[message_id] = max(p[1] * 1e-6, 1.0 / self._parameters.physics_rate_hz)
        peer.due_s[message_id] = flight.time_s
        return Result.ACCEPTED

    def _parameter(self, peer: GroundStation, m: Any) -> None:
        names = sorted(self._values)
        kind = m.get_type()
        if kind == 'PARAM_REQUEST_LIST':
            wanted = names
        elif kind == 'PARAM_REQUEST_READ' and m.param_index >= 0:
            wanted = names[m.param_index : m.param_index + 1]
        elif kind in {'PARAM_REQUEST_READ', 'PARAM_SET'}:
            wanted = [name for name in names if name == m.param_id]
            if kind == 'PARAM_SET' and wanted and isfinite(m.param_value):
                self._values[m.param_id] = m.param_value
        else:
            return
        for name in wanted:
            value = mavlink.MAVLink_param_value_message(
                name.encode(),
                self._values[name],
                mavlink.MAV_PARAM_TYPE_REAL32,
                len(names),
                names.index(name),
            )
            self._tell(peer, value)

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
