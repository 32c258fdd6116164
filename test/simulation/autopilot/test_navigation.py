# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A filter that flies by external navigation, against what was measured of ArduCopter."""

from math import nan, pi

import pytest

from peace_ros.simulation.autopilot.navigation import ExternalNavigation


class Told:
    """A vehicle that moves evenly, and what the filter is told ten times a second."""

    def __init__(self, velocity=(0.0, 0.0), delay_s=0.05, seed=1):
        self.filter = ExternalNavigation(delay_s, seed)
        self.filter.begin(0.0, (0.0, 0.0), aided_s=0.0)
        self.velocity, self.steps = velocity, 0

    @property
    def time_s(self):
        return self.steps / 100.0

    def at(self, time_s):
        return self.velocity[0] * time_s, self.velocity[1] * time_s

    def fly(self, seconds, *, offset_m=0.0, resets=1, position=True, velocity=True, late_s=0.05):
        for _ in range(round(seconds * 100)):
            self.steps += 1
            self.filter.step(self.time_s, self.at(self.time_s), self.velocity)
            if self.steps % 10:
                continue
            north, east = self.at(self.time_s - late_s)
            if position:
                self.filter.see_position(self.time_s, (north + offset_m, east), resets)
            if velocity:
                self.filter.see_velocity(self.time_s, self.velocity)
        return self


@pytest.mark.parametrize('velocity', [True, False])
def test_right_measurements_keep_it_right(velocity):
    told = Told((3.0, -2.0)).fly(60.0, velocity=velocity)
    assert told.filter.has_position(told.time_s)
    assert not told.filter.is_unsure
    assert max(map(abs, told.filter.position_m)) < 0.1
    assert max(map(abs, told.filter.velocity_m_s)) < 0.1


def test_a_wrong_delay_is_an_error_along_the_way():
    told = Told((5.0, 0.0)).fly(10.0, late_s=0.25)
    assert told.filter.position_m[0] == pytest.approx(-1.0, abs=0.2)


@pytest.mark.parametrize('offset_m', [5.0, 30.0])
def test_a_jump_is_ignored_for_10_s_and_then_adopted(offset_m):
    told = Told().fly(5.0)
    told.fly(9.5, offset_m=offset_m)
    assert abs(told.filter.position_m[0]) < 0.5
    assert max(map(abs, told.filter.velocity_m_s)) < 0.2
    told.fly(1.0, offset_m=offset_m)
    assert told.filter.position_m[0] == pytest.approx(offset_m, abs=0.5)
    assert not told.filter.is_unsure


def test_a_jump_with_another_number_of_resets_is_adopted_at_once():
    told = Told().fly(5.0).fly(0.2, offset_m=30.0, resets=2)
    assert told.filter.position_m[0] == pytest.approx(30.0, abs=0.1)
    assert abs(told.filter.velocity_m_s[0]) < 0.2


@pytest.mark.parametrize(('velocity', 'limit_s'), [(False, 7.1), (True, 10.2)])
def test_velocity_alone_is_no_position_for_long(velocity, limit_s):
    told = Told().fly(limit_s - 0.1, position=False, velocity=velocity)
    assert told.filter.has_position(told.time_s)
    told.fly(0.2, position=False, velocity=velocity)
    assert not told.filter.has_position(told.time_s)


def test_without_any_position_before_it_has_none_until_it_is_told_one():
    told = Told()
    told.filter.begin(0.0, (0.0, 0.0), aided_s=None)
    told.fly(0.5, position=False)
    assert not told.filter.has_position(told.time_s)
    assert told.fly(0.2).filter.has_position(told.time_s)


def test_values_that_are_not_numbers_are_ignored():
    told = Told().fly(1.0)
    told.filter.see_position(told.time_s, (nan, 0.0), 7)
    told.filter.see_velocity(told.time_s, (0.0, nan))
    assert abs(told.filter.position_m[0]) < 0.5


def test_tilt_is_told_in_the_axes_of_the_vehicle():
    """Thrust believed to point north: nose down heading north, left side down heading east."""
    told = Told()
    told.fly(2.0, velocity=False)
    for _ in range(12):
        told.fly(0.1, offset_m=0.6, velocity=False)
    north = told.filter.tilt_rad(0.0)
    assert north[1] < -0.001
    turned = told.filter.tilt_rad(0.5 * pi)
    assert turned[0] == pytest.approx(north[1])
    assert turned[1] == pytest.approx(-north[0])
