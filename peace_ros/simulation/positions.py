# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why a camera that follows an autopilot sees nothing."""

from __future__ import annotations

from peace_ros.core.vehicle import VehicleLink

SILENT_S = 3.0
"""After so long without a picture the reason is said."""


def why_no_position(link: VehicleLink) -> str:
    """Return why the autopilot at a link reports no position, empty when it does."""
    told = link.telemetry()
    if told.pose is not None:
        return ''
    reason = link.problem or told.position_problem or 'LOCAL_POSITION_NED or ATTITUDE is missing'
    return f'the autopilot tells no position because {reason}'
