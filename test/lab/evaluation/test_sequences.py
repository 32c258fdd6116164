# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever is told to the helm, in whatever order and state, its commands keep the promises."""

import json
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peace_ros.core.landing import State, guidance
from peace_ros.core.landing.guard import Guard
from peace_ros.core.landing.states import TRANSITIONS
from peace_ros.lab.evaluation.sequences import (
    CHOICES,
    PARAMETERS,
    SequenceReport,
    SequenceStep,
    Trial,
    main,
    run,
)

SEQUENCES = int(os.environ.get('PEACE_SEQUENCES', '5000'))

moments = st.builds(
    SequenceStep,
    **{name: st.sampled_from([value for value, _ in options]) for name, options in CHOICES.items()},
)


def test_no_promise_is_broken_in_random_sequences():
    report = run(SEQUENCES, seed=7)
    assert report.failures == []
    assert report.sequences == SEQUENCES
    # A sequence that never moves proves nothing.
    assert set(report.visits) == {state.value for state in State}
    assert report.descents > SEQUENCES // 10
    assert report.handovers > SEQUENCES // 100
    possible = sum(len(targets - {state}) for state, targets in TRANSITIONS.items())
    assert len(report.transitions) > 0.8 * possible


@settings(max_examples=max(100, SEQUENCES // 100), deadline=None)
@given(
    state=st.sampled_from(State),
    parameters=st.sampled_from(PARAMETERS),
    sequence=st.lists(moments, min_size=1, max_size=8),
)
def test_no_promise_is_broken_in_sequences_that_are_sought_out(state, parameters, sequence):
    trial, report = Trial(parameters, state), SequenceReport()
    for moment in sequence:
        trial.step(moment, report)
    assert report.failures == []


def _let_pass(_guard, wish, _given):
    return wish, ''


@pytest.mark.parametrize(
    ('rule', 'promise'),
    [
        ('_descent', 'over ground that is not safe'),
        ('_descent', 'without a fresh map'),
        ('_fence', 'beyond the fence'),
    ],
)
def test_a_guard_with_a_rule_taken_out_is_noticed(monkeypatch, rule, promise):
    monkeypatch.setattr(Guard, rule, _let_pass)
    failures = run(2000, seed=3).failures
    assert any(promise in each for each in failures)


def test_a_core_that_flies_where_it_must_stand_is_noticed(monkeypatch):
    monkeypatch.setattr('peace_ros.core.landing.guidance.STILL_STATES', frozenset())
    monkeypatch.setitem(guidance._FLIGHTS, State.HOLD, guidance._climb)
    assert any('zero is zero' in each for each in run(500).failures)


def test_the_same_seed_gives_the_same_sequences():
    assert vars(run(50, seed=4)) == vars(run(50, seed=4))
    assert vars(run(50, seed=4)) != vars(run(50, seed=5))


def test_the_command_reports_and_ends_with_the_verdict(tmp_path, capsys, monkeypatch):
    target = tmp_path / 'report.json'
    assert main(['--sequences', '30', '--json', str(target)]) == 0
    assert '0 promises broken' in capsys.readouterr().out
    assert json.loads(target.read_text())['moments'] == 360
    monkeypatch.setattr(Guard, '_descent', _let_pass)
    assert main(['--sequences', '2000']) == 1
