# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A position that rests on GNSS, and one that does not."""

import pytest

from peace_ros.core.vehicle.gnss import BRIDGED_MS, GnssWatch

FIRST, SECOND = 'GPS_RAW_INT', 'GPS2_RAW'


@pytest.fixture
def watch():
    watch = GnssWatch()
    watch.take(FIRST, 6, 0, known=True)
    watch.take(FIRST, 3, 100, known=True)
    return watch


@pytest.mark.parametrize('fix_type', [0, 1, 2])
def test_the_first_message_below_3d_counts(watch, fix_type):
    watch.take(FIRST, fix_type, 200, known=True)
    assert f'fix type {fix_type}' in watch.problem


def test_a_vehicle_that_never_had_a_fix_flies_by_something_else():
    watch = GnssWatch()
    for i in range(50):
        watch.take(FIRST, 1, 100 * i, known=True)
        assert watch.problem == ''


def test_a_second_receiver_carries_the_position(watch):
    watch.take(SECOND, 3, 150, known=True)
    watch.take(FIRST, 1, 200, known=True)
    assert watch.problem == ''
    watch.take(SECOND, 1, 300, known=True)
    assert watch.problem


def lose(watch, known):
    """Take a lost fix for as long as dead reckoning may last; return when it was not held."""
    for boot_ms in range(200, 300 + BRIDGED_MS, 100):
        watch.take(FIRST, 1, boot_ms, known=known)
        if not watch.problem:
            return boot_ms
    return None


def test_a_filter_that_outlives_dead_reckoning_has_another_source(watch):
    assert lose(watch, known=True) == 200 + BRIDGED_MS
    watch.take(FIRST, 3, 20_000, known=True)
    watch.take(FIRST, 3, 20_100, known=True)
    watch.take(FIRST, 1, 20_200, known=True)
    assert watch.problem == '', 'still the other source'
    watch.take(FIRST, 1, 20_300, known=False)
    assert watch.problem, 'until the filter has lost it'


@pytest.mark.parametrize('known', [False, None])
def test_a_filter_that_lost_it_or_says_nothing_is_no_evidence(watch, known):
    assert lose(watch, known=known) is None


def test_a_missing_fix_is_noted_before_there_was_any():
    watch = GnssWatch()
    assert watch.fix_note == ''
    watch.take(FIRST, 1, 0, known=False)
    assert watch.fix_note == 'fix type 1, 3 is needed'
    watch.take(SECOND, 3, 100, known=False)
    assert watch.fix_note == ''
