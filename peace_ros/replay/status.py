# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prompts and decisions as key/value pairs, under the keys that the nodes publish."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from peace_ros.domain import Pose, Prompt
    from peace_ros.landing import Decision


def prompt_values(prompt: Prompt) -> dict[str, str]:
    """Return the pairs of ``prompt``: template, best words, scores best first."""
    values = {'template': prompt.template}
    for category, ranking in prompt.ranking.items():
        values.update({f'word/{category}': best.word for best in ranking[:1]})
        values.update({f'score/{category}/{each.word}': f'{each.score:.4f}' for each in ranking})
    return values


def status_values(decision: Decision, pose: Pose | None) -> dict[str, str]:
    """Return the pairs of ``landing/status`` that a recording can tell; no vehicle is there."""
    values = {
        'state': decision.state.value,
        'reason': decision.reason,
        'outcome': decision.outcome or '',
        'verdict': decision.verdict.kind.value,
        'verdict_reason': decision.verdict.reason,
    }
    numbers = {
        'effective_threshold': decision.effective_threshold,
        'map_age_s': decision.map_age_s,
        'v_north_m_s': decision.setpoint.v_north_m_s,
        'v_east_m_s': decision.setpoint.v_east_m_s,
        'v_down_m_s': decision.setpoint.v_down_m_s,
        'time_in_state_s': decision.time_in_state_s,
    }
    for name, thing, fields in (
        ('', pose, ('north_m', 'east_m', 'altitude_agl_m')),
        ('site_', decision.site, ('north_m', 'east_m', 'clearance_m', 'area_m2', 'confidence')),
        ('focus_', decision.focus, ('north_m', 'east_m', 'radius_m')),
    ):
        if thing is not None:
            numbers.update({f'{name}{field}': getattr(thing, field) for field in fields})
    values.update({key: f'{value:.3f}' for key, value in numbers.items()})
    values.update({f'heatmaps/{fate}': str(n) for fate, n in sorted(decision.counts.items())})
    return values
