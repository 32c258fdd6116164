# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace ablate`` compares prompts fairly: same frames, one encoding, the nodes' own scores."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from peace_ros.cli.main import app
from peace_ros.core.domain import ConfigurationError
from peace_ros.core.segmentation import FUSIONS
from peace_ros.lab.evaluation.ablation.figures import ablation_figures
from peace_ros.lab.evaluation.ablation.run import Counted, ablate
from peace_ros.lab.evaluation.ablation.table import BEGIN, END, markdown, put_into
from peace_ros.lab.evaluation.ablation.variants import DEFAULT, VOCABULARY, default_variants
from peace_ros.lab.evaluation.segmentation.cores import Cores, Overrides, build_cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.inputs import EvaluationInputs, open_source
from peace_ros.lab.evaluation.segmentation.run import evaluate
from peace_ros.lab.evaluation.segmentation.samples import Pair, Sample

FRAMES = 3


@pytest.fixture(scope='module')
def peace_cs() -> Cores:
    cores = build_cores('peace_cs', Overrides(threads=1))
    assert isinstance(cores, Cores)
    return cores


@dataclass(frozen=True)
class _Covered:
    """A sample whose picture was taken with the lens covered."""

    sample: Sample

    @property
    def name(self) -> str:
        return self.sample.name

    def load(self) -> Pair:
        image, labels = self.sample.load()
        return np.full_like(image, 90), labels


@pytest.fixture(scope='module')
def counted(peace_cs: Cores) -> Counted:
    return ablate(open_source(EvaluationInputs(drawn=FRAMES)), peace_cs, default_variants(2))


def test_each_look_is_encoded_once_for_all_variants(counted: Counted, peace_cs: Cores) -> None:
    before = peace_cs.segmenter.calls['image_encoder']
    evaluate(open_source(EvaluationInputs(drawn=FRAMES)), [peace_cs], score_terms=False)
    looks = peace_cs.segmenter.calls['image_encoder'] - before
    assert counted.image_encodings == looks > FRAMES
    assert len(counted.counts) == len(default_variants(2)) * len(FUSIONS)


def test_the_default_does_what_the_nodes_do(counted: Counted, peace_cs: Cores) -> None:
    outcome = evaluate(open_source(EvaluationInputs(drawn=FRAMES)), [peace_cs], score_terms=False)
    nodes = np.stack(outcome.tallies['peace_cs'].counts)
    assert np.array_equal(counted.counts[VOCABULARY, DEFAULT, 'set_difference'], nodes)


def test_the_static_templates_do_what_their_presets_do(counted: Counted) -> None:
    for name in ('DD', 'D'):
        cores = build_cores(f'{name.lower()}_cs', Overrides(threads=1))
        assert isinstance(cores, Cores)
        outcome = evaluate(open_source(EvaluationInputs(drawn=FRAMES)), [cores], score_terms=False)
        nodes = np.stack(outcome.tallies[cores.name].counts)
        assert np.array_equal(counted.counts['template', name, 'set_difference'], nodes)


def test_figures_hold_a_row_for_each_and_no_difference_of_the_default(
    counted: Counted, peace_cs: Cores
) -> None:
    figures = ablation_figures(counted, peace_cs)
    assert len(figures['variants']) == len(counted.counts)
    (default,) = [row for row in figures['variants'] if row['is_default']]
    assert default['difference'] == 0.0
    assert default['difference_interval'] == [0.0, 0.0]
    assert all(row['best_miou'] >= row['miou'] for row in figures['variants'])
    (in_use,) = [row for row in figures['thresholds'] if row['is_default']]
    assert in_use['threshold'] == pytest.approx(peace_cs.standing, abs=1e-3)
    assert in_use['miou'] == default['miou']


def test_the_tables_name_every_variant_and_mark_the_default(
    counted: Counted, peace_cs: Cores
) -> None:
    text = markdown(ablation_figures(counted, peace_cs), 'drawn')
    for variant in default_variants(2):
        assert f'| {variant.name} |' in text or f'| **{variant.name}** |' in text
    for fusion in FUSIONS:
        assert fusion in text
    assert text.count('| **') >= 5


def test_a_document_keeps_what_stands_around_its_marks(tmp_path: Path) -> None:
    document = tmp_path / 'a.md'
    document.write_text(f'before\n{BEGIN}\nold\n{END}\nafter\n')
    put_into(document, 'new')
    assert document.read_text() == f'before\n{BEGIN}\n\nnew\n{END}\nafter\n'
    document.write_text('no marks')
    with pytest.raises(ConfigurationError, match='has no lines'):
        put_into(document, 'new')


def test_other_families_are_refused(peace_cs: Cores) -> None:
    other = replace(peace_cs, segmentation=replace(peace_cs.segmentation, family='fastsam'))
    with pytest.raises(ConfigurationError, match='choose a preset of that family'):
        ablate(open_source(EvaluationInputs(drawn=1)), other, default_variants(1))


def test_pictures_of_a_covered_lens_are_left_out_as_in_an_evaluation(peace_cs: Cores) -> None:
    source = open_source(EvaluationInputs(drawn=2))
    seen = source.samples[1]
    covered = replace(source, samples=(_Covered(source.samples[0]), seen))
    counted = ablate(covered, peace_cs, default_variants(1))
    assert counted.frames == (seen.name,)
    (left_out,) = counted.skipped
    assert 'of one colour' in left_out.reason
    with pytest.raises(DatasetError, match=r'of one colour .* \(--strict\)'):
        ablate(covered, peace_cs, default_variants(1), strict=True)
    with pytest.raises(DatasetError, match='no image could be scored'):
        ablate(replace(covered, samples=covered.samples[:1]), peace_cs, default_variants(1))


def test_the_command_writes_json_and_tables(tmp_path: Path) -> None:
    file, table = tmp_path / 'a.json', tmp_path / 'a.md'
    options = ['ablate', '--drawn', '1', '--threads', '1', '--most-words', '1']
    options += ['--template', 'Ground: {term}.', '--json', str(file), '--table', str(table)]
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 0, result.output
    names = {row['variant'] for row in json.loads(file.read_text())['variants']}
    assert 'Ground: {term}.' in names
    assert '| Fusion |' in table.read_text()
    refused = CliRunner().invoke(app, ['ablate', '--drawn', '1', '--template', 'no term'])
    assert refused.exit_code == 2
    assert 'lacks {term}' in refused.output
