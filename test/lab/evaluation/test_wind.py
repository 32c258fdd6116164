# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Landings in wind against the physics of the simulated autopilot, and which of them are good."""

import json
from dataclasses import replace
from math import hypot

import numpy as np
import pytest

from peace_ros.core.landing import State, guidance
from peace_ros.lab.evaluation import wind
from peace_ros.lab.evaluation.wind import Landed, WindFlight, fly, main, to_and_fro_m

GOOD = Landed(1, True, 30.0, 0.3, 0.8, 19.8, 0.4, 0, 0.0, 0.0, 11.0)


def test_lands_over_the_island_in_wind_and_gusts():
    flight = WindFlight(5.0, 1.5, seed=3)
    landed = flight.run()
    assert landed.is_good, landed
    assert landed.lowest_m < 20.5, 'it came down'
    assert landed.worst_after_m > landed.error_m, 'gusts push after the hand-over too'
    states = {decision.state for *_, decision in flight.track}
    assert {State.LANDING, State.HANDOVER} <= states
    island = flight.island_m
    _, north, east, _ = flight.track[-1]
    assert hypot(north - island[0], east - island[1]) < wind.ISLAND_M - 1.5


def test_a_guidance_that_overreacts_is_noticed(monkeypatch):
    towards = guidance._towards

    def hasty(pose, north_m, east_m, gain, limit_m_s):
        return towards(pose, north_m, east_m, 6.0 * gain, limit_m_s)

    monkeypatch.setattr(guidance, '_towards', hasty)
    landed = WindFlight(5.0, 0.0, seed=1).run()
    assert landed.swing_m > wind.SWING_LIMIT_M or not landed.handed_over
    assert not landed.is_good


@pytest.mark.parametrize(
    'changed',
    [
        {'handed_over': False},
        {'error_m': 1.6},
        {'lowest_m': 18.9},
        {'swing_m': 1.2},
        {'clearance_m': 1.4},
    ],
)
def test_each_limit_counts(changed):
    assert GOOD.is_good
    assert not replace(GOOD, **changed).is_good


def test_what_the_position_is_off_by_is_no_error_of_the_landing():
    """A PX4 with twice its measured errors: it is steered by what it reports."""
    steered = WindFlight(2.0, 0.5, seed=2, px4_errors=2.0)
    landed = steered.run()
    assert landed.handed_over
    assert landed.off_m > 0.01
    assert landed.off_swing_m > 0.1
    assert landed.clearance_m == pytest.approx(steered.clearances_m[1], abs=0.01)
    assert landed.clearance_m > 1.5
    assert replace(GOOD, error_m=1.8, off_m=0.4).is_good
    assert replace(GOOD, swing_m=1.3, off_swing_m=0.4).is_good
    exact = WindFlight(2.0, 0.5, seed=2).run()
    assert exact.off_m == exact.off_swing_m == 0.0


def test_a_way_in_one_direction_is_no_swing():
    steps = np.linspace(0.0, 9.0, 50)
    assert to_and_fro_m(np.c_[steps, -steps]) == 0.0
    circle = np.c_[np.cos(steps), 0.1 * steps]
    assert to_and_fro_m(circle) == pytest.approx(2.0, abs=0.05)
    assert to_and_fro_m(np.empty((0, 2))) == 0.0


def test_the_same_seed_gives_the_same_flight():
    assert fly(1, 5.0, 1.5) == fly(1, 5.0, 1.5)


def test_the_command_tells_each_flight_and_ends_with_the_verdict(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(
        wind, 'fly', lambda *_given, **_options: [GOOD, replace(GOOD, clearance_m=1.0)]
    )
    target = tmp_path / 'wind.json'
    assert main(['--json', str(target)]) == 1
    assert '1 of 2 within error 1.5 m' in capsys.readouterr().out
    assert json.loads(target.read_text())[1]['clearance_m'] == 1.0
    monkeypatch.setattr(wind, 'fly', lambda *_given, **_options: [GOOD])
    assert main([]) == 0
