# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A decision as key/value pairs of ``landing/status``, in flight and in a replay."""

from __future__ import annotations

from peace_ros.core.domain import Pose
from peace_ros.core.landing.decision import Decision

_POSE = ('north_m', 'east_m', 'altitude_agl_m')
_SITE = ('north_m', 'east_m', 'clearance_m', 'area_m2', 'confidence', 'age_s')
_FOCUS = ('north_m', 'east_m', 'radius_m')
_REFUSED = ('north_m', 'east_m', 'clearance_m', 'distance_m')


def decision_pairs(decision: Decision, pose: Pose | None) -> dict[str, str]:
    """Return the pairs of a decision; what is not known has no key.

    ``north_m``, ``east_m`` and ``altitude_agl_m`` are those of the pose, ``site_...`` and
    ``focus_...`` those of the decision, all in the local NED frame; ``heatmaps/...`` counts the
    heatmaps by result; ``height/..._m`` are heights above ground by other sources;
    ``refused/1/...`` is the best of the places that are no sites.
    """
    numbers = {
        'effective_threshold': decision.effective_threshold,
        'map_age_s': decision.map_age_s,
        'v_north_m_s': decision.setpoint.v_north_m_s,
        'v_east_m_s': decision.setpoint.v_east_m_s,
        'v_down_m_s': decision.setpoint.v_down_m_s,
        'time_in_state_s': decision.time_in_state_s,
    }
    refused = [(f'refused/{n}/', each) for n, each in enumerate(decision.refused, start=1)]
    for prefix, thing, fields in (
        ('', pose, _POSE),
        ('site_', decision.site, _SITE),
        ('focus_', decision.focus, _FOCUS),
        *((prefix, each, _REFUSED) for prefix, each in refused),
    ):
        if thing is not None:
            numbers.update({f'{prefix}{field}': getattr(thing, field) for field in fields})
    numbers.update({f'height/{name}_m': each for name, each in decision.heights_m.items()})
    return {
        'state': decision.state.value,
        'reason': decision.reason,
        'outcome': decision.outcome or '',
        'verdict': decision.verdict.kind.value,
        'verdict_reason': decision.verdict.reason,
        'guard': '; '.join(decision.guard_notes),
        'failed_sites': str(decision.failed_sites),
        'attempts': str(decision.attempts),
        **{f'{prefix}reason': each.reason for prefix, each in refused},
        **{key: f'{number:.3f}' for key, number in numbers.items()},
        **{f'heatmaps/{fate}': str(count) for fate, count in sorted(decision.counts.items())},
    }
