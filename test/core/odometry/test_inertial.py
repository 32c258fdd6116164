# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Samples of an inertial unit are summed up between any two stamps, or nothing is said."""

from math import inf, nan, pi

import numpy as np
import pytest

from peace_ros.core.domain import InertialSample
from peace_ros.core.domain.geometry import quaternion_from_euler, rotation_matrix
from peace_ros.core.odometry.inertial import InertialHistory

MS = 1_000_000
REST = (0.0, 0.0, -9.8)


def history_of(rates, force=REST, period_ms=10, until_ms=2000):
    history = InertialHistory()
    for at_ms in range(0, until_ms + 1, period_ms):
        assert history.add(InertialSample(at_ms * MS, rates, force))
    return history


@pytest.mark.parametrize(('axis', 'angles'), [(0, (1, 0, 0)), (1, (0, 1, 0)), (2, (0, 0, 1))])
def test_a_constant_rate_is_an_angle(axis, angles):
    rates = [0.0, 0.0, 0.0]
    rates[axis] = 0.4
    motion = history_of(tuple(rates)).between(103 * MS, 1607 * MS)
    turned = quaternion_from_euler(*(0.4 * 1.504 * each for each in angles))
    assert motion.turn == pytest.approx(turned, abs=1e-9)
    assert motion.rates_rad_s == pytest.approx(rates)


def test_rates_that_change_are_interpolated_to_the_stamps():
    history = InertialHistory()
    for at_ms in range(0, 101, 20):
        history.add(InertialSample(at_ms * MS, (0.0, 0.0, at_ms * 0.01), REST))
    motion = history.between(25 * MS, 85 * MS)
    yaw = (0.25 + 0.85) / 2.0 * 0.06
    assert motion.turn == pytest.approx(quaternion_from_euler(0.0, 0.0, yaw), abs=1e-9)
    assert motion.rates_rad_s[2] == pytest.approx(0.85)


def test_the_force_is_summed_in_the_axes_at_the_start():
    history = history_of((0.0, 0.0, pi / 2.0), (2.0, 0.0, 0.0), period_ms=5)
    moved = history.between(0, 1000 * MS).velocity_m_s
    assert moved == pytest.approx([4.0 / pi, 4.0 / pi, 0.0], abs=1e-3)


def test_the_sum_over_two_parts_is_the_sum_over_both():
    history = history_of((0.3, -0.5, 0.8), (1.0, 2.0, -9.0))
    first, second = history.between(0, 510 * MS), history.between(510 * MS, 900 * MS)
    both = history.between(0, 900 * MS)
    turned = rotation_matrix(first.turn)
    assert turned @ rotation_matrix(second.turn) == pytest.approx(
        rotation_matrix(both.turn), abs=1e-6
    )
    joined = first.velocity_m_s + turned @ second.velocity_m_s
    assert joined == pytest.approx(both.velocity_m_s, abs=1e-3)


@pytest.mark.parametrize(('from_ms', 'to_ms'), [(-5, 100), (1900, 2001)])
def test_beyond_the_samples_nothing_is_said(from_ms, to_ms):
    assert history_of((0.0, 0.0, 0.0)).between(from_ms * MS, to_ms * MS) is None


def test_over_a_gap_nothing_is_said():
    history = history_of((0.0, 0.0, 0.0), until_ms=500)
    history.add(InertialSample(600 * MS, (0.0, 0.0, 0.0), REST))
    assert history.between(400 * MS, 600 * MS) is not None
    history.add(InertialSample(701 * MS, (0.0, 0.0, 0.0), REST))
    assert history.between(550 * MS, 650 * MS) is None
    assert history.between(400 * MS, 550 * MS) is not None


@pytest.mark.parametrize('bad', [nan, inf, 36.0, -36.0])
def test_rates_that_no_sensor_measures_are_rejected(bad):
    history = history_of((0.0, 0.0, 0.0), until_ms=20)
    assert not history.add(InertialSample(30 * MS, (0.0, bad, 0.0), REST))
    assert history.between(0, 20 * MS) is not None


@pytest.mark.parametrize('bad', [nan, -inf, 161.0])
def test_forces_that_no_sensor_measures_are_rejected(bad):
    assert not InertialHistory().add(InertialSample(0, (0.0, 0.0, 0.0), (bad, 0.0, 0.0)))


def test_a_sample_that_is_not_newer_is_rejected():
    history = history_of((0.0, 0.0, 0.0), until_ms=20)
    assert not history.add(InertialSample(20 * MS, (9.0, 0.0, 0.0), REST))
    assert not history.add(InertialSample(5 * MS, (9.0, 0.0, 0.0), REST))


def test_ten_seconds_are_kept_and_not_all():
    history = history_of((0.0, 0.0, 0.1), until_ms=60_000)
    assert history.between(50_000 * MS, 60_000 * MS) is not None
    assert history.between(20_000 * MS, 60_000 * MS) is None


def test_at_rest_the_velocity_cancels_gravity():
    moved = history_of((0.0, 0.0, 0.0)).between(0, 1000 * MS).velocity_m_s
    assert moved + np.array([0.0, 0.0, 9.8]) == pytest.approx(np.zeros(3), abs=1e-9)
