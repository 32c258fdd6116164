# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What looks add up to in one cell, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, log

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peace_ros.core.domain import Camera, Heatmap, ImageError, Pose
from peace_ros.core.mapping import MapParameters, SafetyMap
from peace_ros.core.mapping.projection import Window
from peace_ros.core.mapping.veto import Veto

S = 1_000_000_000
CAMERA = Camera.from_degrees(32, 32, 73.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
Look = tuple[float, float, float]
"""Time in s, value of the heatmap, altitude in m."""

COARSER = 1.5
DEFAULTS = MapParameters(map_size_m=20.0, veto_pixel_m=0.01)
OTHERS = MapParameters(
    map_size_m=20.0,
    veto_pixel_m=0.01,
    neutral_score=0.4,
    look_limit=0.9,
    unsafe_weight=2.5,
    safe_limit=2.0,
    unsafe_limit=1.7,
    repeat_limit=1.6,
    independent_after_s=1.5,
    safe_half_life_s=3.0,
    unsafe_half_life_s=7.0,
    fine_memory_s=2.0,
)


def log_odds(value: float) -> float:
    return log(value / (1.0 - value))


def expected(looks: Sequence[Look], p: MapParameters, *, later_s: float = 0.0) -> float:
    """One cell, by the rules of docs/mapping.md."""
    found, finest_m, last_s = 0.0, inf, -inf

    def faded(value: float, seconds: float) -> float:
        half_life_s = p.safe_half_life_s if value > 0.0 else p.unsafe_half_life_s
        return value * 2.0 ** (-seconds / half_life_s)

    for time_s, value, altitude_m in looks:
        limit = p.look_limit
        evidence = log_odds((int(value * 255.0) + 0.5) / 256.0) - log_odds(p.neutral_score)
        evidence = max(-limit, min(limit, evidence))
        weight = min(1.0, (time_s - last_s) / p.independent_after_s)
        if last_s > -inf:
            found = faded(found, time_s - last_s)
            finest_m *= 2.0 ** ((time_s - last_s) / p.fine_memory_s)
        last_s = time_s
        pixel_m = altitude_m / CAMERA.focal_px * (1.0 + 2.0 * 0.25**2 / altitude_m**2)
        coarseness = pixel_m / finest_m
        old = found * min(1.0, coarseness)
        if evidence < 0.0:
            found = max(old + weight * p.unsafe_weight * evidence, -p.unsafe_limit)
        else:
            trust = weight * (1.0 if coarseness <= 1.0 else 1.0 / coarseness)
            if coarseness > COARSER and found < 0.0:
                trust = 0.0
            most = min(p.safe_limit, p.repeat_limit * evidence)
            found = max(old, min(old + trust * evidence, most))
        finest_m = min(finest_m, pixel_m)
    return faded(found, later_s)


def mapped(looks: Sequence[Look], p: MapParameters, *, later_s: float = 0.0) -> float:
    safety_map = SafetyMap(p)
    for time_s, value, altitude_m in looks:
        heatmap = Heatmap(np.full((32, 32), value, np.float32), round(time_s * S))
        pose = Pose(0, 0.0, 0.0, -altitude_m, LEVEL, altitude_m)
        safety_map.add(heatmap, CAMERA, pose)
    layers = safety_map.layers((safety_map.stamp_ns or 0) + round(later_s * S))
    return log_odds(float(layers.score[layers.cell_at(0.1, 0.1)]))


@pytest.mark.parametrize('p', [DEFAULTS, OTHERS])
@pytest.mark.parametrize(
    'values',
    [
        [0.7],
        [0.3],
        [0.7, 0.7],
        [0.7, 0.3],
        [0.3, 0.7],
        [0.55] * 12,
        [0.95] * 12,
        [0.1] * 6,
        [0.45, 0.52, 0.9, 0.6, 0.2],
    ],
)
def test_evidence_of_one_altitude_adds_up(values: list[float], p: MapParameters) -> None:
    for step_s in (0.2, 1.0, 3.0):
        looks = [(1.0 + step_s * at, value, 40.0) for at, value in enumerate(values)]
        for later_s in (0.0, 10.0):
            assert mapped(looks, p, later_s=later_s) == pytest.approx(
                expected(looks, p, later_s=later_s), abs=2e-3
            )


@pytest.mark.parametrize('p', [DEFAULTS, OTHERS])
@pytest.mark.parametrize('values', [(0.9, 0.6), (0.9, 0.2), (0.2, 0.9), (0.3, 0.4)])
@pytest.mark.parametrize('altitudes_m', [(20.0, 28.0), (20.0, 34.0), (60.0, 30.0), (100.0, 20.0)])
def test_a_finer_look_counts_more(
    altitudes_m: tuple[float, float], values: tuple[float, float], p: MapParameters
) -> None:
    looks = [
        (1.0, values[0], altitudes_m[0]),
        (2.0, values[1], altitudes_m[1]),
        (3.0, values[1], altitudes_m[1]),
        (4.5, values[0], altitudes_m[0]),
    ]
    for count in range(1, 5):
        assert mapped(looks[:count], p) == pytest.approx(expected(looks[:count], p), abs=2e-3)


@settings(max_examples=15, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.05, 5.0), st.floats(0.05, 0.95), st.floats(15.0, 100.0)),
        min_size=1,
        max_size=6,
    )
)
def test_any_looks_add_up_as_the_rules_say(steps: list[Look]) -> None:
    looks, time_s = [], 0.0
    for step_s, value, altitude_m in steps:
        time_s += step_s
        looks.append((time_s, value, altitude_m))
    assert mapped(looks, OTHERS) == pytest.approx(expected(looks, OTHERS), abs=5e-3)


def test_what_was_not_seen_for_very_long_is_coarse() -> None:
    looks = [(1.0, 0.2, 20.0), (1e5, 0.9, 100.0)]
    assert mapped(looks, OTHERS) == pytest.approx(expected(looks[1:], OTHERS), abs=2e-3)


def test_looks_are_counted_up_to_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('peace_ros.core.mapping.safety_map._LOOKS_LIMIT', 3)
    safety_map = SafetyMap(DEFAULTS)
    pose = Pose(0, 0.0, 0.0, -30.0, LEVEL, 30.0)
    for number in range(5):
        heatmap = Heatmap(np.full((32, 32), 0.8, np.float32), number * S)
        safety_map.add(heatmap, CAMERA, pose)
        layers = safety_map.layers(number * S)
        assert layers.looks[layers.cell_at(0.0, 0.0)] == min(number + 1, 3)


def test_each_change_has_its_revision() -> None:
    safety_map = SafetyMap(DEFAULTS)
    assert safety_map.revision == 0
    assert safety_map.stamp_ns is None
    safety_map.widen_unsafe(1.0)
    assert safety_map.revision == 0, 'nothing is known that could grow'
    pose = Pose(0, 0.0, 0.0, -30.0, LEVEL, 30.0)
    safety_map.add(Heatmap(np.full((32, 32), 0.8, np.float32), 5 * S), CAMERA, pose)
    assert safety_map.revision == 1
    assert safety_map.stamp_ns == 5 * S
    safety_map.widen_unsafe(1.0)
    assert safety_map.revision == 2
    safety_map.clear()
    assert safety_map.revision == 3
    assert safety_map.stamp_ns is None


class NotedVeto(Veto):
    """Notes which cells of the whole map it was last told to be clear, and to have been safe."""

    clear_cells: np.ndarray
    safe_cells: np.ndarray

    def take(self, window: Window, **told: np.ndarray) -> None:
        super().take(window, **told)
        self.clear_cells, self.safe_cells = np.zeros((2, self._cells, self._cells), np.bool_)
        self.clear_cells[window.slices] = told['clear']
        self.safe_cells[window.slices] = told['was_safe']


def test_a_look_changes_what_it_sees_and_tells_the_veto_what_is_clear_and_was_safe() -> None:
    p = MapParameters(map_size_m=60.0, border_fraction=0.2)
    safety_map = SafetyMap(p)
    safety_map._veto = veto = NotedVeto(p, round(60.0 / p.map_cell_m))

    def seen_from(east_m: float, value: float, time_s: int) -> np.ndarray:
        before = safety_map.layers(time_s * S).looks
        pose = Pose(0, 0.0, east_m, -20.0, LEVEL, 20.0)
        safety_map.add(Heatmap(np.full((32, 32), value, np.float32), time_s * S), CAMERA, pose)
        return np.asarray(safety_map.layers(time_s * S).looks > before)

    first = seen_from(0.0, 0.6, 1)  # 0.6 is just clear
    np.testing.assert_array_equal(veto.clear_cells, first)
    assert not veto.safe_cells.any()
    known = safety_map.layers(2 * S)
    second = seen_from(4.0, 0.55, 2)
    assert (first & ~second).any()
    assert (second & ~first).any()
    assert not veto.clear_cells.any()
    np.testing.assert_array_equal(veto.safe_cells, first & second)
    now = safety_map.layers(2 * S)
    for name in ('score', 'age_s'):
        before, after = getattr(known, name), getattr(now, name)
        np.testing.assert_allclose(after[~second], before[~second], atol=1e-6)
    assert (now.age_s[second] == 0.0).all()


def test_a_coarse_look_is_not_clear() -> None:
    safety_map = SafetyMap(DEFAULTS)
    safety_map._veto = veto = NotedVeto(DEFAULTS, round(20.0 / DEFAULTS.map_cell_m))
    for time_s, (altitude_m, is_clear) in enumerate(((20.0, True), (29.0, True), (60.0, False))):
        pose = Pose(0, 0.0, 0.0, -altitude_m, LEVEL, altitude_m)
        heatmap = Heatmap(np.full((32, 32), 0.9, np.float32), time_s * S)
        safety_map.add(heatmap, CAMERA, pose)
        assert veto.clear_cells.any() == is_clear


def one_look(safety_map: SafetyMap, north_m: float, value: float, stamp_ns: int) -> None:
    pose = Pose(0, north_m, 0.0, -20.0, LEVEL, 20.0)
    safety_map.add(Heatmap(np.full((32, 32), value, np.float32), stamp_ns), CAMERA, pose)


def test_ground_that_enters_the_window_is_as_new_as_that_of_a_new_map() -> None:
    moved, new = SafetyMap(DEFAULTS), SafetyMap(DEFAULTS)
    one_look(moved, 0.0, 0.7, S)
    for safety_map in (moved, new):
        one_look(safety_map, 30.0, 0.6, 2 * S)
    at = moved.layers(2 * S).cell_at(30.0, 0.0)
    assert moved.layers(2 * S).score[at] == pytest.approx(new.layers(2 * S).score[at], abs=1e-6)


def test_ages_are_exact_by_a_clock_that_began_long_ago() -> None:
    begun_ns = 1_900_000_000 * S
    safety_map = SafetyMap(DEFAULTS)
    one_look(safety_map, 0.0, 0.7, begun_ns)
    one_look(safety_map, 0.0, 0.7, begun_ns + S // 4)
    layers = safety_map.layers(begun_ns + S // 2)
    assert layers.age_s[layers.cell_at(0.0, 0.0)] == pytest.approx(0.25, abs=1e-4)


def test_pixels_are_larger_on_the_ground_the_farther_aside_they_look() -> None:
    safety_map = SafetyMap(DEFAULTS)
    one_look(safety_map, 0.0, 0.7, S)
    layers = safety_map.layers(S)
    for north_m in (0.25, 5.25, 9.25):
        pixel_m = 20.0 / CAMERA.focal_px * (1.0 + (north_m**2 + 0.25**2) / 20.0**2)
        cell = layers.cell_at(north_m, 0.25)
        assert safety_map._pixel_m[cell] == pytest.approx(pixel_m, rel=1e-3)


@pytest.mark.parametrize('value', [-0.01, 1.01, float('nan')])
def test_values_outside_of_0_to_1_change_nothing(value: float) -> None:
    safety_map = SafetyMap(DEFAULTS)
    one_look(safety_map, 0.0, 0.7, S)
    one_look(safety_map, 0.0, 0.7, 2 * S)
    assert safety_map.revision == 2
    with pytest.raises(ImageError, match='within 0 to 1'):
        one_look(safety_map, 0.0, value, 3 * S)
    assert (safety_map.revision, safety_map.stamp_ns) == (2, 2 * S)
