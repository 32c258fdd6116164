# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the link sends on its own: HEARTBEAT with our health, TIMESYNC, requests for streams."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.streams import StreamKeeper

HEARTBEAT_NS = 1_000_000_000
TIMESYNC_SOON_NS = 100_000_000
TIMESYNC_NS = 500_000_000
OPEN_QUESTIONS = 8
"""TIMESYNC questions whose answers are still taken."""


class Housekeeping:
    """Knows when which message is due; sends nothing itself.

    Args:
        clock: Learns from the answers to TIMESYNC.
        clock_ns: Node clock.
    """

    def __init__(self, clock: TimeMap, clock_ns: Callable[[], int]) -> None:
        self._clock, self._clock_ns = clock, clock_ns
        self._health = int(mavlink.MAV_STATE_STANDBY)
        self._heartbeat_due_ns = 0
        self._timesync_due_ns = 0
        self._asked_ns: deque[int] = deque(maxlen=OPEN_QUESTIONS)
        self._answer: Any = None
        self.streams: StreamKeeper | None = None
        """Set once the autopilot is known."""

    def set_health(self, mav_state: int) -> None:
        """Report MAV_STATE in HEARTBEAT from now on; a change is sent at once."""
        if mav_state != self._health:
            self._health = mav_state
            self._heartbeat_due_ns = 0

    def heartbeat(self, now_ns: int) -> Any:
        """Return our HEARTBEAT when it is due, otherwise None."""
        if now_ns < self._heartbeat_due_ns:
            return None
        self._heartbeat_due_ns = now_ns + HEARTBEAT_NS
        who = (mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID)
        return mavlink.MAVLink_heartbeat_message(*who, 0, 0, self._health, 3)

    def requests(self, now_ns: int, assembler: Assembler, target: tuple[int, int]) -> list[Any]:
        """Return what to ask the autopilot for now."""
        due = [] if self.streams is None else self.streams.due(assembler, now_ns)
        messages: list[Any] = [
            mavlink.MAVLink_command_long_message(*target, command, 0, *params, *(0.0,) * 5)
            for command, params in due
        ]
        if self._answer is not None:
            messages.append(self._answer)
            self._answer = None
        if now_ns >= self._timesync_due_ns:
            soon = self._clock.wants_more
            self._timesync_due_ns = now_ns + (TIMESYNC_SOON_NS if soon else TIMESYNC_NS)
            asked_ns = max(1, self._clock_ns())
            self._asked_ns.append(asked_ns)
            messages.append(mavlink.MAVLink_timesync_message(0, asked_ns))
        return messages

    def take_time(self, message: Any) -> None:
        """Take a TIMESYNC; a question is answered with the next requests."""
        if message.tc1 == 0:
            self._answer = mavlink.MAVLink_timesync_message(self._clock_ns(), message.ts1)
        elif message.ts1 in self._asked_ns:
            self._asked_ns.remove(message.ts1)
            self._clock.add(message.ts1, message.tc1, self._clock_ns())
