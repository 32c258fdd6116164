# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forged, late, doubled and absurd messages among those of a flight; what is believed is compared.

``python -m peace_ros.lab.evaluation.forged --messages 50000`` runs the full number. The bytes of
each message take the way of a real one: parser, choice of the autopilot, assembler. Two hostile
messages never follow each other, so that whatever is believed wrongly rests on a single one.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import traceback
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from math import cos, inf, nan, sin
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.peer import Peer
from peace_ros.core.vehicle.wire import Wire

TICK_NS = 50_000_000
HOSTILE_EVERY = (4, 9)
"""Ticks of the flight from one hostile message to the next."""
FLIGHT = 1000
"""Hostile messages per flight."""
TOLERANCE_M = 1.0
HOME_MSL_M, ORIGIN_MSL_M = 100.0, 110.0
KNOWN, UNKNOWN = 0x33F, 0xA7
ROLL_RAD = 0.1
_SHOWN = 20
_HERE, _THERE = ('127.0.0.1', 14551), ('127.0.0.1', 14552)


@dataclass
class ForgedReport:
    """What came of the messages."""

    messages: int = 0
    """Hostile ones."""
    kinds: dict[str, int] = field(default_factory=dict)
    tracebacks: list[str] = field(default_factory=list)
    wrongly_believed: list[str] = field(default_factory=list)
    moments: int = 0
    """Ticks of the flights at which the autopilot had a position."""
    believed: int = 0
    """Of them, those at which it was believed."""

    @property
    def holds(self) -> bool:
        """No traceback, and nothing believed that a single message introduced."""
        return not self.tracebacks and not self.wrongly_believed


class _ForgedFlight:
    """One flight: circles of 30 m, while the height changes between 20 and 60 m.

    Args:
        rng: What is sent, and when.
        report: Is added to.
        px4: The dialect.
        measures: With a rangefinder and terrain data. Without them a forged one is the first.
    """

    def __init__(
        self, rng: random.Random, report: ForgedReport, *, px4: bool, measures: bool
    ) -> None:
        self._rng, self._report, self._measures = rng, report, measures
        self._limit_m = VehicleParameters().jump_limit_m + TOLERANCE_M
        dialect = Px4() if px4 else ArduPilot()
        self._assembler = Assembler(dialect, VehicleParameters())
        self._peer = Peer(0, 0)
        self._wire = Wire(1, None, datagrams=True)
        self._codec = mavlink.MAVLink(None, 1, 1)
        self._mode = 6 << 16 if px4 else 4
        self._autopilot = int(dialect.autopilot)
        self._estimate = (
            mavlink.MAVLink_estimator_status_message
            if px4
            else mavlink.MAVLink_ekf_status_report_message
        )
        self._px4 = px4
        self._now_ns, self._boot_ms = 10**9, rng.randrange(60_000, 4_000_000)
        self._sent: deque[bytes] = deque(maxlen=400)
        self._knows = True
        self._forged_m: dict[str, float] = {}

    def fly(self, messages: int) -> None:
        """Fly until so many hostile messages were sent."""
        for message in (self._heartbeat(), self._landed(2), *self._home()):
            self._send(message)
        left = messages
        due = self._rng.randint(*HOSTILE_EVERY)
        tick = 0
        while left:
            tick += 1
            self._knows = tick % 400 < 360
            self._now_ns += TICK_NS
            self._boot_ms += TICK_NS // 1_000_000
            for message in self._rng.sample(true := self._true(), len(true)):
                self._send(message)
            self._compare(count=True)
            due -= 1
            if due == 0:
                due, left = self._rng.randint(*HOSTILE_EVERY), left - 1
                self._attack()

    def _attack(self) -> None:
        kind, data, source = self._hostile()
        self._report.messages += 1
        self._report.kinds[kind] = self._report.kinds.get(kind, 0) + 1
        try:
            self._take(data, source)
            self._compare(kind)
        except Exception:
            self._report.tracebacks.append(f'{kind}: {traceback.format_exc()}')

    @property
    def _place_m(self) -> tuple[float, float, float]:
        angle = self._boot_ms / 10_000.0
        return 30.0 * cos(angle), 30.0 * sin(angle), -40.0 - 20.0 * sin(angle / 2.0)

    @property
    def _above_m(self) -> float:
        """Above home, which lies as high as the ground."""
        return ORIGIN_MSL_M - HOME_MSL_M - self._place_m[2]

    def _heartbeat(self, mode: int | None = None, base: int = 0x81) -> Any:
        mode = self._mode if mode is None else mode
        return mavlink.MAVLink_heartbeat_message(2, self._autopilot, base, mode, 4, 3)

    def _landed(self, state: int) -> Any:
        return mavlink.MAVLink_extended_sys_state_message(0, state)

    def _home(self, home_m: float = HOME_MSL_M, origin_m: float = ORIGIN_MSL_M) -> tuple[Any, Any]:
        down_m = origin_m - home_m
        unit = [1.0, 0.0, 0.0, 0.0]
        origin_mm, home_mm = round(origin_m * 1000), round(home_m * 1000)
        return (
            mavlink.MAVLink_gps_global_origin_message(0, 0, origin_mm),
            mavlink.MAVLink_home_position_message(0, 0, home_mm, 0, 0, down_m, unit, 0, 0, 0),
        )

    def _flags(self, flags: int) -> Any:
        if self._px4:
            return mavlink.MAVLink_estimator_status_message(0, flags, *(0.1,) * 8)
        return mavlink.MAVLink_ekf_status_report_message(flags, *(0.1,) * 5)

    def _position(self, boot_ms: int, place: Sequence[float], velocity: Sequence[float]) -> Any:
        return mavlink.MAVLink_local_position_ned_message(boot_ms, *place, *velocity)

    def _height(self, boot_ms: int, above_m: float) -> Any:
        if self._px4:
            return mavlink.MAVLink_altitude_message(boot_ms * 1000, 0, 0, 0, above_m, nan, nan)
        mm = round(above_m * 1000)
        return mavlink.MAVLink_global_position_int_message(boot_ms, 0, 0, 0, mm, 0, 0, 0, 0)

    def _fix(self, fix_type: int, above_home_m: float) -> Any:
        msl_mm = round((HOME_MSL_M + above_home_m) * 1000)
        return mavlink.MAVLink_gps_raw_int_message(0, fix_type, 0, 0, msl_mm, 0, 0, 0, 0, 0)

    def _range(self, distance_m: float) -> Any:
        cm, down = max(0, round(distance_m * 100)), mavlink.MAV_SENSOR_ROTATION_PITCH_270
        # Not a distance is 0, which is below the least one.
        return mavlink.MAVLink_distance_sensor_message(
            self._boot_ms, 20, 20_000, min(cm, 65_535), 0, 0, down, 255
        )

    def _terrain(self, above_m: float) -> Any:
        return mavlink.MAVLink_terrain_report_message(0, 0, 100, 0, above_m, 0, 0)

    def _true(self) -> list[Any]:
        angle = self._boot_ms / 10_000.0
        velocity = (-3.0 * sin(angle), 3.0 * cos(angle), -1.0 * cos(angle / 2.0))
        place, above_m = self._place_m, self._above_m
        measured = [self._range(above_m / cos(ROLL_RAD)), self._terrain(above_m)]
        return [
            *(measured if self._measures else ()),
            self._heartbeat(),
            self._landed(2),
            self._flags(KNOWN if self._knows else UNKNOWN),
            self._fix(3 if self._knows else 1, above_m),
            self._height(self._boot_ms, above_m),
            self._position(self._boot_ms, place, velocity),
            mavlink.MAVLink_attitude_message(self._boot_ms, ROLL_RAD, 0, angle % 3.0, 0, 0, 0),
        ]

    def _hostile(self) -> tuple[str, bytes, tuple[str, int]]:
        rng = self._rng
        kind = rng.choice(('late', 'doubled', 'damaged', 'elsewhere', *_FORGERIES))
        if kind in _FORGERIES:
            return kind, bytes(self._forged(kind).pack(self._codec)), _HERE
        if kind == 'elsewhere':
            return kind, bytes(self._forged('place').pack(self._codec)), _THERE
        data = bytearray(
            self._sent[-rng.randint(1, 7)] if kind == 'doubled' else rng.choice(self._sent)
        )
        if kind == 'damaged':
            for _ in range(rng.randint(1, 6)):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        return kind, bytes(data), _HERE

    def _forged(self, kind: str) -> Any:
        rng = self._rng
        boot_ms = self._boot_ms + rng.choice((1, 200, 990, 990, 10_000, 10**8))
        if rng.random() < 0.4:
            boot_ms = rng.choice((0, 20, 900, self._boot_ms - 1200, self._boot_ms // 2, 2**32 - 1))
        boot_ms = min(max(0, boot_ms), 2**32 - 1)
        place = list(self._place_m)
        place[rng.randrange(3)] += rng.choice((-1, 1)) * 10.0 ** rng.uniform(
            0.8, rng.choice((1.5, 3.0))
        )
        velocity = [0.0, 0.0, 0.0]
        if rng.random() < 0.5:
            velocity[rng.randrange(3)] = rng.uniform(-90.0, 90.0)
        if kind == 'absurd':
            numbers = [*place, *velocity]
            numbers[rng.randrange(6)] = rng.choice((1e20, -1e20, 3e38, nan, inf, -inf, 1e-45))
            return self._position(boot_ms, numbers[:3], numbers[3:])
        wrong_m = rng.choice((-1, 1)) * rng.uniform(7.0, 900.0)
        origin, home = self._home(HOME_MSL_M + wrong_m, ORIGIN_MSL_M - wrong_m)
        angles = [rng.choice((0.3, 3.0, 1e20, nan, inf)) for _ in range(3)]
        text = bytes(rng.randrange(256) for _ in range(rng.randint(0, 50)))
        forgeries = {
            'place': lambda: self._position(boot_ms, place, velocity),
            'height': lambda: self._height(boot_ms, wrong_m),
            'home': lambda: home,
            'origin': lambda: origin,
            'heartbeat': lambda: self._heartbeat(rng.randrange(2**32), rng.choice((1, 0x81))),
            'landed': lambda: self._landed(rng.randrange(5)),
            'flags': lambda: self._flags(rng.choice((KNOWN, UNKNOWN, 0, 0xFFFF))),
            'fix': lambda: self._fix(rng.randrange(9), rng.choice((0.0, wrong_m))),
            'range': lambda: self._range(self._unlike_before(kind)),
            'terrain': lambda: self._terrain(
                self._unlike_before(kind) if rng.random() < 0.5 else rng.choice((1e20, nan))
            ),
            'attitude': lambda: mavlink.MAVLink_attitude_message(boot_ms, *angles, 0, 0, 0),
            'text': lambda: mavlink.MAVLink_statustext_message(2, text, rng.randrange(3), 0),
        }
        return forgeries[kind]()

    def _unlike_before(self, kind: str) -> float:
        """Return a height that neither the truth nor the one forged before agrees with."""
        while True:
            height_m = self._rng.uniform(1.0, 199.0)
            before_m = self._forged_m.get(kind, inf)
            if min(abs(height_m - self._above_m), abs(height_m - before_m)) > 2 * self._limit_m:
                self._forged_m[kind] = height_m
                return height_m

    def _send(self, message: Any) -> None:
        data = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        self._sent.append(data)
        self._take(data, _HERE)

    def _take(self, data: bytes, source: tuple[str, int]) -> None:
        for message in self._wire.decode(data):
            if self._peer.is_candidate(message, source, self._now_ns) and not self._peer.target[0]:
                self._peer.choose(message, source, self._now_ns)
            if self._peer.is_ours(message, source, self._now_ns):
                self._assembler.take(message, self._now_ns, self._now_ns)

    def _compare(self, kind: str = 'after it', *, count: bool = False) -> None:
        """Compare what is believed now, and every pose that was made, with the truth."""
        told = self._assembler.telemetry(self._now_ns)
        self._report.moments += count and self._knows
        self._report.believed += count and self._knows and told.pose is not None
        if told.pose is not None and not self._knows:
            self._blame(kind, 'a position while the filter has none')
        north_m, east_m, _ = self._place_m
        above_m = self._above_m
        for pose in (*self._assembler.poses, *(() if told.pose is None else (told.pose,))):
            if pose.has_position:
                off_m = max(abs(pose.north_m - north_m), abs(pose.east_m - east_m))
                if not off_m <= self._limit_m:
                    self._blame(kind, f'a position {off_m:.1f} m off')
            off_m = abs(pose.altitude_agl_m - above_m)
            if not off_m <= self._limit_m:
                self._blame(kind, f'a height {off_m:.1f} m off')
        for height in told.heights:
            true_m = above_m if height.above_ground else HOME_MSL_M + above_m
            if not abs(height.height_m - true_m) <= self._limit_m:
                self._blame(kind, f'{height.source} {height.height_m - true_m:.1f} m off')
        self._assembler.poses.clear()
        if self._assembler.reboots:
            self._blame(kind, 'a reboot')
        if not told.status_text.isprintable():
            self._blame(kind, f'the text {told.status_text!r}')

    def _blame(self, kind: str, what: str) -> None:
        self._report.wrongly_believed.append(f'{kind}: {what} ({self._boot_ms} ms)')


_FORGERIES = (
    *('place', 'absurd', 'height', 'home', 'origin', 'heartbeat', 'landed'),
    *('flags', 'fix', 'range', 'terrain', 'attitude', 'text'),
)


def run_forged(messages: int, seed: int = 0) -> ForgedReport:
    """Send so many hostile messages, half of them to each autopilot's dialect.

    Args:
        messages: Number of hostile messages.
        seed: Same seed, same messages.
    """
    report = ForgedReport()
    for number, first in enumerate(range(0, messages, FLIGHT)):
        rng = random.Random(f'{seed} {number}')
        flight = _ForgedFlight(rng, report, px4=bool(number % 2), measures=number % 4 < 2)
        flight.fly(min(FLIGHT, messages - first))
    report.kinds = dict(Counter(report.kinds).most_common())
    return report


def main(argv: Sequence[str] | None = None) -> int:
    """Run the messages and print a report; status 1 when a promise was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--messages', type=int, default=50_000)
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(argv)
    report = run_forged(options.messages, options.seed)
    shown = asdict(report) | {
        'tracebacks': len(report.tracebacks),
        'wrongly_believed': len(report.wrongly_believed),
        'shown': [*report.tracebacks, *report.wrongly_believed][:_SHOWN],
    }
    print(json.dumps(shown, indent=2))
    return 0 if report.holds else 1


if __name__ == '__main__':
    sys.exit(main())
