# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in closes the ground at once and for a while; noise and a bad frame do not."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peace_ros.core.mapping import MapParameters, SafetyMap

S = 1_000_000_000
PARAMETERS = MapParameters(map_size_m=80.0)
PERSON_PX = 4
"""Half a metre from 30 m."""


def score_at(safety_map: SafetyMap, north_m=0.0, east_m=0.0, after_s=0.0) -> float:
    now_ns = (safety_map.stamp_ns or 0) + round(after_s * S)
    layers = safety_map.layers(now_ns)
    return float(layers.score[layers.cell_at(north_m, east_m)])


@pytest.fixture
def lawn(camera, look, pose_at):
    """A map of ground that was seen safe twenty times from 30 m, up to the fourth second."""
    safety_map = SafetyMap(PARAMETERS)
    for number in range(20):
        safety_map.add(look(0.2 * (number + 1), 0.95), camera, pose_at())
    return safety_map


@pytest.mark.parametrize('altitude_m', [20.0, 30.0, 45.0])
def test_one_look_at_a_person_closes_ground_that_was_safe_for_long(
    lawn, camera, look, pose_at, altitude_m
):
    assert score_at(lawn) > 0.9
    size_px = round(0.6 / (altitude_m * 1.48 / 352))
    lawn.add(look(4.2, 0.95, spot=0.05, spot_px=size_px), camera, pose_at(altitude_m))
    assert score_at(lawn) == 0.0
    assert score_at(lawn, 5.0, 5.0) > 0.9, 'only where the person is'


def test_closed_ground_tells_the_age_of_the_look_that_closed_it(lawn, camera, look, pose_at):
    lawn.add(look(4.2, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    layers = lawn.layers(round(6.7 * S))
    ages_s = layers.unsafe_age_s
    assert ages_s[layers.cell_at(0.0, 0.0)] == pytest.approx(2.5, abs=0.01)
    assert ages_s[layers.cell_at(5.0, 0.0)] == float('inf')
    assert (layers.score[ages_s < float('inf')] == 0.0).all()


def test_it_takes_both_time_and_clear_looks_to_open_again(lawn, camera, look, pose_at):
    lawn.add(look(4.2, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    for number in range(8):  # looks enough, but within a second
        lawn.add(look(4.3 + 0.1 * number, 0.95), camera, pose_at())
    assert score_at(lawn) == 0.0
    assert score_at(lawn, after_s=0.3) > 0.5
    lawn.add(look(8.0, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    for time_s in (14.0, 15.0):  # time enough, but two looks only
        lawn.add(look(time_s, 0.95), camera, pose_at())
        assert score_at(lawn) == 0.0
    lawn.add(look(16.0, 0.95), camera, pose_at())
    assert score_at(lawn) > 0.5


def test_the_longer_a_person_was_seen_the_longer_the_ground_stays_closed(
    lawn, camera, look, pose_at
):
    for number in range(4):
        seen = look(4.2 + 0.2 * number, 0.95, spot=0.05, spot_px=PERSON_PX)
        lawn.add(seen, camera, pose_at())
    last_s = lawn.stamp_ns / S
    for number in range(18):
        lawn.add(look(last_s + 0.2 * (number + 1), 0.95), camera, pose_at())
    assert score_at(lawn) == 0.0
    assert score_at(lawn, after_s=0.6) > 0.5
    last_s = lawn.stamp_ns / S + 2.0
    lawn.add(look(last_s, 0.95), camera, pose_at())
    lawn.add(look(last_s + 0.2, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    for number in range(3):
        lawn.add(look(last_s + 0.4 + 0.2 * number, 0.95), camera, pose_at())
    assert score_at(lawn, after_s=0.6) > 0.5, 'once open, it counts anew'


def test_neither_doubtful_nor_coarser_looks_open_it(lawn, camera, look, pose_at):
    lawn.add(look(4.2, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    for number in range(20):
        lawn.add(look(8.0 + number, 0.55), camera, pose_at())
    assert score_at(lawn) == 0.0
    for number in range(10):
        lawn.add(look(28.0 + number * 0.1, 0.95), camera, pose_at(100.0))
    assert score_at(lawn) == 0.0


def test_a_person_seen_from_30_m_is_not_outvoted_by_looks_from_100_m(camera, look, pose_at):
    safety_map = SafetyMap(PARAMETERS)
    for number in range(3):
        seen = look(1.0 + number, 0.95, spot=0.05, spot_px=PERSON_PX)
        safety_map.add(seen, camera, pose_at(30.0))
    before = score_at(safety_map), score_at(safety_map, 6.0, 6.0)
    for number in range(20):
        safety_map.add(look(4.0 + 0.5 * number, 0.95), camera, pose_at(100.0))
    assert score_at(safety_map) == before[0] == 0.0
    closed = safety_map._veto
    closed.clear()
    assert score_at(safety_map) < 0.3, 'the evidence itself stands too'
    assert score_at(safety_map, 6.0, 6.0) >= before[1]


def test_a_person_seen_from_30_m_after_many_looks_from_100_m_counts(camera, look, pose_at):
    safety_map = SafetyMap(PARAMETERS)
    for number in range(20):
        safety_map.add(look(1.0 + 0.5 * number, 0.95), camera, pose_at(100.0))
    safety_map.add(look(12.0, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at(30.0))
    assert score_at(safety_map) == 0.0


def test_looks_from_as_near_or_much_later_take_unsafe_back(camera, look, pose_at):
    near, late = SafetyMap(PARAMETERS), SafetyMap(PARAMETERS)
    for each in (near, late):
        each.add(look(1.0, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at(30.0))
    for number in range(8):
        near.add(look(5.0 + number, 0.95), camera, pose_at(35.0))
        late.add(look(150.0 + number, 0.95), camera, pose_at(100.0))
    assert score_at(near) > 0.8
    assert score_at(late) > 0.8


def test_single_pixels_and_coarse_pictures_close_nothing(lawn, camera, look, pose_at):
    lawn.add(look(4.2, 0.95, spot=0.0, spot_px=1), camera, pose_at(30.0))
    assert score_at(lawn) > 0.5
    lawn.add(look(4.4, 0.95, spot=0.0, spot_px=6), camera, pose_at(100.0))
    assert score_at(lawn) > 0.0, 'from 100 m it is evidence, not a veto'


def test_a_frame_that_calls_everything_unsafe_closes_everything_until_the_next_clear_one(
    lawn, camera, look, pose_at
):
    lawn.add(look(4.2, 0.0), camera, pose_at())
    assert score_at(lawn) == 0.0
    lawn.add(look(4.4, 0.95), camera, pose_at())
    assert score_at(lawn) > 0.5
    lawn.add(look(4.6, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    lawn.add(look(4.8, 0.0), camera, pose_at())
    lawn.add(look(5.0, 0.95), camera, pose_at())
    assert score_at(lawn) == 0.0, 'and takes no veto away that stood before'


def test_a_veto_moves_with_the_window_and_widens_with_the_map(lawn, camera, look, pose_at):
    lawn.add(look(4.2, 0.95, spot=0.05, spot_px=PERSON_PX), camera, pose_at())
    lawn.add(look(4.4, 0.95), camera, pose_at(30.0, 12.0, 9.0))
    assert score_at(lawn) == 0.0
    assert score_at(lawn, 12.0, 9.0) > 0.9
    assert score_at(lawn, 2.0, 0.0) > 0.9
    lawn.widen_unsafe(2.0)
    assert score_at(lawn, 2.0, 0.0) == 0.0
    assert score_at(lawn, 12.0, 9.0) > 0.9


KINDS = {'clear': (0.95, 0.95), 'person': (0.95, 0.05), 'doubt': (0.95, 0.5), 'black': (0.0, 0.0)}


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    frames=st.lists(
        st.tuples(
            st.sampled_from(sorted(KINDS)), st.sampled_from([0.1, 0.5, 1.5]), st.floats(25.0, 33.0)
        ),
        min_size=1,
        max_size=14,
    )
)
def test_no_order_of_frames_loses_a_veto(*, camera, look, pose_at, frames):
    """Open ground has been seen clear often enough, and for long enough, since the person."""
    small = MapParameters(map_size_m=20.0)
    safety_map = SafetyMap(small)
    time_s, clear, open_s = 1.0, 99, -99.0
    strikes = 0
    for kind, pause_s, altitude_m in frames:
        time_s += pause_s
        value, spot = KINDS[kind]
        # Wide enough that the middle of the cell lies in it from every altitude.
        seen = look(time_s, value, spot=spot, spot_px=2 * PERSON_PX + 1)
        safety_map.add(seen, camera, pose_at(altitude_m))
        clear = clear + 1 if kind == 'clear' else clear
        if clear >= small.veto_looks and time_s >= open_s:
            strikes = 0
        if kind == 'person':
            strikes += 1
            clear, open_s = 0, time_s + min(strikes, 5) * small.veto_s
        if kind == 'black' or clear < small.veto_looks or time_s < open_s - 1e-3:
            assert score_at(safety_map) == 0.0
