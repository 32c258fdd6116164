# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults of autopilot, pilot and weather, of processes and clocks."""

from __future__ import annotations

from peace_ros.core.landing import State
from peace_ros.lab.faults import tamper
from peace_ros.lab.faults.fault import (
    GOING,
    UNDER_WAY,
    Expected,
    Fault,
    FlightSetting,
    Injection,
    Moment,
)
from peace_ros.lab.faults.injections import (
    Autopilot,
    ClockStep,
    FullDisk,
    Killed,
    Stalled,
    Suspended,
    always,
    heatmap,
)
from peace_ros.lab.faults.link_faults import TAKEN_OVER
from peace_ros.lab.faults.perception_faults import NO_NEW_HEATMAP

_IDLE = State.IDLE.value
_HOLD = State.HOLD.value
_ABORTED = State.ABORTED.value
_UNTIL_HANDOVER_S = 46.0
_HOVER_S = 5.5
"""The autopilot forgets a set-point after 3 s and then brakes."""


def _pilot(name: str, state: State, mode: str) -> Fault:
    return Fault(
        name,
        'autopilot',
        f'The pilot moves the switch to {mode} in {state.value}.',
        Autopilot('pilot_mode', {'mode': mode}, undo=''),
        TAKEN_OVER,
        'ABORTED at once; no set-point until a person engages again.',
        at=Moment(state.value),
        lasts_s=3.0,
    )


AUTOPILOT = (
    _pilot('pilot_takes_over_searching', State.SEARCHING, 'LOITER'),
    _pilot('pilot_takes_over_landing', State.LANDING, 'LOITER'),
    _pilot('pilot_lands', State.LANDING, 'LAND'),
    Fault(
        'pilot_takes_over_and_gives_back',
        'autopilot',
        'The pilot moves the switch to LOITER and 2 s later back to GUIDED.',
        Autopilot(
            'pilot_mode', {'mode': 'LOITER'}, undo='pilot_mode', undo_arguments={'mode': 'GUIDED'}
        ),
        TAKEN_OVER,
        'ABORTED for good: GUIDED alone is no order to land.',
        lasts_s=2.0,
    ),
    Fault(
        'autopilot_reboots',
        'autopilot',
        'The autopilot restarts in flight and comes up in another mode.',
        Autopilot('reboot', undo=''),
        Expected(
            reaches=(_ABORTED,), within_s=1.6, silent_within_s=1.9, stays=_ABORTED, flies=False
        ),
        'Another mode is a take-over: ABORTED.',
    ),
    Fault(
        'autopilot_refuses',
        'autopilot',
        'The autopilot refuses GUIDED when the landing is engaged.',
        Autopilot('refuse', {'modes': ['GUIDED']}),
        Expected(refuses=True, silent_within_s=0.0),
        "The engagement fails with the autopilot's own words; nothing is sent.",
        at=Moment(_IDLE),
        lasts_s=1.0,
    ),
    Fault(
        'gnss_lost',
        'autopilot',
        'GNSS is lost; the position stops.',
        Autopilot('gps_loss', undo='gps_restore'),
        Expected(
            reaches=(_HOLD,),
            within_s=1.6,
            still_within_s=3.5,
            zero_within_s=1.9,
            recovers=UNDER_WAY,
            recovers_within_s=15.0,
        ),
        'HOLD; goes on when the position is back before the autopilot gives up.',
        lasts_s=6.0,
    ),
    Fault(
        'gnss_lost_for_good',
        'autopilot',
        'GNSS is lost; 7.4 s later the failsafe of the autopilot lands.',
        Autopilot('gps_loss', undo=''),
        Expected(
            reaches=(_ABORTED,),
            within_s=8.5,
            allowed=(State.LANDING.value, _HOLD, _ABORTED),
            zero_within_s=1.9,
            silent_within_s=8.5,
            stays=_ABORTED,
            flies=False,
        ),
        'HOLD; ABORTED when the autopilot lands by itself.',
        lasts_s=10.0,
    ),
    Fault(
        'gnss_lost_position_stale',
        'autopilot',
        'GNSS is lost; the autopilot repeats the last position.',
        Autopilot('gps_loss', {'stale': True}, undo='gps_restore'),
        Expected(
            reaches=(_HOLD,),
            within_s=3.0,
            still_within_s=4.5,
            zero_within_s=3.3,
            recovers=UNDER_WAY,
            recovers_within_s=15.0,
        ),
        'The speed and the position that are reported disagree: HOLD.',
        lasts_s=6.5,
    ),
    Fault(
        'radio_lost',
        'autopilot',
        "The pilot's radio is lost: the autopilot goes to RTL.",
        Autopilot('radio_loss', undo=''),
        TAKEN_OVER,
        'A failsafe outranks us: ABORTED.',
        lasts_s=3.0,
    ),
    Fault(
        'disarmed',
        'autopilot',
        'The motors are stopped in flight.',
        Autopilot('disarm', undo=''),
        Expected(
            reaches=(_ABORTED,), within_s=1.6, silent_within_s=1.9, stays=_ABORTED, flies=False
        ),
        'Disarmed is a take-over: ABORTED.',
        lasts_s=3.0,
    ),
    Fault(
        'wind_10_m_s',
        'autopilot',
        'Wind of 10 m/s with gusts of 2 m/s rises while it descends.',
        Autopilot('wind', {'to_north_m_s': 8.0, 'to_east_m_s': 6.0, 'gust_m_s': 2.0}),
        Expected(reaches=(State.HANDOVER.value,), within_s=70.0),
        'The autopilot leans into it, lateral correction goes on, and the hand-over is safe.',
        lasts_s=72.0,
        until_reached=True,
    ),
)

_RESTARTED = Expected(
    still_within_s=_HOVER_S,
    silent_within_s=0.2,
    recovers=(_IDLE,),
    recovers_within_s=8.0,
    stays=_IDLE,
)


def _killed(state: State, lead: Injection | None = None) -> Fault:
    return Fault(
        f'landing_killed_{state.value.lower()}',
        'process',
        f'The landing node is killed in {state.value} and started again.',
        Killed('landing'),
        _RESTARTED,
        'The autopilot stops by itself 3 s after the last set-point; the new node is IDLE and '
        'moves nothing until a person engages.',
        at=Moment(state.value),
        lasts_s=7.0,
        lead=lead,
    )


_ALL_UNSAFE = heatmap(lambda: tamper.filled(0))


PROCESS = (
    _killed(State.SEARCHING),
    _killed(State.AIMING),
    _killed(State.LANDING),
    _killed(State.WAITING, _ALL_UNSAFE),
    _killed(State.CLIMBING, _ALL_UNSAFE),
    _killed(State.RESTARTING, _ALL_UNSAFE),
    _killed(State.HANDOVER),
    _killed(State.HOLD, heatmap(always(tamper.nothing))),
    Fault(
        'segmentation_killed',
        'process',
        'The segmentation node is killed and started again.',
        Killed('segmentation'),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            still_within_s=3.5,
            zero_within_s=2.8,
            recovers=UNDER_WAY,
            recovers_within_s=25.0,
        ),
        'HOLD; goes on when heatmaps come again.',
    ),
    Fault(
        'segmentation_killed_searching',
        'process',
        'The segmentation node is killed in SEARCHING and started again.',
        Killed('segmentation'),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            zero_within_s=2.8,
            recovers=UNDER_WAY,
            recovers_within_s=25.0,
        ),
        'HOLD; goes on when heatmaps come again.',
        at=Moment(State.SEARCHING.value),
    ),
    Fault(
        'camera_killed',
        'process',
        'The camera node is killed and started again.',
        Killed('satellite_view'),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            still_within_s=3.5,
            zero_within_s=2.8,
            recovers=UNDER_WAY,
            recovers_within_s=25.0,
        ),
        'HOLD; goes on when pictures come again.',
    ),
    Fault(
        'segmentation_stands_still',
        'process',
        'The segmentation process does not get the processor for 5 s.',
        Suspended('segmentation'),
        NO_NEW_HEATMAP,
        'HOLD; goes on afterwards.',
    ),
    Fault(
        'landing_stands_still',
        'process',
        'The landing process does not get the processor for 6 s.',
        Suspended('landing'),
        Expected(
            still_within_s=_HOVER_S, recovers=(_HOLD, _ABORTED, *GOING), recovers_within_s=5.0
        ),
        'The autopilot stops by itself 3 s after the last set-point; awake again, the landing '
        'looks at the age of its data before it moves, and its dead-man may have handed over: '
        'ABORTED.',
        lasts_s=6.5,
    ),
    Fault(
        'executor_stalls',
        'process',
        'A callback keeps the executor of the landing node for 2 s.',
        Stalled(2.0),
        Expected(
            zero_within_s=0.6,
            recovers=(_HOLD, *GOING),
            recovers_within_s=5.0,
        ),
        'The sender has a thread of its own: its dead-man sends zero 0.5 s after the last '
        'decision; goes on afterwards.',
        lasts_s=1.9,
    ),
    Fault(
        'executor_stalls_for_long',
        'process',
        'A callback keeps the executor of the landing node for 5 s.',
        Stalled(5.0),
        Expected(
            zero_within_s=0.6,
            still_within_s=2.6,
            recovers=(_ABORTED,),
            recovers_within_s=3.0,
            stays=_ABORTED,
        ),
        "2.5 s after the last decision the dead-man asks for the autopilot's own hold mode; "
        'afterwards ABORTED, until a person engages again.',
        lasts_s=5.0,
    ),
    Fault(
        'disk_full',
        'process',
        "The recorder's disk is full.",
        FullDisk(),
        Expected(
            reaches=(State.HANDOVER.value,),
            within_s=45.0,
            allowed=GOING,
            ends_processes=('recorder',),
        ),
        'The recorder ends with a sentence; the landing does not notice.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        note='The file may not grow beyond a limit (RLIMIT_FSIZE), in place of a full disk.',
    ),
)

_SIM_TIME = FlightSetting(sim_time=True)


def _autopilot_clock(name: str, words: str, step_s: float, behaviour: str) -> Fault:
    return Fault(
        name,
        'clock',
        f"The autopilot's own clock steps {words}, without a reboot.",
        Autopilot('boot_clock', {'step_s': step_s}, undo=''),
        Expected(reaches=(State.HANDOVER.value,), within_s=60.0, allowed=(*GOING, _HOLD)),
        behaviour,
        lasts_s=_UNTIL_HANDOVER_S + 16.0,
        until_reached=True,
    )


CLOCK = (
    _autopilot_clock(
        'autopilot_clock_forward',
        '30 s ahead',
        30.0,
        'Where the clocks do not fit, poses get the moment of receipt, until TIMESYNC has found '
        'the new offset: goes on, maybe after HOLD.',
    ),
    _autopilot_clock(
        'autopilot_clock_back',
        '30 s back',
        -30.0,
        'It looks like a reboot that left the mode: everything begins anew, and the landing goes '
        'on, maybe after HOLD.',
    ),
    Fault(
        'clock_steps_forward',
        'clock',
        'The clock of all nodes steps 30 s ahead.',
        ClockStep(30.0),
        Expected(reaches=(_HOLD,), within_s=1.0, recovers=UNDER_WAY, recovers_within_s=20.0),
        'Everything known is old at once: HOLD, until the map is new.',
        setting=_SIM_TIME,
    ),
    Fault(
        'clock_steps_back',
        'clock',
        'The clock of all nodes steps 30 s back.',
        ClockStep(-30.0),
        Expected(reaches=(_HOLD,), within_s=1.0, recovers=UNDER_WAY, recovers_within_s=20.0),
        'What lies in the future is worthless: the map is dropped and begun anew.',
        setting=_SIM_TIME,
    ),
)

FAULTS = (*AUTOPILOT, *PROCESS, *CLOCK)
"""In the order of the documentation."""
