# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What speaks against beginning a landing now."""

from __future__ import annotations

from math import isfinite

from peace_ros.domain import Telemetry
from peace_ros.landing import LandingParameters, State

_MAY_BEGIN = frozenset({State.IDLE, State.HOLD, State.HANDOVER, State.ABORTED})


def reason_against(
    state: State,
    told: Telemetry | None,
    telemetry_age_s: float,
    map_age_s: float,
    parameters: LandingParameters,
) -> str:
    """Return a sentence why the landing cannot be engaged, empty when it can.

    Args:
        state: Of the landing so far.
        told: What the vehicle last said.
        telemetry_age_s: Steady clock, since it said it.
        map_age_s: Node clock, since the newest heatmap in the map was taken.
        parameters: Their limits of age hold here too.

    """
    if state not in _MAY_BEGIN:
        return f'a landing is under way already: {state.value}'
    return _against_vehicle(told, telemetry_age_s, parameters) or _against_map(
        map_age_s, parameters
    )


def _against_vehicle(told: Telemetry | None, age_s: float, parameters: LandingParameters) -> str:
    if told is None or told.pose is None:
        return 'no telemetry: the autopilot has not said where it is; check its streams'
    limit_s = parameters.telemetry_age_limit_s
    if not age_s <= limit_s:
        return f'telemetry is {age_s:.1f} s old, limit {limit_s} s: check the line'
    if not told.armed:
        return 'the vehicle is not armed: a landing begins in the air'
    if told.landed:
        return 'the vehicle is on the ground: a landing begins in the air'
    return ''


def _against_map(age_s: float, parameters: LandingParameters) -> str:
    if not isfinite(age_s):
        return 'no heatmap yet: is segmentation running, and do its stamps and ours share a clock?'
    limit_s = parameters.heatmap_age_limit_s
    if age_s > limit_s:
        return (
            f'the newest heatmap is {age_s:.1f} s old, limit {limit_s} s: is segmentation running?'
        )
    return ''
