# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which system on the line is our autopilot; messages of all others are counted and ignored."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.transport import Source

NEW_ADDRESS_NS = 3_000_000_000
"""Silence of the autopilot after which the same system is accepted from another address."""
ANY_SYSTEM_NS = 2_000_000_000
"""How long system 1 is waited for before another system is taken, when none is asked for."""
USUAL_SYSTEM = 1


class Peer:
    """The autopilot that is accepted: system, component 1, and the address it sends from.

    Args:
        vehicle_id: System id; 0 takes system 1, or after two seconds the first other one.
        opened_ns: Steady clock when listening began.
    """

    def __init__(self, vehicle_id: int, opened_ns: int) -> None:
        self._vehicle_id = vehicle_id
        self._opened_ns = opened_ns
        self._known = False
        self._heard_ns = 0
        self.target = (0, 0)
        """System and component; zeros before one is chosen."""
        self.source: Source = None
        self.ignored = 0
        """Messages of others."""
        self.warning = ''
        """Who else speaks in the autopilot's name, empty when nobody does."""
        self.others: set[tuple[int, int]] = set()
        """Autopilots that were heard and not taken."""

    def is_candidate(self, message: Any, source: Source, now_ns: int) -> bool:
        """Tell whether this HEARTBEAT is of the autopilot to choose; chooses nothing yet."""
        del source
        if message.get_type() != 'HEARTBEAT' or message.type == mavlink.MAV_TYPE_GCS:
            return False
        if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        system, component = message.get_srcSystem(), message.get_srcComponent()
        wanted = self._vehicle_id or USUAL_SYSTEM
        patient = self._vehicle_id != 0 or now_ns - self._opened_ns < ANY_SYSTEM_NS
        if component != mavlink.MAV_COMP_ID_AUTOPILOT1 or (system != wanted and patient):
            self.others.add((system, component))
            return False
        return True

    def choose(self, message: Any, source: Source, now_ns: int) -> None:
        """Accept the sender of this HEARTBEAT from now on."""
        self.target = (message.get_srcSystem(), message.get_srcComponent())
        self.source, self._heard_ns, self._known = source, now_ns, True

    def is_ours(self, message: Any, source: Source, now_ns: int) -> bool:
        """Tell whether a message comes from the chosen autopilot; follows it to a new address."""
        who = (message.get_srcSystem(), message.get_srcComponent())
        is_target = self._known and who == self.target
        follows = now_ns - self._heard_ns >= NEW_ADDRESS_NS
        elsewhere = is_target and source != self.source
        if elsewhere:
            self._warn(source, follows=follows)
        if not is_target or (elsewhere and not follows):
            self.ignored += 1
            return False
        self.source, self._heard_ns = source, now_ns
        return True

    def _warn(self, source: Source, *, follows: bool) -> None:
        old, new = (':'.join(map(str, each or ('?',))) for each in (self.source, source))
        result = f'{new} is followed after 3 s of silence' if follows else f'{new} is ignored'
        self.warning = (
            f'system {self.target[0]}, component {self.target[1]} speaks from two addresses, '
            f'{old} and {new}: {result}; end one of them, or sign the messages'
        )

    def heard_instead(self) -> str:
        """Return who else was heard, as part of a sentence; empty when nobody was."""
        if not self.others:
            return ''
        names = ', '.join(f'{system}/{component}' for system, component in sorted(self.others))
        return f'; heard others (system/component): {names}; choose one with vehicle_id'
