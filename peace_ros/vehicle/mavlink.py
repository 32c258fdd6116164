# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link: one thread reads and keeps house, requests wait for their answer with a limit."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.domain.errors import VehicleError
from peace_ros.domain.motion import Pose, Setpoint, Telemetry
from peace_ros.vehicle.assembler import Assembler
from peace_ros.vehicle.dialects import Dialect, choose_dialect
from peace_ros.vehicle.parameters import VehicleParameters
from peace_ros.vehicle.result import Answer, RequestResult
from peace_ros.vehicle.streams import StreamKeeper
from peace_ros.vehicle.transport import Source, Transport

READ_S = 0.02
HEARTBEAT_NS = 1_000_000_000
RESEND_S = 0.7
REASON_S = 0.4
"""How long the STATUSTEXT with the reason may lag behind its COMMAND_ACK."""
NEW_ADDRESS_NS = 5_000_000_000
"""Silence of the autopilot after which the same system is believed from another address."""
ZERO_STREAM_NS = 50_000_000
PRE_STREAM_S = 0.6
ZERO = Setpoint(stamp_ns=0)


class MavlinkLink:
    """Talks to the autopilot that spoke first, and to no other.

    Args:
        transport: An open line; the link closes it.
        dialect: ``auto``, ``ardupilot`` or ``px4``.
        parameters: Rates and limits.
        clock_ns: Node clock; poses are stamped with it at receipt.

    Raises:
        VehicleError: No autopilot was heard in time, or one that the dialect does not fit.
    """

    def __init__(
        self,
        transport: Transport,
        dialect: str,
        parameters: VehicleParameters,
        clock_ns: Callable[[], int],
    ) -> None:
        self._transport = transport
        self._wanted_dialect = dialect
        self._parameters = parameters
        self._clock_ns = clock_ns
        self._codec = mavlink.MAVLink(
            None, parameters.system_id, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
        )
        self._stream_parser = self._new_parser()
        self._changed = threading.Condition()
        self._write_lock = threading.Lock()
        self._request_lock = threading.Lock()
        self._stop = threading.Event()
        self._opened_ns = time.monotonic_ns()
        self._dialect: Dialect | None = None
        self._assembler: Assembler | None = None
        self._error: VehicleError | None = None
        self._target = (0, 0)
        self._source: Source = None
        self._heard_ns = 0
        self._acks: dict[int, int] = {}
        self._leaving_to = ''
        self._leaving_until_ns = 0
        self._taken_over = False
        self._zero_until_ns = 0
        self._zero_sent_ns = 0
        self._heartbeat_sent_ns = 0
        self._streams = StreamKeeper(parameters)
        self._bytes_heard = 0
        self.ignored = 0
        """Messages of others than the believed autopilot."""
        self._thread = threading.Thread(target=self._run, name='mavlink_link', daemon=True)
        self._thread.start()
        self._await_autopilot()

    @property
    def dialect(self) -> Dialect:
        """How this autopilot speaks."""
        if self._dialect is None:
            raise VehicleError('no autopilot has been heard yet: wait for its HEARTBEAT')
        return self._dialect

    @property
    def taken_over(self) -> bool:
        """A person or a failsafe has left the mode that obeys us, since we were last in it."""
        return self._taken_over

    @property
    def rejected(self) -> int:
        """Messages of the autopilot that were not believed: numbers that are none."""
        with self._changed:
            return self._heard().rejected

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE: 0 unknown, 1 ground, 2 air, 3 take-off, 4 landing."""
        with self._changed:
            return self._heard().landed_state

    def telemetry(self) -> Telemetry:
        """Return what the autopilot last said."""
        with self._changed:
            return self._heard().telemetry(time.monotonic_ns())

    def take_poses(self) -> list[Pose]:
        """Return the poses since the last call, oldest first (at most 256)."""
        with self._changed:
            poses = list(self._heard().poses)
            self._heard().poses.clear()
            return poses

    def status_texts(self) -> list[str]:
        """Return the newest STATUSTEXTs, oldest first (at most 50)."""
        with self._changed:
            return [text for _, text in self._heard().texts]

    def send_velocity(self, setpoint: Setpoint) -> None:
        """Send one set-point; it is not clamped, that is the guard's work.

        Raises:
            VehicleError: A component is not finite, or the line broke.
        """
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        if not all(isfinite(each) for each in v):
            raise VehicleError(
                f'velocity set-point {v} m/s: all components must be finite; nothing was sent'
            )
        self._zero_until_ns = 0
        self._send_setpoint(setpoint)

    def request_control(self, *, by_person: bool = False) -> RequestResult:
        """Ask for the mode that obeys set-points; blocks at most ``request_limit_s`` and a bit.

        Once a person or a failsafe has taken over, this refuses by itself: pass ``by_person``
        only when a person asks for it anew.
        """
        if self._taken_over and not by_person:
            return RequestResult(
                Answer.REFUSED,
                f'{self.telemetry().mode} was chosen after we had control: a person must engage',
            )
        self._taken_over = False
        if self.dialect.streams_before_control:
            limit_ns = int((self._parameters.request_limit_s + PRE_STREAM_S + 1.0) * 1e9)
            self._zero_until_ns = time.monotonic_ns() + limit_ns
            self._stop.wait(PRE_STREAM_S)
        result = self.set_mode(self.dialect.control_mode)
        if not result:
            self._zero_until_ns = 0
        return result

    def request_hold(self) -> RequestResult:
        """Ask for the autopilot's own hold mode; blocks at most ``request_limit_s`` and a bit."""
        return self.set_mode(self.dialect.hold_mode)

    def set_mode(self, mode: str) -> RequestResult:
        """Ask for a mode by the autopilot's own name and wait until HEARTBEAT shows it."""
        flags, main, sub = self.dialect.mode_command(mode)
        limit_ns = int(self._parameters.request_limit_s * 1e9)
        deadline_ns = time.monotonic_ns() + limit_ns
        if mode != self.dialect.control_mode:
            self._leaving_to = mode
            self._leaving_until_ns = deadline_ns + 1_000_000_000
        result = self.command(mavlink.MAV_CMD_DO_SET_MODE, flags, main, sub)
        if not result:
            self._leaving_until_ns = 0
            return result
        with self._changed:
            while self._heard().mode != mode:
                left_s = (deadline_ns - time.monotonic_ns()) / 1e9
                if left_s <= 0.0 or not self._changed.wait(left_s):
                    return RequestResult(
                        Answer.NO_ANSWER, f'{mode} was accepted, but HEARTBEAT does not show it', 0
                    )
        self._leaving_until_ns = 0
        return result

    def command(self, command: int, *params: float) -> RequestResult:
        """Send a COMMAND_LONG, again each 0.7 s, until it is acknowledged or the limit is over.

        Args:
            command: MAV_CMD.
            params: Up to seven parameters; missing ones are 0.
        """
        values = (*params, *(0.0,) * (7 - len(params)))
        started_ns = time.monotonic_ns()
        deadline = time.monotonic() + self._parameters.request_limit_s
        with self._request_lock:
            with self._changed:
                self._acks.pop(command, None)
            code: int | None = None
            attempt = 0
            while code is None and (left_s := deadline - time.monotonic()) > 0.0:
                self._send(
                    mavlink.MAVLink_command_long_message(
                        *self._target, command, min(attempt, 255), *values
                    )
                )
                attempt += 1
                code = self._await_ack(command, min(RESEND_S, left_s))
        if code == mavlink.MAV_RESULT_ACCEPTED:
            return RequestResult(Answer.ACCEPTED, code=code)
        if code is None:
            limit = self._parameters.request_limit_s
            return RequestResult(Answer.NO_ANSWER, f'no COMMAND_ACK within {limit} s')
        return RequestResult(Answer.REFUSED, self._reason(started_ns, code), code)

    def close(self) -> None:
        """Stop the thread and release the line; may be called twice."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        self._transport.close()

    def _await_ack(self, command: int, timeout_s: float) -> int | None:
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while command not in self._acks:
                left_s = deadline - time.monotonic()
                if left_s <= 0.0 or self._stop.is_set():
                    return None
                self._changed.wait(left_s)
            return self._acks.pop(command)

    def _reason(self, since_ns: int, code: int) -> str:
        deadline = time.monotonic() + REASON_S
        with self._changed:
            while True:
                told = [text for at_ns, text in self._heard().texts if at_ns >= since_ns]
                left_s = deadline - time.monotonic()
                if told or left_s <= 0.0:
                    break
                self._changed.wait(left_s)
        return told[-1] if told else f'MAV_RESULT {code} without a reason'

    def _heard(self) -> Assembler:
        if self._assembler is None:
            raise VehicleError('no autopilot has been heard yet: wait for its HEARTBEAT')
        return self._assembler

    def _await_autopilot(self) -> None:
        limit_s = self._parameters.connect_timeout_s
        with self._changed:
            self._changed.wait_for(
                lambda: self._assembler is not None or self._error is not None, limit_s
            )
            if self._assembler is not None:
                return
            error = self._error
        self.close()
        raise error or VehicleError(
            f'no HEARTBEAT of an autopilot within {limit_s} s ({self._bytes_heard} bytes heard): '
            'check address, port, baud rate and that MAVLink 2 is sent to this line'
        )

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                for data, source in self._transport.read(READ_S):
                    self._bytes_heard += len(data)
                    for message in self._decode(data):
                        self._take(message, source)
                self._keep_house(time.monotonic_ns())
        except VehicleError as error:
            with self._changed:
                self._error = error
                self._changed.notify_all()

    def _new_parser(self) -> Any:
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        return parser

    def _decode(self, data: bytes) -> list[Any]:
        # Datagrams stand alone: rubbish in one must not swallow the beginning of the next.
        parser = self._new_parser() if self._transport.datagrams else self._stream_parser
        try:
            messages = parser.parse_buffer(bytearray(data)) or []
        except mavlink.MAVError:
            return []
        return [m for m in messages if m.get_msgId() >= 0]

    def _take(self, message: Any, source: Source) -> None:
        now_ns = time.monotonic_ns()
        who = (message.get_srcSystem(), message.get_srcComponent())
        kind = message.get_type()
        with self._changed:
            if self._assembler is None and not self._believe(message, who, source):
                return
            moved = source != self._source
            if who != self._target or (moved and now_ns - self._heard_ns < NEW_ADDRESS_NS):
                self.ignored += 1
                return
            self._source, self._heard_ns = source, now_ns
            assembler = self._heard()
            if kind == 'COMMAND_ACK':
                self._take_ack(message)
            was_control = assembler.mode == self.dialect.control_mode
            assembler.take(message, self._clock_ns(), now_ns)
            if kind == 'HEARTBEAT' and was_control:
                self._watch_takeover(assembler.mode, now_ns)
            self._changed.notify_all()

    def _believe(self, message: Any, who: tuple[int, int], source: Source) -> bool:
        """Choose the autopilot: the first HEARTBEAT that is one's."""
        if message.get_type() != 'HEARTBEAT' or message.type == mavlink.MAV_TYPE_GCS:
            return False
        if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        try:
            self._dialect = choose_dialect(
                self._wanted_dialect, message.autopilot, self._parameters.hold_mode
            )
        except VehicleError as error:
            self._error = error
            self._changed.notify_all()
            return False
        self._assembler = Assembler(self._dialect, self._parameters)
        self._target, self._source = who, source
        return True

    def _take_ack(self, m: Any) -> None:
        if m.result == mavlink.MAV_RESULT_IN_PROGRESS:
            return
        ours = (self._parameters.system_id, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        # Zero says "to anybody"; older firmware leaves the field out.
        if m.target_system in {0, ours[0]} and m.target_component in {0, ours[1]}:
            self._acks[m.command] = m.result

    def _watch_takeover(self, mode: str, now_ns: int) -> None:
        if mode == self.dialect.control_mode:
            return
        self._zero_until_ns = 0
        if now_ns > self._leaving_until_ns or mode != self._leaving_to:
            self._taken_over = True
        self._leaving_until_ns = 0

    def _keep_house(self, now_ns: int) -> None:
        if now_ns - self._heartbeat_sent_ns >= HEARTBEAT_NS:
            self._heartbeat_sent_ns = now_ns
            self._send(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                    mavlink.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                )
            )
        if self._assembler is None:
            return
        for command, params in self._streams.due(self._assembler, now_ns):
            self._send(
                mavlink.MAVLink_command_long_message(
                    *self._target, command, 0, *params, 0.0, 0.0, 0.0, 0.0, 0.0
                )
            )
        if now_ns < self._zero_until_ns and now_ns - self._zero_sent_ns >= ZERO_STREAM_NS:
            self._zero_sent_ns = now_ns
            self._send_setpoint(ZERO)

    def _send_setpoint(self, setpoint: Setpoint) -> None:
        boot_ms = (time.monotonic_ns() - self._opened_ns) // 1_000_000
        self._send(self.dialect.velocity_message(setpoint, boot_ms, self._target))

    def _send(self, message: Any) -> None:
        if self._error is not None:
            raise self._error
        with self._write_lock:
            data = message.pack(self._codec)
            self._codec.seq = (self._codec.seq + 1) % 256
            self._transport.write(data, self._source)
