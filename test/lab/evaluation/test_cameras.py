# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Landings with wide frames, distortion and a mount that looks ahead, by ground truth."""

from dataclasses import replace

import pytest

from peace_ros.core.domain import NADIR, Camera
from peace_ros.lab.evaluation import cameras
from peace_ros.lab.evaluation.cameras import CASES, CameraLanding, land, main
from peace_ros.lab.evaluation.wind import Landed, WindFlight

GOOD = CameraLanding(Landed(1, True, 30.0, 0.3, 0.8, 19.8, 0.4, 0, 0.0, 0.0, 8.5), 8.0, 8.5, 0.2)


@pytest.mark.parametrize('case', CASES, ids=lambda case: case.name)
def test_each_camera_brings_the_vehicle_to_the_place_that_it_believed_in(case):
    landing = land(case, seed=4)
    assert landing.is_good, landing


@pytest.mark.parametrize('wrong', ['stretched', 'nadir'])
def test_a_camera_that_is_taken_for_another_one_is_noticed(monkeypatch, wrong):
    """What flew before: a frame taken for a square pinhole, and a mount that is not known."""
    case = CASES[3]
    flight = WindFlight(3.0, 1.0, 3, camera=case.camera, mount=case.mount)
    if wrong == 'stretched':
        flight._camera = Camera.from_degrees(352, 352, 95.0)
    else:
        monkeypatch.setattr(flight._core._intake, '_mount', NADIR)
    landed = flight.run()
    landing = CameraLanding(landed, *flight.clearances_m, flight.map_error_m())
    assert not landing.is_good, landing


@pytest.mark.parametrize(
    'changed',
    [
        {'landed': replace(GOOD.landed, handed_over=False)},
        {'landed': replace(GOOD.landed, error_m=1.1)},
        {'clearance_m': 6.9},
        {'map_error_m': 1.1},
    ],
)
def test_each_limit_counts(changed):
    assert GOOD.is_good
    assert not replace(GOOD, **changed).is_good


def test_the_command_tells_each_camera_and_ends_with_the_verdict(capsys, monkeypatch):
    monkeypatch.setattr(cameras, 'land', lambda *_given: GOOD)
    assert main(['--seeds', '2']) == 0
    assert capsys.readouterr().out.count('2 of 2 within 1 m') == len(CASES)
    bad = replace(GOOD, map_error_m=1.5)
    monkeypatch.setattr(cameras, 'land', lambda case, _seed: bad if case is CASES[1] else GOOD)
    assert main(['--seeds', '2']) == 1
    assert (
        '0 of 2 within 1 m; at most 0.30 m beside the site, 1.50 m error' in capsys.readouterr().out
    )
