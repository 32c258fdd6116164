# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A flying simulated vehicle, and a line on which a test speaks for the autopilot."""

import socket
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle import VehicleParameters, open_vehicle
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim


def wait_until(predicate, limit_s=5.0):
    """Tell whether the predicate came true within the limit."""
    deadline = time.monotonic() + limit_s
    while not predicate():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


@pytest.fixture
def eventually():
    return wait_until


class MockAutopilot:
    """Speaks MAVLink bytes as any system, to a companion that listens with udpin."""

    def __init__(self, system=1, component=1):
        self.codec = mavlink.MAVLink(None, system, component)
        self.ear = mavlink.MAVLink(None)
        self.ear.robust_parsing = True
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.socket.setblocking(False)
        self.to = None

    def send(self, *messages):
        for message in messages:
            self.socket.sendto(message.pack(self.codec), self.to)
            self.codec.seq = (self.codec.seq + 1) % 256

    def heartbeat(self, mode=4, *, armed=True, autopilot=3, kind=2):
        base = 1 | (128 if armed else 0)
        self.send(mavlink.MAVLink_heartbeat_message(kind, autopilot, base, mode, 4, 3))

    def position(self, boot_ms, north=0.0, east=0.0, down=-50.0, velocity=(0.0, 0.0, 0.0)):
        self.send(
            mavlink.MAVLink_local_position_ned_message(boot_ms, north, east, down, *velocity),
            mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0, 0, 0, 0),
        )

    def hear(self):
        heard = []
        while True:
            try:
                data = self.socket.recv(65535)
            except BlockingIOError:
                return heard
            heard += self.ear.parse_buffer(bytearray(data)) or []


@pytest.fixture
def mock_autopilot():
    made = []

    def make(port, **ids):
        made.append(MockAutopilot(**ids))
        made[-1].to = ('127.0.0.1', port)
        return made[-1]

    yield make
    for each in made:
        each.socket.close()


@pytest.fixture
def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def in_the_air(altitude_m, speed, **parameters):
    """Return a simulation that hovers in the mode for set-points; it has not been started yet."""
    sim = AutopilotSim(AutopilotParameters(port=0, speed=speed, **parameters))
    sim.step(43.0)
    if sim.parameters.autopilot == 'px4':
        sim.flight.take_off(altitude_m + sim.parameters.home_altitude_msl_m)
        sim.flight.arm()
    else:
        sim.pilot_mode('GUIDED')
        sim.flight.arm()
        sim.flight.take_off(altitude_m)
    sim.step(10.0 + altitude_m / 2.0)
    return sim


@pytest.fixture
def hovering():
    return in_the_air


@pytest.fixture
def flying():
    """Simulation at 10 times real time, 20 m above home in GUIDED, with its link."""
    with in_the_air(20.0, 10.0) as sim:
        link = open_vehicle(sim.url, parameters=VehicleParameters(pose_limit_s=0.4))
        assert wait_until(lambda: link.telemetry().pose is not None, 5.0)
        yield sim, link
        link.close()
