# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every segment is painted with its own scores, and ground that nobody looked at is not safe."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import BundleError, ConfigurationError, Frame, ImageError, Prompt
from peace_ros.core.inference.preprocess import MAX_PIXELS
from peace_ros.core.segmentation import (
    FUSIONS,
    FastSamParameters,
    FastSamSegmenter,
    SegmentationParameters,
    Terms,
    create_segmenter,
)
from peace_ros.core.segmentation.fastsam.letterbox import fitted


def _load_bundles() -> Any:
    path = Path(__file__).with_name('fastsam_bundles.py')
    spec = importlib.util.spec_from_file_location('fastsam_bundles', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules['fastsam_bundles'] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


bundles = _load_bundles()
Patch, SIDE_PX = bundles.Patch, bundles.SIDE_PX
GREEN, RED, BLUE, BLACK = bundles.GREEN, bundles.RED, bundles.BLUE, bundles.BLACK
TERMS = Terms(('grass', 'lawn'), ('building', 'water'))
DAY = Prompt('A photo of {term} in spring.', 0)
NIGHT = Prompt('A photo of {term} in night.', 0)
LEFT, RIGHT, BELOW = Patch(0, 0, 8, 8), Patch(8, 0, 16, 8), Patch(0, 8, 16, 13)
STRIPES = (LEFT, RIGHT, BELOW)
# Two segments side by side, one below both, and at the bottom 3 cells that nothing covers.

Make = Callable[..., FastSamSegmenter]


@pytest.fixture
def make(tiny: Any, tmp_path: Path) -> Make:
    def make_segmenter(
        *patches: Any, terms: Terms = TERMS, bundle: Any = None, **parameters: Any
    ) -> FastSamSegmenter:
        folder = tmp_path / f'bundle{len(list(tmp_path.iterdir()))}'
        bundles.write_fastsam(tiny, folder, patches, **(bundle or {}))
        own = {name: value for name, value in parameters.items() if name.startswith('fastsam_')}
        common = {name: value for name, value in parameters.items() if name not in own}
        settings = SegmentationParameters(threads=1, **common)
        return FastSamSegmenter(folder, terms, settings, FastSamParameters(**own))

    return make_segmenter


def picture(*colours: tuple[int, int, int], size_px: int = SIDE_PX, stamp_ns: int = 5) -> Frame:
    """Paint the STRIPES in their order, and black below."""
    image = np.zeros((16, 16, 3), np.uint8)
    for patch, colour in zip(STRIPES, colours, strict=True):
        image[patch.top : patch.bottom, patch.left : patch.right] = colour
    times = size_px // 16
    return Frame(image.repeat(times, axis=0).repeat(times, axis=1), stamp_ns)


def plain(colour: tuple[int, int, int], *patches: Any, of: tuple[int, int, int] = RED) -> Frame:
    """Paint everything in one colour and patches in another."""
    image = np.full((16, 16, 3), colour, np.uint8)
    for patch in patches:
        image[patch.top : patch.bottom, patch.left : patch.right] = of
    return Frame(image.repeat(4, axis=0).repeat(4, axis=1), 0)


def at(safety: Any, patch: Any) -> Any:
    """Return the scores well inside a patch."""
    return safety[
        4 * patch.top + 2 : 4 * patch.bottom - 2, 4 * patch.left + 2 : 4 * patch.right - 2
    ]


def test_a_heatmap_has_the_frames_stamp_and_scores(make: Make) -> None:
    heatmap = make(*STRIPES).segment(picture(GREEN, RED, GREEN), DAY)
    assert heatmap.stamp_ns == 5
    assert heatmap.safety.shape == (SIDE_PX, SIDE_PX)
    assert heatmap.safety.dtype == np.float32
    assert heatmap.safety.min() >= 0.0
    assert heatmap.safety.max() <= 1.0


@pytest.mark.parametrize('fusion', list(FUSIONS))
def test_every_segment_is_painted_not_only_the_best(make: Make, fusion: str) -> None:
    # One green word only: with two of the same colour each would get half.
    terms = Terms(('grass',), ('building', 'water'))
    segmenter = make(*STRIPES, terms=terms, fusion=fusion)
    safety = segmenter.segment(picture(GREEN, RED, GREEN), DAY).safety
    assert at(safety, LEFT).min() > 0.9
    assert at(safety, BELOW).min() > 0.9
    assert at(safety, RIGHT).max() < 0.1


def test_ground_that_no_segment_covers_is_not_safe(make: Make) -> None:
    safety = make(*STRIPES).segment(plain(GREEN), DAY).safety
    assert (safety[13 * 4 :] == 0.0).all()
    for patch in STRIPES:
        assert (at(safety, patch) > 0.0).all()


def test_a_frame_without_segments_is_nowhere_safe_and_costs_no_clip(make: Make) -> None:
    segmenter = make()
    heatmap = segmenter.segment(plain(GREEN), DAY)
    assert heatmap.safety.shape == (SIDE_PX, SIDE_PX)
    assert not heatmap.safety.any()
    assert not segmenter.term_maps(plain(GREEN), DAY).any()
    assert segmenter.calls['image_encoder'] == 0


def test_a_frame_costs_one_call_of_each_whatever_the_segments_and_terms(make: Make) -> None:
    many = Terms(('grass', 'lawn'), ('building', 'water', 'night'))
    for terms, patches in ((Terms(('grass',), ('water',)), STRIPES[:1]), (many, STRIPES)):
        segmenter = make(*patches, terms=terms)
        assert segmenter.calls == {'segmenter': 0, 'image_encoder': 0, 'text_encoder': 0}
        for _ in range(4):
            segmenter.segment(picture(GREEN, RED, BLUE), DAY)
        assert segmenter.calls == {'segmenter': 4, 'image_encoder': 4, 'text_encoder': 1}


def test_a_prepared_prompt_costs_the_frame_no_text(make: Make) -> None:
    segmenter = make(*STRIPES)
    segmenter.prepare(NIGHT)
    before = segmenter.calls['text_encoder']
    segmenter.segment(picture(GREEN, RED, BLUE), NIGHT)
    assert (before, segmenter.calls['text_encoder']) == (1, 1)


def test_another_prompt_gives_another_heatmap(make: Make) -> None:
    segmenter = make(*STRIPES)
    frame = picture(GREEN, RED, BLUE)
    maps = [segmenter.segment(frame, prompt).safety for prompt in (DAY, NIGHT, DAY)]
    np.testing.assert_array_equal(maps[0], maps[2])
    assert not np.allclose(maps[0], maps[1])


def test_the_second_process_encodes_no_text(make: Make, tiny: Any, tmp_path: Path) -> None:
    folder = bundles.write_fastsam(tiny, tmp_path / 'shared', STRIPES)
    parameters = SegmentationParameters(
        family='fastsam', threads=1, cache_dir=str(tmp_path / 'cache')
    )
    for calls in (1, 0):
        segmenter = create_segmenter(parameters, bundle=folder, terms=TERMS)
        segmenter.segment(picture(GREEN, RED, BLUE), DAY)
        assert segmenter.calls['text_encoder'] == calls


def test_surroundings_do_not_reach_clip(make: Make) -> None:
    ring = Patch(4, 4, 12, 12)
    segmenter = make(ring)
    frames = [plain(colour, ring, of=GREEN) for colour in (GREEN, RED, BLACK)]
    shares = [segmenter.term_maps(frame, DAY)[:, 32, 32] for frame in frames]
    np.testing.assert_allclose(shares[1], shares[0], atol=0.02)
    np.testing.assert_allclose(shares[2], shares[0], atol=0.02)


def test_a_mask_inside_its_box_hides_the_rest_of_the_box(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A box around everything, the mask of which is only its left half.
    segmenter = make(LEFT)
    crops = []
    encoder = segmenter._sessions['image_encoder']
    run = encoder.run

    def watched(names: Any, feeds: Any) -> Any:
        crops.append(feeds['pixel_values'].copy())
        return run(names, feeds)

    monkeypatch.setattr(encoder, 'run', watched)
    original = segmenter._find

    def widened(frame: Frame) -> Any:
        selection, place = original(frame)
        (segment,) = selection.scored
        mask = np.zeros((SIDE_PX, SIDE_PX), bool)
        mask[:, :32] = True
        object.__setattr__(segment, 'mask', mask)
        return selection, place

    monkeypatch.setattr(segmenter, '_find', widened)
    segmenter.segment(plain(RED, Patch(0, 0, 8, 16), of=GREEN), DAY)
    (batch,) = crops
    assert batch.shape == (1, 3, bundles.CROP_PX, bundles.CROP_PX)
    assert not batch[..., 8:].any()
    assert (batch[:, 1, :, :7] > 1.0).all()
    assert (batch[:, 0, :, :7] < 0.0).all()


def test_a_hazard_on_a_lawn_is_not_safe(make: Make) -> None:
    lawn, hazard = Patch(0, 0, 16, 16), Patch(6, 6, 10, 10)
    frame = plain(GREEN, hazard)
    for overlap in ('least_safe', 'smallest'):
        for patches in ((lawn, hazard), (hazard, lawn)):
            safety = make(*patches, fastsam_overlap=overlap).segment(frame, DAY).safety
            assert at(safety, hazard).max() < 0.1
            assert safety[4:20, 4:60].min() > 0.4


def test_a_piece_of_a_roof_that_looks_like_grass_is_as_unsafe_as_the_roof(make: Make) -> None:
    roof, piece = Patch(0, 0, 16, 16), Patch(6, 6, 10, 10)
    frame = plain(RED, piece, of=GREEN)
    cautious = make(roof, piece).segment(frame, DAY).safety
    assert at(cautious, piece).max() < 0.1
    detailed = make(roof, piece, fastsam_overlap='smallest').segment(frame, DAY).safety
    assert at(detailed, piece).min() > 0.4


def test_under_a_segment_too_small_to_be_told_the_ground_is_unknown(make: Make) -> None:
    lawn, speck = Patch(0, 0, 16, 16), Patch(6, 6, 8, 8)
    segmenter = make(lawn, speck, fastsam_min_area=0.05)
    safety = segmenter.segment(plain(GREEN), DAY).safety
    assert (at(safety, speck) == 0.0).all()
    assert at(safety, LEFT)[:16].min() > 0.4
    assert len(segmenter.segments(plain(GREEN)).scored) == 1


def test_beyond_the_cap_the_largest_are_scored_and_the_rest_is_unknown(make: Make) -> None:
    tiles = [Patch(4 * x, 4 * y, 4 * x + 4, 4 * y + 4) for x in range(4) for y in range(2)]
    large = Patch(0, 8, 16, 16, confidence=0.5)
    segmenter = make(*tiles, large, fastsam_max_segments=3)
    safety = segmenter.segment(plain(GREEN), DAY).safety
    assert len(segmenter.segments(plain(GREEN)).scored) == 3
    assert at(safety, large).min() > 0.4
    known = [at(safety, tile).min() > 0.4 for tile in tiles]
    assert sum(known) == 2
    assert all(
        (at(safety, tile) == 0.0).all()
        for tile, is_known in zip(tiles, known, strict=True)
        if not is_known
    )


def test_a_segment_beyond_the_cap_is_unknown_even_on_a_scored_lawn(make: Make) -> None:
    lawn, bush, stone = Patch(0, 0, 16, 16), Patch(1, 1, 7, 7), Patch(9, 9, 13, 13)
    safety = make(lawn, bush, stone, fastsam_max_segments=2).segment(plain(GREEN), DAY).safety
    assert at(safety, bush).min() > 0.4
    assert (at(safety, stone) == 0.0).all()
    assert safety[34:60, 4:28].min() > 0.4


def test_an_unstable_segment_is_noise(make: Make) -> None:
    faint = Patch(0, 0, 16, 16, logit=0.3)
    safety = make(LEFT, faint).segment(plain(GREEN), DAY).safety
    assert at(safety, LEFT).min() > 0.4
    assert (at(safety, RIGHT) == 0.0).all()
    known = make(LEFT, faint, fastsam_min_stability=0.0).segment(plain(GREEN), DAY).safety
    assert at(known, RIGHT).min() > 0.4


def test_segments_that_are_not_sure_do_not_count(make: Make) -> None:
    safety = make(LEFT, Patch(8, 0, 16, 8, confidence=0.35)).segment(plain(GREEN), DAY).safety
    assert (at(safety, RIGHT) == 0.0).all()


@pytest.mark.parametrize('size', [(64, 128), (128, 64), (32, 64), (300, 128)])
def test_the_heatmap_covers_the_frame_and_not_the_borders(
    make: Make, size: tuple[int, int]
) -> None:
    width, height = size
    image = np.full((height, width, 3), RED, np.uint8)
    image[:, width // 2 :] = GREEN
    place = fitted(width, height, make()._manifest.input)
    ends = (place.left_px + place.width_px, place.top_px + place.height_px)
    cells = [each / 4 for each in (place.left_px, place.top_px, *ends)]
    middle = round((cells[0] + cells[2]) / 2)
    top, bottom = int(cells[1]), round(cells[3] + 0.49)
    whole = (Patch(0, top, middle, bottom), Patch(middle, top, 16, bottom))
    safety = make(*whole).segment(Frame(image, 0), DAY).safety
    assert safety.shape == (place.height_px, place.width_px)
    assert max(safety.shape) == SIDE_PX
    assert safety[:, : safety.shape[1] // 2 - 4].max() < 0.1
    assert safety[2:-2, safety.shape[1] // 2 + 4 : -2].min() > 0.4


def test_the_heatmap_is_the_fusion_of_the_term_maps(make: Make) -> None:
    patches = (*STRIPES, Patch(4, 4, 12, 12, confidence=0.6))
    frame = picture(GREEN, RED, BLUE)
    for fusion in FUSIONS:
        segmenter = make(*patches, fusion=fusion)
        maps = segmenter.term_maps(frame, DAY)
        assert maps.shape == (4, SIDE_PX, SIDE_PX)
        assert maps.dtype == np.float32
        positive, negative = maps[:2].max(axis=0), maps[2:].max(axis=0)
        expected = {
            'set_difference': np.minimum(positive, 1.0 - negative),
            'soft': positive * (1.0 - negative),
            'softmax': maps[:2].sum(axis=0),
        }[fusion]
        np.testing.assert_allclose(segmenter.segment(frame, DAY).safety, expected, atol=1e-6)
        covered = maps.sum(axis=0)
        np.testing.assert_allclose(covered[covered > 0.0], 1.0, atol=1e-5)


def test_the_logit_scale_of_the_bundle_sharpens_the_scores(make: Make) -> None:
    frame = plain((120, 130, 120))
    mild = make(LEFT, bundle={'logit_scale': 1.0}).segment(frame, DAY).safety
    sharp = make(LEFT, bundle={'logit_scale': None}).segment(frame, DAY).safety
    assert at(mild, LEFT).max() < at(sharp, LEFT).min()


def test_frames_leave_nothing_behind(make: Make) -> None:
    segmenter = make(*STRIPES)
    first = segmenter.segment(picture(GREEN, RED, GREEN), DAY).safety
    kept = first.copy()
    segmenter.segment(picture(RED, BLUE, RED), NIGHT)
    np.testing.assert_array_equal(first, kept)
    again = segmenter.segment(picture(GREEN, RED, GREEN), DAY).safety
    np.testing.assert_array_equal(again, kept)


def test_a_cut_out_segment_leaves_nothing_for_the_next_frame(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    tall, wide = (make(Patch(*corners)) for corners in ((6, 0, 10, 16), (0, 6, 16, 10)))
    alone = wide.term_maps(plain(GREEN), DAY)
    monkeypatch.setattr(wide, '_cutter', tall._cutter)
    tall.segment(plain(RED), DAY)
    np.testing.assert_array_equal(wide.term_maps(plain(GREEN), DAY), alone)


def test_more_pixels_show_the_same(make: Make) -> None:
    segmenter = make(*STRIPES)
    small, large = (
        segmenter.segment(picture(GREEN, RED, BLUE, size_px=size), DAY).safety for size in (64, 640)
    )
    np.testing.assert_allclose(small, large, atol=0.02)


@pytest.mark.parametrize('bundle', [{'poison': float('nan')}, {'poisoned_crops': float('inf')}])
def test_a_network_gone_wrong_gives_no_heatmap(make: Make, bundle: dict[str, float]) -> None:
    with pytest.raises(BundleError, match='the frame gets no heatmap'):
        make(*STRIPES, bundle=bundle).segment(plain(GREEN), DAY)


def test_a_huge_image_is_refused(make: Make) -> None:
    huge = np.broadcast_to(np.zeros((1, 1, 3), np.uint8), (MAX_PIXELS // 1000 + 1, 1000, 3))
    with pytest.raises(ImageError, match='at most'):
        make(*STRIPES).segment(Frame(huge, 0), DAY)


def test_positive_terms_alone_are_refused(make: Make) -> None:
    with pytest.raises(ConfigurationError, match='would call every segment safe'):
        make(*STRIPES, terms=Terms(('grass',), ()))


def test_terms_the_model_never_learned_are_named(make: Make) -> None:
    segmenter = make(*STRIPES, terms=Terms(('grass', 'moor'), ('water',)))
    assert segmenter.unknown_terms == {'moor': ('moor',)}


def test_a_term_without_a_direction_gives_no_heatmap(make: Make) -> None:
    segmenter = make(*STRIPES, terms=Terms(('grass',), ('road',)))
    with pytest.raises(BundleError, match='text embedding of length zero'):
        segmenter.segment(plain(GREEN), DAY)


@pytest.mark.parametrize(
    ('bundle', 'says'),
    [
        ({'batch': 1}, r'pixel_values tensor\(float\) \[1, 3, 16, 16\] must be .*\[B, 3, 16, 16\]'),
        ({'rows': 2}, r'predictions tensor\(float\) \[1, 10, 8\] must be .*\[1, 8, \?\]'),
        ({'cells': 15}, r'which cannot be used'),
        ({'family': 'clip'}, 'unknown to family clip'),
        ({'crop_input': None}, "crop_input is 'nothing'"),
        ({'logit_scale': -1.0}, 'logit_scale is -1.0; give a positive number'),
        ({'logit_scale': '100'}, "logit_scale is '100'; give a positive number"),
    ],
)
def test_a_bundle_that_breaks_the_contract_is_refused(
    make: Make, bundle: dict[str, Any], says: str
) -> None:
    with pytest.raises(BundleError, match=says):
        make(*STRIPES, bundle=bundle)


def test_a_bundle_of_another_family_is_refused(clipseg_folder: Path) -> None:
    with pytest.raises(BundleError, match="'fastsam' is needed"):
        create_segmenter(SegmentationParameters(family='fastsam'), bundle=clipseg_folder)
