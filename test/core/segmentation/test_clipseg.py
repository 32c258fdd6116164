# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One image encoding and one decoding per frame; heatmaps that can be trusted or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import BundleError, ConfigurationError, Frame, ImageError, Prompt
from peace_ros.core.inference.preprocess import MAX_PIXELS
from peace_ros.core.segmentation import (
    ClipSegParameters,
    ClipSegSegmenter,
    SegmentationParameters,
    Terms,
)

TERMS = Terms(('grass', 'park'), ('road', 'car', 'water'))
SPRING = Prompt('A rendered image of {term} in spring.', 0)
NIGHT = Prompt('A blurred picture of {term} in night.', 0)


def make(
    folder: Path, terms: Terms = TERMS, *, clipseg_max_looks: int = 1, **changes: Any
) -> ClipSegSegmenter:
    parameters = SegmentationParameters(threads=1, **changes)
    return ClipSegSegmenter(folder, terms, parameters, ClipSegParameters(clipseg_max_looks))


def test_a_heatmap_has_the_frames_stamp_and_scores(clipseg_folder: Path, frame: Frame) -> None:
    heatmap = make(clipseg_folder).segment(frame, SPRING)
    assert heatmap.stamp_ns == frame.stamp_ns
    assert heatmap.safety.shape == (8, 10)
    assert heatmap.safety.dtype == np.float32
    assert heatmap.safety.min() >= 0.0
    assert heatmap.safety.max() <= 1.0
    assert heatmap.safety.std() > 0.0


def test_a_frame_costs_one_encoding_and_one_decoding_whatever_the_terms(
    clipseg_folder: Path, frame: Frame
) -> None:
    many = Terms(('grass', 'park', 'lawn', 'field'), ('road', 'car', 'water', 'tree', 'fence'))
    for terms in (Terms(('grass',), ('car',)), many):
        segmenter = make(clipseg_folder, terms)
        assert segmenter.calls == {'image_encoder': 0, 'text_encoder': 0, 'decoder': 0}
        for _ in range(4):
            segmenter.segment(frame, SPRING)
        assert segmenter.calls == {'image_encoder': 4, 'text_encoder': 1, 'decoder': 4}


def test_a_large_frame_costs_one_look_more_than_its_parts(
    clipseg_folder: Path, frame: Frame
) -> None:
    for most, looks, shape in ((10, 10, (24, 30)), (5, 5, (16, 20)), (1, 1, (8, 10))):
        segmenter = make(clipseg_folder, clipseg_max_looks=most)
        heatmap = segmenter.segment(frame, SPRING)
        assert segmenter.calls == {'image_encoder': looks, 'text_encoder': 1, 'decoder': looks}
        assert heatmap.safety.shape == shape
        assert segmenter.term_maps(frame, SPRING).shape == (len(TERMS.all), *shape)


def test_a_new_prompt_is_embedded_once_and_an_old_one_not_again(
    clipseg_folder: Path, frame: Frame
) -> None:
    segmenter = make(clipseg_folder)
    maps = [segmenter.segment(frame, prompt).safety for prompt in (SPRING, NIGHT, SPRING, NIGHT)]
    assert segmenter.calls['text_encoder'] == 2
    np.testing.assert_array_equal(maps[0], maps[2])
    assert not np.allclose(maps[0], maps[1])


def test_a_prepared_prompt_costs_the_frame_no_text(clipseg_folder: Path, frame: Frame) -> None:
    segmenter = make(clipseg_folder)
    segmenter.prepare(NIGHT)
    before = segmenter.calls['text_encoder']
    segmenter.segment(frame, NIGHT)
    assert (before, segmenter.calls['text_encoder']) == (1, 1)


def test_the_second_process_encodes_no_text(
    clipseg_folder: Path, frame: Frame, tmp_path: Path
) -> None:
    cache_dir = str(tmp_path / 'cache')
    first = make(clipseg_folder, cache_dir=cache_dir).segment(frame, SPRING)
    again = make(clipseg_folder, cache_dir=cache_dir)
    np.testing.assert_array_equal(again.segment(frame, SPRING).safety, first.safety)
    assert again.calls['text_encoder'] == 0


@pytest.mark.parametrize(
    ('fusion', 'outputs'),
    [
        ('set_difference', ['positive', 'negative']),
        ('soft', ['positive', 'negative']),
        ('softmax', ['softmax_positive']),
    ],
)
def test_only_the_maps_that_the_fusion_needs_leave_the_graph(
    clipseg_folder: Path, frame: Frame, monkeypatch: pytest.MonkeyPatch, fusion: str, outputs: Any
) -> None:
    segmenter = make(clipseg_folder, fusion=fusion)
    decoder = segmenter._sessions['decoder']
    asked = []
    run = decoder.run

    def watched(names: Any, feeds: Any) -> Any:
        asked.append(list(names))
        return run(names, feeds)

    monkeypatch.setattr(decoder, 'run', watched)
    segmenter.segment(frame, SPRING)
    assert asked == [outputs]


def test_the_heatmap_is_the_union_of_positives_without_the_union_of_negatives(
    clipseg_folder: Path, frame: Frame
) -> None:
    segmenter = make(clipseg_folder)
    maps = segmenter.term_maps(frame, SPRING)
    assert maps.shape == (5, 8, 10)
    assert maps.dtype == np.float32
    expected = np.minimum(maps[:2].max(axis=0), 1.0 - maps[2:].max(axis=0))
    np.testing.assert_allclose(segmenter.segment(frame, SPRING).safety, expected, atol=1e-6)


def test_softmax_sums_the_shares_of_the_positive_terms(clipseg_folder: Path, frame: Frame) -> None:
    segmenter = make(clipseg_folder, fusion='softmax')
    maps = segmenter.term_maps(frame, SPRING).astype(np.float64)
    odds = maps / (1.0 - maps)
    expected = odds[:2].sum(axis=0) / odds.sum(axis=0)
    np.testing.assert_allclose(segmenter.segment(frame, SPRING).safety, expected, atol=1e-4)


def test_a_term_reads_the_same_alone_and_among_others(clipseg_folder: Path, frame: Frame) -> None:
    together = make(clipseg_folder).term_maps(frame, SPRING)
    for index, term in enumerate(TERMS.all):
        alone = make(clipseg_folder, Terms((term,), ())).term_maps(frame, SPRING)
        np.testing.assert_allclose(alone[0], together[index], atol=1e-5)


def test_frames_leave_nothing_behind(clipseg_folder: Path, frame: Frame) -> None:
    segmenter = make(clipseg_folder)
    first = segmenter.segment(frame, SPRING).safety
    kept = first.copy()
    segmenter.segment(Frame(255 - frame.image_rgb, 9), NIGHT)
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(segmenter.segment(frame, SPRING).safety, kept)


def test_terms_the_model_never_learned_are_named(clipseg_folder: Path) -> None:
    segmenter = make(clipseg_folder, Terms(('grass', 'moor'), ('water, lava',)))
    assert segmenter.unknown_terms == {'moor': ('moor',), 'water, lava': ('lava',)}


@pytest.mark.parametrize('poison', [float('nan'), float('inf'), -3.0])
def test_a_network_gone_wrong_gives_no_heatmap(
    tiny: Any, tmp_path: Path, frame: Frame, poison: float
) -> None:
    segmenter = make(tiny.write_bundle(tmp_path / 'sick', 'clipseg', poison=poison))
    with pytest.raises(BundleError, match=r'decoder\.onnx: gave scores from'):
        segmenter.segment(frame, SPRING)


def test_a_hair_beyond_zero_and_one_is_rounding(clipseg_folder: Path) -> None:
    scores = np.array([[-1e-4, 0.5, 1.0 + 1e-4]], np.float32)
    assert make(clipseg_folder)._checked(scores).tolist() == [[0.0, 0.5, 1.0]]


def test_a_huge_image_is_refused(clipseg_folder: Path) -> None:
    huge = np.broadcast_to(np.zeros((1, 1, 3), np.uint8), (MAX_PIXELS // 1000 + 1, 1000, 3))
    with pytest.raises(ImageError, match='at most'):
        make(clipseg_folder).segment(Frame(huge, 0), SPRING)


def test_softmax_without_negatives_is_refused(clipseg_folder: Path) -> None:
    with pytest.raises(ConfigurationError, match='call everything safe'):
        make(clipseg_folder, Terms(('grass',), ()), fusion='softmax')


def test_a_clip_bundle_is_refused(tiny: Any, tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="'clipseg' is needed"):
        make(tiny.write_bundle(tmp_path / 'clip', 'clip'))


@pytest.mark.parametrize(
    ('changes', 'says'),
    [
        ({'fusion': 'mean'}, 'fusion'),
        ({'threads': 0}, 'threads'),
    ],
)
def test_parameters_out_of_bounds_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        SegmentationParameters(**changes)


def test_the_recommended_threshold_of_the_bundle_becomes_one_half(
    tiny: Any, clipseg_folder: Path, frame: Frame
) -> None:
    plain = make(clipseg_folder).segment(frame, SPRING).safety
    threshold = float(np.median(plain))
    tiny.edit_manifest(clipseg_folder, recommended={'threshold': threshold})
    calibrated = make(clipseg_folder).segment(frame, SPRING).safety
    np.testing.assert_array_equal(calibrated > 0.5001, plain > threshold + 1e-4)


@pytest.mark.parametrize('threshold', [0.0, 1.0, -3.0])
def test_a_threshold_that_calls_everything_the_same_is_refused(
    tiny: Any, clipseg_folder: Path, threshold: float
) -> None:
    tiny.edit_manifest(clipseg_folder, recommended={'threshold': threshold})
    with pytest.raises(BundleError, match=r'between 0\.01 and 0\.99'):
        make(clipseg_folder)
