# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Landings with a barometer that becomes wrong, and which of them are good."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf

import pytest

from peace_ros.core.landing import picture_height
from peace_ros.core.mapping import Mismatch
from peace_ros.lab.evaluation import heights
from peace_ros.lab.evaluation.heights import BarometerFault, HeightResult, faults, fly, main

OVER = HeightResult('step of +3 m at 25 m', 1, '', None, 20.1, 2.9, 19.9, 0.01)


def test_a_step_is_said_with_both_figures_and_nothing_is_handed_over():
    (flown,) = fly([BarometerFault(8.0, 30.0)], ['pictures'])
    assert flown.is_good
    assert flown.handed_over_m is None
    assert 'by the autopilot and' in flown.warned
    assert flown.warned_after_s < 6.0


def test_a_fault_that_no_source_shows_is_counted(monkeypatch):
    monkeypatch.setattr(picture_height, 'height_change', lambda *_: Mismatch.DIFFERENT)
    (flown,) = fly([BarometerFault(8.0, 30.0)], ['pictures'])
    assert not flown.warned
    assert flown.handed_over_m == pytest.approx(12.0, abs=1.0)
    assert not flown.is_good


def test_without_a_fault_nothing_holds():
    (flown,) = fly([None], heights.SOURCES)
    assert not flown.warned
    assert flown.handed_over_m == pytest.approx(20.0, abs=1.0)
    assert flown.picture_error < 0.04


@pytest.mark.parametrize(
    ('changed', 'good'),
    [
        ({}, True),
        ({'off_m': 3.1}, False),
        ({'off_m': -3.1, 'warned': 'differs'}, True),
        ({'handed_over_m': 14.9, 'warned': 'differs'}, False),
        ({'handed_over_m': None}, False),
        ({'handed_over_m': None, 'warned': 'differs'}, True),
    ],
)
def test_each_limit_counts(changed, good):
    assert replace(OVER, **changed).is_good is good


def test_every_step_and_drift_is_flown():
    flown = set(faults())
    assert len(flown) == 64
    for size_m in (3.0, 5.0, 8.0, 15.0):
        for at_m in (90.0, 60.0, 40.0, 25.0):
            assert {BarometerFault(size_m, at_m, inf), BarometerFault(-size_m, at_m, inf)} <= flown


@pytest.mark.parametrize(('warned', 'status'), [('differs', 0), ('', 1)])
def test_the_command_writes_its_flights(monkeypatch, tmp_path, capsys, warned, status):
    asked = []

    def flights(flights, sources, **settings):
        asked.extend((flights, sources, settings))
        return [replace(OVER, off_m=8.0, warned=warned), replace(OVER, fault='', off_m=0.0)]

    monkeypatch.setattr(heights, 'fly', flights)
    path = tmp_path / 'flights.json'
    given = ['--every', '32', '--sound', '1', '--sources', 'GNSS', '--px4', '--json', str(path)]
    assert main(given) == status
    assert [str(each) for each in asked[0]] == [
        str(BarometerFault(3.0, 90.0)),
        'drift of +3 m at 90 m',
        'None',
    ]
    assert asked[1] == ['GNSS']
    assert asked[2]['px4'] is True
    assert [each['fault'] for each in json.loads(path.read_text())] == [OVER.fault, '']
    out = capsys.readouterr().out
    assert f'{1 - status} of 1 faults' in out
    assert '1 flights without a fault: 0 holds for heights, 1 hand-overs, lowest 20.10 m' in out
