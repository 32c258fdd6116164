# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the link to the autopilot and of the timed sender."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain.errors import ConfigurationError
from peace_ros.core.domain.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class VehicleParameters(ParameterSet):
    """How to reach the autopilot and what to ask of it."""

    system_id: int = parameter(
        1, 'MAVLink system id of this companion; its component id is 191.', low=1, high=255
    )
    vehicle_id: int = parameter(
        0,
        'MAVLink system id of the vehicle; 0 takes system 1, or after 2 s the first other '
        'autopilot that is heard.',
        low=0,
        high=255,
    )
    signing_key_file: str = parameter(
        '',
        'File with the key of MAVLink 2 signing: exactly 32 bytes, or a passphrase whose SHA-256 '
        'is the key. Everything sent is signed, and unsigned messages are rejected. Empty: '
        'no signing.',
    )
    connect_timeout_s: float = parameter(
        10.0, 'How long to wait for the first HEARTBEAT.', unit='s', low=0.1, high=600.0
    )
    pose_rate_hz: float = parameter(
        30.0, 'Rate of LOCAL_POSITION_NED and ATTITUDE.', unit='Hz', low=5.0, high=100.0
    )
    state_rate_hz: float = parameter(
        5.0, 'Rate of EXTENDED_SYS_STATE.', unit='Hz', low=1.0, high=20.0
    )
    altitude_source: str = parameter(
        'home',
        'Altitude above ground: above home, or by a downward rangefinder while it is in range.',
        choices=('home', 'rangefinder'),
    )
    hold_mode: str = parameter(
        'BRAKE',
        "ArduPilot's mode for holding position; LOITER obeys the sticks, BRAKE needs no radio.",
        choices=('BRAKE', 'LOITER'),
    )
    pose_limit_s: float = parameter(
        1.0, 'Age at which a pose is no longer reported.', unit='s', low=0.1, high=10.0
    )
    heartbeat_limit_s: float = parameter(
        3.5,
        'Silence of HEARTBEAT after which nothing that the autopilot reports is used.',
        unit='s',
        low=1.5,
        high=30.0,
    )
    jump_limit_m: float = parameter(
        5.0,
        'A position that jumps farther than this from where its velocity leads is rejected '
        'while we have control.',
        unit='m',
        low=1.0,
        high=100.0,
    )
    follow_gimbal: bool = parameter(
        False,
        'The camera is on a gimbal whose attitude the autopilot reports '
        '(GIMBAL_DEVICE_ATTITUDE_STATUS), and is turned on it as mount_* say: by default it looks '
        'forward of the gimbal. Without a fresh report the vehicle holds.',
    )
    gimbal_id: int = parameter(
        0, 'With follow_gimbal: its gimbal_device_id; 0 takes the only one.', low=0, high=255
    )
    after_handover: str = parameter(
        'hold',
        'After HANDOVER: hold position; land (the mode of the autopilot); or landing_target: hold '
        'and stream LANDING_TARGET with the site for the next stage.',
        choices=('hold', 'land', 'landing_target'),
    )
    attitude_fallback: bool = parameter(
        False,
        'Without a position, an engagement by a person may at least hold level attitude, heading '
        'and height (ArduPilot, GUIDED_NOGPS). The vehicle drifts with the wind and never '
        'descends.',
    )
    request_limit_s: float = parameter(
        3.0, 'Longest wait for the answer to a request.', unit='s', low=0.5, high=30.0
    )


@dataclass(frozen=True)
class SenderParameters(ParameterSet):
    """The timed sender and its dead-man."""

    rate_hz: float = parameter(20.0, 'Rate of velocity set-points.', unit='Hz', low=4.0, high=50.0)
    limit_s: float = parameter(
        0.5,
        'Age of a set-point before which zero velocity has taken its place.',
        unit='s',
        low=0.1,
        high=2.0,
    )
    handover_s: float = parameter(
        2.0,
        'Further silence after which the autopilot is asked for its own hold mode.',
        unit='s',
        low=0.5,
        high=60.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.limit_s < 2.0 / self.rate_hz:
            raise ConfigurationError(
                f'parameter limit_s = {self.limit_s} s with rate_hz = {self.rate_hz} Hz: give at '
                f'least two periods, {2.0 / self.rate_hz:g} s'
            )
