# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark counts and times what the nodes run, and says plainly what was not measured."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from peace_ros.cli import benchmark as command
from peace_ros.core.domain import BundleError
from peace_ros.lab.benchmark.measure import Measured, Spread
from peace_ros.lab.benchmark.ours import measure_blabberseg, measure_ours
from peace_ros.lab.benchmark.report import clipseg_figures, fastsam_figures, markdown
from peace_ros.lab.benchmark.worker import BenchmarkError, run_apart

SMALL: dict[str, Any] = {
    'bundle': 'clipseg-small',
    'clip': 'clip-small',
    'provider': 'CPUExecutionProvider',
    'threads': 1,
    'frames': 12,
}
WANTED = {
    'frame_ms_p50',
    'frame_ms_p95',
    'speedup_vs_reference',
    'speedup_vs_blabberseg',
    'cost_39_over_13_terms',
    'dynamic_prompt_share',
    'peak_rss_mb',
    'calls_per_frame',
}


@pytest.fixture(scope='module')
def ours() -> Measured:
    return measure_ours(**SMALL)


def test_a_steady_frame_costs_one_encoding_one_decoding_and_no_text(ours: Measured) -> None:
    assert ours.extra['steady_calls'] == {'image_encoder': 1, 'text_encoder': 0, 'decoder': 1}


def test_ranking_runs_at_its_own_rate(ours: Measured) -> None:
    # 12 stamps at 5 frames/s: the first frame and the one 2 s later.
    assert ours.extra['calls_per_frame']['ranking'] == pytest.approx(2 / 12)
    assert ours.extra['calls_per_frame']['image_encoder'] == 1


def test_every_figure_is_there_and_can_be_written(ours: Measured) -> None:
    slow = measure_blabberseg(**{**SMALL, 'frames': 2})
    figures = clipseg_figures(ours, None, None, slow)
    assert set(json.loads(json.dumps(figures))) >= WANTED
    assert figures['speedup_vs_reference'] is None
    assert figures['speedup_vs_blabberseg'] > 0.0
    text = markdown([ours, slow], figures, 'on a test machine')
    assert '| speedup_vs_reference | not measured |' in text
    assert '| peace_ros | fp32, CPUExecutionProvider | frame |' in text


def test_each_way_has_a_process_of_its_own() -> None:
    found = run_apart('peace_ros.lab.benchmark.ours:measure_memory', **{**SMALL, 'frames': 2})
    assert found.frames == 2
    assert found.peak_rss_mb > 20.0
    with pytest.raises(BenchmarkError, match=r"no model bundle 'nowhere'"):
        run_apart('peace_ros.lab.benchmark.ours:measure_memory', **{**SMALL, 'bundle': 'nowhere'})


def test_the_command_writes_table_and_json_and_keeps_other_objects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def measure(name: str, **arguments: Any) -> Measured:
        spread = Spread(100.0, 110.0, 120.0, 101.0)
        extra = {
            'cost_39_over_13_terms': 1.3,
            'cost_per_term': 0.01,
            'dynamic_prompt_share': 0.02,
            'steady_calls': {'decoder': 1.0},
            'calls_per_frame': {'decoder': 1.0},
            'ranking_ms': 30.0,
            'prompts': 2,
        }
        return Measured(name, 'fake', {'frame': spread}, 3, 500.0, 90.0, extra)

    monkeypatch.setattr(command, '_measure', measure)
    file = tmp_path / 'figures.json'
    file.write_text('{"fastsam": {"frame_ms_p50": 1.0}}')
    app = typer.Typer()
    app.command()(command.benchmark)
    options = ['--clipseg', 'clipseg-small', '--clip', 'clip-small', '--json', str(file)]
    options.append('--no-fastsam')
    result = CliRunner().invoke(app, [*options, '--table', str(tmp_path / 'table.md')])
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text())
    assert figures['clipseg']['frame_ms_p50'] == 100.0
    assert figures['fastsam'] == {'frame_ms_p50': 1.0}
    assert '| frame_ms_p50 | 100 |' in (tmp_path / 'table.md').read_text()


@pytest.mark.parametrize('option', ['--clipseg', '--clip'])
def test_a_bundle_that_does_not_exist_is_refused_before_anything_is_made(
    option: str, tmp_path: Path
) -> None:
    app = typer.Typer()
    app.command()(command.benchmark)
    work = tmp_path / 'work'
    result = CliRunner().invoke(app, [option, 'nothing-here', '--work', str(work)])
    assert isinstance(result.exception, BundleError)
    assert "no model bundle 'nothing-here'" in str(result.exception)
    assert not work.exists()


def fastsam_measured(name: str, frame_ms: float) -> Measured:
    spread = Spread(frame_ms, frame_ms * 1.1, frame_ms * 1.2, frame_ms)
    extra = {
        'cost_39_over_13_terms': 1.0,
        'dynamic_prompt_share': 0.01,
        'segments_per_frame': 50.0,
        'steady_calls': {'segmenter': 1.0, 'image_encoder': 1.0, 'text_encoder': 0.0},
    }
    return Measured(name, 'fake', {'frame': spread}, 3, 700.0, 2 * frame_ms, extra)


def test_fastsam_figures_say_what_has_no_meaning_and_why() -> None:
    figures = fastsam_figures(
        fastsam_measured('ours', 100.0),
        fastsam_measured('with texts', 2500.0),
        fastsam_measured('images', 400.0),
    )
    assert set(figures) >= WANTED
    assert figures['speedup_vs_reference'] == pytest.approx(25.0)
    assert figures['speedup_vs_reference_without_texts'] == pytest.approx(4.0)
    assert figures['speedup_vs_blabberseg'] is None
    assert 'CLIPSeg' in figures['speedup_vs_blabberseg_reason']
    assert figures['calls_per_frame']['image_encoder'] == 1.0


def test_a_run_with_fastsam_writes_both_objects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ours: Measured
) -> None:
    asked: list[dict[str, Any]] = []

    def measure(function: str, **arguments: Any) -> Measured:
        asked.append(arguments)
        if 'fastsam' not in arguments['bundle' if 'bundle' in arguments else 'tokenizer_bundle']:
            return ours
        return fastsam_measured(function, 100.0 if 'reference' not in function else 3000.0)

    monkeypatch.setattr(command, '_measure', measure)
    monkeypatch.setattr(command, 'require', lambda *_: None)  # nothing is really measured or made
    names = ('clipseg-rd64-fp32', 'clipseg-rd64-int8', 'clip-vit-b-32-int8', 'fastsam-s-fp32')
    monkeypatch.setattr(command, 'random_bundles', lambda *_: {each: each for each in names})
    app = typer.Typer()
    app.command()(command.benchmark)
    file, table = tmp_path / 'figures.json', tmp_path / 'table.md'
    options = ['--reference', '--quick', '--provider', 'CPUExecutionProvider']
    options += ['--json', str(file), '--table', str(table)]
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 0, result.output
    fastsam = json.loads(file.read_text())['fastsam']
    assert fastsam['speedup_vs_reference'] == pytest.approx(30.0)
    assert [each['with_texts'] for each in asked if 'with_texts' in each] == [True, False]
    assert 'FastSAM-s, 50 segments, 13 terms' in table.read_text()


@pytest.mark.export
def test_planted_segments_are_found_scored_in_one_batch_and_counted(
    tmp_path: Path, random_fastsam_bundle: Path
) -> None:
    found = measure_ours(
        bundle=str(random_fastsam_bundle), clip='clip-small',
        provider='CPUExecutionProvider', threads=1, frames=2, parts=1,
    )  # fmt: skip
    assert found.extra['segments_per_frame'] == 50.0
    assert found.extra['steady_calls'] == {'segmenter': 1, 'image_encoder': 1, 'text_encoder': 0}
    assert set(found.stages_ms) >= {'segmenter', 'boxes and masks', 'crops', 'CLIP, all segments'}


@pytest.fixture
def random_fastsam_bundle(tmp_path: Path) -> Path:
    """50 planted ellipses in a narrow network, and the shipped CLIP to score them."""
    torch = pytest.importorskip('torch')
    from peace_ros.core.inference import Bundle
    from peace_ros.lab.export.fastsam import export_fastsam
    from peace_ros.lab.export.random_fastsam import Yolo, plant_ellipses
    from peace_ros.lab.export.segmenters import from_network

    torch.manual_seed(0)
    network = Yolo(1 / 3, 0.125, 1024, 320).eval()
    network.plant(*plant_ellipses(50, 320, 0))
    source = from_network(network, 'narrow', 320, licence='none', provenance='random')
    export_fastsam(source, Bundle.load('clip-small'), tmp_path / 'narrow')
    return tmp_path / 'narrow'
