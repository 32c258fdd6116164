# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mission protocol: plans, fences and rally points are taken, kept and given back.

They are not flown, and a fence that was uploaded stops nothing: the fault ``fence`` does.
Source of what differs between the autopilots: their source texts (MissionItemProtocol of ArduPilot,
mavlink_mission of PX4), not measured.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.datum import Datum
from peace_ros.simulation.autopilot.lines import Address
from peace_ros.simulation.autopilot.personality import Personality

MAX_ITEMS = 500
ASK_AGAIN_S = 1.0
GIVE_UP_S = 8.0
"""An upload whose sender is silent for so long is cancelled."""
PLAN, FENCE, RALLY = (
    mavlink.MAV_MISSION_TYPE_MISSION,
    mavlink.MAV_MISSION_TYPE_FENCE,
    mavlink.MAV_MISSION_TYPE_RALLY,
)
GIVES = frozenset({'MISSION_REQUEST_LIST', 'MISSION_REQUEST', 'MISSION_REQUEST_INT'})
_LOCAL_FRAMES = frozenset({mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_ENU})
_NO_PLACE = mavlink.MAV_FRAME_MISSION
_E7, _E4 = 1e7, 1e4


@dataclass(frozen=True)
class Item:
    """The fields of MISSION_ITEM_INT that are kept."""

    frame: int
    command: int
    autocontinue: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float


@dataclass
class _Upload:
    """A transfer to the autopilot that is under way."""

    kind: int
    count: int
    sender: tuple[int, int]
    """System and component."""
    asked_s: float
    heard_s: float
    items: list[Item] = field(default_factory=list)


class Missions:
    """Keeps one plan of each kind; one upload at a time for each peer.

    Args:
        personality: ArduPilot keeps home as the first item of a plan, and asks with
            MISSION_REQUEST; PX4 asks with MISSION_REQUEST_INT.
        datum: Where home is.
    """

    def __init__(self, personality: Personality, datum: Datum) -> None:
        self._is_px4 = personality.is_px4
        self._datum = datum
        self._plans: dict[int, list[Item]] = {PLAN: [], FENCE: [], RALLY: []}
        self._uploads: dict[Address, _Upload] = {}
        self.current = 0
        """Number of the item that MISSION_CURRENT tells."""

    def count(self, kind: int = PLAN) -> int:
        """Return the number of items of a plan."""
        return len(self._plans[kind])

    def choose(self, number: int) -> bool:
        """Make an item the current one; False where there is none."""
        if not 0 <= number < self.count():
            return False
        self.current = number
        return True

    def take(self, address: Address, message: Any, time_s: float) -> list[Any]:
        """Answer a message of the protocol to the peer that sent it; time_s as of the autopilot."""
        kind = message.get_type()
        if kind == 'MISSION_SET_CURRENT':
            self.choose(message.seq)
            return [mavlink.MAVLink_mission_current_message(self.current)]
        who = (message.get_srcSystem(), message.get_srcComponent())
        if kind == 'MISSION_CLEAR_ALL':
            return [self._clear(who, message.mission_type)]
        plan = getattr(message, 'mission_type', None)
        if kind == 'MISSION_ACK' or plan is None:
            return []
        return self._transfer(address, who, message, time_s)

    def due(self, time_s: float) -> list[tuple[Address, Any]]:
        """Return what silent senders are asked again, or told when it is given up."""
        told: list[tuple[Address, Any]] = []
        for address, upload in list(self._uploads.items()):
            if time_s - upload.heard_s > GIVE_UP_S:
                del self._uploads[address]
                cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
                told.append((address, _ack(upload.sender, upload.kind, cancelled)))
            elif time_s - upload.asked_s > ASK_AGAIN_S:
                told.append((address, self._ask(upload, time_s)))
        return told

    def forget_uploads(self) -> None:
        """Drop what is under way, as a reboot does; plans stay."""
        self._uploads.clear()

    def _transfer(
        self, address: Address, who: tuple[int, int], message: Any, time_s: float
    ) -> list[Any]:
        kind, plan = message.get_type(), message.mission_type
        if plan in self._plans:
            if kind in {'MISSION_ITEM', 'MISSION_ITEM_INT'}:
                return self._receive(address, who, message, time_s)
            if kind == 'MISSION_COUNT':
                return [self._begin(address, who, message, time_s)]
            if kind in GIVES:
                return [self._give(who, message)]
        return [_ack(who, plan, mavlink.MAV_MISSION_UNSUPPORTED)]

    def _clear(self, who: tuple[int, int], kind: int) -> Any:
        everything = kind == mavlink.MAV_MISSION_TYPE_ALL
        if not everything and kind not in self._plans:
            return _ack(who, kind, mavlink.MAV_MISSION_UNSUPPORTED)
        for each in self._plans if everything else [kind]:
            self._plans[each] = []
        self.current = min(self.current, max(0, self.count() - 1))
        return _ack(who, kind, mavlink.MAV_MISSION_ACCEPTED)

    def _begin(self, address: Address, who: tuple[int, int], message: Any, time_s: float) -> Any:
        kind, count = message.mission_type, message.count
        if count > MAX_ITEMS:
            return _ack(who, kind, mavlink.MAV_MISSION_NO_SPACE)
        if count == 0:
            return self._clear(who, kind)
        upload = _Upload(kind, count, who, time_s, time_s)
        self._uploads[address] = upload
        return self._ask(upload, time_s)

    def _receive(
        self, address: Address, who: tuple[int, int], message: Any, time_s: float
    ) -> list[Any]:
        upload = self._uploads.get(address)
        if upload is None or upload.kind != message.mission_type or upload.sender != who:
            return []
        if message.seq < len(upload.items):
            return []  # a repetition: the next one has been asked for
        if message.seq > len(upload.items):
            return [_ack(who, upload.kind, mavlink.MAV_MISSION_INVALID_SEQUENCE)]
        item = _item(message)
        if item is None:
            del self._uploads[address]
            return [_ack(who, upload.kind, mavlink.MAV_MISSION_INVALID)]
        upload.items.append(item)
        upload.heard_s = time_s
        if len(upload.items) < upload.count:
            return [self._ask(upload, time_s)]
        del self._uploads[address]
        self._plans[upload.kind] = upload.items
        self.current = 0 if upload.kind == PLAN else self.current
        return [_ack(who, upload.kind, mavlink.MAV_MISSION_ACCEPTED)]

    def _ask(self, upload: _Upload, time_s: float) -> Any:
        upload.asked_s = time_s
        ask = (
            mavlink.MAVLink_mission_request_int_message
            if self._is_px4
            else mavlink.MAVLink_mission_request_message
        )
        return ask(*upload.sender, len(upload.items), upload.kind)

    def _give(self, who: tuple[int, int], message: Any) -> Any:
        kind = message.mission_type
        if message.get_type() == 'MISSION_REQUEST_LIST':
            return mavlink.MAVLink_mission_count_message(*who, self.count(kind), kind)
        number = message.seq
        if number >= self.count(kind):
            return _ack(who, kind, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        item = self._plans[kind][number]
        if kind == PLAN and number == 0 and not self._is_px4:
            item = self._home()
        current = int(kind == PLAN and number == self.current)
        head = (*who, number, item.frame, item.command, current, item.autocontinue, *item.params)
        if message.get_type() == 'MISSION_REQUEST_INT':
            return mavlink.MAVLink_mission_item_int_message(*head, item.x, item.y, item.z, kind)
        scale = _scale(item.frame)
        return mavlink.MAVLink_mission_item_message(
            *head, item.x / scale, item.y / scale, item.z, kind
        )

    def _home(self) -> Item:
        x, y = self._datum.geodetic_e7(0.0, 0.0)
        frame, command = mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_NAV_WAYPOINT
        return Item(frame, command, 1, (0.0,) * 4, x, y, self._datum.altitude_msl_m)


def _scale(frame: int) -> float:
    if frame == _NO_PLACE:
        return 1.0
    return _E4 if frame in _LOCAL_FRAMES else _E7


def _item(m: Any) -> Item | None:
    """Return the item of MISSION_ITEM or MISSION_ITEM_INT, None where its place is no number."""
    if not (isfinite(m.x) and isfinite(m.y) and isfinite(m.z)):
        return None
    x, y = m.x, m.y
    if m.get_type() == 'MISSION_ITEM':
        x, y = round(x * _scale(m.frame)), round(y * _scale(m.frame))
    limit = 2**31 - 1
    if max(abs(x), abs(y)) > limit:
        return None
    params = (m.param1, m.param2, m.param3, m.param4)
    return Item(m.frame, m.command, m.autocontinue, params, x, y, m.z)


def _ack(who: tuple[int, int], kind: int, result: int) -> Any:
    return mavlink.MAVLink_mission_ack_message(*who, result, kind)
