# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a landing may begin, and the sentence when it may not."""

from math import inf, nan

import pytest

from peace_ros.core.domain import Level, Pose, Telemetry
from peace_ros.core.landing import LandingParameters, State, engagement_problem, readiness

LEVEL = (1.0, 0.0, 0.0, 0.0)
POSE = Pose(0, 0.0, 0.0, -100.0, LEVEL, 100.0)
LOST = Pose(0, 0.0, 0.0, -100.0, LEVEL, nan)
FLYING = {'pose': POSE, 'armed': True, 'landed': False}


@pytest.mark.parametrize('state', State)
def test_a_landing_begins_only_where_none_is_under_way(state):
    problem = engagement_problem(state, Telemetry(1, **FLYING), 0.0, 0.0, LandingParameters())
    over = state in {State.IDLE, State.HOLD, State.HANDOVER, State.ABORTED}
    assert problem == ('' if over else f'a landing is under way already: {state.value}')


@pytest.mark.parametrize(
    ('told', 'telemetry_age_s', 'map_age_s', 'word'),
    [
        (None, 0.0, 0.0, 'no telemetry'),
        ({**FLYING, 'pose': None}, 0.0, 0.0, 'no telemetry'),
        ({**FLYING, 'pose': None, 'position_problem': 'it jumped'}, 0.0, 0.0, 'it jumped'),
        ({**FLYING, 'pose': LOST}, 0.0, 0.0, 'not valid'),
        (FLYING, 0.7, 0.0, ''),
        (FLYING, 0.71, 0.0, '0.7 s old, limit 0.7 s'),
        (FLYING, 5.0, 0.0, '5.0 s old'),
        (FLYING, nan, 0.0, 'old'),
        ({**FLYING, 'armed': False}, 0.0, 0.0, 'not armed'),
        ({**FLYING, 'landed': True}, 0.0, 0.0, 'on the ground'),
        ({**FLYING, 'landed': None}, 0.0, 0.0, ''),
        (FLYING, 0.0, inf, 'no heatmap yet'),
        (FLYING, 0.0, nan, 'no heatmap yet'),
        (FLYING, 0.0, 2.0, ''),
        (FLYING, 0.0, 9.0, '9.0 s old, limit 2.0 s: is segmentation running?'),
    ],
)
def test_says_why_a_landing_cannot_begin(told, telemetry_age_s, map_age_s, word):
    telemetry = None if told is None else Telemetry(1, **told)
    problem = engagement_problem(
        State.IDLE, telemetry, telemetry_age_s, map_age_s, LandingParameters()
    )
    assert word in problem
    assert bool(problem) == bool(word)


@pytest.mark.parametrize(
    ('state', 'several', 'problem', 'level', 'words'),
    [
        (State.IDLE, '', '', Level.OK, 'IDLE, ready'),
        (State.IDLE, '', 'not armed', Level.WARN, 'IDLE, not ready: not armed'),
        (State.ABORTED, '', '', Level.ERROR, 'ABORTED, ready'),
        (State.LANDING, '', 'under way', Level.OK, 'LANDING'),
        (State.HOLD, '', 'no heatmap', Level.WARN, 'HOLD'),
        (State.LANDING, '2 publishers', '', Level.ERROR, 'nothing is engaged: 2 publishers'),
    ],
)
def test_readiness_is_the_level_of_the_landing(state, several, problem, level, words):
    found = readiness(state, several, problem)
    assert found.level is level
    assert words in found.sentence
