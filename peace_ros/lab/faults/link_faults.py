# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults of telemetry and of the MAVLink line."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.landing import State
from peace_ros.lab.faults import line
from peace_ros.lab.faults.fault import (
    GOING,
    UNDER_WAY,
    Expected,
    Fault,
    FlightSetting,
    Moment,
)
from peace_ros.lab.faults.injections import (
    Autopilot,
    DisturbedLine,
    ForgedTelemetry,
    SecondCompanion,
    Together,
    both_ways,
)
from peace_ros.lab.faults.perception_faults import GOES_ON

_HOLD = State.HOLD.value
_ABORTED = State.ABORTED.value
_UNTIL_HANDOVER_S = 46.0
_LATER_S = 15.0

NO_POSITION = Expected(
    reaches=(_HOLD,),
    within_s=1.5,
    still_within_s=3.2,
    zero_within_s=1.8,
    recovers=UNDER_WAY,
    recovers_within_s=_LATER_S,
)
"""A pose that is not renewed for 1 s, or cannot be believed, is none."""

JUMPED = Expected(
    reaches=(_HOLD,),
    within_s=1.2,
    still_within_s=3.0,
    zero_within_s=1.4,
    allowed=(State.LANDING.value, _HOLD),
    recovers=GOING,
    recovers_within_s=40.0,
)

TAKEN_OVER = Expected(
    reaches=(_ABORTED,), within_s=0.4, silent_within_s=0.3, stays=_ABORTED, flies=False
)
"""Somebody else flies: no set-point any more, until a person engages again."""

TELEMETRY = (
    Fault(
        'telemetry_stops',
        'telemetry',
        'The autopilot says nothing for 3 s.',
        Autopilot('telemetry_stop', undo='telemetry_resume'),
        Expected(
            reaches=(_HOLD,),
            within_s=1.1,
            still_within_s=2.5,
            zero_within_s=1.4,
            recovers=UNDER_WAY,
            recovers_within_s=_LATER_S,
        ),
        'HOLD when the newest telemetry is 0.7 s old; goes on when it comes again.',
        lasts_s=3.0,
    ),
    Fault(
        'position_stops',
        'telemetry',
        'LOCAL_POSITION_NED stops, everything else goes on.',
        Autopilot('telemetry_stop', {'messages': ['LOCAL_POSITION_NED']}, undo='telemetry_resume'),
        NO_POSITION,
        'A pose older than 1 s is none: HOLD.',
    ),
    Fault(
        'attitude_stops',
        'telemetry',
        'ATTITUDE stops, everything else goes on.',
        Autopilot('telemetry_stop', {'messages': ['ATTITUDE']}, undo='telemetry_resume'),
        NO_POSITION,
        'Without attitude there is no pose: HOLD.',
    ),
    Fault(
        'heartbeat_stops',
        'telemetry',
        'HEARTBEAT stops, everything else goes on.',
        Autopilot('telemetry_stop', {'messages': ['HEARTBEAT']}, undo='telemetry_resume'),
        Expected(
            reaches=(_HOLD,),
            within_s=4.2,
            still_within_s=5.8,
            zero_within_s=4.5,
            recovers=UNDER_WAY,
            recovers_within_s=_LATER_S,
        ),
        'After 3.5 s without HEARTBEAT nobody knows who flies: no set-points.',
        lasts_s=8.0,
    ),
    Fault(
        'altitude_nan',
        'telemetry',
        'The reported altitude is no number.',
        Autopilot('altitude', {'kind': 'nan'}),
        NO_POSITION,
        'Such a position is refused, so the pose grows old: HOLD.',
    ),
    Fault(
        'altitude_jumps_up',
        'telemetry',
        'The reported altitude jumps up by 30 m, and stays there for 12 s.',
        Autopilot('altitude', {'kind': 'jump', 'offset_m': 30.0}),
        JUMPED,
        'A position that no flight explains is not believed until it comes back: HOLD.',
        lasts_s=12.0,
    ),
    Fault(
        'altitude_jumps_down',
        'telemetry',
        'The reported altitude jumps down by 15 m, and stays there for 12 s.',
        Autopilot('altitude', {'kind': 'jump', 'offset_m': -15.0}),
        JUMPED,
        'A position that no flight explains is not believed until it comes back: HOLD.',
        lasts_s=12.0,
    ),
    Fault(
        'altitude_sign',
        'telemetry',
        'The reported altitude has the wrong sign.',
        Autopilot('altitude', {'kind': 'sign'}),
        NO_POSITION,
        'An altitude below the ground is not valid: HOLD.',
    ),
    Fault(
        'altitude_freezes',
        'telemetry',
        'The reported altitude does not change any more.',
        Autopilot('altitude', {'kind': 'freeze'}),
        Expected(
            reaches=(_HOLD,), within_s=3.0, still_within_s=4.5, zero_within_s=3.3, stays=_HOLD
        ),
        'Told to sink, it does not report that it does: HOLD, until a person takes over.',
        lasts_s=12.0,
    ),
    Fault(
        'position_jumps',
        'telemetry',
        'The reported position jumps by 20 m to the north.',
        Autopilot('position', {'north_m': 20.0}),
        JUMPED,
        'A position that no flight explains is not believed until it comes back: HOLD.',
    ),
    Fault(
        'position_resets',
        'telemetry',
        'The reported position jumps by 20 m to the north and stays there, as when GNSS returns.',
        Autopilot('position', {'north_m': 20.0}, undo=''),
        JUMPED,
        'HOLD, until it has been steady at the same height for 15 s; then searches with a new map.',
    ),
    Fault(
        'frame_enu',
        'telemetry',
        'LOCAL_POSITION_NED comes in ENU.',
        Autopilot('frame', {'kind': 'enu'}),
        NO_POSITION,
        'An altitude below the ground is not valid: HOLD.',
    ),
    Fault(
        'frame_south',
        'telemetry',
        'LOCAL_POSITION_NED comes with x and y negated.',
        Autopilot('frame', {'kind': 'south'}),
        JUMPED,
        'Away from the origin the position jumps, and is not believed until it comes back: HOLD.',
    ),
    Fault(
        'frame_south_at_origin',
        'telemetry',
        'LOCAL_POSITION_NED comes with x and y negated, near the origin and in gusts of 3 m/s.',
        Together(
            (
                Autopilot('wind', {'gust_m_s': 3.0}),
                Autopilot('frame', {'kind': 'south'}),
            )
        ),
        Expected(reaches=(_HOLD,), within_s=40.0, stays=_HOLD),
        'Nothing jumps, but correcting by it leads away: told to go one way, the vehicle reports '
        'the other. HOLD, until a person takes over.',
        at=Moment(State.SEARCHING.value),
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        setting=FlightSetting(at_origin=True),
    ),
    Fault(
        'frame_msl',
        'telemetry',
        'LOCAL_POSITION_NED counts its heights from the sea, 35 m lower.',
        Autopilot('frame', {'kind': 'msl'}),
        JUMPED,
        'The altitude jumps, and is not believed until it comes back: HOLD.',
    ),
)

_SIGNED = FlightSetting(signed=True)

LINE = (
    Fault(
        'line_lost_1_s',
        'line',
        'Nothing passes between companion and autopilot for 1 s.',
        both_ways(lambda: line.nothing),
        Expected(reaches=(_HOLD,), within_s=1.1, recovers=UNDER_WAY, recovers_within_s=_LATER_S),
        'HOLD when the newest telemetry is 0.7 s old; goes on afterwards.',
        lasts_s=1.2,
    ),
    Fault(
        'line_lost_5_s',
        'line',
        'Nothing passes for 5 s.',
        both_ways(lambda: line.nothing),
        Expected(
            reaches=(_HOLD,),
            within_s=1.1,
            allowed=(*GOING, _HOLD, _ABORTED),
            still_within_s=5.0,
            recovers=(*GOING, _ABORTED),
            recovers_within_s=_LATER_S,
        ),
        'HOLD; the autopilot stops by itself 3 s after the last set-point.',
        lasts_s=5.5,
    ),
    Fault(
        'line_lost_60_s',
        'line',
        'Nothing passes for 60 s.',
        both_ways(lambda: line.nothing),
        Expected(
            reaches=(_HOLD,),
            within_s=1.1,
            allowed=(*GOING, _HOLD, _ABORTED),
            still_within_s=5.0,
            recovers=(*GOING, _ABORTED),
            recovers_within_s=_LATER_S,
        ),
        'As 5 s.',
        lasts_s=60.0,
    ),
    Fault(
        'line_down_lost',
        'line',
        'The companion is heard, but hears nothing for 3 s.',
        DisturbedLine(down=lambda: line.nothing),
        Expected(
            reaches=(_HOLD,),
            within_s=1.1,
            still_within_s=2.6,
            zero_within_s=1.4,
            recovers=UNDER_WAY,
            recovers_within_s=_LATER_S,
        ),
        'HOLD when the newest telemetry is 0.7 s old, and zero goes out.',
        lasts_s=3.0,
    ),
    Fault(
        'line_up_lost',
        'line',
        'The companion hears, but is not heard for 6 s.',
        DisturbedLine(up=lambda: line.nothing),
        Expected(reaches=(_HOLD,), within_s=7.0, still_within_s=5.0, stays=_HOLD),
        'The autopilot stops by itself 3 s after the last set-point. Told to sink, it reports that '
        'it does not: HOLD, until a person takes over.',
        lasts_s=8.0,
    ),
    Fault(
        'line_doubles',
        'line',
        'Every datagram comes twice.',
        both_ways(lambda: line.doubled),
        GOES_ON,
        'Goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
    ),
    Fault(
        'line_shuffles',
        'line',
        'Every second datagram is overtaken by those behind it.',
        both_ways(lambda: line.shuffled(0.08)),
        GOES_ON,
        'Goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
    ),
    Fault(
        'line_damages',
        'line',
        'A bit is wrong in every fourth datagram.',
        both_ways(lambda: line.damaged(4)),
        GOES_ON,
        'Damaged messages fail their checksum and are dropped: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
    ),
    Fault(
        'line_slow',
        'line',
        'Every datagram takes 0.3 s longer.',
        both_ways(lambda: line.late(0.3)),
        GOES_ON,
        'TIMESYNC tells when a pose was true: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
    ),
    Fault(
        'second_companion_mode',
        'line',
        'A second companion sends the autopilot to LOITER.',
        SecondCompanion(
            lambda: mavlink.MAVLink_command_long_message(
                1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0
            ),
            0.0,
        ),
        TAKEN_OVER,
        'A mode that we did not ask for is a take-over: ABORTED, whoever asked.',
    ),
    Fault(
        'second_companion_setpoints',
        'line',
        'A second companion sends set-points of 2 m/s downwards, without the key of the line.',
        SecondCompanion(lambda: _setpoint(2.0), 30.0),
        GOES_ON,
        'With signing the autopilot obeys nobody else: goes on. Without signing nothing can help.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        setting=_SIGNED,
    ),
    Fault(
        'forged_telemetry_same_address',
        'line',
        "Positions in the autopilot's name come from its own address, without the key of the line.",
        ForgedTelemetry(lambda: [_forged_position()], from_elsewhere=False),
        GOES_ON,
        'With signing nothing else is believed: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        setting=_SIGNED,
    ),
    Fault(
        'forged_telemetry',
        'line',
        'Somebody sends the companion positions in the name of the autopilot from elsewhere.',
        ForgedTelemetry(lambda: [_forged_position()]),
        GOES_ON,
        'Only the address is believed that the autopilot has: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
    ),
)


def _setpoint(v_down_m_s: float) -> Any:
    velocity_only = 0x5C7
    return mavlink.MAVLink_set_position_target_local_ned_message(
        *(0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, velocity_only),
        *(0.0, 0.0, 0.0),
        *(0.0, 0.0, v_down_m_s),
        *(0.0, 0.0, 0.0, 0.0, 0.0),
    )


def _forged_position() -> bytes:
    codec = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_AUTOPILOT1)
    message = mavlink.MAVLink_local_position_ned_message(1_000_000, 0.0, 0.0, -90.0, 0.0, 0.0, 0.0)
    return bytes(message.pack(codec))


FAULTS = (*TELEMETRY, *LINE)
"""In the order of the documentation."""
