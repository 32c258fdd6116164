# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A map of safe ground and telemetry become a decision: state, verdict, set-point."""

from peace_ros.core.landing.core import LandingCore
from peace_ros.core.landing.decision import Decision, Focus, Verdict, VerdictKind
from peace_ros.core.landing.engagement import engagement_problem, readiness
from peace_ros.core.landing.parameters import SAFETY_THRESHOLD_FLOOR, LandingParameters
from peace_ros.core.landing.states import CONCERNING_STATES, SILENT_STATES, State

__all__ = [
    'CONCERNING_STATES',
    'SAFETY_THRESHOLD_FLOOR',
    'SILENT_STATES',
    'Decision',
    'Focus',
    'LandingCore',
    'LandingParameters',
    'State',
    'Verdict',
    'VerdictKind',
    'engagement_problem',
    'readiness',
]
