# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sweep tries every choice and tells what each one takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from peace_ros.cli import benchmark as command
from peace_ros.core.inference.providers import CPU, available_providers
from peace_ros.lab.benchmark import sweep as sweep_module
from peace_ros.lab.benchmark.sweep import measure_setting, settings, sweep_table


def test_every_choice_is_tried() -> None:
    found = settings({'fp32': 'a', 'int8': 'b'}, threads=4)
    assert {each['threads'] for each in found} == {1, 4}
    assert {each['precision'] for each in found} == {'fp32', 'int8'}
    assert {each['provider'] for each in found} <= set(available_providers())
    tried = {each['optimisation'] for each in found if each['provider'] == CPU}
    assert tried == {'none', 'basic', 'extended', 'all'}


def test_a_setting_is_measured_on_a_real_bundle() -> None:
    row = measure_setting('clipseg-small', CPU, 1, 'basic')
    assert row['networks_ms'] == pytest.approx(row['encoder_ms'] + row['decoder_ms'])
    assert min(row.values()) > 0.0


def test_the_command_writes_the_sweep_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = iter(range(100, 10_000, 10))

    def measure(function: str, **setting: Any) -> dict[str, float]:
        taken = float(next(times))
        names = ('encoder_ms', 'decoder_ms', 'networks_ms', 'processor_ms', 'peak_rss_mb')
        return dict.fromkeys(names, taken)

    monkeypatch.setattr(sweep_module, 'run_apart', measure)
    app = typer.Typer()
    app.command()(command.benchmark)
    file, table = tmp_path / 'sweep.json', tmp_path / 'sweep.md'
    options = ['--sweep', '--clipseg', 'clipseg-small', '--json', str(file), '--table', str(table)]
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())['sweep']
    assert len(rows) == len(settings({'fp32': 'x'}, 2))
    assert '| fp32 | CPU | 1 | all | 100 | 100 | 100 |' in table.read_text()


def test_the_fastest_comes_first() -> None:
    row = {'precision': 'fp32', 'provider': CPU, 'threads': 1, 'optimisation': 'all'}
    times = {'encoder_ms': 3.0, 'decoder_ms': 1.0, 'processor_ms': 4.0, 'peak_rss_mb': 9.0}
    rows = [{**row, **times, 'networks_ms': each} for each in (30.0, 20.0)]
    lines = sweep_table(rows, 'here').splitlines()
    assert '| 20 |' in lines[-2]
    assert '| 30 |' in lines[-1]
