# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The choice of a site: clearance first, then near ones, and it stays chosen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing import SAFETY_THRESHOLD_FLOOR, Focus, LandingParameters, VerdictKind
from peace_ros.core.landing.memory import FailedPlace
from peace_ros.core.landing.sites import (
    Search,
    clearance,
    confidence,
    find_site,
    safe_ground,
    shapes,
)
from peace_ros.core.mapping import MapLayers

P = LandingParameters()
CELLS = 200
SEARCH = Search(
    pose=Pose(0, 0.0, 0.0, -80.0, (1.0, 0.0, 0.0, 0.0), 80.0),
    focus=Focus(0.0, 0.0, 100.0),
    threshold=0.8,
    required_clearance_m=3.0,
    age_limit_s=10.0,
)


def layers_with(*discs: tuple[float, float, float], score: float = 0.95) -> MapLayers:
    """100 x 100 m of unsafe ground with safe discs (north, east, radius)."""
    layers = MapLayers(
        np.full((CELLS, CELLS), 0.05, np.float32),
        np.zeros((CELLS, CELLS), np.float32),
        np.full((CELLS, CELLS), 9, np.uint16),
        0.5,
        -50.0,
        -50.0,
        np.full((CELLS, CELLS), np.inf, np.float32),
    )
    for disc in discs:
        layers.score[layers.disc(*disc)] = score
    return layers


def test_finds_the_middle_of_the_only_safe_ground():
    verdict = find_site(layers_with((20.0, -10.0, 8.0)), SEARCH, P)
    assert verdict.kind is VerdictKind.SITE
    site = verdict.site
    assert (site.north_m, site.east_m) == pytest.approx((20.0, -10.0), abs=2.0)
    assert site.clearance_m == pytest.approx(8.0, abs=1.5)
    assert site.area_m2 == pytest.approx(np.pi * 64.0, rel=0.15)
    assert site.confidence > 0.9


def test_clearance_reaches_to_unknown_ground_and_to_the_edge_of_the_map():
    known = np.ones((21, 41), dtype=bool)
    assert clearance(known, 0.5)[10, 20] == pytest.approx(5.15, abs=0.01)
    known[10, 24] = False
    assert clearance(known, 0.5)[10, 20] == pytest.approx(1.65, abs=0.01)


@pytest.mark.parametrize(
    'change',
    [
        {'score': np.full((CELLS, CELLS), 0.7, np.float32)},
        {'age_s': np.full((CELLS, CELLS), 11.0, np.float32)},
        {'looks': np.full((CELLS, CELLS), 2, np.uint16)},
        {'looks': np.zeros((CELLS, CELLS), np.uint16)},
    ],
    ids=['unsure', 'old', 'few looks', 'unknown'],
)
def test_no_zone_where_ground_is_not_surely_safe(change):
    layers = replace(layers_with((0.0, 0.0, 20.0)), **change)
    verdict = find_site(layers, SEARCH, P)
    assert verdict.kind is VerdictKind.NO_ZONE
    assert verdict.site is None
    assert verdict.reason


@given(threshold=st.floats(-1.0, 1.0), score=st.floats(0.0, SAFETY_THRESHOLD_FLOOR - 0.01))
def test_no_threshold_makes_ground_below_the_floor_safe(threshold, score):
    layers = layers_with((0.0, 0.0, 20.0), score=np.float32(score))
    assert not safe_ground(layers, threshold, 10.0, 2).any()


def test_a_single_unsafe_cell_is_an_obstacle_but_a_doubtful_one_is_not():
    layers = layers_with((0.0, 0.0, 15.0))
    layers.score[100, 100] = 0.7
    assert find_site(layers, SEARCH, P).site.clearance_m > 11.0
    layers.score[100, 100] = 0.3
    site = find_site(layers, SEARCH, P).site
    assert np.hypot(site.north_m, site.east_m) > site.clearance_m - 1.0


def test_says_how_much_clearance_is_missing():
    verdict = find_site(layers_with((0.0, 0.0, 2.5)), SEARCH, P)
    assert verdict.kind is VerdictKind.NO_ZONE
    assert 'too narrow by ' in verdict.reason
    assert '3.0 m are needed' in verdict.reason


def test_prefers_wide_to_near_and_near_to_far():
    wide_far = find_site(layers_with((0.0, 0.0, 4.5), (35.0, 0.0, 9.0)), SEARCH, P).site
    assert wide_far.north_m > 25.0
    near = find_site(layers_with((-12.0, 0.0, 9.0), (35.0, 0.0, 9.0)), SEARCH, P).site
    assert near.north_m < 0.0


def test_takes_the_small_one_when_there_is_no_wide_one():
    site = find_site(layers_with((5.0, 0.0, 4.5)), SEARCH, P).site
    assert site.north_m == pytest.approx(5.0, abs=2.0)


def test_stays_with_its_choice_until_another_is_clearly_better():
    chosen = Site(0.0, 20.0, 7.0, 100.0, 0.9, 0.0)
    search = replace(SEARCH, incumbent=chosen)
    similar = find_site(layers_with((0.0, 20.0, 8.0), (0.0, -18.0, 8.5)), search, P).site
    assert similar.east_m == pytest.approx(20.0, abs=2.0)
    better = find_site(layers_with((0.0, 20.0, 5.0), (0.0, -18.0, 13.0)), search, P).site
    assert better.east_m < 0.0


def test_moves_in_small_steps_with_the_ground():
    incumbent = Site(0.0, 0.0, 8.0, 200.0, 0.9, 0.0)
    path = []
    for _ in range(40):
        incumbent = find_site(
            layers_with((0.0, 2.0, 9.0)), replace(SEARCH, incumbent=incumbent), P
        ).site
        path.append(incumbent.east_m)
    assert np.abs(np.diff([0.0, *path])).max() < 0.5
    assert path[-1] > 1.0


def test_looks_only_within_the_focus():
    search = replace(SEARCH, focus=Focus(0.0, 0.0, 9.0))
    layers = layers_with((30.0, 0.0, 12.0))
    assert find_site(layers, search, P).kind is VerdictKind.NO_ZONE


def test_places_that_failed_are_left_out():
    layers = layers_with((0.0, 0.0, 6.5), (35.0, 0.0, 6.5))
    assert abs(find_site(layers, SEARCH, P).site.north_m) < 3.0
    failed = (FailedPlace(0.0, 0.0, 8.0, 0), FailedPlace(-40.0, 0.0, 5.0, 0))
    again = find_site(layers, replace(SEARCH, failed=failed), P).site
    assert again.north_m > 30.0
    near = replace(SEARCH, focus=Focus(0.0, 0.0, 12.0), failed=failed[1:])
    wide_beyond = layers_with((0.0, 0.0, 6.5), (35.0, 0.0, 12.0))
    assert abs(find_site(wide_beyond, near, P).site.north_m) < 3.0, 'not beyond the focus'


def layers_of_boxes(*boxes: tuple[float, float, float, float], score: float = 0.95) -> MapLayers:
    """Safe boxes of ground: north and east of the middle, metres to the north and to the east."""
    layers = layers_with()
    for north_m, east_m, high_m, wide_m in boxes:
        rows, columns = (
            slice(round((at + 50.0 - size / 2) / 0.5), round((at + 50.0 + size / 2) / 0.5))
            for at, size in ((north_m, high_m), (east_m, wide_m))
        )
        layers.score[rows, columns] = score
    return layers


# Of two places that are worth the same, the southern one comes first: the better lies in the north.
@pytest.mark.parametrize(
    ('layers', 'parameters'),
    [
        pytest.param(layers_with((-25.0, 0.0, 8.0), (25.0, 0.0, 9.0)), P, id='clearance'),
        pytest.param(layers_with((-27.0, 0.0, 9.0), (24.0, 0.0, 9.0)), P, id='nearness'),
        pytest.param(
            layers_of_boxes((-25.0, 0.0, 28.0, 28.0), (25.0, 0.0, 28.0, 80.0)),
            P,
            id='width of the whole lawn',
        ),
        pytest.param(
            layers_of_boxes((-25.0, 0.0, 20.0, 61.0), (25.0, 0.0, 24.0, 24.0)),
            replace(P, ample_clearance_m=6.0, distance_scale_m=1000.0),
            id='compactness',
        ),
    ],
)
def test_each_criterion_decides_between_places_that_are_else_alike(layers, parameters):
    assert find_site(layers, SEARCH, parameters).site.north_m > 0.0


def test_the_surer_of_two_equal_places_is_chosen():
    layers = layers_with((-25.0, 0.0, 9.0), (25.0, 0.0, 9.0))
    layers.score[:100][layers.score[:100] > 0.5] = 0.9
    assert find_site(layers, SEARCH, P).site.north_m > 0.0
    sure = find_site(layers_with((-25.0, 0.0, 9.0), (25.0, 0.0, 9.0)), SEARCH, P).site
    assert sure.north_m < 0.0, 'of equal ones the first'


def test_ground_below_the_preferred_clearance_counts_only_where_there_is_no_wider():
    narrow_near, wide_far = (-3.0, 0.0, 6.0), (40.0, 0.0, 7.5)
    far = replace(SEARCH, pose=replace(SEARCH.pose, north_m=-3.0))
    assert find_site(layers_with(narrow_near, wide_far), far, P).site.north_m > 30.0
    modest = replace(P, preferred_clearance_m=4.0)
    assert find_site(layers_with(narrow_near, wide_far), far, modest).site.north_m < 0.0


@pytest.mark.parametrize(('hysteresis', 'stays'), [(1.0, False), (1.3, True), (10.0, True)])
def test_a_rival_must_be_worth_the_hysteresis_times_the_present_choice(hysteresis, stays):
    layers = layers_with((0.0, 20.0, 8.0), (0.0, -20.0, 9.0))
    search = replace(SEARCH, incumbent=Site(0.0, 20.0, 7.5, 200.0, 0.95, 0.0))
    site = find_site(layers, search, replace(P, site_hysteresis=hysteresis)).site
    assert (site.east_m > 0.0) is stays


def test_shape_ranks_new_places_but_is_no_reason_to_leave_the_present_one():
    """Pieces of ground merge and split from frame to frame; both places are equally wide here."""
    layers = layers_of_boxes((0.0, 25.0, 14.0, 40.0), (0.0, -28.0, 30.0, 30.0))
    alike = replace(P, ample_clearance_m=6.0, distance_scale_m=1000.0)
    lawn = find_site(layers, SEARCH, alike).site
    assert lawn.east_m < 0.0
    search = replace(SEARCH, incumbent=Site(0.0, 25.0, 6.0, 500.0, 0.95, 0.0))
    assert find_site(layers, search, alike).site.east_m > 0.0


def test_a_choice_is_kept_down_to_85_percent_of_the_clearance_it_needs():
    search = replace(SEARCH, incumbent=Site(0.25, 0.25, 3.2, 40.0, 0.95, 0.0))
    for radius_m, kind in ((2.8, VerdictKind.NO_ZONE), (3.4, VerdictKind.SITE)):
        layers = layers_with((0.25, 0.25, radius_m))
        verdict = find_site(layers, search, P)
        assert verdict.kind is kind
        assert find_site(layers, replace(search, incumbent=None), P).kind is VerdictKind.NO_ZONE


@pytest.mark.parametrize('step', [0.1, 0.5, 1.0])
def test_a_choice_moves_by_the_focus_step_towards_the_middle_of_its_ground(step):
    search = replace(SEARCH, incumbent=Site(-0.75, 1.25, 6.0, 250.0, 0.95, 0.0))
    site = find_site(layers_with((0.25, 0.25, 9.0)), search, replace(P, focus_step=step)).site
    assert (site.north_m, site.east_m) == pytest.approx((-0.75 + step, 1.25 - step))


def test_a_choice_does_not_move_towards_wider_ground_far_away():
    layers = layers_with((0.25, 0.25, 9.0), (0.25, 32.25, 15.0))
    search = replace(SEARCH, incumbent=Site(0.25, 0.25, 8.0, 250.0, 0.95, 0.0))
    site = find_site(layers, search, replace(P, site_hysteresis=10.0)).site
    assert (site.north_m, site.east_m) == (0.25, 0.25)


def test_a_choice_does_not_drift_over_a_large_field():
    search = replace(SEARCH, incumbent=Site(5.25, -4.75, 12.0, 4000.0, 0.95, 0.0))
    site = find_site(layers_with((0.0, 0.0, 40.0)), search, P).site
    assert (site.north_m, site.east_m) == (5.25, -4.75)


def test_a_rival_may_lie_on_ground_of_exactly_the_clearance_that_is_kept():
    layers = layers_with((0.25, 0.25, 6.0))
    clearance_m = float(clearance(safe_ground(layers, 0.8, 10.0, 3), 0.5)[100, 100])
    search = replace(SEARCH, incumbent=Site(0.25, 0.25, 4.0, 90.0, 0.95, 0.0))
    for needed_m, kind in ((clearance_m, VerdictKind.SITE), (1.01 * clearance_m, None)):
        kept = replace(search, required_clearance_m=needed_m / 0.85)
        assert (find_site(layers, kept, P).kind is VerdictKind.SITE) is (kind is not None)


def test_ground_of_exactly_the_clearance_that_is_needed_or_preferred_is_wide_enough():
    layers = layers_of_boxes((-4.0, 0.0, 11.0, 30.0), (30.0, 0.0, 14.0, 40.0))
    clear_m = clearance(safe_ground(layers, 0.8, 10.0, 3), 0.5)
    exact_m = float(clear_m[:120].max())
    assert exact_m < clear_m[120:].max()
    for preferred_m, is_near in ((exact_m, True), (exact_m + 0.01, False)):
        parameters = replace(P, preferred_clearance_m=preferred_m, ample_clearance_m=preferred_m)
        site = find_site(layers, SEARCH, parameters).site
        assert (site.north_m < 10.0) is is_near
    for needed_m, kind in ((exact_m, VerdictKind.SITE), (exact_m + 0.01, VerdictKind.NO_ZONE)):
        search = replace(SEARCH, focus=Focus(-4.0, 0.0, 12.0), required_clearance_m=needed_m)
        assert find_site(layers, search, P).kind is kind


def test_the_confidence_of_a_site_is_the_mean_score_within_its_clearance():
    layers = layers_with((0.25, 0.25, 8.0))
    layers.score[layers.disc(0.25, 0.25, 3.0)] = 0.9
    site = find_site(layers, SEARCH, replace(P, distance_scale_m=1000.0)).site
    assert (site.north_m, site.east_m) == (0.25, 0.25)
    disc = layers.disc(0.25, 0.25, site.clearance_m)
    assert site.confidence == pytest.approx(float(layers.score[disc].mean()))
    assert 0.905 < site.confidence < 0.945


def test_a_site_tells_of_its_ground_what_the_map_shows():
    layers = layers_of_boxes((0.0, 0.0, 20.0, 30.0), (30.0, 30.0, 8.0, 8.0))
    layers.age_s[:] = 1.5
    layers.age_s[:100, :100] = layers.age_s[100:, 100:] = 20.0
    site = find_site(layers, SEARCH, P).site
    # Two quarters of it are old: the other two touch in one corner only.
    assert site.area_m2 == 9.5 * 14.5
    layers.age_s[:] = 1.5
    site = find_site(layers, SEARCH, P).site
    # Its rim is not safe: the mean over 3 x 3 cells is too low there.
    assert site.area_m2 == 19.0 * 29.0
    assert site.clearance_m == pytest.approx(9.15, abs=0.05)
    assert site.confidence == pytest.approx(0.95)
    assert site.age_s == 1.5


@pytest.mark.parametrize(
    ('score', 'looks', 'age_s', 'missing'),
    [
        (0.9, 0, np.inf, 'nothing is known yet'),
        (0.9, 2, 0.0, 'seen in 2 frames at most, 3 are needed'),
        (0.9, 9, 14.0, 'last seen 14 s ago, at most 10 s are allowed'),
        (0.7, 9, 0.0, 'the best score is 0.70, 0.80 is needed'),
    ],
)
def test_says_what_all_ground_in_the_focus_is_missing(score, looks, age_s, missing):
    layers = layers_with((0.0, 0.0, 20.0), score=score)
    layers.looks[:] = looks
    layers.age_s[:] = age_s
    assert missing in find_site(layers, SEARCH, P).reason


def test_says_that_the_focus_lies_outside_of_the_map():
    empty = np.zeros((0, 0), np.float32)
    layers = MapLayers(empty, empty, empty.astype(np.uint16), 0.5, 0.0, 0.0, empty)
    assert find_site(layers, SEARCH, P).reason == 'the focus lies outside of the map'
    safe = safe_ground(layers, 0.8, 10.0, 3)
    assert (safe.shape, safe.dtype) == ((0, 0), bool)


@pytest.mark.parametrize(
    ('change', 'is_safe'),
    [
        ({}, True),
        ({'looks': 3}, True),
        ({'looks': 2}, False),
        ({'age_s': 10.0}, True),
        ({'age_s': 10.1}, False),
        ({'score': 0.8}, True),
        ({'score': 0.79}, False),
    ],
)
def test_the_bounds_of_safe_ground_are_inclusive(change, is_safe):
    layers = layers_with(score=0.0)
    values = {'score': 0.9, 'age_s': 0.0, 'looks': 9, **change}
    for name, value in values.items():
        getattr(layers, name)[:] = value
    safe = safe_ground(layers, float(np.float32(0.8)), 10.0, 3)
    assert safe.all() == safe.any() == is_safe


@pytest.mark.parametrize(('score', 'is_safe'), [(0.5, True), (0.49, False)])
def test_a_cell_is_an_obstacle_below_one_half_whatever_surrounds_it(score, is_safe):
    layers = layers_with((0.0, 0.0, 20.0), score=1.0)
    layers.score[100, 100] = score
    assert safe_ground(layers, 0.8, 10.0, 3)[100, 100] == is_safe
    assert safe_ground(layers, 0.8, 10.0, 3)[100, 102]


def test_unsafe_ground_has_no_clearance_and_the_cell_beside_it_little():
    safe = np.zeros((9, 9), dtype=bool)
    safe[:, 4:] = True
    assert clearance(safe, 0.5)[4].tolist() == pytest.approx(
        [0, 0, 0, 0, 0.146, 0.646, 1.146, 0.646, 0.146], abs=0.001
    )


def true_clearance_m(safe, north_m, east_m, cell_m) -> float:
    """Return the way from a place to the nearest point of an unsafe cell; 0, 0 is a corner."""
    rows, columns = np.nonzero(~safe)
    apart_north = np.maximum(np.abs((rows + 0.5) * cell_m - north_m) - cell_m / 2, 0.0)
    apart_east = np.maximum(np.abs((columns + 0.5) * cell_m - east_m) - cell_m / 2, 0.0)
    return float(np.hypot(apart_north, apart_east).min())


@pytest.mark.parametrize('seed', range(3))
def test_clearance_is_never_more_than_the_truth_at_any_angle(seed):
    rng = np.random.default_rng(seed)
    safe = rng.random((80, 80)) > 0.002
    safe[:, [0, -1]] = safe[[0, -1]] = False
    found = clearance(safe, 0.5)
    for row, column in rng.integers(0, 80, (200, 2)).tolist():
        truth_m = true_clearance_m(safe, (row + 0.5) * 0.5, (column + 0.5) * 0.5, 0.5)
        assert truth_m - 0.11 <= found[row, column] <= truth_m + 1e-5


def test_the_clearance_of_a_site_counts_from_where_it_is_in_its_cell():
    layers = layers_with((0.0, 0.0, 8.0))
    safe = safe_ground(layers, 0.8, 10.0, 3)
    for north_m, east_m in ((0.25, 0.25), (0.49, 0.01), (-0.3, 0.3)):
        search = replace(SEARCH, incumbent=Site(north_m, east_m, 8.0, 200.0, 0.95, 0.0))
        site = find_site(layers, search, replace(P, focus_step=0.01)).site
        from_corner = site.north_m - layers.south_m, site.east_m - layers.west_m
        truth_m = true_clearance_m(safe, *from_corner, layers.cell_m)
        assert truth_m - 0.5 <= site.clearance_m <= truth_m + 1e-5


def test_says_when_only_places_that_failed_are_left():
    failed = (FailedPlace(0.0, 0.0, 20.0, 0),)
    verdict = find_site(layers_with((0.0, 0.0, 8.0)), replace(SEARCH, failed=failed), P)
    assert verdict.reason == (
        'the widest safe ground outside of failed sites is too narrow by 3.0 m: 0.0 m of '
        'clearance, 3.0 m are needed from this altitude'
    )
    whole_focus = replace(SEARCH, focus=Focus(0.0, 0.0, 9.0), failed=failed)
    assert find_site(layers_with((0.0, 0.0, 8.0)), whole_focus, P).reason == verdict.reason


@pytest.mark.parametrize(('beside_m', 'north_wins'), [(2.0, True), (5.5, False)])
def test_confidence_counts_as_far_around_as_the_clearance_that_is_needed(beside_m, north_wins):
    """The southern of two lawns is nearer, but has doubtful ground on both sides of its middle."""
    layers = layers_with((-24.25, 0.25, 9.0), (25.25, 0.25, 9.0))
    for sign in (-1.0, 1.0):
        doubtful = layers.disc(-24.25, 0.25 + sign * beside_m, 1.2)
        layers.score[doubtful] = np.minimum(layers.score[doubtful], 0.83)
    site = find_site(layers, SEARCH, P).site
    assert (site.north_m > 0.0) is north_wins


@pytest.mark.parametrize('radius_m', [0.2, 0.5, 1.3, 1.5])
def test_confidence_is_the_mean_within_a_radius(radius_m):
    score = np.random.default_rng(2).random((9, 14), np.float32)
    beyond = np.pad(score, 4, mode='edge')
    rows, columns = np.mgrid[0 : beyond.shape[0], 0 : beyond.shape[1]]
    means = confidence(score, radius_m, 0.5)
    assert means.shape == score.shape
    for row, column in np.ndindex(score.shape):
        away_m = 0.5 * np.hypot(rows - row - 4, columns - column - 4)
        assert means[row, column] == pytest.approx(beyond[away_m <= radius_m].mean(), abs=1e-5)


def test_the_mean_of_three_by_three_cells_goes_on_beyond_the_edge():
    layers = layers_with(score=0.0)
    layers.score[:] = 0.9
    layers.score[1] = 0.65
    # (2 x 0.9 + 0.65) / 3 = 0.82 on the edge, (0.9 + 2 x 0.65) / 3 = 0.73 if it were mirrored.
    assert safe_ground(layers, 0.8, 10.0, 3)[0].all()


def test_shapes_are_told_by_area_and_rim_of_each_piece():
    candidates = np.zeros((14, 40), dtype=bool)
    candidates[1:11, 1:11] = True  # a square: 100 cells, 36 of them at the rim
    candidates[11, 11] = True  # one cell that touches it in a corner only
    candidates[1, 14:34] = True  # a line: 20 cells, all at the rim
    half_width_m, compactness = shapes(candidates, 0.5)
    assert half_width_m.dtype == compactness.dtype == np.float32
    assert half_width_m[[5, 11, 1], [5, 11, 20]] == pytest.approx([0.5 * 100 / 36, 0.5, 0.5])
    expected = [4.0 * np.pi * 100 / 36**2, 1.0, 4.0 * np.pi * 20 / 20**2]
    assert compactness[[5, 11, 1], [5, 11, 20]] == pytest.approx(expected)
