# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs faults in a ROS domain of its own: names come on standard input, rows go to the output."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from peace_ros.core.domain import PeaceError
from peace_ros.lab.faults import worlds
from peace_ros.lab.faults.bench import FlightBench
from peace_ros.lab.faults.catalogue import named
from peace_ros.lab.faults.fault import Fault, FlightSetting
from peace_ros.lab.faults.judge import Row, judge
from peace_ros.lab.faults.node import BenchNode
from peace_ros.lab.faults.record import Record
from peace_ros.lab.faults.scenario import Scenario
from peace_ros.simulation.demo.isolation import isolate

MARK = '@row '
"""Before a row on standard output, because libraries may print there too."""
_ATTEMPTS = 2


class Worker:
    """Keeps one bench alive for as long as the faults ask for the same setting."""

    def __init__(self, folder: Path, world_folder: Path) -> None:
        self._folder = folder
        self._world_folder = world_folder
        self._node = BenchNode()
        self._bench: FlightBench | None = None
        self._count = 0

    def close(self) -> None:
        """Stop everything."""
        self._drop()
        self._node.close()

    def run(self, fault: Fault) -> tuple[Row, list[float]]:
        """Run a fault; return its row and the gaps between set-points before the injection.

        A flight that did not come to the moment of the injection, or failed while the machine was
        too slow, says nothing of the landing and is repeated once.
        """
        attempt, slow = 0, ''
        while True:
            attempt += 1
            record, gaps_s = self._attempt(fault)
            row = judge(fault, record)
            slow = slow or row.slow
            if attempt == _ATTEMPTS or row.passed or not (record.trouble or row.slow):
                return replace(row, attempts=attempt, slow=slow), gaps_s

    def _attempt(self, fault: Fault) -> tuple[Record, list[float]]:
        try:
            bench = self._bench_for(fault.setting)
        except PeaceError as error:
            self._drop()
            return Record(trouble=f'{type(error).__name__}: {error}'), []
        scenario = Scenario(bench, fault)
        record = scenario.run()
        if record.trouble:
            print(f'{fault.name}: {record.trouble}', file=sys.stderr, flush=True)
            self._drop()
        return record, scenario.gaps_s

    def _bench_for(self, setting: FlightSetting) -> FlightBench:
        bench = self._bench
        if bench is not None and (bench.setting != setting or not bench.is_whole()):
            self._drop()
            bench = None
        if bench is None:
            self._count += 1
            begin_m = (0.0, 0.0) if setting.at_origin else worlds.BEGIN_M
            ground = worlds.load(self._world_folder, setting.world, begin_m)
            folder = self._folder / f'bench-{self._count}'
            bench = self._bench = FlightBench(setting, ground, folder, self._node)
            bench.open()
        return bench

    def _drop(self) -> None:
        bench, self._bench = self._bench, None
        if bench is not None:
            bench.close()


def row_line(row: Row, gaps_s: list[float]) -> str:
    """Return the line that tells a row to the one who asked."""
    return MARK + json.dumps({'row': asdict(row), 'gaps_s': gaps_s})


def read_line(line: str) -> dict[str, Any] | None:
    """Return what :func:`row_line` wrote; None for anything else."""
    if not line.startswith(MARK):
        return None
    told: dict[str, Any] = json.loads(line[len(MARK) :])
    return told


def main() -> int:
    """Run what standard input names, until it ends."""
    folder, world_folder = Path(sys.argv[1]), Path(sys.argv[2])
    isolate(folder / 'ros')
    worker = Worker(folder, world_folder)
    try:
        for name in sys.stdin:
            row, gaps_s = worker.run(named(name.strip()))
            print(row_line(row, gaps_s), flush=True)
    finally:
        worker.close()
    return 0


if __name__ == '__main__':
    sys.exit(main())
