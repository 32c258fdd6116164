# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the evaluation of the odometry flies, how it judges, and what it prints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from peace_ros.core.domain import Pose
from peace_ros.core.domain.geometry import quaternion_from_euler, rotation_matrix
from peace_ros.lab.evaluation.odometry import __main__ as command
from peace_ros.lab.evaluation.odometry.flight import (
    CAMERA,
    Conditions,
    SeenMotion,
    fly,
    memory_mb,
    register_along,
)
from peace_ros.lab.evaluation.odometry.ground import HillCamera, draw_hills
from peace_ros.lab.evaluation.odometry.motion import InertialUnit, Motion
from peace_ros.lab.evaluation.odometry.random_sequences import (
    MOVING,
    Count,
    draw_flight,
    drifted,
    is_wrong,
)
from peace_ros.simulation import NadirCamera, draw_world

MOTION = Motion(
    50.0, speed_m_s=3.0, course_rad=0.8, sway_m_s=1.0, lean_deg=10.0, yaw_rate_deg_s=15.0
)


@pytest.fixture(scope='module')
def world():
    return draw_world(3, 200.0, 0.25)


@pytest.fixture(scope='module')
def see(world):
    eye = NadirCamera(world, CAMERA)
    return lambda pose, _: eye.view(pose).image_rgb


def test_rates_and_forces_belong_to_the_motion():
    """Integrated in small steps they give attitude and velocity of a second later."""
    step_s, steps = 1e-3, 1000
    turned = rotation_matrix(MOTION.pose(0.3).quaternion_ned_frd)
    velocity = MOTION.velocity(0.3)
    for step in range(steps):
        rates, force = MOTION.rates_and_force(0.3 + (step + 0.5) * step_s)
        velocity = velocity + step_s * (turned @ force + np.array([0.0, 0.0, 9.80665]))
        p, q, r = step_s * rates
        turned = turned @ (np.eye(3) + np.array([[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]]))
    end = rotation_matrix(MOTION.pose(1.3).quaternion_ned_frd)
    assert turned == pytest.approx(end, abs=0.003)
    assert velocity == pytest.approx(MOTION.velocity(1.3), abs=0.03)


def test_an_inertial_unit_errs_as_asked():
    random = np.random.default_rng(1)
    exact = InertialUnit(MOTION, random, 0.0).measure(1.0)
    rates, force = MOTION.rates_and_force(1.0)
    assert exact.rates_rad_s == pytest.approx(rates)
    assert exact.specific_force_m_s2 == pytest.approx(force)
    noisy = InertialUnit(MOTION, random).measure(1.0)
    assert noisy.rates_rad_s != exact.rates_rad_s


def test_hills_are_where_the_camera_sees_them(world):
    """A hill is nearer to the camera: it looks farther from the middle."""
    flat = HillCamera(world, CAMERA, np.zeros((100, 100), np.float32))
    attitude = quaternion_from_euler(0.1, -0.1, 0.5)
    pose = Pose(0, 5.0, -8.0, -40.0, attitude, 40.0)
    same = NadirCamera(world, CAMERA).view(pose).image_rgb.astype(int)
    assert np.abs(flat.view(pose).astype(int) - same).mean() < 3.0
    high = HillCamera(world, CAMERA, np.full((100, 100), 4.0, np.float32)).view(pose)
    lower = replace(pose, altitude_agl_m=36.0)
    near = NadirCamera(world, CAMERA).view(lower).image_rgb.astype(int)
    assert np.abs(high.astype(int) - near).mean() < 3.0
    assert np.abs(high.astype(int) - same).mean() > 5.0


def test_hills_keep_their_height_and_are_the_same_for_a_seed():
    hills = draw_hills(200.0, 3.0, 5)
    assert np.abs(hills).max() == pytest.approx(3.0)
    assert hills.std() > 0.5
    assert (draw_hills(200.0, 3.0, 5) == hills).all()
    assert not (draw_hills(200.0, 3.0, 6) == hills).all()


def test_a_flight_compares_with_the_truth(see):
    found = fly(SeenMotion(MOTION, see, 1), 2.0)
    assert found.frames == 20
    assert len(found.errors_m_s) == 16
    assert max(found.lengths_m_s) < 0.25
    assert found.bias_m_s < 0.1
    assert found.position_error_m < 0.3
    wrong = fly(SeenMotion(MOTION, see, 1, Conditions(altitude_factor=0.8)), 2.0)
    assert max(wrong.lengths_m_s, default=9.0) > 0.4


def test_a_covered_lens_and_a_lag_are_felt(see):
    dark = Conditions(dark_from_s=0.55, dark_until_s=1.25)
    assert fly(SeenMotion(MOTION, see, 1, dark), 2.0).doubts['DIFFERENT'] == 7
    quick = replace(MOTION, lean_period_s=1.0)
    good, late = (fly(SeenMotion(quick, see, 1, Conditions(lag_s=each)), 2.0) for each in (0, 0.1))
    assert good.doubts.total() == 4
    assert late.doubts.total() > 8


def test_registration_is_measured_beside_it(see):
    found = register_along(SeenMotion(Motion(40.0, speed_m_s=2.0), see, 1), 1.0)
    assert found.frames == 6
    assert found.bias_m_s < 0.3
    assert len(found.used_s) == 6


def test_memory_is_measured(see):
    assert 0.0 <= memory_mb(SeenMotion(MOTION, see, 1), 10) < 40.0


@pytest.mark.parametrize(
    ('error', 'speed', 'wrong'),
    [
        (1.01, 8.0, True),
        (0.99, 8.0, False),
        (0.61, 3.0, True),
        (0.59, 3.0, False),
        (0.29, 0.1, False),
        (0.31, 0.1, True),
    ],
)
def test_a_wrong_velocity_is_one_above_the_limits(error, speed, wrong):
    assert is_wrong(error, speed) is wrong


def test_a_count_keeps_the_numbers_of_wrong_sequences(see):
    count, found = Count(), fly(SeenMotion(MOTION, see, 1), 1.0)
    count.add(4, found)
    found.errors_m_s[0] = (3.0, 0.0)
    count.add(5, found)
    assert (count.sequences, count.wrong, count.frames) == (2, [5], 20)
    assert count.largest_m_s == 3.0


def test_ground_that_moves_looks_like_a_vehicle_that_moves_back():
    pose = drifted(MOTION.pose(0.0), np.array([2.0, -1.0]), 3.0)
    assert (pose.north_m, pose.east_m) == (-6.0, 3.0)


def test_the_same_seed_draws_the_same_flight():
    first, second = (draw_flight(np.random.default_rng([1, 7])) for _ in range(2))
    assert first == second
    assert draw_flight(np.random.default_rng([1, 8])) != first


class FewGrounds:
    """One world, so that the test is quick."""

    kinds = ('flat', 'hills', MOVING)

    def __init__(self, eye):
        self._eye = eye

    def see(self, kind, random):
        return self._eye


def test_the_command_counts_sequences(monkeypatch, see, capsys):
    monkeypatch.setattr(command, 'Grounds', lambda: FewGrounds(see))
    assert command.main(['--sequences', '3']) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].split()[:3] == ['ground', 'sequences', 'wrong']
    rows = [line for line in out[1:] if not line.startswith('  wrong')]
    assert 1 <= len(rows) <= 3


def test_the_count_ends_when_its_time_is_over(monkeypatch, see, capsys):
    monkeypatch.setattr(command, 'Grounds', lambda: FewGrounds(see))
    assert command.main(['--sequences', '3', '--minutes', '0']) == 0
    rows = capsys.readouterr().out.splitlines()[1:]
    assert len([line for line in rows if not line.startswith('  wrong')]) == 1


@pytest.mark.parametrize(('error_m', 'status'), [(1.5, 0), (0.0, 1)])
def test_the_command_fails_when_a_limit_is_not_kept(monkeypatch, see, capsys, error_m, status):
    monkeypatch.setattr(command, '_grounds', lambda _: {'flat': see})
    monkeypatch.setattr(command, 'HEIGHTS_M', (60.0,))
    kept = {name: command.MOTIONS[name] for name in list(command.MOTIONS)[:1]}
    fast = command.MOTIONS['all three, 5 m/s']
    monkeypatch.setattr(command, 'MOTIONS', {**kept, 'all three, 5 m/s': fast})
    if status:
        monkeypatch.setattr(command, 'LIMITS', {60.0: (0.0, 0.0)})
    assert command.main(['--seconds', '1.5', '--ground-error', str(error_m)]) == status
    out = capsys.readouterr().out
    assert 'flat, 60 m, level, 2 m/s' in out
    assert 'registration: mean' in out
    assert 'MB more than before' in out
