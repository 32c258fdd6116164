# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""GNSS that is lost during a descent: how soon the vehicle is told to stop, and stops.

``python -m peace_ros.lab.evaluation.gnss_loss`` flies landings in simulated time. The messages of
the simulated autopilot take the way of real ones: at the rates that the companion asks for, late by
what a line takes, into its assembler. GNSS is lost when the vehicle comes down to a height.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.landing import State
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.streams import StreamKeeper
from peace_ros.lab.evaluation.wind import WindFlight
from peace_ros.simulation.autopilot.parameters import AutopilotParameters
from peace_ros.simulation.autopilot.streams import Streams

HEIGHTS_M = (90.0, 75.0, 60.0, 50.0, 40.0, 30.0, 25.0, 22.0)
TOLD_LIMIT_S = 1.0
"""From the loss to the last set-point that descends."""
STANDING_M_S = 0.1
_START_M = 100.0
_LINE_DELAY_S = 0.04
_SENDER_S = 0.05
"""Period of the sender: a decision waits for so long at most."""
_WATCHED_S = 4.0
_LIMIT_S = 150.0


@dataclass(frozen=True)
class GnssLoss:
    """One landing."""

    autopilot: str
    at_m: float
    """True height at which GNSS was lost."""
    seed: int
    descent_m_s: float
    """True descent at the loss."""
    told_s: float
    """From the loss to the last set-point that descends, with the wait of the sender."""
    stood_s: float | None
    """From the loss until the true descent is below 0.1 m/s for good; None: it is not."""
    sunk_m: float
    state: str
    """Of the landing at the end."""

    @property
    def holds(self) -> bool:
        """The landing was told to stop in time, and stood still."""
        return self.told_s <= TOLD_LIMIT_S and self.stood_s is not None


class GnssLossFlight(WindFlight):
    """A landing whose telemetry comes by messages.

    Args:
        at_m: Where GNSS is lost.
        seed: Of wind, gusts and noise.
        wind_m_s: Mean speed; gusts are 0.3 of it.
        px4: Fly as PX4, with its measured errors.
    """

    def __init__(self, at_m: float, seed: int, wind_m_s: float = 5.0, *, px4: bool) -> None:
        errors = float(px4)
        super().__init__(wind_m_s, 0.3 * wind_m_s, seed, px4_errors=errors, start_m=_START_M)
        self._at_m = at_m
        dialect = Px4() if px4 else ArduPilot()
        played = AutopilotParameters(autopilot='px4' if px4 else 'ardupilot')
        self._streams = Streams(played, self._flight.personality)
        self._assembler = Assembler(dialect, VehicleParameters())
        self._periods_s = {
            each: 1.0 / hz
            for each, hz in StreamKeeper(VehicleParameters(), dialect).rates_hz.items()
            if self._streams.knows(each)
        }
        for each in (mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_HOME_POSITION):
            self._periods_s.setdefault(each, 1.0)
        self._periods_s.setdefault(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1.0)
        self._message_due_s = dict.fromkeys(self._periods_s, self._now_s)
        self._messages: deque[tuple[float, Any]] = deque()

    def result(self) -> GnssLoss | None:
        """Fly to the height, lose GNSS, and watch; None when the vehicle never came there."""
        flight, begin_s = self._flight, self._now_s
        while self._descends_above():
            self._tick()
            if self._now_s > begin_s + _LIMIT_S:
                return None
        lost_s, lost_m = self._now_s, -flight.physics.down_m
        descent_m_s = flight.physics.velocity_ned_m_s[2]
        flight.lose_gps(stale=False)
        told_s, moved_s = -_SENDER_S, 0.0
        while self._now_s < lost_s + _WATCHED_S:
            self._tick()
            since_s = self._now_s - lost_s
            if self.track[-1][3].setpoint.v_down_m_s > 0.0:
                told_s = since_s
            if flight.physics.velocity_ned_m_s[2] > STANDING_M_S:
                moved_s = since_s
        return GnssLoss(
            autopilot=flight.personality.kind.value,
            at_m=round(lost_m, 1),
            seed=self._seed,
            descent_m_s=round(descent_m_s, 2),
            told_s=round(told_s + _SENDER_S, 2),
            stood_s=round(moved_s, 2) if moved_s < _WATCHED_S - 0.5 else None,
            sunk_m=round(lost_m + flight.physics.down_m, 2),
            state=self.track[-1][3].state.value,
        )

    def _descends_above(self) -> bool:
        """Tell whether the height of the loss is still to come, in a descent."""
        high = -self._flight.physics.down_m > self._at_m
        descends = bool(self.track) and self.track[-1][3].setpoint.v_down_m_s > 0.0
        return high or not descends

    def _report(self) -> None:
        for message_id, period_s in self._periods_s.items():
            if self._now_s + 1e-9 < self._message_due_s[message_id]:
                continue
            self._message_due_s[message_id] = self._now_s + period_s
            message = self._streams.build(message_id, self._flight)
            if message is not None:
                self._messages.append((self._now_s + _LINE_DELAY_S, message))

    def _receive(self) -> None:
        now_ns = round(self._now_s * 1e9)
        while self._messages and self._messages[0][0] <= self._now_s:
            self._assembler.take(self._messages.popleft()[1], now_ns, now_ns)
            self._told_s = self._now_s
        for pose in self._assembler.poses:
            self._core.add_pose(pose)
        self._assembler.poses.clear()
        self._telemetry = self._assembler.telemetry(now_ns)
        while self._heatmaps and self._heatmaps[0][0] <= self._now_s:
            self._core.add_heatmap(self._heatmaps.popleft()[1])


def measure(heights_m: Sequence[float], seeds: int, wind_m_s: float) -> list[GnssLoss]:
    """Fly each height with each seed on both autopilots; a height never reached is left out."""
    found: list[GnssLoss] = []
    for px4 in (False, True):
        for at_m in heights_m:
            for seed in range(1, seeds + 1):
                flown = GnssLossFlight(at_m, seed, wind_m_s, px4=px4).result()
                if flown is not None:
                    found.append(flown)
    return found


def main(args: Sequence[str] | None = None) -> int:
    """Fly from the command line; 1 when a landing was told to stop too late, or none was flown."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.gnss_loss',
        description=(__doc__ or '').splitlines()[0],
    )
    parser.add_argument('--seeds', type=int, default=2)
    parser.add_argument('--wind', type=float, default=5.0, help='mean speed, m/s')
    parser.add_argument('--heights', type=float, nargs='+', default=list(HEIGHTS_M), help='m')
    parser.add_argument('--json', type=Path, help='write the flights to this file')
    given = parser.parse_args(args)
    found = measure(given.heights, given.seeds, given.wind)
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(each) for each in found], indent=2) + '\n')
    lines = ['autopilot  lost at m  descent m/s  told to stop s  stood s  sunk m  state']
    for each in found:
        stood = '     -' if each.stood_s is None else f'{each.stood_s:6.2f}'
        lines.append(
            f'{each.autopilot:9s}  {each.at_m:9.1f}  {each.descent_m_s:11.2f}  '
            f'{each.told_s:14.2f}  {stood}  {each.sunk_m:6.2f}  {each.state}'
        )
    slowest_s = max((each.told_s for each in found), default=inf)
    held = sum(each.holds for each in found)
    lines.append(
        f'{held} of {len(found)} told to stop within {TOLD_LIMIT_S:g} s and standing; '
        f'the slowest after {slowest_s:.2f} s'
    )
    sys.stdout.write('\n'.join(lines) + '\n')
    stopped = all(each.state == State.HOLD.value for each in found)
    return 0 if found and held == len(found) and stopped else 1


if __name__ == '__main__':
    sys.exit(main())
