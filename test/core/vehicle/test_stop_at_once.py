# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The last thing that a failing process asks of its vehicle, whichever thread has died."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from peace_ros.core.domain import Setpoint
from peace_ros.core.vehicle import VehicleLink, open_vehicle
from peace_ros.nodes.twist_link import TwistLink
from peace_ros.simulation.autopilot import Mode

FORWARD = Setpoint(0, 2.0)


def test_the_vehicle_holds_by_itself_without_anybody_waiting(flying, eventually):
    sim, link = flying
    link.send_velocity(FORWARD)
    begun = time.monotonic()
    assert link.stop_at_once()
    assert time.monotonic() - begun < 0.2
    assert eventually(lambda: sim.flight.mode is Mode.BRAKE)
    assert eventually(lambda: not link.stop_at_once()), 'it has seen that the vehicle holds'
    assert not link.taken_over, 'it was our own wish'


def test_it_needs_neither_the_reading_thread_nor_its_lock(hovering, eventually):
    died = threading.Event()
    clock = [time.monotonic_ns]
    with hovering(20.0, 1.0) as sim:
        link = open_vehicle(
            sim.url,
            clock_ns=lambda: clock[0](),  # noqa: PLW0108
            on_defect=lambda _error: died.set(),
        )
        clock[0] = lambda: 1 // 0
        assert died.wait(5.0)
        with link._changed, ThreadPoolExecutor() as pool:
            assert pool.submit(link.stop_at_once).result(5.0)
        assert eventually(lambda: sim.flight.mode is Mode.BRAKE)
        link.close()


@pytest.mark.parametrize('mode', ['LOITER', 'LAND', 'BRAKE'])
def test_nothing_is_sent_to_a_vehicle_that_somebody_else_flies(flying, eventually, mode):
    sim, link = flying
    assert sim.pilot_mode(mode)
    assert eventually(lambda: link.telemetry().mode == mode)
    assert not link.stop_at_once()
    time.sleep(0.3)
    assert sim.flight.mode.name == mode


def test_telemetry_is_a_getter_and_the_reading_thread_finds_disobedience(flying, eventually):
    _sim, link = flying
    watch = link._obedience
    for _ in range(50):
        link.telemetry()
    assert eventually(lambda: link.take_poses() != [])
    until = time.monotonic() + 5.0
    while not watch.problem and time.monotonic() < until:
        link._obedience.tell((0.0, 0.0, 2.0), time.monotonic_ns())
        time.sleep(0.05)
    assert 'told to sink' in watch.problem, 'it was told to sink, and nobody sent it anything'
    assert 'told to sink' in link.telemetry().position_problem


@pytest.mark.parametrize('kind', ['mavlink', 'twist'])
def test_every_link_does_all_that_the_protocol_asks(kind, request):
    link = request.getfixturevalue('flying')[1] if kind == 'mavlink' else TwistLink(lambda _t: None)
    asked = [name for name in vars(VehicleLink) if not name.startswith('_')]
    assert len(asked) >= 14
    assert [name for name in asked if not hasattr(link, name)] == []
