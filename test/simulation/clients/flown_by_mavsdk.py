# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One flight by MAVSDK, the same for its gRPC and its native binding; prints what was answered.

``python flown_by_mavsdk.py grpc|native URL``. A process of its own: MAVSDK has threads, and a
server, that a test cannot end otherwise.
"""

from __future__ import annotations

import asyncio
import json
import sys
from types import SimpleNamespace

GROUND_STATION = (245, 190)
ALTITUDE_M, AWAY_DEG, LIMIT_S = 6.0, 1e-4, 20.0


async def connect_grpc(url):
    """Connect by the binding that talks to ``mavsdk_server`` (gRPC)."""
    try:
        import mavsdk_grpc as mavsdk
        from mavsdk_grpc import mavlink_direct, mission_raw, offboard
    except ImportError:
        import mavsdk
        from mavsdk import mavlink_direct, mission_raw, offboard
    drone = mavsdk.System(port=int(url.rpartition(':')[2]) + 1)
    await drone.connect(system_address=url)
    async for state in drone.core.connection_state():
        if state.is_connected:
            break
    return SimpleNamespace(
        action=drone.action,
        info=drone.info,
        param=drone.param,
        offboard=drone.offboard,
        mission_raw=drone.mission_raw,
        direct=drone.mavlink_direct,
        stream=lambda name: getattr(drone.telemetry, name)(),
        rate=lambda name: getattr(drone.telemetry, f'set_rate_{name}')(10.0),
        version=drone.info.get_version,
        Message=mavlink_direct.MavlinkMessage,
        Item=mission_raw.MissionItem,
        Velocity=offboard.VelocityNedYaw,
        Place=offboard.PositionNedYaw,
    )


async def connect_native(url):
    """Connect by the binding of MAVSDK 4 that needs no server."""
    from mavsdk.asyncio import Configuration, Mavsdk
    from mavsdk.asyncio.plugins import action, info, mavlink_direct, mission_raw, offboard, param
    from mavsdk.asyncio.plugins import telemetry as told

    mavsdk = Mavsdk(Configuration.create_manual(*GROUND_STATION, always_send_heartbeats=True))
    await mavsdk.add_any_connection(url)
    system = await mavsdk.first_autopilot(timeout_s=20.0)
    telemetry = told.TelemetryAsync(system)
    return SimpleNamespace(
        owner=mavsdk,
        action=action.ActionAsync(system),
        param=param.ParamAsync(system),
        offboard=offboard.OffboardAsync(system),
        mission_raw=mission_raw.MissionRawAsync(system),
        direct=mavlink_direct.MavlinkDirectAsync(system),
        stream=lambda name: getattr(telemetry, f'subscribe_{name}')(),
        rate=lambda name: getattr(telemetry, f'set_rate_{name}')(10.0),
        version=info.InfoAsync(system).get_version,
        Message=mavlink_direct.MavlinkMessage,
        Item=mission_raw.MissionItem,
        Velocity=offboard.VelocityNedYaw,
        Place=offboard.PositionNedYaw,
    )


async def until(drone, name, fits):
    """Return the first value of a telemetry stream that fits."""

    async def wait():
        async for each in drone.stream(name):
            if fits(each):
                return each
        raise EOFError(name)

    return await asyncio.wait_for(wait(), LIMIT_S)


async def ask(drone, *, px4):
    """Ask for what is told without flying; return the answers and home."""
    if not px4:  # ArduPilot sends little unasked
        fields = {
            'target_system': 1,
            'target_component': 1,
            'req_stream_id': 0,
            'req_message_rate': 10,
            'start_stop': 1,
        }
        ids = (*GROUND_STATION, 1, 1)
        message = drone.Message('REQUEST_DATA_STREAM', *ids, json.dumps(fields))
        await drone.direct.send_message(message)
    for name in ('home', 'landed_state'):
        await drone.rate(name)
    await until(drone, 'health', lambda h: h.is_armable and h.is_global_position_ok)
    health = await until(drone, 'health', lambda h: h.is_home_position_ok)
    answers = {
        'health': [health.is_magnetometer_calibration_ok, health.is_gyrometer_calibration_ok]
    }
    version = await drone.version()
    answers['version'] = [version.flight_sw_major, version.flight_sw_minor]

    number, whole = ('MIS_TAKEOFF_ALT', 'COM_RCL_EXCEPT') if px4 else ('WP_SPD', 'FRAME_CLASS')
    answers['float'] = await drone.param.get_param_float(number)
    answers['int'] = await drone.param.get_param_int(whole)
    await drone.param.set_param_int(whole, 3)
    answers['int after'] = await drone.param.get_param_int(whole)
    everything = await drone.param.get_all_params()
    answers['names'] = len(everything.int_params) + len(everything.float_params)

    home = await until(drone, 'home', lambda _: True)
    east_e7 = round(home.longitude_deg * 1e7)
    items = [
        drone.Item(n, 6, 16, int(n == 0), 1, 0.0, 2.0, 0.0, 0.0, lat, east_e7, 9.0, 0)
        for n, lat in enumerate(round((home.latitude_deg + d * AWAY_DEG) * 1e7) for d in range(3))
    ]
    await drone.mission_raw.upload_mission(items)
    back = await drone.mission_raw.download_mission()
    answers['mission'] = [
        (b.command, b.x - i.x, b.z) for i, b in zip(items[1:], list(back)[1:], strict=True)
    ]
    await drone.mission_raw.clear_mission()
    answers['cleared'] = len(list(await drone.mission_raw.download_mission()))

    return answers, home


async def fly(drone, home):
    """Take off, fly to places, return and land; return the answers."""
    answers = {}

    async def mode(name):
        return (await until(drone, 'flight_mode', lambda m: m.name == name)).name

    await drone.action.set_takeoff_altitude(ALTITUDE_M)
    await drone.action.arm()
    await drone.action.takeoff()
    await until(drone, 'position', lambda p: p.relative_altitude_m > ALTITUDE_M - 0.5)
    await until(drone, 'landed_state', lambda state: state.name == 'IN_AIR')
    north_deg = home.latitude_deg + AWAY_DEG
    above_sea_m = home.absolute_altitude_m + ALTITUDE_M
    await drone.action.goto_location(north_deg, home.longitude_deg, above_sea_m, 90.0)
    await until(drone, 'position', lambda p: abs(p.latitude_deg - north_deg) < 0.2 * AWAY_DEG)
    found = await until(drone, 'flight_mode', lambda m: m.name in {'HOLD', 'OFFBOARD'})
    answers['mode of goto'] = found.name

    await drone.offboard.set_velocity_ned(drone.Velocity(0.0, 0.0, 0.0, 0.0))
    await drone.offboard.start()
    answers['offboard'] = await mode('OFFBOARD')
    await drone.offboard.set_position_ned(drone.Place(0.0, 6.0, -ALTITUDE_M, 0.0))
    await until(drone, 'position_velocity_ned', lambda p: abs(p.position.east_m - 6.0) < 1.5)
    await drone.offboard.stop()

    await drone.action.hold()
    answers['hold'] = await mode('HOLD')
    await drone.action.return_to_launch()
    answers['rtl'] = await mode('RETURN_TO_LAUNCH')
    await drone.action.land()
    answers['land'] = await mode('LAND')
    await until(drone, 'armed', lambda armed: not armed)
    return answers


async def main():
    """Fly by the binding of the command line."""
    binding, url, autopilot = sys.argv[1:]
    drone = await {'grpc': connect_grpc, 'native': connect_native}[binding](url)
    answers, home = await ask(drone, px4=autopilot == 'px4')
    print(json.dumps({**answers, **await fly(drone, home)}))


if __name__ == '__main__':
    asyncio.run(main())
