# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ``landing/status`` says: the state, a sentence, and everything behind it as pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray

from peace_ros.domain import Telemetry
from peace_ros.landing import Decision, State
from peace_ros.nodes.messages import ERROR, OK, WARN, diagnostic_array

_CONCERNING = frozenset({State.WAITING, State.CLIMBING, State.RESTARTING, State.HOLD})


@dataclass(frozen=True)
class Situation:
    """What the node knows besides the decision."""

    telemetry: Telemetry | None
    telemetry_age_s: float
    """By the steady clock, infinite before the first."""
    problem: str = ''
    """Why the vehicle cannot be reached, empty when it can."""
    sender: str = ''
    """What the timed sender does."""


def status_message(decision: Decision, situation: Situation, at_ns: int) -> DiagnosticArray:
    """Return the status; a vehicle that cannot be reached is a HOLD, whatever was decided."""
    state = State.HOLD if situation.problem else decision.state
    reason = situation.problem or decision.reason
    level = ERROR if state is State.ABORTED else WARN if state in _CONCERNING else OK
    pairs = [
        ('state', state.value),
        ('reason', reason),
        ('outcome', decision.outcome or ''),
        *_vehicle(situation),
        *_judgement(decision),
        *_motion(decision, situation),
    ]
    return diagnostic_array(at_ns, 'landing/status', level, f'{state.value}: {reason}', pairs)


def _vehicle(situation: Situation) -> Iterator[tuple[str, str]]:
    yield 'telemetry_age_s', f'{situation.telemetry_age_s:.2f}'
    told = situation.telemetry
    if told is None:
        return
    yield 'mode', told.mode
    yield 'armed', _truth(told.armed)
    yield 'in_control', _truth(told.in_control)
    yield 'landed', _truth(told.landed)
    yield 'status_text', told.status_text
    if told.pose is not None:
        yield 'altitude_agl_m', f'{told.pose.altitude_agl_m:.2f}'
        yield 'north_m', f'{told.pose.north_m:.2f}'
        yield 'east_m', f'{told.pose.east_m:.2f}'


def _judgement(decision: Decision) -> Iterator[tuple[str, str]]:
    yield 'verdict', decision.verdict.kind.value
    yield 'verdict_reason', decision.verdict.reason
    yield 'effective_threshold', f'{decision.effective_threshold:.3f}'
    yield 'map_age_s', f'{decision.map_age_s:.2f}'
    yield 'failed_sites', str(decision.failed_sites)
    site, focus = decision.site, decision.focus
    if site is not None:
        yield 'site_north_m', f'{site.north_m:.2f}'
        yield 'site_east_m', f'{site.east_m:.2f}'
        yield 'site_clearance_m', f'{site.clearance_m:.2f}'
        yield 'site_area_m2', f'{site.area_m2:.1f}'
        yield 'site_confidence', f'{site.confidence:.3f}'
        yield 'site_age_s', f'{site.age_s:.2f}'
    if focus is not None:
        yield 'focus_north_m', f'{focus.north_m:.2f}'
        yield 'focus_east_m', f'{focus.east_m:.2f}'
        yield 'focus_radius_m', f'{focus.radius_m:.2f}'
    for fate, count in sorted(decision.counts.items()):
        yield f'heatmaps/{fate}', str(count)


def _motion(decision: Decision, situation: Situation) -> Iterator[tuple[str, str]]:
    wish = decision.setpoint
    yield 'v_north_m_s', f'{wish.v_north_m_s:.3f}'
    yield 'v_east_m_s', f'{wish.v_east_m_s:.3f}'
    yield 'v_down_m_s', f'{wish.v_down_m_s:.3f}'
    yield 'guard', '; '.join(decision.guard_notes)
    yield 'sender', situation.sender
    yield 'time_in_state_s', f'{decision.time_in_state_s:.2f}'


def _truth(value: bool | None) -> str:
    return 'unknown' if value is None else str(value).lower()
