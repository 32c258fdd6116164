# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States in words, for somebody who sees them for the first time."""

from __future__ import annotations

STATES = {
    'IDLE': 'Not engaged: the vehicle is not commanded',
    'SEARCHING': 'Looking for a safe place',
    'AIMING': 'Flying over the chosen place',
    'LANDING': 'Descending over the chosen place',
    'WAITING': 'The place is lost: hovering, and waiting for it',
    'CLIMBING': 'Climbing to look for another place',
    'RESTARTING': 'Looking for another place',
    'RETURNING': 'Flying back to where the landing began',
    'HANDOVER': 'Done: hovering over a safe place',
    'HOLD': 'Hovering: something is missing or used up',
    'ABORTED': 'A pilot or a failsafe is in control',
    'FAILED': 'The landing node has failed: take over',
}
"""State in ``landing/status`` -> what the vehicle does."""
_FLIES = 'pictures, heatmaps or telemetry stop, a pilot changes the mode, or somebody disengages'
_PLACE = f'something unsafe is seen on the place or it gets too narrow, {_FLIES}'
STOPS = {
    'IDLE': 'nothing is under way',
    'SEARCHING': f'the time or the way for the search is used up, {_FLIES}',
    'AIMING': _PLACE,
    'LANDING': _PLACE,
    'WAITING': f'the place is not found again (then it climbs), {_FLIES}',
    'CLIMBING': _FLIES,
    'RESTARTING': f'the time for the landing is used up, {_FLIES}',
    'RETURNING': f'the position is lost, {_FLIES}',
    'HANDOVER': 'it has ended: a pilot, or the action after the hand-over, goes on',
    'HOLD': 'it hovers now; it goes on by itself only when the reason is gone and a budget is left',
    'ABORTED': 'it has ended: it begins again only when a person engages',
    'FAILED': 'it has ended: the node must be started again',
}
"""State -> what would stop the landing, or how it goes on."""
UNKNOWN = 'Nothing is heard from the landing node'


def in_words(state: str) -> str:
    """Return what the vehicle does in a state, or its name where it is not one of ours."""
    return STATES.get(state, state or UNKNOWN)
