# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Families are a table, and one without a model says so."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import BundleError, ConfigurationError, Frame, Heatmap, Prompt
from peace_ros.core.domain.parameters import ParameterSet, describe, parameter
from peace_ros.core.inference import Bundle
from peace_ros.core.node_parameters import groups_of, named
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.presets import Preset, load_preset
from peace_ros.core.segmentation import (
    FAMILIES,
    ClipSegSegmenter,
    Family,
    SegmentationParameters,
    Segmenter,
    Terms,
    create_segmenter,
)

TERMS = Terms(('grass',), ('car',))
PARAMETERS = SegmentationParameters(threads=1)


def test_clipseg_is_made_from_a_bundle_or_its_folder(clipseg_folder: Path) -> None:
    for bundle in (Bundle.load(clipseg_folder), clipseg_folder, str(clipseg_folder)):
        segmenter = create_segmenter(PARAMETERS, bundle=bundle, terms=TERMS)
        assert isinstance(segmenter, ClipSegSegmenter)
        assert segmenter.terms is TERMS


def test_an_unknown_family_lists_the_known_ones() -> None:
    with pytest.raises(ConfigurationError, match="'sam2' is unknown: choose one of clipseg"):
        create_segmenter(SegmentationParameters(family='sam2'))


def test_a_missing_bundle_is_refused() -> None:
    with pytest.raises(BundleError, match='no model bundle'):
        create_segmenter(SegmentationParameters(bundle='nowhere-to-be-found'))


def test_words_that_the_model_does_not_know_are_told(clipseg_folder: Path, caplog) -> None:
    create_segmenter(PARAMETERS, bundle=clipseg_folder, terms=Terms(('moor',), ('car',)))
    (record,) = [each for each in caplog.records if each.levelname == 'WARNING']
    assert "'moor': the model has never learned moor" in record.message


def test_each_family_has_its_own_parameters_and_only_the_common_ones_are_shared() -> None:
    common = {each.name for each in describe(SegmentationParameters)}
    own = [{each.name for each in describe(family.parameters)} for family in FAMILIES.values()]
    assert all(own)
    for one, other in combinations([common, *own], 2):
        assert not one & other
    known = named(groups_of('segmentation'))
    assert all(name in known for names in (common, *own) for name in names)


@dataclass(frozen=True)
class GreenParameters(ParameterSet):
    green_gain: float = parameter(4.0, 'Score per share of green', low=0.1, high=100.0)


class GreenSegmenter(Segmenter):
    """Needs what is to be looked for, and to segment; all else it inherits."""

    def __init__(self, bundle: Any, terms: Terms, parameters: Any, own: GreenParameters) -> None:
        self.terms, self.own = terms, own

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        safety = self.own.green_gain * frame.image_rgb[..., 1].astype(np.float32) / 255.0
        return Heatmap(np.clip(safety, 0.0, 1.0), frame.stamp_ns)


@pytest.fixture
def green(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FAMILIES, 'green', Family(GreenSegmenter, GreenParameters))


def preset(folder: Path, values: str) -> Preset:
    path = folder / 'green.yaml'
    path.write_text(f'segmentation: {{ros__parameters: {{family: green, template: DD, {values}}}}}')
    return load_preset(path)


@pytest.mark.usefixtures('green')
def test_one_entry_makes_a_family_known_to_parameter_files_and_pipeline(tmp_path: Path) -> None:
    pipeline = Pipeline.from_preset(preset(tmp_path, 'green_gain: 2'), threads=1)
    image = np.zeros((4, 6, 3), np.uint8)
    image[..., 1] = np.arange(6) * 10
    heatmap = pipeline.heatmap(Frame(image, 3), Prompt('{term}', 3))
    assert heatmap.safety[0, 5] == pytest.approx(2 * 50 / 255)
    assert (pipeline.segmenter.unknown_terms, pipeline.segmenter.calls) == ({}, {})
    assert pipeline.segmenter.threshold == 0.5
    with pytest.raises(ConfigurationError, match='GreenSegmenter does not score each term'):
        pipeline.segmenter.term_maps(Frame(image, 3), Prompt('{term}', 3))


@pytest.mark.usefixtures('green')
@pytest.mark.parametrize(
    ('values', 'says'),
    [('green_gian: 2.0', 'did you mean green_gain'), ('green_gain: 0.0', 'green_gain = 0.0')],
)
def test_its_parameters_are_checked_as_all_others(tmp_path: Path, values: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        preset(tmp_path, values)
