# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""After a silence of a line on which set-points can change the mode, the mode has to be heard."""

import pytest

from peace_ros.core.vehicle.control import Control

MS = 1_000_000


def hear(control, *times_ms, every_ms=200):
    """Hear a message each 20 ms from the first to the second time, each tenth a HEARTBEAT."""
    begin_ms, end_ms = times_ms
    for at_ms in range(begin_ms, end_ms, 20):
        control.hear(at_ms * MS, is_mode=(at_ms - begin_ms) % every_ms == 0)


def test_a_line_that_is_never_silent_leaves_the_mode_known():
    control = Control(0.9)
    assert control.mode_known(0)
    hear(control, 0, 5000)
    assert control.mode_known(4980 * MS)


def test_the_mode_is_known_for_as_long_as_the_line_may_be_silent():
    control = Control(0.9)
    hear(control, 0, 1020)
    assert control.mode_known(1900 * MS)
    assert not control.mode_known(1901 * MS)


def test_after_a_silence_the_mode_has_to_be_reported_and_not_by_a_message_that_was_on_its_way():
    control = Control(0.9)
    hear(control, 0, 1020)
    for at_ms in (4000, 4100, 4249):
        control.hear(at_ms * MS, is_mode=True)
        assert not control.mode_known(at_ms * MS)
    control.hear(4300 * MS, is_mode=False)
    assert not control.mode_known(4300 * MS)
    control.hear(4320 * MS, is_mode=True)
    assert control.mode_known(4320 * MS)


def test_a_second_silence_begins_it_again():
    control = Control(0.9)
    hear(control, 0, 1020)
    hear(control, 4000, 5000)
    assert control.mode_known(5000 * MS)
    control.hear(9000 * MS, is_mode=True)
    assert not control.mode_known(9000 * MS)


@pytest.mark.parametrize('silence_s', [0.0])
def test_where_set_points_change_no_mode_it_is_always_known(silence_s):
    control = Control(silence_s)
    hear(control, 0, 1000)
    assert control.mode_known(60_000 * MS)
    control.hear(60_000 * MS, is_mode=False)
    assert control.mode_known(60_000 * MS)
