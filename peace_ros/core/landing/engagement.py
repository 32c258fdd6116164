# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a landing may begin: the policy behind the engage service."""

from __future__ import annotations

from peace_ros.core.domain import Health, Level, Telemetry
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.states import CONCERNING_STATES, SILENT_STATES, State
from peace_ros.core.landing.watch import bad_map, bad_vehicle

_MAY_BEGIN = frozenset({State.IDLE, State.HOLD, State.HANDOVER, State.ABORTED})


def engagement_problem(
    state: State,
    telemetry: Telemetry | None,
    telemetry_age_s: float,
    map_age_s: float,
    parameters: LandingParameters,
    last_rejection: str = '',
    distrusted: str = '',
) -> str:
    """Return a sentence why a landing cannot begin now, empty when it can.

    Control of the vehicle is no condition: it is requested after this check.

    Args:
        state: Of the landing so far.
        telemetry: What the autopilot last said, None before it said anything.
        telemetry_age_s: Since it was received, by a steady clock.
        map_age_s: Since the newest heatmap in the map was taken; infinite without one.
        parameters: Their limits of age and altitude hold here too.
        last_rejection: Why a heatmap did not reach the map, empty when all did.
        distrusted: Why inputs cannot be used, whatever they say; empty when they can.
    """
    if state not in _MAY_BEGIN:
        return f'a landing is under way already: {state.value}'
    return (
        bad_vehicle(telemetry, telemetry_age_s, parameters)
        or distrusted
        or bad_map(map_age_s, last_rejection, parameters)
    )


def readiness(state: State, several: str, problem: str) -> Health:
    """Return whether a landing goes well, or could begin now.

    Args:
        state: Of the landing so far.
        several: Which topic has several publishers, empty when none has.
        problem: Why a landing cannot begin now, empty when it can.
    """
    if several:
        return Health(Level.ERROR, f'{state.value}, nothing is engaged: {several}')
    if state not in SILENT_STATES:
        return Health(Level.WARN if state in CONCERNING_STATES else Level.OK, state.value)
    level = Level.ERROR if state is State.ABORTED else Level.WARN if problem else Level.OK
    return Health(level, f'{state.value}, {f"not ready: {problem}" if problem else "ready"}')
