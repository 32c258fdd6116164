# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Single steps of the watch over the axes, by its equations."""

from __future__ import annotations

from math import exp, hypot

import numpy as np
import pytest
from numpy.typing import NDArray

from peace_ros.core.vehicle.faulty_axes import (
    EXPLANATIONS,
    AxesWatch,
    _Comparison,
    _ExpectedMotion,
)

Array = NDArray[np.float64]
STILL, MIRRORED = 'it stands still', 'north and east are mirrored'


def plane(north: float, east: float = 0.0) -> Array:
    return np.array((north, east))


def evidence_for(fault: str, comparison: _Comparison) -> float:
    return float(comparison._evidence[list(EXPLANATIONS).index(fault)])


def bias_of(fault: str, comparison: _Comparison) -> list[float]:
    return list(comparison._bias[list(EXPLANATIONS).index(fault)])


def test_the_expected_motion_lies_between_a_slow_vehicle_and_a_quick_one() -> None:
    motion, follow = _ExpectedMotion(), 1.0 - exp(-0.05 / 0.4)
    motion.step(plane(3.0), 0.05)
    quick = 3.0 * follow
    limited = 4.0 * 0.05  # of 3 m/s, by 4 m/s^2
    half = limited * follow
    slow = half * follow
    way_m = (0.8 * slow + 0.2 * quick) * 0.05
    unsettled_m2 = 0.7 * ((quick - slow) / 2.0) ** 2 * 0.05
    slow_way_m = slow * 0.05
    assert motion.way_m == pytest.approx((way_m, 0.0))
    assert motion.slow_way_m == pytest.approx(slow_way_m)
    assert motion.unsettled_m2 == pytest.approx(unsettled_m2)
    # Told 0.1 m/s more than the limited speed: the limit lets it follow at once.
    motion.step(plane(0.3), 0.05)
    quick += (0.3 - quick) * follow
    half += (0.3 - half) * follow
    slow += (half - slow) * follow
    way_m += (0.8 * slow + 0.2 * quick) * 0.05
    unsettled_m2 += 0.7 * ((quick - slow) / 2.0) ** 2 * 0.05
    assert motion.way_m == pytest.approx((way_m, 0.0))
    assert motion.slow_way_m == pytest.approx(slow_way_m + slow * 0.05)
    assert motion.unsettled_m2 == pytest.approx(unsettled_m2)


def test_evidence_is_the_log_likelihood_with_a_bias_that_is_learned_and_forgotten() -> None:
    """A bias of 0.5 m/s stays alike for 2 s; the periods are of 1 s."""
    comparison, keep = _Comparison(0.5, 2.0), exp(-1.0 / 2.0)
    expected_m, seen_m, noise_m2 = plane(1.0), plane(0.1), 0.75
    assert comparison.step(expected_m, seen_m, 1.0, noise_m2) == ''
    # The variance of the bias begins at 0.5^2, that of the way is 0.25 + 0.75 = 1, the gain 0.25.
    # The error is -0.9 m without a fault, 0.1 m of a vehicle that stands still.
    evidence = (0.9**2 - 0.1**2) / 2.0
    assert evidence_for(STILL, comparison) == pytest.approx(evidence)
    assert bias_of('', comparison) == pytest.approx((-0.25 * 0.9, 0.0))
    assert bias_of(STILL, comparison) == [0.0, 0.0], 'what stands still has none'
    others = np.delete(comparison._evidence, list(EXPLANATIONS).index(STILL))
    assert not others.any(), 'they predicted no better'

    comparison.step(expected_m, seen_m, 1.0, noise_m2)
    # Learned, the variance of the bias was 0.25 * (1 - 0.25); it grows back towards 0.25.
    bias_variance = keep**2 * 0.25 * 0.75 + (1.0 - keep**2) * 0.25
    variance = bias_variance + noise_m2
    error_m = 0.1 - 1.0 + keep * 0.25 * 0.9
    evidence += (error_m**2 - 0.1**2) / (2.0 * variance)
    assert evidence_for(STILL, comparison) == pytest.approx(evidence)
    bias = -keep * 0.25 * 0.9 + bias_variance / variance * error_m
    assert bias_of('', comparison) == pytest.approx((bias, 0.0))
    assert comparison._bias_variance == pytest.approx(
        bias_variance * (1.0 - bias_variance / variance)
    )


def test_a_bias_learned_where_nothing_is_expected_is_mirrored_with_the_axes() -> None:
    """All explanations predict alike then; a mirrored one starts with the bias mirrored."""
    comparison = _Comparison(0.5, 2.0)
    comparison.step(plane(0.0), plane(0.2, 0.4), 1.0, 0.75)
    assert bias_of('', comparison) == pytest.approx((0.05, 0.1))
    assert bias_of(MIRRORED, comparison) == pytest.approx((-0.05, -0.1))
    assert bias_of('north and east are swapped', comparison) == pytest.approx((0.1, 0.05))
    assert bias_of(STILL, comparison) == [0.0, 0.0]
    assert not comparison._evidence.any()


def test_evidence_grows_and_shrinks_by_thirty_a_second_at_most() -> None:
    """An error counts as three standard deviations at most: 9 of evidence where both axes err."""
    comparison, way_m = _Comparison(0.1, 5.0), plane(10.0, 10.0)
    assert comparison.step(way_m, -way_m, 0.2, 0.01) == ''
    assert evidence_for(MIRRORED, comparison) == 6.0
    assert comparison.step(way_m, way_m, 0.1, 0.01) == ''
    assert evidence_for(MIRRORED, comparison) == 3.0


def test_an_evidence_of_twelve_is_enough() -> None:
    comparison, way_m = _Comparison(0.1, 5.0), plane(10.0, 10.0)
    assert comparison.step(way_m, -way_m, 0.2, 0.01) == ''
    assert comparison.step(way_m, -way_m, 0.2, 0.01) == MIRRORED
    assert evidence_for(MIRRORED, comparison) == 12.0


class Noted:
    """Notes what it is given to compare, and finds no fault."""

    def __init__(self) -> None:
        self.given: list[tuple[list[float], list[float], float, float]] = []

    def step(self, expected_m: Array, seen_m: Array, seconds: float, noise_m2: float) -> str:
        self.given.append((list(expected_m), list(seen_m), seconds, noise_m2))
        return ''


def test_a_period_compares_told_with_velocity_and_velocity_with_position(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch, velocity, position = AxesWatch(), Noted(), Noted()
    monkeypatch.setattr(watch, '_velocity', velocity)
    monkeypatch.setattr(watch, '_position', position)
    assert watch.take((5.0, -2.0), (1.0, 0.0), (7.4, 0.0), 0.0) == ''
    watch.follow((1.0, 0.5), 0.1)
    assert watch.take((5.2, -1.9), (2.0, 0.4), (0.0, 3.7), 0.1) == ''

    told = _ExpectedMotion()
    for _ in range(2):
        told.step(plane(1.0, 0.5), 0.05)
    fades = exp(-0.1 / 5.0)  # the wind is the mean lean of some five seconds
    windy = (hypot(7.4 * fades, 3.7 * (1.0 - fades)) / 3.7) ** 4
    ((told_m, way_m, seconds, noise_m2),) = velocity.given
    assert told_m == pytest.approx(list(told.way_m))
    assert way_m == pytest.approx([0.15, 0.02]), 'the mean velocity of both reports'
    assert seconds == 0.1
    assert noise_m2 == pytest.approx(0.03 * (1.0 + windy) * 0.1 + told.unsettled_m2)
    ((way_m, seen_m, seconds, noise_m2),) = position.given
    assert way_m == pytest.approx([0.15, 0.02])
    assert seen_m == pytest.approx([0.2, 0.1])
    assert seconds == 0.1
    assert noise_m2 == pytest.approx(0.06 * 0.1)


class Slow:
    """Expects a quarter of a metre in each period, of the slow vehicle."""

    way_m, slow_way_m, unsettled_m2 = np.zeros(2), 0.25, 0.0

    def restart(self) -> None:
        """Stay as it is."""


@pytest.mark.parametrize(('wobble_m', 'stands'), [(0.0, True), (0.01, True), (0.0101, False)])
def test_a_position_within_a_centimetre_stands_still_after_a_metre(
    monkeypatch: pytest.MonkeyPatch, wobble_m: float, stands: bool
) -> None:
    watch = AxesWatch()
    monkeypatch.setattr(watch, '_expected', Slow())
    found = [
        watch.take((0.0, wobble_m * (step % 2)), (0.0, 0.0), (0.0, 0.0), 0.1) for step in range(6)
    ]
    # The first report begins a period, the second ends it, and four more make a metre.
    assert found[:5] == [''] * 5
    assert ('its position stands still' in found[5]) == stands


def drifted(each_m: float, periods: int) -> list[str]:
    """Tell a vehicle to stay, report a way north each half second, return what was found."""
    watch = AxesWatch()
    return [
        watch.take((each_m * step, 0.0), (0.0, 0.0), (0.0, 0.0), 0.5) for step in range(periods + 1)
    ]


def test_a_position_may_drift_fifteen_metres_in_any_six_seconds() -> None:
    assert not any(drifted(1.25, 40))
    found = drifted(1.3125, 12)
    assert not any(found[:12])
    assert 'runs away sideways from what was told, 15.8 m in 6.0 s' in found[12]


def test_a_drift_counts_by_its_length_whatever_the_direction() -> None:
    watch = AxesWatch()
    watch.take((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.0)
    assert '17.0 m in 0.1 s' in watch.take((12.0, -12.0), (0.0, 0.0), (0.0, 0.0), 0.1)
