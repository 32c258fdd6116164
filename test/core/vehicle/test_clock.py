# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The autopilot's clock from round trips, with jitter, steps and reboots."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peace_ros.core.vehicle.clock import TimeMap

MS = 1_000_000
SECOND = 1_000 * MS


def feed(clock, offset_ns, *, begin_ns, count=40, seed=0, one_way_ms=2.0, jitter_ms=30.0):
    """Ask ``count`` times over a line whose ways are slow by chance."""
    source = random.Random(seed)
    now_ns = begin_ns
    for _ in range(count):
        out_ns = int(
            (one_way_ms + source.expovariate(1.0) * jitter_ms * (source.random() < 0.6)) * MS
        )
        back_ns = int(
            (one_way_ms + source.expovariate(1.0) * jitter_ms * (source.random() < 0.6)) * MS
        )
        clock.add(now_ns, now_ns + out_ns - offset_ns, now_ns + out_ns + back_ns)
        now_ns += SECOND
    return now_ns


@settings(max_examples=80, deadline=None)
@given(st.integers(-(10**18), 10**18), st.integers(0, 1000), st.floats(0.1, 20.0))
def test_the_offset_is_found_through_jitter(offset_ns, seed, one_way_ms):
    clock = TimeMap()
    feed(clock, offset_ns, begin_ns=10**18, seed=seed, one_way_ms=one_way_ms)
    assert abs(clock.offset_ns - offset_ns) < 3 * MS


def test_nothing_is_claimed_before_three_round_trips():
    clock = TimeMap()
    feed(clock, 0, begin_ns=0, count=2)
    assert clock.offset_ns is None
    assert clock.stamp_ns(5, 77) == 77, 'the moment of receipt'


def test_a_step_of_a_clock_is_followed_after_three_answers():
    clock = TimeMap()
    now_ns = feed(clock, 7 * SECOND, begin_ns=10**15, jitter_ms=0.0)
    feed(clock, 3 * SECOND, begin_ns=now_ns, count=2, jitter_ms=0.0)
    assert abs(clock.offset_ns - 7 * SECOND) < MS, 'one slow answer is no step'
    feed(clock, 3 * SECOND, begin_ns=now_ns + 2 * SECOND, count=3, jitter_ms=0.0)
    assert abs(clock.offset_ns - 3 * SECOND) < MS
    assert clock.steps == 1


def test_after_a_standstill_the_moment_of_receipt_counts_until_the_new_offset_is_known():
    clock = TimeMap()
    now_ns = feed(clock, 7 * SECOND, begin_ns=10**15, jitter_ms=0.0)
    assert not clock.wants_more
    lost_ns = 400 * MS
    feed(clock, 7 * SECOND + lost_ns, begin_ns=now_ns, count=1, jitter_ms=0.0)
    assert clock.wants_more, 'three answers settle it, and they are asked for soon'
    boot_ms = (now_ns + SECOND - 7 * SECOND - lost_ns) // MS
    assert clock.stamp_ns(boot_ms, now_ns + SECOND + MS) == now_ns + SECOND + MS
    feed(clock, 7 * SECOND + lost_ns, begin_ns=now_ns + SECOND, count=4, jitter_ms=0.0)
    assert abs(clock.offset_ns - 7 * SECOND - lost_ns) < MS


@pytest.mark.parametrize('speed', [0.5, 1.2, 5.0])
def test_clocks_of_different_speed_have_no_offset(speed):
    clock = TimeMap()
    for i in range(60):
        now_ns = i * SECOND // 10
        clock.add(now_ns, int(speed * now_ns), now_ns + MS)
        if i >= 12:
            stamp_ns = clock.stamp_ns(int(speed * now_ns) // MS, now_ns + MS)
            assert abs(stamp_ns - now_ns) < 80 * MS


def test_a_stamp_is_the_moment_of_the_message_not_of_its_arrival():
    clock = TimeMap()
    feed(clock, 7 * SECOND, begin_ns=10**12, jitter_ms=0.0)
    true_ns = 10**12 + 60 * SECOND
    stamp_ns = clock.stamp_ns((true_ns - 7 * SECOND) // MS, true_ns + 80 * MS)
    assert abs(stamp_ns - true_ns) <= MS


def test_a_moment_that_cannot_be_is_replaced_by_that_of_receipt():
    clock = TimeMap()
    feed(clock, 0, begin_ns=10**12, jitter_ms=0.0)
    received_ns = 10**12 + 60 * SECOND
    for wrong_s in (-5, 5):
        boot_ms = (received_ns + wrong_s * SECOND) // MS
        received_ns += 1
        assert clock.stamp_ns(boot_ms, received_ns) == received_ns


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10**7), st.integers(0, 10**13)), max_size=60))
def test_stamps_never_go_back_unless_our_own_clock_does(messages):
    clock = TimeMap()
    feed(clock, 0, begin_ns=0, count=5)
    last_ns, last_received_ns = 0, 0
    for boot_ms, received_ns in sorted(messages, key=lambda each: each[1]):
        stamp_ns = clock.stamp_ns(boot_ms, received_ns)
        assert stamp_ns > last_ns
        assert stamp_ns <= max(received_ns, last_ns + 1)
        last_ns, last_received_ns = stamp_ns, received_ns
    if last_received_ns > 5 * SECOND:
        assert clock.stamp_ns(0, 1) == 1, 'a clock that stepped back begins anew'


def test_what_is_stamped_at_receipt_does_not_delay_the_stamps_of_another_series():
    clock = TimeMap()
    now_ns = feed(clock, 0, begin_ns=10 * SECOND, jitter_ms=0.0)
    assert clock.stamp_ns(1, now_ns, 'gimbal') == now_ns, 'a clock of its own: as received'
    sent_ns = now_ns - 100 * MS
    assert clock.stamp_ns(sent_ns // MS, now_ns) == pytest.approx(sent_ns, abs=3 * MS)
