# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""GNSS that is lost in a descent: the landing stops, by the messages of the autopilot."""

from dataclasses import replace

import pytest

from peace_ros.lab.evaluation import gnss_loss
from peace_ros.lab.evaluation.gnss_loss import GnssLoss, GnssLossFlight, main

HELD = GnssLoss('px4', 50.0, 1, 2.5, 0.2, 1.9, 2.4, 'HOLD')


@pytest.mark.parametrize('px4', [False, True])
def test_the_vehicle_is_told_to_stop_within_a_second_and_stands(px4):
    flown = GnssLossFlight(30.0, 1, px4=px4).result()
    assert flown.descent_m_s > 1.0, 'it was lost in a descent'
    assert flown.at_m == pytest.approx(30.0, abs=0.5)
    assert flown.told_s <= 1.0
    assert flown.stood_s is not None
    assert flown.state == 'HOLD'
    assert flown.holds


def test_a_landing_that_goes_on_blindly_is_noticed(monkeypatch):
    """Without the fix in GPS_RAW_INT dead reckoning looks like a position."""
    build = gnss_loss.Streams.build

    def without_fix(self, message_id, flight):
        return None if message_id == 24 else build(self, message_id, flight)

    monkeypatch.setattr(gnss_loss.Streams, 'build', without_fix)
    flown = GnssLossFlight(30.0, 1, px4=False).result()
    assert not flown.holds


@pytest.mark.parametrize('changed', [{'told_s': 1.1}, {'stood_s': None}])
def test_each_limit_counts(changed):
    assert HELD.holds
    assert not replace(HELD, **changed).holds


def test_the_command_ends_with_the_verdict(monkeypatch, capsys):
    monkeypatch.setattr(gnss_loss, 'measure', lambda *_given: [HELD])
    assert main([]) == 0
    assert '1 of 1 told to stop within 1 s' in capsys.readouterr().out
    for found in ([replace(HELD, told_s=2.0)], [replace(HELD, state='LANDING')], []):
        monkeypatch.setattr(gnss_loss, 'measure', lambda *_given, found=found: found)
        assert main([]) == 1
