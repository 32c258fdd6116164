# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Families are a table, and one without a model says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference import Bundle
from peace_ros.core.segmentation import (
    FACTORIES,
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
        segmenter = create_segmenter('clipseg', bundle, TERMS, PARAMETERS)
        assert isinstance(segmenter, ClipSegSegmenter)
        assert segmenter.terms is TERMS


def test_an_unknown_family_lists_the_known_ones() -> None:
    with pytest.raises(ConfigurationError, match="'sam2' is unknown: choose one of clipseg"):
        create_segmenter('sam2', 'x', TERMS, PARAMETERS)


def test_a_missing_bundle_is_refused() -> None:
    with pytest.raises(BundleError, match='no model bundle'):
        create_segmenter('clipseg', 'nowhere-to-be-found', TERMS, PARAMETERS)


def test_the_parameter_offers_exactly_the_families_of_the_table() -> None:
    assert tuple(FACTORIES) == FAMILIES
