# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Disk, memory and clock: what is too little is said with the remedy."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

from peace_ros.lab.doctor.machine import check_clock, check_disk, check_machine, check_memory


def test_this_computer_is_read() -> None:
    subjects = [each.found.partition(':')[0] for each in check_machine()]
    assert subjects[0] == 'disk'
    assert subjects[-2:] == ['memory', 'clock']


def test_a_full_disk_is_to_be_mended(tmp_path, monkeypatch, to_mend) -> None:
    monkeypatch.setattr(shutil, 'disk_usage', lambda _folder: SimpleNamespace(free=5e8))
    ((found, remedy),) = to_mend(check_disk({'logs': tmp_path / 'not' / 'there'}))
    assert '0.5 GB free for logs' in found
    assert '1 GB' in remedy


def test_a_file_system_is_named_once(tmp_path) -> None:
    assert len(list(check_disk({'logs': tmp_path, 'models': tmp_path / 'new'}))) == 1


def test_little_memory_is_to_be_mended(tmp_path, to_mend) -> None:
    file = tmp_path / 'meminfo'
    file.write_text('MemTotal: 4000000 kB\nMemAvailable: 300000 kB\n')
    ((found, remedy),) = to_mend(check_memory(file))
    assert '0.3 GB available' in found
    assert 'end other processes' in remedy
    file.write_text('MemTotal: 4000000 kB\nMemAvailable: 1000000 kB\n')
    assert not to_mend(check_memory(file))


def test_a_clock_that_began_in_1970_is_to_be_mended(to_mend) -> None:
    ((found, remedy),) = to_mend(check_clock(100.0, 1e9))
    assert '1970-01-01' in found
    assert 'set the clock' in remedy
    assert not to_mend(check_clock(1e9, 1e9))
