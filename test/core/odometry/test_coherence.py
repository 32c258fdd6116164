# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A velocity over ground that no acceleration explains is doubted."""

import numpy as np
import pytest

from peace_ros.core.odometry.coherence import AccelerationCheck

LIMIT_M_S = 0.5
STEP_S = 0.1


class Told:
    """A vehicle whose pictures say more or less than its accelerations."""

    def __init__(self, *, error_m_s2=0.0):
        self.check = AccelerationCheck(LIMIT_M_S)
        self.error_m_s2 = error_m_s2
        self.stamp_ns = 5_000_000_000
        self.velocity = np.array([1.0, -0.5, 0.3])
        self.check.begin(self.stamp_ns, self.velocity)

    def step(self, ground=(0.0, 0.0), acceleration=(0.0, 0.0), *, sees=True):
        """Return whether the pictures are doubted; ground: velocity by which it moves (m/s)."""
        self.stamp_ns += round(STEP_S * 1e9)
        change = STEP_S * np.array([*acceleration, 0.0])
        self.velocity = self.velocity + change
        self.check.accelerate(
            self.stamp_ns, change + STEP_S * np.array([self.error_m_s2, 0.0, 9.0])
        )
        if not sees:
            return None
        return self.check.compare(self.stamp_ns, self.velocity - np.array([*ground, 5.0]))


def test_a_vehicle_that_accelerates_is_not_doubted():
    told = Told()
    for step in range(300):
        swing = 2.0 * np.cos(0.1 * step)
        assert not told.step(acceleration=(swing, -swing))


@pytest.mark.parametrize('speed_m_s', [0.6, 1.0, 3.0])
def test_ground_that_begins_to_move_is_doubted_and_stays_so(speed_m_s):
    told = Told()
    for _ in range(50):
        assert not told.step()
    assert all(told.step(ground=(0.0, speed_m_s)) for _ in range(200))
    assert told.check.off_m_s == pytest.approx(speed_m_s, abs=0.05)
    assert not told.step()


def test_ground_that_moves_from_the_start_is_doubted():
    told = Told()
    assert told.step(ground=(1.0, 0.0))


def test_a_constant_error_of_the_acceleration_is_learned():
    """A tilt that is wrong by 2 degrees, which grows slowly."""
    told = Told()
    for step in range(600):
        told.error_m_s2 = min(0.34, 0.34 * step / 300.0)
        assert not told.step()
    assert told.check.off_m_s < 0.05


def test_what_was_learned_while_ground_stood_still_counts_during_a_doubt():
    told = Told(error_m_s2=0.1)
    for _ in range(300):
        told.step()
    assert all(told.step(ground=(1.0, 0.0)) for _ in range(100))
    assert told.check.off_m_s == pytest.approx(1.0, abs=0.1)


def test_after_a_time_without_pictures_the_limit_is_wider():
    told = Told(error_m_s2=0.15)
    for _ in range(60):
        told.step(sees=False)
    assert not told.step(), '0.9 m/s off'
    told = Told(error_m_s2=0.15)
    for _ in range(60):
        told.step(sees=False)
    assert told.step(ground=(1.5, 0.0))


def test_a_velocity_of_some_time_ago_is_compared_with_that_of_then():
    told = Told()
    for step in range(30):
        told.step(acceleration=(5.0, 0.0), sees=step < 10)
    late_ns = told.stamp_ns - 500_000_000
    then = told.velocity - np.array([2.5, 0.0, 0.0])
    assert not told.check.compare(late_ns, then)
    assert told.check.off_m_s < 0.01
