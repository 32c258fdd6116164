# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The TCP ports of an autopilot in software: who is served, when it boots, what is handed on."""

import socket
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import VehicleError
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim


class Client:
    """A TCP client that only listens, until it is told to speak."""

    def __init__(self, port, system=255, component=190):
        self.socket = socket.create_connection(('127.0.0.1', port), timeout=2.0)
        self.socket.setblocking(False)
        self.codec = mavlink.MAVLink(None, system, component)
        self.codec.robust_parsing = True

    def send(self, message):
        self.socket.sendall(message.pack(self.codec))

    def hear(self):
        try:
            data = self.socket.recv(65535)
        except BlockingIOError:
            return []
        return self.codec.parse_buffer(bytearray(data)) or []

    def kinds(self):
        return {m.get_type() for m in self.hear()}


def free_ports():
    """Return a port whose two successors (the third is not used) are free too."""
    for _ in range(50):
        with socket.create_server(('127.0.0.1', 0)) as probe:
            port = probe.getsockname()[1]
        try:
            for step in (2, 3):
                socket.create_server(('127.0.0.1', port + step)).close()
        except (OSError, OverflowError):
            continue
        return port
    raise AssertionError('no three free ports')


@pytest.fixture
def port():
    return free_ports()


@pytest.fixture
def sim(port):
    sim = AutopilotSim(AutopilotParameters(port=0, serial_port=port))
    yield sim
    sim.close()


def pass_time(sim, seconds):
    for _ in range(round(seconds / 0.1)):
        sim.step(0.1)
        time.sleep(0.001)


def test_it_boots_when_the_first_client_has_come(sim, port):
    pass_time(sim, 2.0)
    assert sim.flight.time_s == 0.0
    with pytest.raises(ConnectionRefusedError):
        Client(port + 2)
    client = Client(port)
    pass_time(sim, 2.0)
    assert sim.flight.time_s == pytest.approx(2.0, abs=0.2)
    assert 'HEARTBEAT' in client.kinds(), 'also to somebody who says nothing'
    Client(port + 2).socket.close()


def test_a_port_serves_one_client_and_the_next_one_afterwards(sim, port):
    first = Client(port)
    pass_time(sim, 1.5)
    second = Client(port)
    pass_time(sim, 2.0)
    assert first.kinds()
    assert not second.hear()
    first.socket.close()
    pass_time(sim, 2.0)
    assert 'HEARTBEAT' in second.kinds()


def test_intervals_belong_to_the_port_and_survive_its_client(sim, port):
    first = Client(port)
    pass_time(sim, 0.2)
    other = Client(port + 2)
    first.send(mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, 50_000, 0, 0, 0, 0, 0))
    pass_time(sim, 1.0)
    assert 'ATTITUDE' in first.kinds()
    assert 'ATTITUDE' not in other.kinds()
    first.socket.close()
    pass_time(sim, 0.5)
    again = Client(port)
    pass_time(sim, 1.0)
    assert 'ATTITUDE' in again.kinds()


def test_what_is_meant_for_anybody_is_handed_on_but_commands_are_not(sim, port):
    station = Client(port)
    pass_time(sim, 0.2)
    companion = Client(port + 2, 1, 191)
    pass_time(sim, 0.2)
    station.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    station.send(mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, 50_000, 0, 0, 0, 0, 0))
    pass_time(sim, 0.3)
    heard = companion.hear()
    assert [m.get_srcSystem() for m in heard if m.get_srcComponent() == 190] == [255]
    assert 'COMMAND_LONG' not in {m.get_type() for m in heard}


def test_a_taken_port_is_said(port):
    with (
        socket.create_server(('127.0.0.1', port)),
        pytest.raises(VehicleError, match=f'TCP 127.0.0.1:{port}'),
    ):
        AutopilotSim(AutopilotParameters(port=0, serial_port=port))
