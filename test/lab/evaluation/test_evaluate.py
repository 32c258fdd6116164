# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace evaluate`` scores what can be scored, names what cannot, and keeps its budgets."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from peace_ros.cli.main import app
from peace_ros.core.domain import Label
from peace_ros.core.inference import Bundle
from peace_ros.core.resources import models_dir
from peace_ros.lab.evaluation.segmentation.cores import Cores, Overrides, build_cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.figures import figures_of, together
from peace_ros.lab.evaluation.segmentation.html import write_report
from peace_ros.lab.evaluation.segmentation.inputs import EvaluationInputs, open_source
from peace_ros.lab.evaluation.segmentation.pictures import PANELS
from peace_ros.lab.evaluation.segmentation.run import Outcome, evaluate
from peace_ros.lab.evaluation.segmentation.threshold import (
    RiskBudget,
    choose_threshold,
    save_threshold,
)

STORED = Path(__file__).parents[2] / 'data/drawn_evaluation.json'
REFRESH = 'peace evaluate --drawn 12 --threads 1 --no-terms --json test/data/drawn_evaluation.json'
NOISE = {'miou': 0.01, 'false_safe': 0.005}
"""Same scenes, same model: only the last digits of sums differ between machines."""
RATES = ('miou', 'iou_safe', 'iou_unsafe', 'false_safe', 'recall', 'ece', 'hz', 'baseline_miou')
Writer = Callable[..., SimpleNamespace]


def scene(safe_green: int, unsafe_green: int, rows: int = 16) -> tuple[Any, Any]:
    """Return a square image, its upper half grass, its lower half water with a person."""
    image = np.zeros((rows, rows, 3), np.uint8)
    labels = np.full((rows, rows), Label.GRASS, np.uint8)
    labels[rows // 2 :] = Label.WATER
    labels[rows // 2, :2] = Label.PERSON
    image[..., 1] = np.where(labels == Label.GRASS, safe_green, unsafe_green)
    image[..., 2] = np.where(labels == Label.WATER, 250, 0)
    return image, labels


def run_green(cores: Cores, folders: SimpleNamespace, **options: Any) -> Outcome:
    source = open_source(EvaluationInputs(images=folders.images, labels=folders.labels))
    return evaluate(source, [cores], **options)


def test_figures_follow_from_what_was_called_safe(green_cores: Cores, pair_on_disk: Writer) -> None:
    for name, greens in (('a', (200, 10)), ('b', (200, 200)), ('c', (10, 10))):
        folders = pair_on_disk(name, *scene(*greens))
    outcome = run_green(green_cores, folders)
    figures = figures_of(green_cores, outcome.tallies['green'], outcome)
    assert figures['frames'] == 3
    assert figures['recall'] == pytest.approx(2 / 3, abs=1e-5)
    assert figures['false_safe'] == pytest.approx(1 / 3, abs=1e-5)
    assert figures['baseline_miou'] == pytest.approx(0.25)
    assert figures['false_safe_by_hazard']['person'] == pytest.approx(1 / 3, abs=1e-5)
    assert figures['false_safe_by_hazard']['vehicle'] is None
    assert figures['iou_by_term']['water'] == pytest.approx(1.0)
    assert figures['unscored_terms'] == ['spaceship']
    low, high = figures['false_safe_interval']
    assert low <= figures['false_safe'] <= high
    assert [each['unsafe_called_safe_area'] for each in figures['per_frame']] == [0.0, 0.5, 0.0]


def test_a_raw_threshold_moves_what_is_called_safe(
    green_cores: Cores, pair_on_disk: Writer
) -> None:
    folders = pair_on_disk('a', *scene(200, 150))
    outcome = run_green(green_cores, folders)
    strict = figures_of(green_cores, outcome.tallies['green'], outcome, 0.7)
    assert strict['false_safe'] == 0.0
    assert strict['recall'] == 1.0
    assert strict['threshold'] == pytest.approx(0.7, abs=0.01)
    # Where the bundle puts 0.7 at one half, a score of one half is its 0.7.
    calibrated = replace(
        green_cores, pipeline=SimpleNamespace(segmenter=SimpleNamespace(threshold=0.7))
    )
    assert calibrated.heatmap_score(0.7) == pytest.approx(0.5)
    assert calibrated.own_score(calibrated.heatmap_score(0.3)) == pytest.approx(0.3)


def test_pictures_that_a_flight_refuses_are_not_scored_but_told(
    green_cores: Cores, pair_on_disk: Writer
) -> None:
    pair_on_disk('a', *scene(200, 150))
    image, labels = scene(200, 150)
    folders = pair_on_disk('covered', np.full_like(image, 90), labels)
    outcome = run_green(green_cores, folders)
    assert outcome.tallies['green'].names == ['a.png']
    (skipped,) = outcome.skipped
    assert skipped.name == 'covered.png'
    assert 'of one colour' in skipped.reason
    with pytest.raises(DatasetError, match=r'covered.png: .* of one colour .*--strict'):
        run_green(green_cores, folders, strict=True)


def test_oblong_images_are_cut_and_each_pixel_counts_once(
    green_cores: Cores, pair_on_disk: Writer
) -> None:
    image, labels = (np.concatenate([each, each[:, :5]], axis=1) for each in scene(200, 10))
    folders = pair_on_disk('a', image, labels)
    tally = run_green(green_cores, folders).tallies['green']
    assert tally.tiles == [2]
    assert tally.counts[0].sum() - tally.counts[0][0].sum() == labels.size
    whole = run_green(green_cores, folders, tile_px=0).tallies['green']
    assert whole.tiles == [1]
    assert np.array_equal(whole.counts[0][1:], tally.counts[0][1:])


def test_what_cannot_be_scored_is_named_and_not_scored(
    green_cores: Cores, pair_on_disk: Writer
) -> None:
    image, labels = scene(200, 10)
    folders = pair_on_disk('good', image, labels)
    pair_on_disk('size', image, labels[:8])
    pair_on_disk('value', image, labels + 40)
    pair_on_disk('blank', image, np.zeros_like(labels))
    pair_on_disk('alone', image, None)
    (folders.images / 'torn.png').write_bytes(b'torn')
    (folders.labels / 'torn.png').write_bytes(b'torn')
    (folders.labels / 'orphan.png').write_bytes((folders.labels / 'good.png').read_bytes())
    outcome = run_green(green_cores, folders)
    reasons = {each.name: each.reason for each in outcome.skipped}
    assert outcome.tallies['green'].names == ['good.png']
    assert '16 x 8 px for an image of 16 x 16 px' in reasons['size.png']
    assert 'label value 41 (128 px)' in reasons['value.png']
    assert 'nothing to score' in reasons['blank.png']
    assert 'no label' in reasons['alone.png']
    assert 'holds 4 bytes' in reasons['torn.png']
    assert reasons['orphan.png'] == 'a label without an image'
    figures = figures_of(green_cores, outcome.tallies['green'], outcome)
    assert len(figures['skipped']) == 6
    with pytest.raises(DatasetError, match='--strict'):
        run_green(green_cores, folders, strict=True)


def test_nothing_to_score_is_refused(green_cores: Cores, pair_on_disk: Writer) -> None:
    folders = pair_on_disk('a', scene(200, 10)[0], np.full((16, 16), 99, np.uint8))
    with pytest.raises(DatasetError, match=r'no image could be scored; the first of 1: a\.png'):
        run_green(green_cores, folders)


def test_the_threshold_keeps_the_budget_with_the_highest_recall(
    green_cores: Cores, pair_on_disk: Writer
) -> None:
    for place in range(6):
        folders = pair_on_disk(f'f{place}', *scene(200 + place, 150 + place))
    outcome = run_green(green_cores, folders)
    tally = outcome.tallies['green']
    choice = choose_threshold(green_cores, tally, RiskBudget(0.01, 0.0))
    assert 155 / 255 < choice.threshold <= 200 / 255 + 0.01
    assert choice.recall == 1.0
    assert choice.false_safe_limit == 0.0
    assert choice.persons == 0.0
    lenient = choose_threshold(green_cores, tally, RiskBudget(0.9))
    assert lenient.recall == 1.0
    # Not even a budget that allows everything gives a threshold that calls everything safe.
    assert lenient.threshold > 149 / 255
    assert lenient.false_safe < 0.5


def test_a_threshold_that_is_as_good_as_any_stays(green_cores: Cores, pair_on_disk: Writer) -> None:
    for place in range(6):
        folders = pair_on_disk(f'f{place}', *scene(200, 100))
    tally = run_green(green_cores, folders).tallies['green']
    choice = choose_threshold(green_cores, tally, RiskBudget(0.01))
    assert choice.threshold == pytest.approx(green_cores.standing)
    assert choice.recall == 1.0


def test_a_budget_that_no_threshold_keeps_is_refused(
    green_cores: Cores, pair_on_disk: Writer
) -> None:
    folders = pair_on_disk('a', *scene(100, 200))
    pair_on_disk('b', *scene(100, 200))
    tally = run_green(green_cores, folders).tallies['green']
    with pytest.raises(DatasetError, match=r'no threshold keeps false-safe at most 1\.00%'):
        choose_threshold(green_cores, tally, RiskBudget(0.01))


def test_a_chosen_threshold_goes_into_the_bundle_which_stays_whole(
    green_cores: Cores, pair_on_disk: Writer, tmp_path: Path
) -> None:
    folder = tmp_path / 'bundle'
    shutil.copytree(models_dir() / 'clipseg-small', folder)
    cores = replace(green_cores, bundle=Bundle.load(folder))
    for name in 'ab':
        folders = pair_on_disk(name, *scene(200, 150))
    budget = RiskBudget(0.02)
    choice = choose_threshold(cores, run_green(cores, folders).tallies['green'], budget)
    save_threshold(cores, choice, budget)
    again = Bundle.load(folder).manifest
    assert again.recommended['threshold'] == pytest.approx(choice.threshold, abs=1e-4)
    assert again.recommended['max_false_safe'] == 0.02
    assert again.files == cores.bundle.manifest.files
    softmax = replace(cores, segmentation=replace(cores.segmentation, fusion='softmax'))
    with pytest.raises(DatasetError, match='leave --save out'):
        save_threshold(softmax, choice, budget)


def test_the_report_stands_by_itself(
    green_cores: Cores, pair_on_disk: Writer, tmp_path: Path
) -> None:
    folders = pair_on_disk('a<b', *scene(200, 150))
    pair_on_disk('lone', scene(1, 1)[0], None)
    outcome = run_green(green_cores, folders)
    named = {'green': figures_of(green_cores, outcome.tallies['green'], outcome)}
    page = write_report(tmp_path / 'out', named, outcome, [green_cores], None).read_text()
    assert 'a&lt;b.png' in page
    assert page.count('data:image/jpeg;base64,') == len(PANELS)
    assert page.count('<svg') == 3
    assert 'lone.png' in page
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    assert '<meta name="viewport"' in page
    assert 'configurations' not in together(named, outcome)


@pytest.mark.parametrize('missing', ['jinja2', 'matplotlib'])
def test_a_report_without_its_libraries_is_refused_before_the_work(
    missing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = 'peace_ros.lab.evaluation.segmentation'
    for module in (f'{package}.html', f'{package}.charts'):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, missing, None)
    options = ['evaluate', '--drawn', '1', '--html', str(tmp_path)]
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 2
    assert f'needs {missing}: run pip install jinja2 matplotlib' in result.output
    assert not list(tmp_path.iterdir())


def test_the_command_writes_figures_with_intervals(tmp_path: Path) -> None:
    file, out = tmp_path / 'figures.json', tmp_path / 'out'
    options = ['evaluate', 'dd_cs', 'peace_cs', '--drawn', '2', '--threads', '1']
    result = CliRunner().invoke(app, [*options, '--json', str(file), '--html', str(out)])
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text())
    assert list(figures['configurations']) == ['dd_cs', 'peace_cs']
    assert figures['configuration'] == 'dd_cs'
    assert figures['miou'] == figures['configurations']['dd_cs']['miou']
    for rate in RATES:
        low, high = figures[f'{rate}_interval']
        assert low <= high
    assert set(figures['iou_by_term']) == set(figures['iou_by_term_interval'])
    assert set(figures['false_safe_by_hazard']) >= {'person', 'water', 'road', 'tree'}
    assert (out / 'report.html').is_file()


@pytest.mark.parametrize(
    ('options', 'complaint'),
    [
        (['--drawn', '1', '--save'], '--save without --max-false-safe'),
        (['--images', '/nowhere', '--labels', '/nowhere'], 'is not a folder'),
        (['--drawn', '1', '--threshold', '1.0'], '--threshold 1.0'),
        (['no_such', '--drawn', '1'], "preset 'no_such' does not exist"),
    ],
)
def test_what_makes_no_sense_is_refused(options: list[str], complaint: str) -> None:
    result = CliRunner().invoke(app, ['evaluate', *options])
    assert result.exit_code == 2
    assert complaint in result.output


def test_a_configuration_without_its_model_is_left_out_with_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('peace_ros.lab.evaluation.segmentation.cores.models_dir', lambda: tmp_path)
    monkeypatch.setenv('PEACE_MODELS_DIR', str(tmp_path))
    assert 'peace_fs is left out' in str(build_cores('peace_fs', Overrides()))


def _fastsam_bundles() -> Any:
    path = Path(__file__).parents[2] / 'core/segmentation/fastsam_bundles.py'
    spec = importlib.util.spec_from_file_location('fastsam_bundles_to_evaluate', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_fastsam_is_measured_by_the_same_stick(
    tiny: Any, pair_on_disk: Writer, tmp_path: Path
) -> None:
    bundles = _fastsam_bundles()
    halves = bundles.Patch(0, 0, 8, 16), bundles.Patch(8, 0, 16, 16)
    folder = bundles.write_fastsam(tiny, tmp_path / 'fastsam', halves)
    (tmp_path / 'terms.yaml').write_text('positive: [grass]\nnegative: [building, water]\n')
    side = bundles.SIDE_PX
    image = np.full((side, side, 3), bundles.BLUE, np.uint8) // 2
    image[:, : side // 2] = bundles.GREEN
    labels = np.full((side, side), Label.WATER, np.uint8)
    labels[:, : side // 2] = Label.GRASS
    source_folders = pair_on_disk('a', image, labels)
    overrides = Overrides(fastsam=str(folder), terms=str(tmp_path / 'terms.yaml'), threads=1)
    cores = build_cores('dd_fs', overrides)
    assert isinstance(cores, Cores)
    outcome = run_green(cores, source_folders)
    figures = figures_of(cores, outcome.tallies['dd_fs'], outcome)
    assert figures['model']['family'] == 'fastsam'
    assert figures['miou'] > 0.9
    assert figures['iou_by_term']['water'] > 0.9


def test_the_bundled_model_is_as_good_as_the_stored_figures() -> None:
    stored = json.loads(STORED.read_text())
    source = open_source(EvaluationInputs(drawn=12))
    cores = build_cores('peace_cs', Overrides(threads=1))
    assert isinstance(cores, Cores)
    outcome = evaluate(source, [cores], score_terms=False)
    found = figures_of(cores, outcome.tallies['peace_cs'], outcome)
    hint = f'if the model or the drawing changed on purpose: {REFRESH}'
    assert found['frames'] == stored['frames'] == 12
    assert found['miou'] >= stored['miou'] - NOISE['miou'], hint
    assert found['false_safe'] <= stored['false_safe'] + NOISE['false_safe'], hint
