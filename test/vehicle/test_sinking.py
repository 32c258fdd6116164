# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An altitude that does not sink when the vehicle is told to is not believed."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.vehicle.sinking import SinkWatch

STEP_S = 0.04


def fly(
    watch: SinkWatch,
    seconds: float,
    told: Callable[[float], float],
    reported: Callable[[float, float], float | None],
    begin_s: float = 0.0,
) -> float:
    """Follow what is told with 0.4 s of lag; return how far it truly sank until it was noticed."""
    altitude_m = speed = 0.0
    for step in range(round(seconds / STEP_S)):
        at_s = step * STEP_S
        watch.tell(told(at_s))
        speed += (told(at_s) - speed) * STEP_S / 0.4
        altitude_m -= speed * STEP_S
        watch.take(reported(at_s, 50.0 + altitude_m), round((begin_s + at_s) * 1e9))
        if watch.problem:
            return -altitude_m
    return float('inf')


@pytest.mark.parametrize('speed', [0.5, 1.0, 2.0, 3.0])
def test_an_altitude_that_froze_is_noticed_within_few_metres(speed: float) -> None:
    frozen: list[float] = []

    def reported(at_s: float, true_m: float) -> float:
        if at_s >= 4.0:
            frozen.append(true_m)
        return frozen[0] if frozen else true_m

    watch = SinkWatch()
    sunk_m = fly(watch, 12.0, lambda _: speed, reported)
    assert sunk_m - (50.0 - frozen[0]) < 4.5
    assert 'told to sink' in watch.problem


@given(
    st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=8),
    st.floats(-0.3, 0.3),
)
def test_a_vehicle_that_follows_is_believed(speeds: list[float], drift: float) -> None:
    watch = SinkWatch()
    fly(
        watch,
        2.0 * len(speeds),
        lambda at_s: speeds[min(len(speeds) - 1, int(at_s / 2.0))],
        lambda at_s, true_m: true_m + 0.1 * drift * at_s,
    )
    assert watch.problem == ''


def test_standing_and_climbing_prove_nothing() -> None:
    watch = SinkWatch()
    fly(watch, 10.0, lambda _: 0.0, lambda _, __: 40.0)
    fly(watch, 10.0, lambda _: -2.0, lambda _, __: 40.0, begin_s=20.0)
    assert watch.problem == ''


def test_silence_proves_nothing() -> None:
    watch = SinkWatch()
    fly(watch, 10.0, lambda _: 2.0, lambda at_s, _: 40.0 if at_s % 1.0 < 0.8 else None)
    assert watch.problem == ''


def test_an_old_report_is_no_altitude_that_stands_still() -> None:
    watch = SinkWatch()
    watch.tell(2.0)
    for step in range(100):
        watch.take(50.0 - 0.08 * step, round(step * STEP_S * 1e9))
    for _ in range(100):
        watch.take(42.08, round(99 * STEP_S * 1e9))
    assert watch.problem == ''


def test_a_jump_is_left_to_others() -> None:
    watch = SinkWatch()
    fly(watch, 10.0, lambda _: 2.0, lambda at_s, true_m: true_m + (30.0 if at_s >= 5.0 else 0.0))
    assert watch.problem == ''


def test_doubt_stays_until_somebody_else_flies() -> None:
    watch = SinkWatch()
    fly(watch, 10.0, lambda _: 2.0, lambda _, __: 40.0)
    assert watch.problem
    fly(watch, 5.0, lambda _: 2.0, lambda _, true_m: true_m, begin_s=20.0)
    assert watch.problem
    watch.forget()
    fly(watch, 5.0, lambda _: 2.0, lambda _, true_m: true_m, begin_s=40.0)
    assert watch.problem == ''
