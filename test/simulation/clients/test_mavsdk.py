# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVSDK by both of its Python bindings: gRPC (3.x, or mavsdk-grpc) and native (4.x)."""

from importlib.metadata import PackageNotFoundError, version

import pytest

FLOATS = {'ardupilot': 10.0, 'px4': 2.5}
"""WP_SPD and MIS_TAKEOFF_ALT."""
WHOLE = {'ardupilot': 1, 'px4': 4}
"""FRAME_CLASS and COM_RCL_EXCEPT."""
VERSIONS = {'ardupilot': [4, 7], 'px4': [1, 17]}
GOTO = {'ardupilot': 'OFFBOARD', 'px4': 'HOLD'}
"""MAVSDK's names of GUIDED, and of AUTO.LOITER, in which PX4 flies to a place."""


def _installed():
    """Return the bindings that are installed; `mavsdk` is the gRPC one below version 4."""
    found = set()
    for package in ('mavsdk', 'mavsdk-grpc'):
        try:
            major = int(version(package).partition('.')[0])
        except PackageNotFoundError:
            continue
        found.add('native' if package == 'mavsdk' and major >= 4 else 'grpc')
    return found


@pytest.mark.parametrize('binding', ['grpc', 'native'])
def test_mavsdk_flies_it(binding, autopilot, flown):
    if binding not in _installed():
        pytest.skip(f'the {binding} binding of MAVSDK is not installed (extra "clients")')
    answers = flown('flown_by_mavsdk.py', binding, 'udpout://127.0.0.1:{port}')
    assert answers['health'] == [True, True], 'magnetometer and gyroscope'
    assert answers['version'] == VERSIONS[autopilot]
    assert answers['float'] == FLOATS[autopilot]
    assert answers['int'] == WHOLE[autopilot]
    assert answers['int after'] == 3
    assert answers['names'] > 10
    waypoint = [16, 0, 9.0]
    assert answers['mission'] == [waypoint, waypoint], 'command, error in 1e-7 degrees, altitude'
    # MAVSDK clears the plan of an ArduPilot by uploading home alone.
    assert answers['cleared'] == (0 if autopilot == 'px4' else 1)
    assert answers['mode of goto'] == GOTO[autopilot]
    modes = {name: answers[name] for name in ('offboard', 'hold', 'rtl', 'land')}
    assert modes == {
        'offboard': 'OFFBOARD',
        'hold': 'HOLD',
        'rtl': 'RETURN_TO_LAUNCH',
        'land': 'LAND',
    }
