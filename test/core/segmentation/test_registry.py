# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Families are a table, and one without a model says so."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.domain.parameters import describe
from peace_ros.core.inference import Bundle
from peace_ros.core.node_parameters import groups_of, named
from peace_ros.core.segmentation import (
    FAMILIES,
    ClipSegSegmenter,
    SegmentationParameters,
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
