# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pilot of the demo before a stranger: cold boot, one client at a time, already in the air."""

from __future__ import annotations

import socket
import threading
import time

import pytest

from peace_ros.core.domain import VehicleError
from peace_ros.core.vehicle import open_vehicle
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.demo import piloting
from peace_ros.simulation.demo.piloting import VehicleLine


@pytest.fixture
def port() -> int:
    with socket.create_server(('127.0.0.1', 0)) as probe:
        return probe.getsockname()[1]


@pytest.fixture
def stranger(port):
    """A simulation with one client per TCP port, which has not been started."""
    made = []

    def make() -> AutopilotSim:
        made.append(AutopilotSim(AutopilotParameters(port=0, serial_port=port, speed=30.0)))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_a_cold_autopilot_is_waited_for_brought_up_and_let_go(stranger, port) -> None:
    url = f'tcp:127.0.0.1:{port}'
    late = threading.Timer(1.0, lambda: stranger().start())
    late.start()
    said: list[str] = []
    with VehicleLine(url, 20.0) as line:
        line.open()
        line.bring_up(30.0, 30.0, said.append)
    late.join()
    assert any('waiting for a position' in each for each in said)
    with_next = open_vehicle(url, timeout_s=5.0)
    deadline = time.monotonic() + 5.0
    while with_next.telemetry().pose is None and time.monotonic() < deadline:
        time.sleep(0.02)
    told = with_next.telemetry()
    with_next.close()
    assert told.pose is not None
    assert told.pose.altitude_agl_m == pytest.approx(30.0, abs=3.5)
    assert (told.armed, told.mode) == (True, 'GUIDED')


def test_a_vehicle_in_the_air_is_left_as_it_is(stranger, port) -> None:
    sim = stranger()
    with socket.create_connection(('127.0.0.1', port)):
        sim.step(43.0)
        sim.step(43.0)  # the first one let the client in
        sim.pilot_mode('GUIDED')
        sim.flight.arm()
        sim.flight.take_off(20.0)
        sim.step(20.0)
        sim.pilot_mode('LOITER')
    sim.start()
    said: list[str] = []
    with VehicleLine(f'tcp:127.0.0.1:{port}', 10.0) as line:
        line.open()
        changes = sim.flight.mode_changes
        line.bring_up(100.0, 20.0, said.append)
    assert 'in the air already at 20 m' in said[-1]
    assert sim.mode_name == 'LOITER'
    assert sim.flight.mode_changes == changes


def test_only_a_vehicle_of_this_machine_is_armed(stranger, port, monkeypatch) -> None:
    sim = stranger()
    sim.start()
    monkeypatch.setattr('peace_ros.simulation.demo.options.is_on_this_machine', lambda _: False)
    with VehicleLine(f'tcp:127.0.0.1:{port}', 10.0) as line:
        line.open()
        with pytest.raises(VehicleError, match='not on this machine'):
            line.bring_up(30.0, 20.0, lambda _: None)
    assert not sim.flight.armed


def test_nobody_there_is_said_after_the_limit(port, monkeypatch) -> None:
    monkeypatch.setattr(piloting, '_AGAIN_S', 0.2)
    with VehicleLine(f'tcp:127.0.0.1:{port}', 0.6) as line:
        begun = time.monotonic()
        with pytest.raises(VehicleError, match=r'start the autopilot'):
            line.open()
        assert 0.3 < time.monotonic() - begun < 3.0
