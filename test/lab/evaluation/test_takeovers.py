# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Set-points after a take-over, over UDP."""

from dataclasses import replace

import pytest

from peace_ros.core.domain import VehicleError
from peace_ros.lab.evaluation import takeovers
from peace_ros.lab.evaluation.takeovers import Takeover, main, take_over

ENDED = Takeover('px4', 'AUTO.RTL', 0.19, noticed=True)


@pytest.mark.parametrize(('autopilot', 'mode'), [('ardupilot', 'LOITER'), ('px4', 'AUTO.LOITER')])
def test_set_points_end_when_somebody_takes_over(autopilot, mode):
    assert take_over(autopilot, mode).holds


def test_a_mode_that_is_not_entered_is_said():
    with pytest.raises((VehicleError, KeyError)):
        take_over('ardupilot', 'POSCTL')


@pytest.mark.parametrize('changed', [{'last_s': 0.31}, {'noticed': False}])
def test_each_limit_counts(changed, monkeypatch, capsys):
    assert ENDED.holds
    assert not replace(ENDED, **changed).holds
    monkeypatch.setattr(takeovers, 'measure', lambda _repeat: [ENDED, replace(ENDED, **changed)])
    assert main([]) == 1
    assert '1 of 2 within 0.3 s' in capsys.readouterr().out
    monkeypatch.setattr(takeovers, 'measure', lambda _repeat: [ENDED])
    assert main([]) == 0
