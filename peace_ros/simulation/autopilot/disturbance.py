# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with the simulated autopilot and its line at the moment; plain state."""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import nan
from random import Random

Vector = tuple[float, float, float]


@dataclass
class Disturbance:
    """Set by :mod:`peace_ros.simulation.autopilot.faults`, read where messages are made."""

    altitude: str = 'true'
    altitude_offset_m: float = 0.0
    frozen_down_m: float = 0.0
    frame: str = 'ned'
    position_offset_m: tuple[float, float] = (0.0, 0.0)
    clock_step_s: float = 0.0
    muted: frozenset[str] = frozenset()
    """Message names that are not sent; ``*`` is every one."""
    silent_until_s: float = 0.0
    """Steady clock until which the line is cut."""
    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    refused_modes: frozenset[str] = frozenset()
    refuse_silently: bool = False

    @property
    def silent(self) -> bool:
        """The line is cut."""
        return self.silent_until_s > 0.0 and time.monotonic() < self.silent_until_s

    def mutes(self, name: str) -> bool:
        """Whether a message of this name is held back."""
        return name in self.muted or '*' in self.muted

    def reported_position(self, position_m: Vector, ground_msl_m: float) -> Vector:
        """Return the position as it is told."""
        north = position_m[0] + self.position_offset_m[0]
        east = position_m[1] + self.position_offset_m[1]
        down = self._down_m(position_m[2])
        if self.frame == 'enu':
            return east, north, -down
        if self.frame == 'south':
            return -north, -east, down
        if self.frame == 'msl':
            return north, east, down - ground_msl_m
        return north, east, down

    def reported_velocity(self, velocity_m_s: Vector) -> Vector:
        """Return the velocity as it is told."""
        north, east, down = velocity_m_s
        if self.altitude == 'sign':
            down = -down
        if self.altitude == 'freeze':
            down = 0.0
        if self.frame == 'enu':
            return east, north, -down
        if self.frame == 'south':
            return -north, -east, down
        return north, east, down

    def _down_m(self, down_m: float) -> float:
        return {
            'nan': nan,
            'sign': -down_m,
            'freeze': self.frozen_down_m,
            'jump': down_m - self.altitude_offset_m,
        }.get(self.altitude, down_m)


class BadLine:
    """Loses, doubles, swaps and damages datagrams as a disturbance asks; one per direction."""

    def __init__(self, disturbance: Disturbance, seed: int) -> None:
        self._disturbance = disturbance
        self._random = Random(seed)
        self._held: list[tuple[int, bytes]] = []
        """Datagrams under way, each with how many later ones overtake it."""

    def carry(self, data: bytes) -> list[bytes]:
        """Return the datagrams that arrive now for one that is sent."""
        d = self._disturbance
        if not (d.drop or d.duplicate or d.reorder or d.corrupt):
            held, self._held = self._held, []
            return [*(each for _, each in held), data]
        chance = self._random.random
        if chance() < d.drop:
            return []
        if chance() < d.corrupt:
            damaged = bytearray(data)
            damaged[self._random.randrange(len(damaged))] ^= 1 << self._random.randrange(8)
            data = bytes(damaged)
        arriving = [data, data] if chance() < d.duplicate else [data]
        self._held = [(left - 1, each) for left, each in self._held]
        arriving += [each for left, each in self._held if left <= 0]
        self._held = [(left, each) for left, each in self._held if left > 0]
        if chance() < d.reorder:
            self._held.append((self._random.randint(1, 4), arriving.pop(0)))
        return arriving
