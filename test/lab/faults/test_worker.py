# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A flight that says nothing of the landing is repeated once; a failure of the landing is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from peace_ros.lab.faults import worker
from peace_ros.lab.faults.fault import Fault
from peace_ros.lab.faults.record import Record, longest_gap_s


class FakeNode:
    """Listens to nobody."""

    def close(self) -> None:
        """Nothing to close."""


@pytest.fixture
def runner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> worker.Worker:
    monkeypatch.setattr(worker, 'BenchNode', FakeNode)
    return worker.Worker(tmp_path, tmp_path)


def flights(
    runner: worker.Worker, monkeypatch: pytest.MonkeyPatch, *records: Record
) -> list[Record]:
    left = list(records)
    monkeypatch.setattr(runner, '_attempt', lambda _fault: (left.pop(0), [0.05]))
    return left


def bad(record: Record, *, slow: str = '') -> Record:
    """Return a flight that descends on although it says HOLD."""
    falling = [replace(t, altitude_agl_m=40.0 - t.at_s) for t in record.truths]
    return replace(record, truths=falling, slow=slow)


def test_a_failure_of_the_landing_is_not_repeated(
    runner: worker.Worker, stopping: Fault, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = flights(runner, monkeypatch, bad(record), record)
    row, _ = runner.run(stopping)
    assert (row.passed, row.attempts, len(left)) == (False, 1, 1)


@pytest.mark.parametrize('second', ['good', 'bad'])
def test_a_failure_on_a_machine_that_was_too_slow_is_repeated_once_and_said(
    second: str,
    runner: worker.Worker,
    stopping: Fault,
    record: Record,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    again = record if second == 'good' else bad(record)
    left = flights(runner, monkeypatch, bad(record, slow='stood still'), again, record)
    row, _ = runner.run(stopping)
    assert (row.passed, row.attempts, row.slow) == (second == 'good', 2, 'stood still')
    assert len(left) == 1


def test_a_good_flight_counts_however_slow_the_machine_was(
    runner: worker.Worker, stopping: Fault, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights(runner, monkeypatch, replace(record, slow='stood still'))
    row, _ = runner.run(stopping)
    assert (row.passed, row.attempts) == (True, 1)


def test_a_flight_that_never_came_to_its_moment_is_repeated(
    runner: worker.Worker, stopping: Fault, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights(runner, monkeypatch, Record(trouble='no landing'), record)
    row, _ = runner.run(stopping)
    assert (row.passed, row.attempts) == (True, 2)


def test_the_longest_gap_counts_the_ends_too() -> None:
    assert longest_gap_s([], 1.0, 3.0) == 2.0
    assert longest_gap_s([0.0, 1.5, 2.0, 9.0], 1.0, 3.0) == 1.0
