# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bundled segmenter keeps what the architecture promises of every bundle."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Frame, Prompt
from peace_ros.core.inference import Bundle
from peace_ros.core.segmentation import (
    SegmentationParameters,
    Segmenter,
    Terms,
    create_segmenter,
    load_terms,
)
from peace_ros.core.segmentation.fusion import calibrated

PROMPT = Prompt('A rendered image of {term} in spring.', 0)
PARAMETERS = SegmentationParameters(threads=1)


def make(terms: Terms) -> Segmenter:
    return create_segmenter(PARAMETERS, terms=terms)


@pytest.fixture(scope='module')
def segmenter() -> Segmenter:
    return make(load_terms())


@pytest.fixture(scope='module')
def scene() -> Frame:
    """Blotches of green and grey, so that the maps have something to tell apart."""
    rng = np.random.default_rng(3)
    coarse = rng.integers(40, 200, (6, 6, 3), np.uint8)
    return Frame(np.kron(coarse, np.ones((60, 60, 1), np.uint8)).astype(np.uint8), 11)


def test_it_knows_every_shipped_term(segmenter: Segmenter) -> None:
    assert not segmenter.unknown_terms


def test_thirteen_terms_cost_one_encoding_and_one_decoding(
    segmenter: Segmenter, scene: Frame
) -> None:
    segmenter.segment(scene, PROMPT)
    before = dict(segmenter.calls)
    heatmap = segmenter.segment(scene, PROMPT)
    spent = {role: calls - before[role] for role, calls in segmenter.calls.items()}
    assert spent == {'image_encoder': 1, 'text_encoder': 0, 'decoder': 1}
    assert heatmap.stamp_ns == scene.stamp_ns
    assert heatmap.safety.std() > 0.0


def test_a_term_reads_the_same_alone_and_among_others(segmenter: Segmenter, scene: Frame) -> None:
    together = segmenter.term_maps(scene, PROMPT)
    for index, term in list(enumerate(segmenter.terms.all))[::6]:
        alone = make(Terms((term,), ())).term_maps(scene, PROMPT)
        np.testing.assert_allclose(alone[0], together[index], atol=1e-3)


def test_the_graph_fuses_as_the_paper_says(segmenter: Segmenter, scene: Frame) -> None:
    maps = segmenter.term_maps(scene, PROMPT)
    count = len(segmenter.terms.positive)
    fused = np.minimum(maps[:count].max(axis=0), 1.0 - maps[count:].max(axis=0))
    threshold = Bundle.load('clipseg-small').manifest.recommended['threshold']
    difference = np.abs(segmenter.segment(scene, PROMPT).safety - calibrated(fused, threshold))
    # The graph fuses before it enlarges the maps, so only edges may differ.
    assert difference.mean() < 0.01
    assert np.quantile(difference, 0.9) < 0.03


@pytest.mark.parametrize('terms', [Terms(('grass',), ()), load_terms('terms_dovesei.yaml')])
def test_other_term_lists_run_too(terms: Terms, scene: Frame) -> None:
    assert np.isfinite(make(terms).segment(scene, PROMPT).safety).all()
