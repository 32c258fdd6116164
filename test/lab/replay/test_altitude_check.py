# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Altitudes that do not fit the scale of the pictures are said aloud, true ones are not."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import Camera, Frame, Pose
from peace_ros.lab.replay.altitude_check import AltitudeCheck
from peace_ros.simulation import NadirCamera, draw_world

CAMERA = Camera.from_degrees(256, 256, 73.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
SECOND = 1_000_000_000


@pytest.fixture(scope='module')
def eye() -> NadirCamera:
    return NadirCamera(draw_world(3, 160.0, 0.2), CAMERA)


def checked(eye: NadirCamera, heights_m, told_m, *, are_recorded=True) -> str | None:
    check = AltitudeCheck(CAMERA, are_recorded=are_recorded)
    for k, (height, told) in enumerate(zip(heights_m, told_m, strict=True)):
        image, *_ = eye.view(Pose(k, 0.0, 0.0, -height, LEVEL, height))
        check.add(Frame(image, k * SECOND), Pose(k * SECOND, 0.0, 0.0, -told, LEVEL, told))
    return check.remark()


DESCENT = [60.0, 58.0, 56.0, 54.0, 52.0, 50.0]


@pytest.mark.parametrize('off_m', [120.0, 480.0, -35.0])
def test_an_altitude_above_another_level_is_said_with_the_ground(eye, off_m) -> None:
    remark = checked(eye, DESCENT, [each + off_m for each in DESCENT])
    assert 'the altitudes are doubtful' in remark
    given = float(remark.partition('--ground ')[2].partition(',')[0])
    assert given == pytest.approx(off_m, abs=6.0)


@pytest.mark.parametrize('heights_m', [DESCENT, DESCENT[::-1], [60.0] * 6, [60.0, 59.5, 59.0]])
def test_true_altitudes_and_flights_that_show_nothing_are_not_doubted(eye, heights_m) -> None:
    assert checked(eye, heights_m, heights_m) is None


def test_an_altitude_that_goes_the_other_way_is_said(eye) -> None:
    assert 'do not belong' in checked(eye, DESCENT, DESCENT[::-1])


def test_assumed_altitudes_are_compared_by_their_factors_alone(eye) -> None:
    # Their differences are not true, so that no --ground can be told from them.
    remark = checked(eye, DESCENT, [100.0, 84.0, 68.0, 52.0, 36.0, 20.0], are_recorded=False)
    assert 'from 100 m to 20 m' in remark
    assert 'by the factor 0.20, in the pictures by 0.8' in remark
    assert '--altitude' in remark
    assert '--ground' not in remark
    doubled = [2.0 * each for each in DESCENT]
    assert checked(eye, DESCENT, doubled, are_recorded=False) is None
