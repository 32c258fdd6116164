# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One flight by the helpers of pymavlink's mavutil, as scripts of users have them.

``python flown_by_pymavlink.py URL ardupilot|px4`` prints what was answered. A process of its own,
because mavutil keeps its dialect in the module.
"""

from __future__ import annotations

import json
import sys
import time

from pymavlink import mavutil

mavlink = mavutil.mavlink
ALTITUDE_M, LIMIT_S = 6.0, 20.0
PLACE_ONLY = 0xDF8
EXTENDED_STATE = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
TARGET = mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED


def until(vehicle, kind, fits, repeat=lambda: None):
    """Return the first message of a kind that fits; ``repeat`` is called meanwhile."""
    end_s = time.monotonic() + LIMIT_S
    while time.monotonic() < end_s:
        repeat()
        message = vehicle.recv_match(type=kind, blocking=True, timeout=0.1)
        if message is not None and fits(message):
            return message
    raise TimeoutError(f'no {kind} that fits within {LIMIT_S:g} s')


def acknowledged(vehicle, command, *params):
    """Send COMMAND_LONG and return the result."""
    values = (*params, *(0.0,) * (7 - len(params)))
    vehicle.mav.command_long_send(1, 1, command, 0, *values)
    return until(vehicle, 'COMMAND_ACK', lambda m: m.command == command).result


def fetch_parameters(vehicle):
    """Return all parameters, by name."""
    vehicle.param_fetch_all()
    values = {}
    while True:
        m = until(vehicle, 'PARAM_VALUE', lambda _: True)
        values[m.param_id] = m.param_value
        if len(values) == m.param_count:
            return values


def upload(vehicle, places, kind):
    """Upload waypoints by the loop that mavutil's examples have; return the result."""
    vehicle.mav.mission_count_send(1, 1, len(places), kind)
    while True:
        m = until(
            vehicle, ['MISSION_REQUEST', 'MISSION_REQUEST_INT', 'MISSION_ACK'], lambda _: True
        )
        if m.get_type() == 'MISSION_ACK':
            return m.type
        head = (1, 1, m.seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
        item = (mavlink.MAV_CMD_NAV_WAYPOINT, int(m.seq == 0), 1, 0.0, 0.0, 0.0, 0.0)
        vehicle.mav.mission_item_int_send(*head, *item, *places[m.seq], kind)


def download(vehicle, kind):
    """Return the items of a plan as (x, y, z)."""
    vehicle.mav.mission_request_list_send(1, 1, kind)
    count = until(vehicle, 'MISSION_COUNT', lambda m: m.mission_type == kind).count
    items = []
    for number in range(count):
        vehicle.mav.mission_request_int_send(1, 1, number, kind)
        m = until(vehicle, 'MISSION_ITEM_INT', lambda m, n=number: m.seq == n)
        items.append((m.x, m.y, m.z))
    vehicle.mav.mission_ack_send(1, 1, mavlink.MAV_MISSION_ACCEPTED, kind)
    return items


def ask(vehicle, *, px4):
    """Ask for what is told without flying; return the answers and home."""
    answers = {}
    if px4:
        until(vehicle, 'GLOBAL_POSITION_INT', lambda _: True)
    else:
        vehicle.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 10, 1)
    answers['told'] = sorted(
        until(vehicle, kind, lambda _: True).get_type()
        for kind in ('VFR_HUD', 'SYS_STATUS', 'GPS_RAW_INT', 'SCALED_PRESSURE')
    )
    name = 'MIS_TAKEOFF_ALT' if px4 else 'RTL_ALT_M'
    answers['parameters'] = len(fetch_parameters(vehicle))
    vehicle.param_set_send(name, ALTITUDE_M)
    until(vehicle, 'PARAM_VALUE', lambda m: m.param_id == name and m.param_value == ALTITUDE_M)
    answers['unknown command'] = acknowledged(vehicle, 31_010)

    place = vehicle.location(relative_alt=True)
    e7 = [round(place.lat * 1e7), round(place.lng * 1e7)]
    places = [(e7[0] + 1000 * n, e7[1], 10.0 + n) for n in range(4)]
    answers['upload'] = [upload(vehicle, places, kind) for kind in (0, 1, 2)]
    back = [[tuple(each) for each in download(vehicle, kind)] for kind in (0, 1, 2)]
    answers['back'] = [back[0][1:] == places[1:], *(each == places for each in back[1:])]
    vehicle.mav.mission_clear_all_send(1, 1, 255)
    until(vehicle, 'MISSION_ACK', lambda m: m.mission_type == 255)
    answers['cleared'] = [len(download(vehicle, kind)) for kind in (0, 1, 2)]
    return answers, e7


def fly(vehicle, home_e7, *, px4):
    """Take off, fly to places by three ways, return and land; return the answers."""
    answers = {}

    def at(axis, target_m):
        kind = 'LOCAL_POSITION_NED'
        return until(vehicle, kind, lambda m: abs(getattr(m, axis) - target_m) < 1.0, keep)

    def keep():
        if px4 and streaming:
            vehicle.mav.set_position_target_local_ned_send(*head, PLACE_ONLY, *streaming, *rest)

    head, rest, streaming = (0, 1, 1, 1), (0.0,) * 8, []
    for kind in (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, EXTENDED_STATE, TARGET):
        acknowledged(vehicle, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, kind, 100_000)
    if not px4:
        vehicle.set_mode('GUIDED')
    vehicle.arducopter_arm()
    vehicle.motors_armed_wait()
    altitude_m = 35.0 + ALTITUDE_M if px4 else ALTITUDE_M
    command = mavlink.MAV_CMD_NAV_TAKEOFF
    answers['take-off'] = acknowledged(vehicle, command, 0, 0, 0, 0, 0, 0, altitude_m)
    at('z', -ALTITUDE_M)
    until(vehicle, 'EXTENDED_SYS_STATE', lambda m: m.landed_state == 2)

    change, frame = mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 6
    where = (home_e7[0], home_e7[1] + 1000, ALTITUDE_M)
    vehicle.mav.command_int_send(
        1, 1, frame, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, change, 0, float('nan'), *where
    )
    answers['reposition'] = until(vehicle, 'COMMAND_ACK', lambda m: m.command == 192).result
    at('y', 1000e-7 * 111_319.5 * 0.658)

    streaming[:] = [5.0, 0.0, -ALTITUDE_M]
    if px4:
        keep()
        vehicle.set_mode('OFFBOARD')
    else:
        vehicle.mav.set_position_target_local_ned_send(*head, PLACE_ONLY, *streaming, *rest)
    at('x', 5.0)
    target = until(vehicle, 'POSITION_TARGET_LOCAL_NED', lambda _: True, keep)
    answers['target'] = [target.type_mask, round(target.x, 1), round(target.z, 1)]

    for mode in ('LOITER', 'RTL'):
        vehicle.set_mode(mode)
        until(vehicle, 'HEARTBEAT', lambda _, mode=mode: vehicle.flightmode == mode, keep)
    modes = set()
    while vehicle.motors_armed():
        until(vehicle, 'HEARTBEAT', lambda _: True)
        modes.add(vehicle.flightmode)
    answers['modes until disarmed'] = sorted(modes)
    return answers


def main():
    """Fly at the URL of the command line."""
    url, autopilot = sys.argv[1:]
    vehicle = mavutil.mavlink_connection(url, source_system=255, dialect='ardupilotmega')
    heartbeat = (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
    vehicle.mav.heartbeat_send(*heartbeat)
    vehicle.wait_heartbeat(timeout=LIMIT_S)
    px4 = autopilot == 'px4'
    answers, home_e7 = ask(vehicle, px4=px4)
    print(json.dumps({**answers, **fly(vehicle, home_e7, px4=px4)}))


if __name__ == '__main__':
    main()
