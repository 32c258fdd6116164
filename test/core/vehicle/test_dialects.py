# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mode numbers and set-point messages of each autopilot."""

import pytest

from peace_ros.core.domain import Setpoint, VehicleError
from peace_ros.core.vehicle.dialects import ArduPilot, Px4, choose_dialect


@pytest.mark.parametrize(
    ('dialect', 'custom_mode', 'name'),
    [
        (ArduPilot(), 4, 'GUIDED'),
        (ArduPilot(), 5, 'LOITER'),
        (ArduPilot(), 9, 'LAND'),
        (ArduPilot(), 17, 'BRAKE'),
        (ArduPilot(), 99, 'MODE 99'),
        (Px4(), 6 << 16, 'OFFBOARD'),
        (Px4(), 4 << 16 | 3 << 24, 'AUTO.LOITER'),
        (Px4(), 3 << 16, 'POSCTL'),
        (Px4(), 4 << 16 | 9 << 24, 'MODE 4.9'),
    ],
)
def test_names_modes(dialect, custom_mode, name):
    assert dialect.mode_name(custom_mode) == name


@pytest.mark.parametrize(
    ('dialect', 'control', 'hold'),
    [
        (ArduPilot(), (1, 4, 0), (1, 17, 0)),
        (ArduPilot(hold_mode='LOITER'), (1, 4, 0), (1, 5, 0)),
        (Px4(), (1, 6, 0), (1, 4, 3)),
    ],
)
def test_asks_for_control_and_hold(dialect, control, hold):
    assert dialect.mode_command(dialect.control_mode) == control
    assert dialect.mode_command(dialect.hold_mode) == hold


@pytest.mark.parametrize('dialect', [ArduPilot(), Px4()])
def test_setpoints_hold_the_heading_in_local_ned(dialect):
    m = dialect.velocity_message(Setpoint(0, 1.0, 2.0, 3.0), 2**32 + 5, (1, 1))
    assert (m.coordinate_frame, m.type_mask, m.yaw_rate) == (1, 0x5C7, 0.0)
    assert (m.vx, m.vy, m.vz) == (1.0, 2.0, 3.0)
    assert m.time_boot_ms == 5


def test_finds_the_dialect_in_the_heartbeat():
    assert choose_dialect('auto', 3).name == 'ardupilot'
    assert choose_dialect('auto', 12).name == 'px4'


@pytest.mark.parametrize(('wanted', 'autopilot'), [('px4', 3), ('auto', 0), ('betaflight', 3)])
def test_says_when_nothing_fits(wanted, autopilot):
    with pytest.raises(VehicleError, match=wanted):
        choose_dialect(wanted, autopilot)


@pytest.mark.parametrize(
    ('autopilot', 'kind', 'named'),
    [(3, 1, 'fixed-wing'), (3, 10, 'ground vehicle'), (3, 20, 'VTOL'), (12, 12, 'submarine')],
)
def test_what_does_not_hover_is_refused(autopilot, kind, named):
    with pytest.raises(VehicleError, match=named):
        choose_dialect('auto', autopilot, vehicle_type=kind)


@pytest.mark.parametrize('kind', [0, 2, 3, 4, 13, 14, 15, 29, 35])
def test_multicopters_helicopters_and_those_that_do_not_say_are_taken(kind):
    assert choose_dialect('auto', 3, vehicle_type=kind).name == 'ardupilot'
    assert choose_dialect('auto', 12, vehicle_type=kind).name == 'px4'


def test_an_unknown_mode_names_the_known_ones():
    with pytest.raises(VehicleError, match=r"'HOVER'.*GUIDED"):
        ArduPilot().mode_command('HOVER')
