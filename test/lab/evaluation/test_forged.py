# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile messages in a flight: none ends the link, none is believed alone."""

import json

import pytest

from peace_ros.core.vehicle.boots import BootClock, BootMoment
from peace_ros.core.vehicle.heights import HomeHeight
from peace_ros.core.vehicle.trust import JumpWatch, Pairwise
from peace_ros.lab.evaluation import forged


@pytest.mark.parametrize('seed', [0, 1])
def test_nothing_that_a_single_message_introduced_is_believed(seed):
    report = forged.run_forged(2000, seed)
    assert (report.tracebacks, report.wrongly_believed) == ([], [])
    assert report.messages == 2000
    assert min(report.kinds.values()) > 50
    assert report.believed > 0.9 * report.moments > 9000, 'the true messages are believed'


@pytest.mark.parametrize(
    ('owner', 'name', 'what'),
    [
        (JumpWatch, 'believes', 'a position'),
        (JumpWatch, '_is_near', 'a position'),
        (Pairwise, 'believes', 'a height'),
        (BootClock, 'judge', 'a reboot'),
        (HomeHeight, '_take', 'a height'),
    ],
)
def test_a_guard_that_is_taken_away_is_noticed(monkeypatch, owner, name, what):
    def old_rule(_self, boot_ms, *_):
        return BootMoment.REBOOTED if boot_ms < 1000 else BootMoment.FITS

    def any_home(self, home_m, origin_m, told_m, **_how):
        self.home_msl_m, self._origin_msl_m, self._told_m = home_m, origin_m, told_m
        self.down_m = None if home_m is None or origin_m is None else origin_m - home_m
        return True

    careless = {'judge': old_rule, '_take': any_home}.get(name, lambda *_args, **_how: True)
    monkeypatch.setattr(owner, name, careless)
    report = forged.run_forged(1000, seed=3)
    assert not report.holds
    assert any(what in line for line in report.wrongly_believed)


def test_a_first_message_that_is_enough_is_noticed(monkeypatch):
    """Of flights without terrain data: the third and the fourth of each four."""
    pairs = Pairwise.__init__

    def trusting(self, limit, **_first):
        pairs(self, limit)

    monkeypatch.setattr(Pairwise, '__init__', trusting)
    monkeypatch.setattr(forged, 'FLIGHT', 100)
    report = forged.run_forged(800, seed=3)
    assert any('terrain data' in line for line in report.wrongly_believed)
    assert any('rangefinder' in line for line in report.wrongly_believed)


def test_a_traceback_is_counted(monkeypatch, capsys):
    monkeypatch.setattr(forged, '_THERE', None)
    monkeypatch.setattr(forged.Peer, '_warn', lambda *_args, **_how: 1 / 0)
    assert forged.main(['--messages', '100']) == 1
    told = json.loads(capsys.readouterr().out)
    assert told['tracebacks'] > 0
    assert 'ZeroDivisionError' in told['shown'][0]
