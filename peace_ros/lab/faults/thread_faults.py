# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Defects in the threads of the landing node."""

from __future__ import annotations

from dataclasses import replace

from peace_ros.core.landing import State
from peace_ros.lab.faults.fault import GOING, Expected, Fault, FlightSetting, Injection, Moment
from peace_ros.lab.faults.injections import Defect
from peace_ros.nodes.status import FAILED

_IDLE = State.IDLE.value
_LASTS_S = 4.0

FAILS = Expected(
    reaches=(FAILED,),
    within_s=1.0,
    zero_within_s=1.0,
    still_within_s=2.5,
    ends_processes=('landing',),
    ends_within_s=1.0,
    recovers=(_IDLE,),
    recovers_within_s=8.0,
    stays=_IDLE,
)
"""The vehicle is told to stop and to hold by itself, and the process ends; a new one is IDLE."""


def _defect(thread: str, title: str, injection: Injection | None = None) -> Fault:
    return Fault(
        f'thread_{thread}',
        'thread',
        title,
        injection or Defect(thread),
        FAILS,
        'Zero velocity and the hold mode of the autopilot at once; FAILED with a sentence, and the '
        'process ends with status 1. Started again, it is IDLE.',
        at=Moment(),
        lasts_s=_LASTS_S,
    )


FAULTS = (
    _defect('timer', 'The timer that steps the landing raises an exception.'),
    _defect('callback', 'A subscription of the landing node raises an exception.'),
    _defect('setpoint_sender', 'The thread of the set-point sender raises an exception.'),
    _defect('mavlink_link', 'The thread that reads MAVLink raises an exception.'),
    _defect(
        'engage',
        'A person engages again, and the thread of the engagement raises an exception.',
        Defect('engage', engages=True),
    ),
    replace(
        _defect(
            'hand_over',
            'The executor is stalled, and the thread in which the dead-man asks for the hold mode '
            'raises an exception.',
            Defect('hand_over', stalls_s=4.5),
        ),
        expected=replace(
            FAILS, within_s=3.5, zero_within_s=0.6, still_within_s=3.5, ends_within_s=3.5
        ),
        behaviour='The dead-man sends zero 0.5 s after the last decision and asks for the hold '
        'mode 2 s later; the defect then ends the process as in the other threads.',
        lasts_s=6.0,
    ),
    replace(
        _defect('after_handover', 'The thread that asks for LAND raises an exception.'),
        expected=Expected(
            reaches=(FAILED,),
            within_s=45.0,
            allowed=(*GOING, FAILED),
            ends_processes=('landing',),
            recovers=(_IDLE,),
            recovers_within_s=8.0,
            stays=_IDLE,
        ),
        lasts_s=46.0,
        until_reached=True,
        setting=FlightSetting(after_handover='land'),
        note='The thread begins at HANDOVER.',
    ),
    replace(
        _defect('stuck', 'The thread of the set-point sender stands still.'),
        expected=replace(FAILS, within_s=1.5, zero_within_s=1.2, ends_within_s=1.5),
        behaviour='The main thread misses the heartbeat for 0.4 s: then as after a defect.',
    ),
)
"""In the order of the documentation."""
