# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One long flight: engage, land, hand over, up again; memory and the wire are watched."""

from __future__ import annotations

import json
import os
import sys
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from peace_ros.core.domain import PeaceError, VehicleError
from peace_ros.core.landing import State
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.lab.faults import report, worlds
from peace_ros.lab.faults.bench import ENGAGE_S, FlightBench
from peace_ros.lab.faults.fault import FlightSetting
from peace_ros.lab.faults.node import BenchNode
from peace_ros.lab.faults.scenario import unsafe_ground
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.isolation import isolate

_LANDING_S = 90.0
_START_M = 10.0
"""Landings begin up to this far beside the start, so that no two of them are alike."""
_LOOK_S = 0.05
_MEMORY_S = 5.0
_SETTLED = 0.2
"""Memory is compared with what it was after this part of the time: caches fill at first."""
GROWTH_LIMIT = 0.05
GAP_LIMIT_S = 0.15
"""Of the 99th percentile of the gaps between set-points."""
DEADLINE_S = 0.5
"""No decision outlives this, so no gap between set-points may either."""
REACTION_LIMIT_S = 0.3
_PAGE = os.sysconf('SC_PAGE_SIZE')
_ENDS = (State.HANDOVER.value, State.ABORTED.value)


@dataclass(frozen=True)
class SoakOptions:
    """How long, and where the logs go."""

    seconds: float
    folder: Path


@dataclass
class Soak:
    """What was seen."""

    landings: int = 0
    handovers: int = 0
    unsafe_handovers: int = 0
    unfinished: int = 0
    """Landings that found no place in time; the pilot ended them."""
    troubles: list[str] = field(default_factory=list)
    gaps_s: list[float] = field(default_factory=list)
    reactions_s: list[float] = field(default_factory=list)
    """From a pilot's mode change to the last set-point on the wire."""
    memory: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    """Process -> (second, resident bytes)."""

    def growth(self) -> dict[str, float]:
        """Return by which part the resident memory of each process has grown since it settled."""
        grown = {}
        for name, samples in self.memory.items():
            whole_s = samples[-1][0]
            first = [size for at_s, size in samples if at_s >= _SETTLED * whole_s]
            if len(first) >= 10:
                # Tenths at both ends: a single sample depends on when the collector ran.
                tenth = max(1, len(first) // 10)
                begin = sum(first[:tenth]) / tenth
                end = sum(first[-tenth:]) / tenth
                grown[name] = round(end / begin - 1.0, 4)
        return grown

    def told(self, duration_s: float) -> dict[str, Any]:
        """Return the report."""
        return {
            'duration_s': round(duration_s, 1),
            'landings': self.landings,
            'handovers': self.handovers,
            'unsafe_handovers': self.unsafe_handovers,
            'unfinished': self.unfinished,
            'troubles': self.troubles,
            'setpoint_gap_s': report.gap_figures(self.gaps_s),
            'late_setpoints': sum(gap > GAP_LIMIT_S for gap in self.gaps_s),
            'missed_deadlines': sum(gap > DEADLINE_S for gap in self.gaps_s),
            'reaction_to_pilot_s': max(self.reactions_s, default=None),
            'memory_growth': self.growth(),
            'memory_bytes': {name: samples[-1][1] for name, samples in self.memory.items()},
        }


def is_passed(told: dict[str, Any]) -> bool:
    """Tell whether a soak kept its limits."""
    reaction_s = told['reaction_to_pilot_s']
    return (
        not told['troubles']
        and told['handovers'] > 0
        and told['unsafe_handovers'] == 0
        and told['setpoint_gap_s'].get('p99', 1.0) <= GAP_LIMIT_S
        and told['missed_deadlines'] == 0
        and (reaction_s is None or reaction_s <= REACTION_LIMIT_S)
        and all(part < GROWTH_LIMIT for part in told['memory_growth'].values())
    )


def soak_in_terminal(options: SoakOptions, console: Console, json_file: Path | None) -> bool:
    """Fly for so long and tell; return whether the limits were kept."""
    isolate(options.folder / 'ros')
    began = time.monotonic()
    seen = Soak()
    with console.status('flying') as status:
        node = BenchNode()
        ground = worlds.load(options.folder / 'worlds', 'meadow')
        bench = FlightBench(FlightSetting(), ground, options.folder / 'soak', node)
        try:
            bench.open()
            bench.reset()
            while time.monotonic() - began < options.seconds:
                _land(bench, seen, began)
                status.update(
                    f'{(time.monotonic() - began) / 60:.1f} min, {seen.handovers} hand-overs'
                )
        except PeaceError as error:
            seen.troubles.append(f'{type(error).__name__}: {error}')
        finally:
            bench.close()
            node.close()
    told = seen.told(time.monotonic() - began)
    if json_file is not None:
        report.write(told, json_file)
    console.print(json.dumps(told, indent=2), highlight=False)
    return is_passed(told)


def _land(bench: FlightBench, seen: Soak, began: float) -> None:
    """One landing, or every third time one that the pilot ends."""
    seen.landings += 1
    random = np.random.default_rng(seen.landings)
    north_m, east_m = (float(each) for each in random.uniform(-_START_M, _START_M, size=2))
    bench.put_vehicle(north_m, east_m)
    bench.node.engage(ENGAGE_S)
    engaged_s = time.monotonic()
    takes_over = seen.landings % 3 == 0
    deadline = engaged_s + _LANDING_S
    while (state := bench.state()) not in _ENDS or time.monotonic() - engaged_s < 1.0:
        _watch(bench, seen, began)
        is_late = time.monotonic() > deadline
        seen.unfinished += is_late
        if is_late or (takes_over and state == State.LANDING.value):
            _take_over(bench, seen)
            break
        time.sleep(_LOOK_S)
    sent = bench.line.sent_since(engaged_s)
    seen.gaps_s += [b.at_s - a.at_s for a, b in pairwise(sent)]
    if bench.state() == State.HANDOVER.value:
        seen.handovers += 1
        camera = NadirCamera(bench.ground.world, CameraOptions().camera)
        why = unsafe_ground(bench, camera, None, time.monotonic())
        if why:
            seen.unsafe_handovers += 1
            seen.troubles.append(f'unsafe hand-over {seen.handovers}: {why}')


def _take_over(bench: FlightBench, seen: Soak) -> None:
    asked_s = time.monotonic()
    bench.ask_autopilot('pilot_mode', {'mode': 'LOITER'})
    time.sleep(1.0)
    late = bench.line.sent_since(asked_s)
    seen.reactions_s.append(late[-1].at_s - asked_s if late else 0.0)


def _watch(bench: FlightBench, seen: Soak, began: float) -> None:
    bench.look()
    if bench.losses.ended:
        names = ', '.join(each.name for each in bench.losses.ended)
        raise VehicleError(f'{names} ended by itself: see {bench.folder}')
    at_s = time.monotonic() - began
    for name, pid in bench.processes.pids.items():
        samples = seen.memory.setdefault(name, [])
        if not samples or at_s - samples[-1][0] >= _MEMORY_S:
            samples.append((at_s, _resident_bytes(pid)))


def _resident_bytes(pid: int) -> int:
    """Return the resident memory of a process, 0 where the system does not tell."""
    if sys.platform != 'linux':
        return 0
    try:
        words = Path(f'/proc/{pid}/statm').read_text(encoding='ascii').split()
    except OSError:
        return 0
    return int(words[1]) * _PAGE
