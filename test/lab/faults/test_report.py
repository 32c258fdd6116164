# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the report counts, and what the soak lets pass."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.lab.faults import report
from peace_ros.lab.faults.fault import Fault
from peace_ros.lab.faults.judge import judge
from peace_ros.lab.faults.record import Record
from peace_ros.lab.faults.run import Results
from peace_ros.lab.faults.soak import Soak, is_passed
from peace_ros.lab.faults.worker import read_line, row_line


def rows(stopping: Fault, record: Record) -> list[dict[str, Any]]:
    good = asdict(judge(replace(stopping, name='executor_stalls'), record))
    record.unsafe.append((7.0, 'roof'))
    bad = asdict(judge(replace(stopping, name='pilot_lands'), record))
    return [good, bad]


def test_the_report_counts_what_went_wrong(stopping: Fault, record: Record) -> None:
    told = report.figures(Results(rows(stopping, record), [0.05] * 98 + [0.2, 0.4]), 61.0)
    assert (told['faults'], told['passed'], told['unsafe_handovers']) == (2, 1, 1)
    assert (told['crashes'], told['hangs']) == (0, 0)
    assert (told['repeated'], told['too_slow']) == (0, 0)
    assert told['dead_man_s'] == pytest.approx(1.91)
    assert told['reaction_to_pilot_s'] == pytest.approx(4.91, abs=0.11)
    assert told['setpoint_gap_s'] == {'count': 100, 'p50': 0.05, 'p99': 0.202, 'max': 0.4}
    assert report.table(told).row_count == 10
    assert report.line(told['rows'][0]).startswith('passed  executor_stalls after 2.0 s')
    assert 'roof' in report.line(told['rows'][1])


def test_the_report_tells_what_was_flown_twice_and_what_got_no_fair_test(
    stopping: Fault, record: Record
) -> None:
    good, bad = rows(stopping, record)
    for row in (good, bad):
        row.update(attempts=2, slow='the relay stood still for 0.9 s')
    told = report.figures(Results([good, bad], []), 61.0)
    assert (told['repeated'], told['too_slow']) == (2, 1)
    assert '2 flights' in report.line(good)
    assert 'too slow: the relay stood still for 0.9 s' in report.line(bad)


def test_the_report_is_json_and_a_bad_place_is_said(
    stopping: Fault, record: Record, tmp_path: Path
) -> None:
    told = report.figures(Results(rows(stopping, record), []), 1.0)
    report.write(told, tmp_path / 'new' / 'report.json')
    assert json.loads((tmp_path / 'new' / 'report.json').read_text())['rows'][1]['passed'] is False
    (tmp_path / 'file').write_text('')
    with pytest.raises(RecordingError, match='cannot be written'):
        report.write(told, tmp_path / 'file' / 'report.json')


def test_a_row_survives_the_way_from_the_worker(stopping: Fault, record: Record) -> None:
    row = judge(stopping, record)
    told = read_line(row_line(row, [0.05]))
    assert told is not None
    assert told['row']['name'] == 'stops'
    assert told['gaps_s'] == [0.05]
    assert read_line('some library says hello') is None


def flown() -> Soak:
    soak = Soak(landings=10, handovers=9, gaps_s=[0.05] * 200, reactions_s=[0.1])
    soak.memory = {'landing': [(float(at_s), 100_000_000) for at_s in range(0, 600, 5)]}
    return soak


def test_a_quiet_soak_passes() -> None:
    told = flown().told(600.0)
    assert is_passed(told)
    assert told['memory_growth'] == {'landing': 0.0}
    assert told['missed_deadlines'] == 0


@pytest.mark.parametrize('spoil', ['memory', 'gaps', 'deadline', 'reaction', 'unsafe', 'nothing'])
def test_a_soak_that_leaks_or_stutters_fails(spoil: str) -> None:
    soak = flown()
    if spoil == 'memory':
        # Doubles while caches fill, which is allowed, and then goes on growing, which is not.
        soak.memory['landing'] = [
            (at_s, round(size * (1.0 + at_s / 4000.0))) for at_s, size in soak.memory['landing']
        ]
    elif spoil == 'gaps':
        soak.gaps_s += [0.4] * 10
    elif spoil == 'deadline':
        # One in a thousand: the 99th percentile does not show it.
        soak.gaps_s += [0.05] * 800 + [0.6]
    elif spoil == 'reaction':
        soak.reactions_s.append(0.5)
    elif spoil == 'unsafe':
        soak.unsafe_handovers = 1
    else:
        soak.handovers = 0
    assert not is_passed(soak.told(600.0))


def test_memory_that_fills_at_first_and_then_stands_is_no_leak() -> None:
    soak = flown()
    soak.memory['landing'] = [
        (at_s, size if at_s > 60 else size // 2) for at_s, size in soak.memory['landing']
    ]
    assert is_passed(soak.told(600.0))
