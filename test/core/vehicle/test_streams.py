# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the autopilot is asked for, and when it is asked again."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.streams import StreamKeeper

S = 1_000_000_000
POSITION = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
NAMING = (
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
)


def asked_s(dialect, message_id, seconds=40, arriving=()):
    """Return at which seconds a message was asked for, where only ``arriving`` come."""
    parameters = VehicleParameters()
    keeper, assembler = StreamKeeper(parameters, dialect), Assembler(dialect, parameters)
    found = []
    for tenth in range(seconds * 10):
        now_ns = (100 * 10 + tenth) * S // 10
        assembler.arrived_ns.update(dict.fromkeys(arriving, now_ns))
        wanted = [int(values[0]) for _, values in keeper.due(assembler, now_ns)]
        if message_id in wanted:
            found.append(tenth / 10)
    return found


@pytest.mark.parametrize('dialect', [ArduPilot(), Px4()], ids=['ardupilot', 'px4'])
@pytest.mark.parametrize('message_id', NAMING)
def test_what_names_a_stop_is_asked_for_and_seldom_again_where_it_is_missing(dialect, message_id):
    assert asked_s(dialect, message_id) == [0.0, 15.0, 30.0]
    assert asked_s(dialect, message_id, arriving=(message_id,)) == [0.0]


def test_a_position_that_is_missing_is_asked_for_each_second():
    assert asked_s(ArduPilot(), POSITION, seconds=4) == [0.0, 1.0, 2.0, 3.0]
