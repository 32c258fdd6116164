# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A representative part of the matrix with real processes, DDS and MAVLink."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from peace_ros.lab.faults.catalogue import REPRESENTATIVE

pytestmark = pytest.mark.integration

LIMIT_S = 280.0


def peace_faults(*options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-m', 'peace_ros.cli.main', 'faults', *options],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
        env={**os.environ, 'COLUMNS': '200'},
    )


def test_one_fault_of_each_kind_ends_as_documented(tmp_path: Path) -> None:
    report = tmp_path / 'report.json'
    chosen = [word for name in REPRESENTATIVE for word in ('--only', name)]
    run = peace_faults(*chosen, '--json', str(report), '--run-dir', str(tmp_path / 'run'))
    told = json.loads(report.read_text())
    failures = {row['name']: row['failures'] for row in told['rows'] if not row['passed']}
    assert not failures, run.stdout[-3000:]
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    assert {row['name'] for row in told['rows']} == set(REPRESENTATIVE)
    assert (told['faults'], told['passed']) == (len(REPRESENTATIVE), len(REPRESENTATIVE))
    assert (told['unsafe_handovers'], told['crashes'], told['hangs']) == (0, 0, 0)
    assert told['setpoint_gap_s']['count'] > 50
    for row in told['rows']:
        assert 'LANDING' in row['states'], row
        assert row['lowest_m'] > 19.0
        assert row['happened'] != row['injected']


def test_an_unknown_fault_is_refused_and_the_list_is_shown() -> None:
    refused = peace_faults('--only', 'earthquake')
    assert refused.returncode == 2
    assert 'earthquake' in refused.stderr
    listed = peace_faults('--list')
    assert listed.returncode == 0
    assert all(name in listed.stdout for name in REPRESENTATIVE)
