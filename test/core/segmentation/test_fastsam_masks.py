# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes and masks are those that ultralytics makes of the same tensors (see make_reference.py)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.segmentation.fastsam.letterbox import Letterbox, Placement, fitted
from peace_ros.core.segmentation.fastsam.masks import Detections, Segment, assemble, detect

REFERENCE = Path(__file__).parents[2] / 'data' / 'fastsam' / 'reference.npz'
SIDE_PX, CELL_PX = 160, 4
WHOLE = Placement(0, 0, SIDE_PX, SIDE_PX)
SPEC = InputSpec(SIDE_PX, SIDE_PX, 'letterbox', (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
CASES = ('square', 'wide', 'drawn')


@pytest.fixture(scope='module')
def reference() -> dict[str, Any]:
    with np.load(REFERENCE, allow_pickle=False) as file:
        return dict(file)


def found(reference: dict[str, Any], case: str) -> Detections:
    confidence, overlap = reference[f'{case}/limits'].tolist()
    return detect(reference[f'{case}/predictions'], min_confidence=confidence, max_overlap=overlap)


def full(segment: Segment) -> Any:
    mask = np.zeros((SIDE_PX, SIDE_PX), bool)
    mask[segment.slices] = segment.mask
    return mask


@pytest.mark.parametrize('case', CASES)
def test_the_boxes_that_stay_are_those_of_the_reference(
    reference: dict[str, Any], case: str
) -> None:
    detections = found(reference, case)
    candidates = int((reference[f'{case}/predictions'][4] > 0.4).sum())
    assert 15 < len(detections.boxes) < candidates
    np.testing.assert_allclose(detections.boxes, reference[f'{case}/boxes'], atol=1e-4)
    np.testing.assert_array_equal(detections.confidences, reference[f'{case}/confidences'])


@pytest.mark.parametrize('case', CASES)
def test_every_mask_is_that_of_the_reference(reference: dict[str, Any], case: str) -> None:
    prototypes = reference[f'{case}/prototypes'].astype(np.float32)
    ours = iter(assemble(found(reference, case), prototypes, CELL_PX, WHOLE))
    packed = reference[f'{case}/masks']
    compared = 0
    for theirs in np.unpackbits(packed).reshape(-1, SIDE_PX, SIDE_PX).astype(bool):
        if not theirs.any():
            continue  # a segment without a pixel is none, here and in the reference's results
        mask = full(next(ours))
        union = np.count_nonzero(mask | theirs)
        assert np.count_nonzero(mask & theirs) / union >= 0.99
        compared += 1
    assert next(ours, None) is None
    assert compared > 15


@pytest.mark.parametrize('case', ['square', 'wide', 'tall'])
def test_the_letterbox_is_that_of_the_reference(reference: dict[str, Any], case: str) -> None:
    pixels, place = Letterbox(SPEC)(reference[f'{case}/frame'])
    expected = reference[f'{case}/letterboxed'].astype(np.float32).transpose(2, 0, 1)[None] / 255
    np.testing.assert_allclose(pixels, expected, atol=1e-3)
    height, width = reference[f'{case}/frame'].shape[:2]
    assert place.width_px / place.height_px == pytest.approx(width / height, rel=0.02)


def test_masks_end_where_the_frame_ends(reference: dict[str, Any]) -> None:
    place = fitted(130, 93, SPEC)
    prototypes = reference['wide/prototypes'].astype(np.float32)
    detections = found(reference, 'wide')
    whole = {each.confidence: each for each in assemble(detections, prototypes, CELL_PX, WHOLE)}
    inside = assemble(detections, prototypes, CELL_PX, place)
    assert inside
    for segment in inside:
        within = full(whole[segment.confidence])[place.slices]
        part = within[segment.slices]
        np.testing.assert_array_equal(part, segment.mask)
        assert segment.area_px == np.count_nonzero(within)


@pytest.mark.parametrize(('width', 'height'), [(1, 3000), (3000, 1), (1, 1), (161, 159)])
def test_any_frame_finds_its_place(width: int, height: int) -> None:
    place = fitted(width, height, SPEC)
    assert place.left_px >= 0
    assert place.top_px >= 0
    assert place.width_px >= 1
    assert place.height_px >= 1
    assert place.left_px + place.width_px <= SIDE_PX
    assert place.top_px + place.height_px <= SIDE_PX


def test_nothing_sure_is_nothing_found() -> None:
    predictions = np.tile(np.float32([[50, 50, 20, 20, 0.3, 1]]).T, 9)
    detections = detect(predictions, min_confidence=0.4, max_overlap=0.9)
    assert detections.boxes.shape == (0, 4)
    assert assemble(detections, np.ones((1, 40, 40), np.float32), CELL_PX, WHOLE) == []


def test_boxes_without_area_are_no_segments() -> None:
    predictions = np.float32([[50, 50, 20, 0, 0.9, 1], [50, 50, -8, 20, 0.9, 1]]).T
    assert len(detect(predictions, min_confidence=0.4, max_overlap=0.9).boxes) == 0


def test_a_mask_that_fades_slowly_is_less_stable_than_one_with_an_edge() -> None:
    detections = Detections(
        np.float32([[0, 0, 160, 160]] * 2), np.float32([0.9, 0.8]), np.eye(2, dtype=np.float32)
    )
    ramp = np.tile(np.linspace(-3.0, 3.0, 40, dtype=np.float32), (40, 1))
    faint, sharp = assemble(detections, np.stack([ramp, np.sign(ramp) * 9]), CELL_PX, WHOLE)
    assert faint.stability == pytest.approx(0.5, abs=0.03)
    assert sharp.stability > 0.95
