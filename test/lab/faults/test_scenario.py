# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What shows that a machine is too slow for the limits of a fault."""

from __future__ import annotations

from peace_ros.lab.faults.scenario import overload


def test_two_flights_at_a_time_are_no_overload_and_ten_are() -> None:
    assert overload(6.0, 2) == ''
    assert overload(20.0, 2) == '10.0 processes for each core, 4 allowed'
    assert overload(20.0, 16) == ''
