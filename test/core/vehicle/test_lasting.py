# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lines that break are opened again, with growing pauses, and say why they are broken."""

import socket

import pytest

from peace_ros.core.domain import VehicleError
from peace_ros.core.vehicle import open_vehicle
from peace_ros.core.vehicle.lasting import LastingTransport
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim


class Line:
    datagrams = False

    def __init__(self):
        self.broken = False
        self.closed = False

    def read(self, timeout_s):
        if self.broken:
            raise VehicleError('the cable is out')
        return [(b'x', None)]

    def write(self, data, to):
        if self.broken:
            raise VehicleError('the cable is out')

    def close(self):
        self.closed = True


class Bench:
    """A clock in the test's hand, and lines that open when they are allowed to."""

    def __init__(self):
        self.now_s = 100.0
        self.lines = []
        self.attempts = []
        self.refuses = False
        self.transport = LastingTransport('serial:/dev/x', lambda: self.now_s, self.open)

    def open(self, url, connect_s):
        self.attempts.append(self.now_s)
        if self.refuses:
            raise VehicleError('no such device')
        self.lines.append(Line())
        return self.lines[-1]

    def pass_time(self, seconds):
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.transport.read(0.0)


@pytest.fixture
def bench():
    return Bench()


def test_a_broken_line_is_opened_again(bench):
    bench.lines[0].broken = True
    assert bench.transport.read(0.0) == []
    assert bench.transport.problem == 'the cable is out'
    assert bench.lines[0].closed
    with pytest.raises(VehicleError, match='cable is out; opening it again'):
        bench.transport.write(b'x', None)
    bench.pass_time(1.0)
    assert bench.transport.problem == ''
    assert bench.transport.openings == 2
    assert bench.transport.read(0.0) == [(b'x', None)]


def test_the_pauses_grow_to_five_seconds(bench):
    bench.lines[0].broken = True
    bench.transport.read(0.0)
    bench.refuses = True
    bench.pass_time(40.0)
    pauses = [b - a for a, b in zip(bench.attempts, bench.attempts[1:], strict=False)]
    assert pauses[1] < pauses[2] < pauses[3]
    assert max(pauses) == pytest.approx(5.0, abs=0.2)
    assert bench.transport.problem == 'no such device'


def test_a_closed_line_stays_closed(bench):
    bench.transport.close()
    bench.pass_time(10.0)
    assert len(bench.lines) == 1


def free_tcp_port():
    with socket.create_server(('127.0.0.1', 0)) as probe:
        return probe.getsockname()[1]


def test_flies_over_tcp_and_finds_back_after_the_autopilot_was_restarted(eventually):
    port = free_tcp_port()

    def start():
        sim = AutopilotSim(AutopilotParameters(port=0, tcp_port=port, speed=40.0))
        sim.start()
        return sim

    sim = start()
    link = open_vehicle(f'tcp:127.0.0.1:{port}')
    assert eventually(lambda: link.telemetry().pose is not None, 8.0)
    sim.close()
    assert eventually(lambda: 'closed' in link.problem or 'refused' in link.problem.lower())
    assert eventually(lambda: link.telemetry().pose is None, 3.0)
    sim = start()
    assert eventually(lambda: link.problem == '', 8.0)
    assert eventually(lambda: link.telemetry().pose is not None, 8.0), 'streams are asked for again'
    link.close()
    sim.close()


def test_a_port_that_serves_somebody_else_is_said_to_and_is_ours_when_he_has_gone(eventually):
    port = free_tcp_port()
    sim = AutopilotSim(AutopilotParameters(port=0, serial_port=port, speed=40.0))
    sim.start()
    station = open_vehicle(f'tcp:127.0.0.1:{port}')
    with pytest.raises(VehicleError, match='serves one client'):
        open_vehicle(f'tcp:127.0.0.1:{port}', timeout_s=1.0)
    station.close()
    link = open_vehicle(f'tcp:127.0.0.1:{port}', timeout_s=5.0)
    assert eventually(lambda: link.telemetry().pose is not None, 8.0)
    link.close()
    sim.close()


def test_follows_an_autopilot_to_a_new_address_after_its_silence(
    free_port, mock_autopilot, eventually, monkeypatch
):
    monkeypatch.setattr('peace_ros.core.vehicle.peer.NEW_ADDRESS_NS', 300_000_000)
    first = mock_autopilot(free_port)
    second = mock_autopilot(free_port)
    import threading

    threading.Timer(0.1, first.heartbeat).start()
    link = open_vehicle(f'udpin:127.0.0.1:{free_port}', timeout_s=5.0)
    second.position(1000, north=4.0)
    assert eventually(lambda: link.counts.ignored >= 2), 'not while the first is heard'

    def speaks():
        second.heartbeat()
        second.position(speaks.boot_ms, north=4.0)
        speaks.boot_ms += 50
        return link.telemetry().pose is not None

    speaks.boot_ms = 2000
    assert eventually(speaks, 2.0)
    second.hear()
    assert eventually(second.hear, 2.0), 'and is spoken to at the new one'
    link.close()
