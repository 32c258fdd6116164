# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The run of the matrix keeps what was flown, whatever becomes of a worker."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from peace_ros.lab.faults import report, run
from peace_ros.lab.faults.catalogue import choose
from peace_ros.lab.faults.fault import Fault
from peace_ros.simulation.demo.processes import ProcessError

FAULTS = choose(['telemetry'])


class Worker:
    """Runs every fault well, but for those of a name."""

    hanging = ''

    def __init__(self, _number: int, _folder: Path, _world_folder: Path) -> None:
        self.closed = False

    def run(self, fault: Fault, _stop: threading.Event) -> dict[str, Any]:
        if fault.name == self.hanging:
            raise ProcessError(f'fault {fault.name}: nothing for 400 s')
        row = {'name': fault.name, 'passed': True, 'figures': {}, 'attempts': 1, 'slow': ''}
        return {'row': {**row, 'unsafe_handovers': 0, 'crashes': 0, 'hangs': 0}, 'gaps_s': [0.05]}

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize('jobs', [1, 3])
def test_every_fault_is_run_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int
) -> None:
    monkeypatch.setattr(run, '_WorkerProcess', Worker)
    told: list[str] = []
    results = run.run_faults(
        FAULTS, jobs, tmp_path, tmp_path, lambda name, row: told.append(name) if row else None
    )
    assert sorted(told) == sorted(fault.name for fault in FAULTS)
    assert sorted(row['name'] for row in results.rows) == sorted(told)
    assert len(results.gaps_s) == len(FAULTS)
    assert results.trouble == ''


def test_a_worker_that_hangs_fails_its_fault_and_loses_no_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, '_WorkerProcess', Worker)
    monkeypatch.setattr(Worker, 'hanging', FAULTS[3].name)
    results = run.run_faults(FAULTS, 1, tmp_path, tmp_path, lambda _name, _row: None)
    assert [row['name'] for row in results.rows] == [fault.name for fault in FAULTS[:4]]
    told = report.figures(results, 1.0)
    assert (told['faults'], told['passed'], told['hangs']) == (4, 3, 1)
    assert 'nothing for 400 s' in results.rows[3]['failures'][0]
    assert 'nothing for 400 s' in results.trouble
